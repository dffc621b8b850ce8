"""Sources without what a program does not use: functions that nothing calls, and comments.

A program includes whole files and calls a few of their functions. Drivers parse, check and optimise all of them before
they leave the rest out; a light path's program has 3,000 lines, of which it may use half. What is called is told by
words: a function stays where its name stands in what stays. That keeps some too many (of each name all overloads, and
functions that a branch of the preprocessor leaves out), never one too few.

A function is told by the style of the files: it begins at the left margin with its type and name, and ends with a brace
there. What looks otherwise stays.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import lru_cache
from itertools import groupby

_HEAD = re.compile(r"(?:(?!return\b|else\b|struct\b|const\b|layout\b)\w+\s+)+(\w+)\s*\(")
_WORD = re.compile(r"[A-Za-z_]\w*")
_MACRO = re.compile(r"\s*#\s*define\s+(\w+)")
_OPENS = re.compile(r"\s*#\s*if")
_CLOSES = re.compile(r"\s*#\s*endif")
_KEPT = 2048  # parts of files


@dataclass(frozen=True)
class _Piece:
    """Some lines of a file: a function, by its name, or what stands between two. `lines`: (text, number in the part);
    `macros`: those that are defined there, with the words of each, which are not among `words`."""

    name: str | None
    lines: tuple[tuple[str, int], ...]
    words: frozenset[str]
    macros: tuple[tuple[str, frozenset[str]], ...] = ()


def without_unused(
    text: str, origin: list[tuple[str, int]], roots: frozenset[str] = frozenset()
) -> tuple[str, list[tuple[str, int]]]:
    """`text` and the (file, line) of each of its lines, as `library.resolve` gives them, without the functions that are
    not called from `main`, from what stands outside functions, or by a name in `roots`."""
    lines = text.split("\n")
    pieces: list[tuple[_Piece, int]] = []
    at = 0
    for _, run in groupby(origin, key=lambda one: one[0]):
        count = sum(1 for _ in run)
        pieces += [(piece, at) for piece in _pieces("\n".join(lines[at : at + count]))]
        at += count
    called = {"main"} | roots
    uses: dict[str, list[frozenset[str]]] = {}  # of functions and macros
    for piece, _ in pieces:
        if piece.name is None:
            called |= piece.words
            for name, words in piece.macros:
                uses.setdefault(name, []).append(words)
        else:
            uses.setdefault(piece.name, []).append(piece.words)
    left = [name for name in uses if name in called]
    kept = set(left)
    while left:
        for words in uses[left.pop()]:
            found = [word for word in words if word in uses and word not in kept]
            kept.update(found)
            left += found
    stay = [
        (line, origin[start + number])
        for piece, start in pieces
        if piece.name is None or piece.name in kept
        for line, number in piece.lines
    ]
    return "\n".join(line for line, _ in stay) + "\n", [place for _, place in stay]


@lru_cache(maxsize=_KEPT)
def _pieces(part: str) -> tuple[_Piece, ...]:
    found: list[_Piece] = []
    lines = part.split("\n")
    between: list[int] = []
    at = 0
    while at < len(lines):
        head = _HEAD.match(lines[at])
        end = _end_of(lines, at) if head else None
        if end is None:
            between.append(at)
            at += 1
            continue
        if between:
            found.append(_piece(None, lines, between))
            between = []
        found.append(_piece(head.group(1), lines, range(at, end)))
        at = end
    if between:
        found.append(_piece(None, lines, between))
    return tuple(found)


def _end_of(lines: list[str], start: int) -> int | None:
    """The line behind a function, or behind its declaration; None if it is none, or a branch of the preprocessor holds
    part of it alone."""
    depth = branches = 0
    opened = False
    for number in range(start, len(lines)):
        line = _code(lines[number])
        branches += bool(_OPENS.match(line)) - bool(_CLOSES.match(line))
        if branches < 0:
            return None
        depth += line.count("{") - line.count("}")
        opened = opened or "{" in line
        if opened and depth <= 0:
            return number + 1 if branches == 0 else None
        if not opened and line.rstrip().endswith(";"):
            return number + 1 if branches == 0 and ")" in line else None
    return None


def _piece(name: str | None, lines: list[str], numbers) -> _Piece:
    coded = [(_code(lines[number]), number) for number in numbers]
    words: list[str] = []
    macros: list[tuple[str, list[str]]] = []
    goes_on = False
    for line, _ in coded:
        macro = None if name or goes_on else _MACRO.match(line)
        if macro:
            macros.append((macro.group(1), []))
        of = macros[-1][1] if macro or goes_on else words
        of += _WORD.findall(line[macro.end() :] if macro else line)
        goes_on = bool(macro or goes_on) and line.endswith("\\")
    stay = tuple((line, number) for line, number in coded if line.strip())
    return _Piece(name, stay, frozenset(words), tuple((one, frozenset(used)) for one, used in macros))


def _code(line: str) -> str:
    """A line without its comment; the sources have none that goes over several."""
    return line.partition("//")[0].rstrip()
