"""Small wrongs drawn at random, for `python -m bench mutations --drawn N`: where tests are blind, nobody thought of it.

From each file of `addon/` and `shaders/` that computes something, places are drawn by a seed: a constant times 1.05, a
sum in place of a difference, a quotient in place of a product, a comparison the other way, an index off by one. What
is a choice is left alone, since any other would be as right: see `_is_a_choice`. The tests are the fast ones nearest to
the file.
"""

from __future__ import annotations

import io
import random
import re
import tokenize
from functools import cache
from pathlib import Path

from bench.cells import ROOT

MOST_TESTS = 5  # files of tests for one wrong
FEW_NAMED = 3  # files that have a word in their names, where it says which are nearest
FAST = ("-m", "not slow and not timing and not window")
COMPUTES = ("eye", "film", "frame", "gfx", "grass", "kernels", "lighting", "materials", "sampling", "scene", "snapshot",
            "sources", "surfaces", "techniques")  # fmt: skip
_TOKEN = re.compile(r"//[^\n]*|/\*.*?\*/|#[^\n]*|\d+\.\d*(?:e-?\d+)?|\b\d+\b|[<>]=?|[-+*/](?![=+\-/*])", re.DOTALL)
SWAPPED = {"+": "-", "-": "+", "*": "/", "/": "*", "<": ">", ">": "<", "<=": ">=", ">=": "<="}


def drawn(count: int, seed: int) -> list[tuple[str, int, str, str, str]]:
    """(file, offset in characters, old, new, kind) of `count` wrongs, each file as likely as any other."""
    chance = random.Random(seed)
    files = sources()
    found, tried = [], 0
    while len(found) < count and tried < 20 * count:
        tried += 1
        file = chance.choice(files)
        places = places_of(file)
        if places and tests_for(file):
            offset, old = chance.choice(places)
            text = (ROOT / file).read_text(encoding="utf-8")
            if _is_part_of_a_word(text, offset) or _is_a_choice(text, offset, old):
                continue
            new, kind = changed(old)
            if all((file, offset) != one[:2] for one in found):
                found.append((file, offset, old, new, kind))
    return found


def _is_part_of_a_word(text: str, offset: int) -> bool:
    """Whether a sign belongs to a shift or to the exponent of a number: what stood there would be no code."""
    around = text[max(offset - 1, 0) : offset + 2]
    return "<<" in around or ">>" in around or bool(re.search(r"\de$", text[:offset]))


def _is_a_choice(text: str, offset: int, old: str) -> bool:
    """Is what stands there a choice, of which no picture's mean depends? Those are, by where they stand:

    - guards against division by nothing and tolerances: constants of at most a thousandth, names of such, and what
      multiplies them;
    - thresholds: constants that something is compared with by < or >;
    - sizes: the length of an array in a shader, a whole number that is all that a name in capitals stands for;
    - defaults: arguments of Param and Socket, and of a field of a dataclass, which every file sets;
    - the ledger: arguments of `count`.
    """
    before, after = text[:offset], text[offset + len(old) :]
    if old in SWAPPED:
        beside = _LAST.search(before), _NEXT.match(after)
        return old in "*/" and any(_is_tiny(text, found.group(1)) for found in beside if found)
    line = before[before.rfind("\n") + 1 :]
    is_threshold = ("." in old or "e" in old) and before.rstrip("= ").endswith(("<", ">"))
    return (
        is_threshold or _is_tiny(text, old) or bool(_SIZE.search(line)) or (old.isdigit() and bool(_COUNT.search(line)))
        or bool(_FIELD.search(line)) or _argument_of(before) in DECLARATIONS
    )  # fmt: skip


DECLARATIONS = ("Param", "Socket", "count")
_LAST, _NEXT = re.compile(r"([\w.]+|\d\.?\d*e-\d+)\s*$"), re.compile(r"\s*(\d\.?\d*e-\d+|[\w.]+)")
_SIZE = re.compile(r"\b(float|u?int|bool|[iub]?vec[234]|mat[234]|[A-Z]\w+) \w+\[$")
_COUNT, _FIELD = re.compile(r"^_?[A-Z][A-Z0-9_]* = $"), re.compile(r"^ +\w+: [\w .|\[\]]+ = $")


