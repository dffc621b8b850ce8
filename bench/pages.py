"""Every generated page anew, all of one commit: `make pages`, for a quiet night.

The documents themselves say what writes them: `<!-- written by COMMAND -->` before each generated part, and
bench/ages.py for pages that are written whole. These commands run one after the other, each in a process of its own.
What is done is kept in out/pages.json, so that the next call goes on with the rest; a new commit begins again. What
fails is named at the end, and its page stays as it was.
"""

from __future__ import annotations

import argparse
import json
import re
import shlex
import subprocess
import sys
import time

from bench import ages
from bench.cells import ROOT
from bench.markdown import write_whole

STATE = ROOT / "out" / "pages.json"
MARK = re.compile(r"<!-- written by `([^`]+)` -->")
INSTEAD = {  # the mark names the last step of a longer command
    "python -m bench page": "make bench",
    "python -m bench pairs": "make pairs",
    "python -m bench.viewport": "make bench-viewport",
}
BY_HAND = {
    "python -m bench gpu": "it describes graphics cards: run tools/on_a_card.sh on a machine with one",
    ages.COMMAND: "it runs at the end",
}


def commands() -> list[str]:
    """What writes the pages, in the order of the documents, each once."""
    found = []
    for path in (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))):
        found += MARK.findall(path.read_text(encoding="utf-8"))
    for several in ages.PAGES.values():
        found += several.split(", ")
    found = [INSTEAD.get(command, command) for command in found]
    whole = [_with_page(command) for command in dict.fromkeys(found) if command not in BY_HAND]
    return list(dict.fromkeys(whole))


def _with_page(command: str) -> str:
    """The marks of some pages leave out the option that writes them."""
    words = shlex.split(command)
    if words[:3] != ["python", "-m", "bench"] or "--page" in words:
        return command
    written = any("--page" in action.option_strings for action in parser_of(words[3])._actions)
    return f"{command} --page" if written else command


def parser_of(verb: str) -> argparse.ArgumentParser:
    """The options of `python -m bench VERB`. KeyError where there is no such verb."""
    from bench.__main__ import VERBS

    parser = argparse.ArgumentParser(prog=f"python -m bench {verb}")
    VERBS[verb].add_options(parser)
    return parser


def run(command: str) -> bool:
    words = shlex.split(command)
    words = [sys.executable, *words[1:]] if words[0] == "python" else words
    return subprocess.run(words, cwd=ROOT, check=False).returncode == 0


def done_at(commit: str) -> dict[str, float]:
    """Seconds by command that has run at this commit."""
    known = json.loads(STATE.read_text(encoding="utf-8")) if STATE.exists() else {}
    return known["seconds"] if known.get("commit") == commit else {}


def keep(commit: str, done: dict[str, float]) -> None:
    STATE.parent.mkdir(exist_ok=True)
    write_whole(STATE, json.dumps({"commit": commit, "seconds": done}, indent=1))


# ------------------------------------------------------------------------------------------------------------- command


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--list", action="store_true", help="print the commands, those that are done with their seconds"
    )
    parser.add_argument("--only", metavar="TEXT", help="only commands that hold this text")
    parser.add_argument("--again", action="store_true", help="run what is done at this commit, too")


def command(options: argparse.Namespace) -> int:
    commit = ages.git("rev-parse", "HEAD") or ""
    done = done_at(commit)
    chosen = [one for one in commands() if options.only is None or options.only in one]
    if not chosen:
        print(f"No page is written by a command that holds '{options.only}': --list names them all.")
        return 2
    if options.list:
        for one in chosen:
            print(f"{f'{done[one]:.0f} s' if one in done else '-':>8}  {one}")
        return 0
    failed = []
    for number, one in enumerate(chosen):
        if one in done and not options.again:
            continue
        print(f"== {number + 1} of {len(chosen)}: {one}", flush=True)
        began = time.monotonic()
        if run(one):
            done[one] = round(time.monotonic() - began, 1)
            keep(commit, done)
        else:
            failed.append(one)
    run(ages.COMMAND)
    for one, why in BY_HAND.items():
        if one != ages.COMMAND:
            print(f"not run: {one}: {why}")
    for one in failed:
        print(f"failed: {one}")
    return bool(failed)
