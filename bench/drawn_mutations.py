"""Small wrongs drawn at random, for `python -m bench mutations --drawn N`: where tests are blind, nobody thought of it.

From each file of `addon/` and `shaders/` that computes something, places are drawn by a seed: a constant times 1.05, a
sum in place of a difference, a quotient in place of a product, a comparison the other way, an index off by one. Guards
against division by nothing and thresholds are left alone: there a twentieth more is no wrong. The tests are the fast
ones nearest to the file.
"""

from __future__ import annotations

import io
import random
import re
import tokenize
from functools import cache
from pathlib import Path

from bench.cells import ROOT

MOST_TESTS = 8  # files of tests for one wrong
FAST = ("-m", "not slow and not timing and not window")
COMPUTES = ("eye", "film", "frame", "gfx", "grass", "kernels", "lighting", "materials", "sampling", "scene", "snapshot",
            "sources", "surfaces", "techniques")  # fmt: skip
_TOKEN = re.compile(r"//[^\n]*|/\*.*?\*/|#[^\n]*|\d+\.\d*(?:e-?\d+)?|\b\d+\b|[<>]=?|[-+*/](?![=+\-/*])", re.DOTALL)
SWAPPED = {"+": "-", "-": "+", "*": "/", "/": "*", "<": ">", ">": "<", "<=": ">=", ">=": "<="}


def drawn(count: int, seed: int, only: list[str] | None = None) -> list[tuple[str, int, str, str, str]]:
    """(file, offset in characters, old, new, kind) of `count` wrongs, each file as likely as any other."""
    chance = random.Random(seed)
    files = [name for name in sources() if not only or any(text in name for text in only)]
    found, tried = [], 0
    while len(found) < count and tried < 20 * count:
        tried += 1
        file = chance.choice(files)
        places = places_of(file)
        if places and tests_for(file):
            offset, old = chance.choice(places)
            if _is_a_choice((ROOT / file).read_text(encoding="utf-8"), offset, old):
                continue
            new, kind = changed(old)
            if all((file, offset) != one[:2] for one in found):
                found.append((file, offset, old, new, kind))
    return found


def _is_a_choice(text: str, offset: int, old: str) -> bool:
    """Is a constant a guard against division by nothing, or a threshold? A twentieth more is no wrong there."""
    number = "." in old or "e" in old
    return number and (
        0 < float(old) <= 1e-3 or text[:offset].rstrip()[-1:] in "<>" or text[:offset].endswith(("<= ", ">= "))
    )


def sources() -> list[str]:
    """Files that compute, by their path from the root."""
    python = [path for room in COMPUTES for path in (ROOT / "addon" / room).rglob("*.py")]
    return sorted(str(path.relative_to(ROOT)) for path in (*python, *(ROOT / "shaders").rglob("*.glsl")))


def changed(old: str) -> tuple[str, str]:
    """What stands there instead, and what kind of wrong that is."""
    if old in SWAPPED:
        return SWAPPED[old], "comparison" if old[0] in "<>" else "operator"
    if old.isdigit():
        return str(int(old) + 1), "off by one"
    return (repr(round(1.05 * float(old), 9)) if float(old) else "0.05"), "constant"


@cache
def places_of(file: str) -> tuple[tuple[int, str], ...]:
    """(offset, text) of constants and operators in a file's code."""
    text = (ROOT / file).read_text(encoding="utf-8")
    return tuple(_python_places(text) if file.endswith(".py") else _shader_places(text))


def _python_places(text: str):
    starts = [0]
    for line in text.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    before = ""
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        is_number = token.type == tokenize.NUMBER and re.fullmatch(r"\d+(\.\d*)?(e-?\d+)?", token.string)
        is_binary = token.type == tokenize.OP and token.string in SWAPPED and (before[-1:].isalnum() or before in ")]")
        if (is_number and before != "def") or (is_binary and before):
            yield starts[token.start[0] - 1] + token.start[1], token.string
        if token.type not in (tokenize.NL, tokenize.NEWLINE, tokenize.COMMENT, tokenize.INDENT, tokenize.DEDENT):
            before = token.string


def _shader_places(text: str):
    for match in _TOKEN.finditer(text):
        word, before = match.group(), text[: match.start()].rstrip()[-1:]
        if word.startswith(("//", "/*", "#")) or (word in SWAPPED and not (before.isalnum() or before in ")]_")):
            continue
        if word.isdigit() and (text[match.start() - 1].isalpha() or text[match.start() - 1] in "._"):
            continue
        yield match.start(), word


@cache
def tests_for(file: str) -> tuple[str, ...]:
    """Arguments for pytest: the files of tests nearest to a file, and that they be fast. Empty where there are none.
    First those that are named after its modules, then those that import them (where there are neither, those of the
    modules that use it), then those that speak of it, then those that are named after its room."""
    modules = [Path(file).stem] if file.endswith(".py") else _users(file)
    names = _tests_of(modules) or _tests_of([module for one in modules for module in _importers(one)])
    word = Path(file).name.split(".")[0]
    speaking = [f"tests/{name}" for name, text in _texts("tests", "test_*.py", whole=True) if word in text.lower()]
    names = dict.fromkeys((*names, *(speaking if len(word) > 4 else ()), *_tests_named(Path(file).parts[1])))
    return (*list(names)[:MOST_TESTS], *FAST) if names else ()


def _tests_of(modules: list[str]) -> list[str]:
    """Files of tests that are named after modules, or that import them, in this order."""
    wanted = [re.compile(rf"^ *from addon\S*( import .*\b|\.){one}\b", re.MULTILINE) for one in modules]
    importing = [name for pattern in wanted for name, text in _texts("tests", "test_*.py", whole=True)
                 if pattern.search(text)]  # fmt: skip
    return [*(name for one in modules for name in _tests_named(one)), *(f"tests/{name}" for name in importing)]


def _tests_named(word: str) -> list[str]:
    found = [f"tests/{name}" for name, _ in _texts("tests", "test_*.py", whole=True) if f"test_{word}" in name]
    return [name for name in found if not name.startswith("tests/window")]


@cache
def _users(shader: str) -> list[str]:
    """Modules that declare a program of this shader, or of one that includes it."""
    waiting, seen = [str(Path(shader).relative_to("shaders"))], set()
    modules: dict[str, None] = {}
    while waiting:
        name = waiting.pop(0)
        seen.add(name)
        modules |= dict.fromkeys(stem for stem, text in _texts("addon", "*.py") if f'"{name}"' in text)
        for other, text in _texts("shaders", "*.glsl", whole=True):
            if f'#include "{name}"' in text and other not in seen:
                waiting.append(other)
    return list(modules)


@cache
def _importers(module: str) -> list[str]:
    """Modules that import this one."""
    wanted = re.compile(rf"^from \S*\b{module} import|^from \S+ import .*\b{module}\b", re.MULTILINE)
    return [stem for stem, text in _texts("addon", "*.py") if wanted.search(text)]


@cache
def _texts(folder: str, pattern: str, whole: bool = False) -> tuple[tuple[str, str], ...]:
    """(name, text) of files: the stem, or the whole path below the folder."""
    root = ROOT / folder
    return tuple(
        (str(path.relative_to(root)) if whole else path.stem, path.read_text(encoding="utf-8"))
        for path in sorted(root.rglob(pattern))
    )