def _is_tiny(text: str, word: str) -> bool:
    """Whether a number, or what a name in capitals stands for in this file, is at most a thousandth, and not 0."""
    if re.fullmatch(r"[A-Z][A-Z0-9_]+", word):
        named = re.search(rf"^(?:#define {word} |{word} = )([\d.e-]+)", text, re.MULTILINE)
        word = named.group(1) if named else ""
    return bool(re.fullmatch(r"\d+\.?\d*(e-?\d+)?", word)) and 0 < float(word) <= 1e-3


def _argument_of(before: str) -> str:
    """The name of the innermost call whose arguments are not closed yet, tuples in it apart."""
    depth = 0
    for place in range(len(before) - 1, max(len(before) - 2000, -1), -1):
        depth += {")": 1, "]": 1, "(": -1, "[": -1}.get(before[place], 0)
        if depth < 0:
            name = re.search(r"(\w+)$", before[max(place - 40, 0) : place])
            if name:
                return name.group(1)
            depth = 0
    return ""


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
    First those that name a shader by its path, and those that are named after the file, or have its name among their
    words; then those of the modules that use it, of a shader also one that is named after its folder; then those that
    speak of it."""
    path, word = Path(file), Path(file).stem.split(".")[0]
    is_shader = path.suffix == ".glsl"
    naming = [f"tests/{name}" for name, text in _test_files()
              if is_shader and str(path.relative_to("shaders")) in text]  # fmt: skip
    modules = _users(file) if is_shader else [path.stem]
    holding = [f"tests/{name}" for name, _ in _test_files() if word in Path(name).stem.split("_")]
    named = [*naming, *(_tests_named(word) if len(word) > 4 else ()), *(holding if len(holding) <= FEW_NAMED else ())]
    of_modules, of_room = _tests_of(modules), sorted(_tests_named(path.parts[1]), key=_is_of_a_technique, reverse=True)
    names = [*named, *of_modules[:1], *of_room[:1], *of_modules] if is_shader else [*named, *of_modules]
    names = names or _tests_of([module for one in modules for module in _importers(one)])
    speaking = [f"tests/{name}" for name, text in _test_files() if word in text.lower()]
    names = dict.fromkeys((*names, *(speaking if len(word) > 4 else ()), *of_room))
    return (*list(names)[:MOST_TESTS], *FAST) if names else ()


def _tests_of(modules: list[str]) -> list[str]:
    """Files of tests that are named after modules, or that import them, in this order."""
    wanted = [re.compile(rf"^ *from addon\S*( import .*\b|\.){one}\b", re.MULTILINE) for one in modules]
    importing = [name for pattern in wanted for name, text in _test_files()
                 if pattern.search(text)]  # fmt: skip
    return [*(name for one in modules for name in _tests_named(one)), *(f"tests/{name}" for name in importing)]


def _tests_named(word: str) -> list[str]:
    return [f"tests/{name}" for name, _ in _test_files() if f"test_{word}" in name]


def _is_of_a_technique(name: str) -> bool:
    """Whether pictures are tested there: of a room of shaders these say more than how its data is kept."""
    return name.startswith("tests/techniques/")


def _test_files() -> list[tuple[str, str]]:
    """Those of the extension: the bench is not what is changed, and windows are opened elsewhere."""
    return [one for one in _texts("tests", "test_*.py", whole=True) if not one[0].startswith(("window/", "bench/"))]


@cache
def _users(shader: str) -> list[str]:
    """Modules that declare a program of this shader, or of one that includes it."""
    waiting, seen = [str(Path(shader).relative_to("shaders"))], set()
    modules: dict[str, None] = {}
    while waiting:
        name = waiting.pop(0)
        seen.add(name)
        modules |= dict.fromkeys(stem for stem, text in _texts("addon", "*.py") if _names(text, name))
        for other, text in _texts("shaders", "*.glsl", whole=True):
            if f'#include "{name}"' in text and other not in seen:
                waiting.append(other)
    return list(modules)


def _names(text: str, shader: str) -> bool:
    """Whether a module names this shader, by itself or as f"edges/{what}.frag.glsl"."""
    made = (re.sub(r"\\\{.*?\\\}", r"\\w+", re.escape(name)) for name in re.findall(r'f"(\w+/[^"]*\.glsl)"', text))
    return f'"{shader}"' in text or any(re.fullmatch(name, shader) for name in made)


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
