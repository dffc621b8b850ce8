"""Small wrongs that tests must notice: `python -m bench mutations`.

bench/mutations.toml lists them as data: a file, a piece of its text that occurs once, what stands there instead, and
the fast tests that should fail then. Each is applied alone to a copy of the working tree, where its tests run until the
first one fails. What is printed:

- survivors: no test failed, so nobody would have noticed; the exit code is 1;
- stale ones: the text is not there any more (or not once), so that the entry says nothing until it is mended;
- equivalents: entries with a `reason` why nothing can be noticed; they are listed and not run.

The test that fails must pass without the wrong, where it is run alone: one that always fails notices nothing. Results
go to out/mutations.json, as far as they came. `--drawn N` takes wrongs drawn at random instead of the list, and tells
the share that is noticed by room. What was drawn and how it was judged is kept in bench/results, by the line of code
that each stands in, so that a draw stays what it is where files are added: a run goes on where the last one ended,
draws others for those whose line is gone, and with `--again` judges anew what was not noticed. Of one that was looked
at and changes nothing, or makes another noise of the same mean, `--equivalent NAME --reason TEXT` keeps why; it is
judged no more and counts in no share.
"""

from __future__ import annotations

import argparse
import json
import os
import shlex
import signal
import subprocess
import sys
import tempfile
import time
import tomllib
from dataclasses import dataclass, replace
from pathlib import Path

from bench import ages, drawn_mutations
from bench.cells import ROOT
from bench.markdown import table, write_whole

try:
    import resource
except ImportError:  # Windows
    resource = None

LIST = ROOT / "bench" / "mutations.toml"
RESULTS = ROOT / "out" / "mutations.json"
JUDGED = ROOT / "bench" / "results"  # of those that were drawn, a file for each seed
KILLED, SURVIVED, STALE, BROKEN, EQUIVALENT = "killed", "survived", "stale", "tests fail without it", "equivalent"
NOT_JUDGED = "not judged"
# Of the processor for the tests of one wrong; longer than that counts as noticed: something hangs. By the clock, where
# others take the processor or nothing is computed, ten times that.
SECONDS = 240
NO_TESTS = 5  # pytest's exit code where none was chosen


@dataclass(frozen=True)
class Mutation:
    """One wrong: `old` becomes `new` in `file`; `tests` are arguments for pytest. `reason`: why it is equivalent. `at`:
    where in the file, in characters, if `old` may stand there more than once."""

    name: str
    file: str
    old: str
    new: str
    tests: tuple[str, ...] = ()
    reason: str = ""
    at: int = -1

    def applied(self, text: str) -> str | None:
        """The text with the wrong in it; None where the place is not there, or not once."""
        if self.at >= 0:
            end = self.at + len(self.old)
            return text[: self.at] + self.new + text[end:] if text[self.at : end] == self.old else None
        return text.replace(self.old, self.new) if text.count(self.old) == 1 else None


def read(path: Path = LIST) -> list[Mutation]:
    """The list. ValueError with a sentence where an entry cannot be meant."""
    found = [
        Mutation(**{**one, "tests": tuple(one.get("tests", ()))})
        for one in tomllib.loads(path.read_text("utf-8"))["mutation"]
    ]
    names = [one.name for one in found]
    for one in found:
        if names.count(one.name) > 1:
            raise ValueError(f"Two mutations are called '{one.name}'.")
        if one.old == one.new:
            raise ValueError(f"Mutation '{one.name}' changes nothing.")
        if not one.tests and not one.reason:
            raise ValueError(f"Mutation '{one.name}' names no tests, and no reason why none can notice it.")
    return found


def is_stale(mutation: Mutation, root: Path = ROOT) -> bool:
    path = root / mutation.file
    return not path.is_file() or mutation.applied(path.read_text("utf-8")) is None


def copy_of_tree(folder: Path) -> None:
    """What git tracks or would track, as it stands in the working tree. ValueError outside of a clone."""
    listed = ages.git("ls-files", "-z", "--cached", "--others", "--exclude-standard")
    if listed is None:
        raise ValueError(f"{ROOT} is no clone: what is copied is what git tracks.")
    for name in filter(None, listed.split("\0")):
        source, place = ROOT / name, folder / name
        if source.is_file():
            place.parent.mkdir(parents=True, exist_ok=True)
            place.write_bytes(source.read_bytes())


