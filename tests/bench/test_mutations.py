"""The list of small wrongs, and what is said of each."""

import argparse
import json

import pytest

from bench import ages, drawn_mutations, mutations
from bench.mutations import BROKEN, EQUIVALENT, KILLED, STALE, SURVIVED, Mutation

SOURCE = "def double(x):\n    return 2 * x\n"
NOTICES = "from source import double\n\n\ndef test_it():\n    assert double(3) == 6\n"


@pytest.fixture
def tree(tmp_path):
    """A small program with a test that notices, one that does not, and one that always fails."""
    (tmp_path / "source.py").write_text(SOURCE)
    for name, text in (
        ("notices", NOTICES),
        ("sleeps", "def test_it():\n    pass\n"),
        ("fails", "def test_it():\n    assert 0\n"),
    ):
        (tmp_path / f"test_{name}.py").write_text(text)
    return tmp_path


def wrong(test, old="2 * x", **values):
    return Mutation("wrong", "source.py", old, "3 * x", (test,), **values)


@pytest.mark.parametrize(
    ("mutation", "state"),
    [
        (wrong("test_notices.py"), KILLED),
        (wrong("test_sleeps.py"), SURVIVED),
        (wrong("test_fails.py"), BROKEN),
        (wrong("test_notices.py", old="x"), STALE),
        (wrong("test_notices.py", old="nowhere"), STALE),
        (wrong("test_notices.py", reason="it is the same"), EQUIVALENT),
    ],
)
def test_what_becomes_of_a_wrong(tree, mutation, state):
    assert mutations.judge(mutation, tree, {})[0] == state
    assert (tree / "source.py").read_text() == SOURCE


def test_names_of_tests_may_have_spaces():
    assert mutations.named("FAILED tests/a.py::test_it[two words] - assert 1 == 2") == "tests/a.py::test_it[two words]"
    assert mutations.named("ERROR tests/a.py") == "tests/a.py"


def test_forty_wrongs_stand_in_the_list_and_in_the_code():
    """Those whose text has changed are named by the command; enough of them must apply for it to say something."""
    found = mutations.read()
    assert sum(not one.reason and not mutations.is_stale(one) for one in found) >= 40
    assert len({one.file.split("/")[0] for one in found}) > 1 and len({one.file for one in found}) >= 20
    assert all(len(one.reason) > 20 for one in found if one.reason)


@pytest.mark.parametrize(
    ("entry", "words"),
    [
        ('old = "a"\nnew = "a"\ntests = ["t"]', "changes nothing"),
        ('old = "a"\nnew = "b"', "names no tests"),
    ],
)
def test_an_entry_that_says_nothing_is_refused(tmp_path, entry, words):
    path = tmp_path / "list.toml"
    path.write_text(f'[[mutation]]\nname = "it"\nfile = "f"\n{entry}\n')
    with pytest.raises(ValueError, match=words):
        mutations.read(path)


def test_the_working_tree_is_copied_without_what_git_ignores(tmp_path):
    if ages.git("rev-parse", "HEAD") is None:
        pytest.skip("this is no clone")
    mutations.copy_of_tree(tmp_path)
    assert (tmp_path / "bench" / "mutations.toml").is_file() and (tmp_path / "pyproject.toml").is_file()
    assert not list(tmp_path.rglob("__pycache__")) and not (tmp_path / ".git").exists()


def test_outside_of_a_clone_a_sentence_says_what_is_missing(tmp_path, monkeypatch):
    monkeypatch.setattr(mutations.ages, "git", lambda *_: None)
    with pytest.raises(ValueError, match="no clone"):
        mutations.copy_of_tree(tmp_path)


def test_drawn_wrongs_are_the_same_for_a_seed_and_change_code_alone():
    found = mutations.drawn(40, 3, {})
    assert found == mutations.drawn(40, 3, {}) and len({one.name for one in found}) == 40
    for one in found:
        text = (mutations.ROOT / one.file).read_text("utf-8")
        wrong = one.applied(text)
        assert wrong is not None and wrong != text and one.tests
        if one.file.endswith(".py"):
            compile(wrong, one.file, "exec")
        else:
            assert "//" not in text[text.rfind("\n", 0, one.at) + 1 : one.at], "a comment"


@pytest.mark.parametrize(
    ("text", "old", "is_choice"),
    [
        ("  vec4 attributes[8];\n", "8", True),
        ("  vec4 attributes = row[8];\n", "8", False),
        ("POINTS = 2\n", "2", True),
        ("FACTOR = 1.3\n", "1.3", False),
        ('Param("r", "R", 0.6, "")', "0.6", True),
        ('(Socket("C", "COLOR", (1.0, 0.9)),)', "0.9", True),
        ("max(1.0, 0.9)", "0.9", False),
        ("    levels: int = 6\n", "6", True),
        ('frame.count(self, "passes", 1 + more)', "1", True),
        ("#define SAME 1e-4\nif (a <= SAME * t) {", "*", True),
        ("#define SIZE 2.0\na = SIZE * t;", "*", False),
        ("x = 2e-5 * reach", "*", True),
        ("x = a < 0.5", "0.5", True),
        ("x = a + 0.5", "0.5", False),
    ],
)
def test_what_is_a_choice_is_not_drawn(text, old, is_choice):
    assert drawn_mutations._is_a_choice(text, text.rindex(old), old) == is_choice


