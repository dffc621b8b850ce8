"""`make pages`: what the documents say writes them can be run, and a second call goes on with the rest."""

import argparse
import shlex

import pytest

from bench import pages

COMMANDS = [command for command in pages.commands() if command.startswith("python -m bench ")]


@pytest.mark.parametrize("command", COMMANDS)
def test_what_a_page_says_writes_it_is_a_command_with_these_options(command):
    _, _, _, verb, *options = shlex.split(command)
    pages.parser_of(verb).parse_args(options)


def test_a_second_call_runs_only_what_failed(monkeypatch, tmp_path):
    ran = []
    monkeypatch.setattr(pages, "STATE", tmp_path / "out" / "pages.json")
    monkeypatch.setattr(pages, "commands", lambda: ["one", "two", "three"])
    monkeypatch.setattr(pages, "run", lambda command: ran.append(command) or command != "two" or ran.count("two") > 1)
    monkeypatch.setattr(pages.ages, "git", lambda *_: "commit")
    options = argparse.Namespace(list=False, only=None, again=False)
    last = pages.ages.COMMAND
    assert pages.command(options) == 1 and ran == ["one", "two", "three", last]
    assert pages.command(options) == 0 and ran[4:] == ["two", last]


def test_another_commit_begins_again(monkeypatch, tmp_path):
    monkeypatch.setattr(pages, "STATE", tmp_path / "pages.json")
    pages.keep("old", {"one": 1.0})
    assert pages.done_at("old") == {"one": 1.0} and pages.done_at("new") == {}


def test_a_command_that_no_page_has_is_told(capsys):
    assert pages.command(argparse.Namespace(list=False, only="no such page", again=False)) == 2
    assert "no such page" in capsys.readouterr().out