def failing(folder: Path, tests: tuple[str, ...]) -> str:
    """The first test that fails in the copy, or an empty string."""
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", "-m", "not timing", *tests]
    environment = {name: value for name, value in os.environ.items() if name != "OCIO"}
    try:
        done = subprocess.run(
            command, cwd=folder, check=False, capture_output=True, text=True, timeout=10 * SECONDS,
            stdin=subprocess.DEVNULL, preexec_fn=_limited if resource else None,
            env={**environment, "PYTHONDONTWRITEBYTECODE": "1"},
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return f"no end after {10 * SECONDS} s"
    if done.returncode in (0, NO_TESTS):
        return ""
    if resource and done.returncode == -signal.SIGXCPU:
        return f"no end after {SECONDS} s of the processor"
    lines = [line for line in done.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
    if "Fatal Python error" in done.stderr:  # where it was: the first lines of what the handler of faults prints
        fault = done.stderr[done.stderr.index("Fatal Python error") :].splitlines()
        lines.append("; ".join(line.strip() for line in fault if line.startswith(("Fatal", "  File")))[:400])
    return lines[0] if lines else (done.stdout + done.stderr).strip().splitlines()[-1]


def _limited() -> None:
    resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, 2 * SECONDS))


def named(line: str) -> str:
    """The test that a line of pytest's summary names: "FAILED file::test[of spaces, too] - why"."""
    return line.split(" ", 1)[1].split(" - ")[0]


def judge(mutation: Mutation, folder: Path, sound: dict[tuple[str, ...], str]) -> tuple[str, str]:
    """What becomes of a mutation, and by which test or why."""
    if mutation.reason:
        return EQUIVALENT, mutation.reason
    if is_stale(mutation, folder):
        return STALE, f"its text does not stand once in {mutation.file}"
    path = folder / mutation.file
    right = path.read_text("utf-8")
    path.write_text(mutation.applied(right), encoding="utf-8")
    try:
        by = failing(folder, mutation.tests)
    finally:
        path.write_text(right, encoding="utf-8")
    if not by:
        return SURVIVED, ""
    alone = (named(by),) if by.startswith(("FAILED", "ERROR")) and "::" in by else mutation.tests
    if alone not in sound:
        sound[alone] = failing(folder, alone)
    return (BROKEN, sound[alone]) if sound[alone] else (KILLED, by)


# ------------------------------------------------------------------------------------------------------------- command


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--only", metavar="TEXT", nargs="+", help="mutations whose name or file has one of these texts")
    parser.add_argument("--part", metavar="K/N", default="1/1", help="every Nth mutation, from the Kth on")
    parser.add_argument("--list", action="store_true", help="print the mutations and end")
    parser.add_argument(
        "--drawn", metavar="N", type=int, default=0, help="N wrongs drawn at random instead of the list"
    )
    parser.add_argument("--seed", type=int, default=1, help="of those that are drawn")
    parser.add_argument(
        "--files", metavar="N", type=int, default=drawn_mutations.MOST_TESTS,
        help="files of tests for each wrong that is drawn, the nearest first",
    )  # fmt: skip
    parser.add_argument("--tests", metavar="ARGS", help="of those that are drawn: judge by these tests, as for pytest")
    parser.add_argument("--again", action="store_true", help="of those that were drawn, judge survivors anew")
    parser.add_argument("--equivalent", metavar="NAME", help="of those that were drawn, one that nothing can notice")
    parser.add_argument("--reason", metavar="TEXT", help="with --equivalent: why nothing can")


def chosen(options: argparse.Namespace, kept: dict[str, dict]) -> list[Mutation]:
    """`kept`: what was drawn with this seed before, see `drawn`."""
    first, _, step = options.part.partition("/")
    all_of_them = drawn(options.drawn, options.seed, kept) if options.drawn else read()
    found = [one for one in all_of_them
             if not options.only or any(text in f"{one.name} {one.file}" for text in options.only)]  # fmt: skip
    return found[int(first) - 1 :: int(step or 1)]


def drawn(count: int, seed: int, kept: dict[str, dict]) -> list[Mutation]:
    """Wrongs that bench/drawn_mutations.py draws, named by the place where each stood when it was drawn: those of
    `kept` whose line is still there, with its text and the column of the wrong in it, then others."""
    made = [one for name, about in kept.items() if (one := located(name, **about))][:count]
    names, places = {*kept}, {(one.file, one.at) for one in made}
    for file, at, old, new, kind in drawn_mutations.drawn(count, seed):
        number = (ROOT / file).read_text("utf-8").count("\n", 0, at) + 1
        name = f"{file}:{number} {kind} {old} -> {new}"
        if len(made) < count and name not in names and (file, at) not in places:
            names.add(name)
            made.append(Mutation(name, file, old, new, drawn_mutations.tests_for(file), at=at))
    return made