def test_a_shader_whose_name_is_made_of_parts_is_judged_by_the_tests_of_what_draws_it():
    """f"edges/{what}.frag.glsl" of edge_tiles.py: pictures of depth complexity, and not only how its data is kept."""
    assert "tests/techniques/test_depth_complexity.py" in drawn_mutations.tests_for("shaders/edges/quads.frag.glsl")[:2]


def test_a_draw_stays_what_it_is_where_files_are_added(monkeypatch, tmp_path):
    """Those that were drawn are found by their line, wherever it stands now; others take the places of lines that are
    gone, and none is drawn twice."""
    source = tmp_path / "addon" / "film" / "one.py"
    source.parent.mkdir(parents=True)
    source.write_text("def f(x, y):\n    return x + y + 2.5 * x\n")
    for module in (mutations, drawn_mutations):
        monkeypatch.setattr(module, "ROOT", tmp_path)
    monkeypatch.setattr(drawn_mutations, "tests_for", lambda file: ("tests",))
    for kept in (drawn_mutations.places_of, drawn_mutations._texts):
        kept.cache_clear()
    first = mutations.drawn(2, 1, {})
    kept = {one.name: {"state": KILLED, "by": "", **mutations._place_in_line(one)} for one in first}
    source.write_text("# Moved.\n\n" + source.read_text())
    (source.parent / "another.py").write_text("a = b - c\n")
    drawn_mutations.places_of.cache_clear()
    again = mutations.drawn(3, 1, kept)
    assert [(one.name, one.old) for one in again[:2]] == [(one.name, one.old) for one in first]
    assert [one.at for one in again[:2]] == [one.at + len("# Moved.\n\n") for one in first]
    assert again[2].name not in kept and (again[2].file, again[2].at) not in {(one.file, one.at) for one in again[:2]}
    source.write_text("def f(x, y):\n    return x\n")
    drawn_mutations.places_of.cache_clear()
    assert not {one.name for one in mutations.drawn(1, 1, kept)} & {*kept}
    drawn_mutations.places_of.cache_clear()


@pytest.mark.parametrize(("text", "at"), [("a = (v & 1) << 3;", 12), ("a = (v & 1) << 3;", 13), ("max(b, 1e-6)", 9)])
def test_signs_of_shifts_and_exponents_are_no_places(text, at):
    assert drawn_mutations._is_part_of_a_word(text, at)
    assert not drawn_mutations._is_part_of_a_word("a = b < c - d;", 6)


@pytest.mark.parametrize(
    "arguments", [("--tests", "tests"), ("--again",), ("--equivalent", "a"), ("--drawn", "2", "--reason", "none")]
)
def test_options_that_would_be_ignored_are_refused(arguments, monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(mutations, "RESULTS", tmp_path / "mutations.json")
    monkeypatch.setattr(mutations, "JUDGED", tmp_path)
    (tmp_path / "mutations.json").write_text(kept := '{"a": {"state": "survived", "by": ""}}')
    parser = argparse.ArgumentParser()
    mutations.add_options(parser)
    assert mutations.command(parser.parse_args(arguments)) == 2
    assert "give --" in capsys.readouterr().out
    assert (tmp_path / "mutations.json").read_text() == kept and len([*tmp_path.iterdir()]) == 1


def test_a_drawn_wrong_that_nothing_can_notice_keeps_its_reason_and_is_not_judged(monkeypatch, tmp_path, capsys):
    kept = {
        "a.py:1 constant 1.0 -> 1.05": {"state": SURVIVED, "by": "", "line": "a = 1.0", "column": 4},
        "a.py:2 operator + -> -": {"state": KILLED, "by": "a test", "line": "b = a + a", "column": 6},
    }
    monkeypatch.setattr(mutations, "JUDGED", tmp_path)
    monkeypatch.setattr(mutations, "ROOT", tmp_path)
    monkeypatch.setattr(drawn_mutations, "tests_for", lambda file: ("tests",))
    monkeypatch.setattr(drawn_mutations, "drawn", lambda count, seed: [])
    monkeypatch.setattr(mutations, "copy_of_tree", lambda folder: None)
    monkeypatch.setattr(mutations, "failing", lambda *_: pytest.fail("it was judged"))
    (tmp_path / "a.py").write_text("a = 1.0\nb = a + a\n")
    (tmp_path / "mutations_1.json").write_text(json.dumps(kept))

    def run(*arguments):
        parser = argparse.ArgumentParser()
        mutations.add_options(parser)
        return mutations.command(parser.parse_args(["--drawn", "2", *arguments]))

    assert run("--equivalent", next(iter(kept))) == 2  # no reason
    assert run("--equivalent", next(iter(kept)), "--reason", "nobody reads it") == 0
    assert run("--again") == 0
    killed = next(name for name, about in json.loads((tmp_path / "mutations_1.json").read_text()).items()
                  if about["state"] == mutations.KILLED)  # fmt: skip
    assert run("--equivalent", killed, "--reason", "nobody reads it") == 2
    assert "1 of 2 noticed, 1 equivalent" in capsys.readouterr().out
    assert json.loads((tmp_path / "mutations_1.json").read_text())[next(iter(kept))]["by"] == "nobody reads it"
