"""A packed record from one declaration: where numpy writes its fields, and the GLSL struct that reads them.

A record is a run of vec4. What each holds is declared once, field after field, with the numbers of its kinds and flags;
sources include `record/NAME.glsl`, which is made from that: the struct, its reader, and a #define for each number. So
no column is counted by hand on either side, and no constant has a twin.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import SimpleNamespace

import numpy as np

from .library import GENERATED

_COMPONENTS = {"int": 1, "float": 1, "vec2": 2, "vec3": 3, "vec4": 4}


class Record:
    """`texels`: for each vec4 its fields, as "vec3 centre"; integers may share a component from the lowest bits on, as
    "int kind:4 unlit". `asked`: further texels, which the struct does not hold: each field is fetched by a macro of its
    own where a shader uses it, as `light_u(light)`. `fetch`: a GLSL expression for texel number {} of the whole list.
    `kinds`: numbered from 0 on; `flags`: bits from the lowest on; `constants`: other numbers that both sides know."""

    def __init__(
        self, name: str, fetch: str, texels: Sequence[Sequence[str]], kinds: Sequence[str] = (),
        flags: Sequence[str] = (), constants: Mapping[str, int] | None = None, asked: Sequence[Sequence[str]] = (),
    ):  # fmt: skip
        self.name, self.texels = name, len(texels) + len(asked)
        self.kinds = {kind: number for number, kind in enumerate(kinds)}
        self.constants = dict(constants or {})
        self.flags = {flag: 1 << bit for bit, flag in enumerate(flags)}
        places, members, reads, macros, low = {}, [], [], [], name.lower()
        for row, fields in enumerate((*texels, *asked)):
            used = 0
            for kind, *names in (field.split() for field in fields):
                count = _COMPONENTS[kind]
                if used + count > 4:
                    raise ValueError(f"Record {name}: texel {row} holds more than four numbers.")
                component = f"texel{row}.{'xyzw'[used : used + count]}"
                places |= {one.partition(":")[0]: (row, _columns(used, count)) for one in names}
                used += count
                if row < len(texels):
                    members += [f"  {kind} {one.partition(':')[0]};" for one in names]
                    reads += _read(kind, names, component, name)
                else:
                    place = fetch.format(f"(one).base + {row}")
                    macros.append(f"#define {low}_{names[0]}(one) ({place}.{component.partition('.')[2]})")
        self.at = SimpleNamespace(**places)  # of a (texels, 4) array: row[LIGHT.at.radius]
        head = name.upper()
        numbers = {f"{head}_TEXELS": self.texels}
        for group in (self.kinds, self.flags, self.constants):
            numbers |= {f"{head}_{one}": number for one, number in group.items()}
        fetched = [f"  vec4 texel{row} = {fetch.format(f'made.base + {row}')};" for row in range(len(texels))]
        self.glsl = "\n".join((
            *(f"#define {one} {number}" for one, number in numbers.items()), *macros,
            f"struct {name} {{", *members, "  int base;  // number of its first texel", "};", "",
            f"{name} {low}_read(int index)", "{", f"  {name} made;", f"  made.base = index * {head}_TEXELS;", *fetched,
            *reads, "  return made;", "}", "",
        ))  # fmt: skip
        GENERATED[f"record/{low}.glsl"] = self.glsl

    def rows(self, count: int | None = None, **values) -> np.ndarray:
        """Zeros of (texels, 4), or (count, texels, 4), with these fields set."""
        made = np.zeros((self.texels, 4) if count is None else (count, self.texels, 4))
        for field, value in values.items():
            made[(..., *getattr(self.at, field))] = value
        return made


def _columns(first: int, count: int) -> int | slice:
    return first if count == 1 else slice(first, first + count)


def _read(kind: str, names: Sequence[str], component: str, record: str) -> list[str]:
    """Lines that read the fields of one component."""
    if kind != "int":
        return [f"  made.{names[0]} = {component};"]
    if len(names) == 1:
        return [f"  made.{names[0]} = int({component});"]
    lines, shift = [], 0
    for one in names:
        field, _, bits = one.partition(":")
        shifted = f"int({component}) >> {shift}" if shift else f"int({component})"
        lines.append(
            f"  made.{field} = ({shifted}) & {(1 << int(bits)) - 1};" if bits else f"  made.{field} = {shifted};"
        )
        shift += int(bits or 0)
    if shift > 24:
        raise ValueError(f"Record {record}: integers of more than 24 bits are not exact in a float.")
    return lines