def located(name: str, line: str, column: int, **_: str) -> Mutation | None:
    """A wrong in today's code: in the line of this text that is nearest to where it stood. None where none is left."""
    place, _, what = name.partition(" ")
    file, _, number = place.rpartition(":")
    what, _, new = what.rpartition(" -> ")
    path, old, found = ROOT / file, what.rpartition(" ")[2], []
    start = 0
    for k, text in enumerate(path.read_text("utf-8").splitlines(keepends=True) if path.is_file() else (), 1):
        if text.strip() == line:
            found.append((abs(k - int(number)), start + text.index(line) + column))
        start += len(text)
    return Mutation(name, file, old, new, drawn_mutations.tests_for(file), at=min(found)[1]) if found else None


def _place_in_line(mutation: Mutation) -> dict[str, object]:
    """The line of code that a drawn wrong stands in, and the wrong's column there."""
    text = (ROOT / mutation.file).read_text("utf-8")
    start = text.rfind("\n", 0, mutation.at) + 1
    whole = text[start:].partition("\n")[0]
    return {"line": whole.strip(), "column": mutation.at - start - (len(whole) - len(whole.lstrip()))}


def by_room(states: dict[str, str]) -> list[list[str]]:
    """Share of the wrongs that tests noticed, by room of the house."""
    rows = [["room", "drawn", "noticed", "share"]]
    rooms: dict[str, list[str]] = {}
    for name, state in states.items():
        if state in (KILLED, SURVIVED):
            rooms.setdefault("/".join(name.split("/")[:2]), []).append(state)
    for room, found in sorted(rooms.items()):
        noticed = found.count(KILLED)
        rows.append([room, str(len(found)), str(noticed), f"{100 * noticed / len(found):.0f} %"])
    return rows


def misplaced(options: argparse.Namespace) -> str | None:
    """What options that would be ignored, or would change another list, lack."""
    if not options.drawn:
        for name in ("tests", "again", "equivalent"):
            if getattr(options, name):
                return f"--{name} is of wrongs that are drawn: give --drawn N, too."
    if options.reason and not options.equivalent:
        return "--reason says why nothing can notice a wrong: give --equivalent NAME, too."
    return None


def command(options: argparse.Namespace) -> int:
    if (asked := misplaced(options)) is not None:
        print(asked)
        return 2
    results = JUDGED / f"mutations_{options.seed}.json" if options.drawn else RESULTS
    before = json.loads(results.read_text("utf-8")) if results.exists() else {}
    wanted = chosen(options, before if options.drawn else {})
    if options.list:
        for one in wanted:
            print(f"{one.name:<52} {'stale' if is_stale(one) else '':<6} {one.file}")
        return 0
    results.parent.mkdir(exist_ok=True)
    if options.equivalent:
        if not options.reason or options.equivalent not in before:
            print("A reason and the whole name of one that was drawn are needed, as --list prints it.")
            return 2
        if before[options.equivalent]["state"] == KILLED:
            print(f"A test notices it: {before[options.equivalent]['by']}")
            return 2
        before[options.equivalent] |= {"state": EQUIVALENT, "by": options.reason}
        write_whole(results, json.dumps(before, indent=1, ensure_ascii=False) + "\n")
        return 0
    if options.drawn:
        for one in wanted:
            before.setdefault(one.name, {"state": NOT_JUDGED, "by": "", **_place_in_line(one)})
    sound: dict[tuple[str, ...], str] = {}
    with tempfile.TemporaryDirectory(prefix="candela_mutations_") as folder:
        try:
            copy_of_tree(Path(folder))
        except ValueError as error:
            print(error)
            return 2
        for one in wanted:
            started = time.monotonic()
            known = before[one.name]["state"] if options.drawn else NOT_JUDGED
            if known != NOT_JUDGED and not (options.again and known not in (KILLED, EQUIVALENT)):
                continue
            if options.drawn:
                files, fast = one.tests[: -len(drawn_mutations.FAST)], drawn_mutations.FAST
                nearest = shlex.split(options.tests) if options.tests else files[: options.files]
                one = replace(one, tests=(*nearest, *fast))
            state, by = judge(one, Path(folder), sound)
            before[one.name] = before.get(one.name, {}) | {"state": state, "by": by}
            print(f"{state:<9} {one.name:<52} {time.monotonic() - started:5.0f} s  {by}"[:200], flush=True)
            write_whole(results, json.dumps(before, indent=1, ensure_ascii=False) + "\n")
    states = {one.name: before[one.name]["state"] for one in wanted}
    left = [name for name, state in states.items() if state in (SURVIVED, BROKEN)]
    stale = [name for name, state in states.items() if state == STALE]
    killed, equal = (sum(state == one for state in states.values()) for one in (KILLED, EQUIVALENT))
    print(f"{killed} of {len(states)} noticed, {equal} equivalent, {len(stale)} stale, {len(left)} survived")
    for name in left:
        print(f"  survived: {name}")
    if options.drawn:
        print(table(by_room(states)))
    return 1 if left else 0
