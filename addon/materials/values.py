"""The constants of a material, packed into the vec4 array that its program reads."""

from __future__ import annotations

import numpy as np

from .working_space import current

BLOCK_LIMIT = 1024  # vec4 in the 16 KiB that every backend guarantees for a uniform block


def to_kind(value, kind: str, wanted: str) -> float | tuple[float, float, float]:
    """A constant as a finite number (FLOAT) or triple (VECTOR, COLOR), converted from its socket's kind."""
    if value is None or isinstance(value, str):
        value = 0.0
    number = np.nan_to_num(np.asarray(value, float).ravel(), nan=0.0, posinf=3e38, neginf=-3e38).clip(-3e38, 3e38)
    if wanted == "FLOAT":
        if number.size < 3:
            return float(number[0]) if number.size else 0.0
        return float(number[:3] @ current().luminance) if kind == "COLOR" else float(number[:3].mean())
    if number.size == 1:
        number = np.repeat(number, 3)
    triple = np.zeros(3)
    triple[: min(3, number.size)] = number[:3]
    return tuple(float(channel) for channel in triple)


def glsl_number(value, kind: str) -> str:
    """A constant as GLSL text, with a decimal point or an exponent in every number."""
    if kind == "FLOAT":
        return repr(float(np.float32(value)))
    return f"vec3({', '.join(repr(float(np.float32(channel))) for channel in np.broadcast_to(value, 3))})"


class ValueBlock:
    """Collects constants in order of their first use and says how the shader reads each.

    Numbers fill the components that triples leave free. Places depend on the order and kinds of what is added, never
    on the values.
    """

    def __init__(self) -> None:
        self._rows: list[list[float]] = []
        self._free: list[tuple[int, int]] = []  # components that no value uses yet, in order
        self._text_rows: list[list[float]] = []  # of tables that did not fit
        self.overflow = False  # some constants did not fit and stand in the program's text

    def add(self, value, kind: str) -> str:
        triple = kind != "FLOAT"
        if triple or not self._free:
            if len(self._rows) >= BLOCK_LIMIT:
                self.overflow = True
                return glsl_number(value, kind)
            self._rows.append([0.0] * 4)
        row = len(self._rows) - 1
        if triple:
            self._rows[row][:3] = value
            self._free.append((row, 3))
            return f"material_value({row}).xyz"
        if not self._free:
            self._free += [(row, component) for component in range(4)]
        row, component = self._free.pop(0)
        self._rows[row][component] = value
        return f"material_value({row}).{'xyzw'[component]}"

    def add_rows(self, rows) -> int:
        """Whole rows of four that stand one after the other: `first` of material_row (material/values.glsl)."""
        rows = [[float(x) for x in row] for row in rows]
        if len(self._rows) + len(rows) > BLOCK_LIMIT:
            self.overflow = True
            self._text_rows += rows
            return len(rows) - len(self._text_rows) - 1
        self._rows += rows
        return len(self._rows) - len(rows)

    def text(self) -> str:
        """GLSL of the rows that stand in the program's text, which goes before all includes."""
        if not self._text_rows:
            return ""
        return (
            f"#define MATERIAL_TEXT_ROWS {len(self._text_rows)}\n"
            f"vec4 material_text_row(int row)\n{{\n{self._found(0, len(self._text_rows))}}}\n"
        )

    def _found(self, low: int, high: int) -> str:
        """Halves the rows: Metal has no constructors of arrays, and drivers may go through a switch case by case."""
        if high - low == 1:
            numbers = ", ".join(repr(float(np.float32(x))) for x in self._text_rows[low])
            return f"return vec4({numbers});\n"
        middle = (low + high) // 2
        return f"if (row < {middle}) {{\n{self._found(low, middle)}}}\n{self._found(middle, high)}"

    def array(self) -> np.ndarray:
        """(P, 4) float32 with P >= 1, because a uniform block cannot be empty."""
        return np.array(self._rows or [[0.0] * 4], np.float32)
