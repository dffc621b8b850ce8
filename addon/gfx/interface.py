"""Interfaces: features that not every scene has, as media, and that shaders ask without knowing whether this one does.

A source includes `ask/NAME.glsl`, neutral versions of the functions (no medium: transmittance 1), and calls them
without any condition. `answered` makes the variant of a program for a scene that has the feature: the include then
yields the interface's own file, and its images are added to the program's textures. So no source and no program is
written twice, and which interfaces a program uses follows from its includes (`asked_by`). A program that leaves an
interface out says so with its reason, in `Program.leaves_out` or in a line `// Leaves out NAME: …` of its shader.

The limit of textures of a program holds for all of its answers together: see tests/gfx/test_interface.py.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

from .images import Image
from .library import Program, resolve


@dataclass(frozen=True)
class Interface:
    """`glsl`: the file that replaces the neutral shaders/ask/NAME.glsl and defines the same functions. `textures`:
    (type, name) of what it reads. `present`: from a frame the images of `textures` by name; None where the frame has
    nothing of this."""

    name: str
    glsl: str
    textures: tuple[tuple[str, str], ...]
    present: Callable[[Any], dict[str, Image] | None]

    @property
    def asked(self) -> str:
        """The file that sources include."""
        return f"ask/{self.name}.glsl"


@lru_cache(maxsize=1024)
def asked_by(program: Program) -> frozenset[str]:
    """Files below shaders/ask that the program's sources include, but for what it leaves out."""
    snippets = dict(program.snippets)
    sources = [resolve(one, snippets)[1] for one in (program.vertex, program.fragment, program.compute) if one]
    asked = frozenset(file for origin in sources for file, _ in origin if file.startswith("ask/"))
    return asked - {f"ask/{name}.glsl" for name, _ in program.leaves_out}


@lru_cache(maxsize=1024)
def answered(program: Program, present: tuple[Interface, ...]) -> Program:
    """The same program for a scene that has what these interfaces tell of."""
    if not present:
        return program
    return replace(
        program,
        name=", ".join((program.name, *(one.name for one in present))),
        textures=(*program.textures, *(texture for one in present for texture in one.textures)),
        snippets=(*program.snippets, *((one.asked, f'#include "{one.glsl}"\n') for one in present)),
    )


def answer(frame: Any, program: Program, textures: dict[str, Image], interfaces: tuple[Interface, ...]) -> Program:
    """The variant of a program for a frame: with those of `interfaces` that the program includes and the frame has.
    Their images are added to `textures`."""
    asked, there = asked_by(program), []
    for one in interfaces:
        found = one.present(frame) if one.asked in asked else None
        if found is not None:
            there.append(one)
            textures |= found
    return answered(program, tuple(there))
