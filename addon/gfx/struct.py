"""Uniform-block structs from one declaration: numpy dtype and GLSL text always agree.

std140 layout with explicit padding. `vec3` is refused: Metal and OpenGL pad it differently inside a struct.
"""

from __future__ import annotations

import gpu
import numpy as np

# GLSL type -> (base dtype, components, alignment in bytes)
_TYPES = {
    "float": (np.float32, 1, 4),
    "int": (np.int32, 1, 4),
    "vec2": (np.float32, 2, 8),
    "vec4": (np.float32, 4, 16),
    "mat4": (np.float32, 16, 16),
}


class Struct:
    """A named list of fields: `Struct("View", ("mat4", "projection"), ("vec4", "planes[6]"), …)`.

    Arrays hold vec4 or mat4 only, since std140 strides every array by 16 bytes.
    Matrices are set as (4, 4) arrays in mathematical order and stored column by column.
    """

    def __init__(self, name: str, *fields: tuple[str, str]):
        self.name = name
        self.fields: dict[str, tuple[str, int]] = {}  # field -> (GLSL type, array length or 0)
        numpy_fields, lines, offset, pads = [], [], 0, 0
        for kind, declared in fields:
            if kind not in _TYPES:
                raise ValueError(f"Struct {name}: '{kind}' cannot stand in a struct; use one of {', '.join(_TYPES)}.")
            field, _, length = declared.rstrip("]").partition("[")
            count = int(length) if length else 0
            if count and kind not in ("vec4", "mat4"):
                raise ValueError(f"Struct {name}: array '{field}' must hold vec4 or mat4, not {kind}.")
            if field in self.fields:
                raise ValueError(f"Struct {name}: field '{field}' is declared twice.")
            base, components, align = _TYPES[kind]
            while offset % align:
                numpy_fields.append((f"_pad{pads}", np.float32))
                lines.append(f"  float _pad{pads};")
                pads, offset = pads + 1, offset + 4
            shape = (components,) if components > 1 else ()
            numpy_fields.append((field, base, ((count,) if count else ()) + shape))
            lines.append(f"  {kind} {declared};")
            offset += 4 * components * max(count, 1)
            self.fields[field] = (kind, count)
        while offset % 16 or not offset:
            numpy_fields.append((f"_pad{pads}", np.float32))
            lines.append(f"  float _pad{pads};")
            pads, offset = pads + 1, offset + 4
        self.dtype = np.dtype(numpy_fields)
        self._matrices = frozenset(field for field, (kind, _) in self.fields.items() if kind == "mat4")
        self.glsl = f"struct {name} {{\n" + "\n".join(lines) + "\n};\n"

    def pack(self, **values) -> np.ndarray:
        """One record with every field set; a missing or unknown name raises KeyError."""
        if values.keys() != self.fields.keys():
            wrong = sorted(values.keys() ^ self.fields.keys())
            raise KeyError(f"Struct {self.name}: missing or unknown fields {', '.join(wrong)}.")
        record = np.zeros((), self.dtype)
        for field, value in values.items():
            if field in self._matrices:
                value = np.swapaxes(np.asarray(value, np.float32), -1, -2)
                value = value.reshape(*value.shape[:-2], 16)
            record[field] = value
        return record


class Block:
    """A uniform buffer of one record of a struct. Images `beside` it, by name, are bound with it, as those beside
    an image are (images.Image). `answers`: snippets by which full-screen and compute programs that read it differ."""

    def __init__(self, struct: Struct, **values):
        self.struct = struct
        self.beside: dict[str, object] = {}
        self.answers: tuple[tuple[str, str], ...] = ()
        self._data = struct.pack(**values)
        self._content = self._data.tobytes()
        self.buffer = gpu.types.GPUUniformBuf(self._bytes())

    def update(self, **values) -> None:
        """Upload new values; equal values upload nothing."""
        data = self.struct.pack(**values)
        content = data.tobytes()
        if content != self._content:
            self._data, self._content = data, content
            self.buffer.update(self._bytes())

    def value(self, field: str) -> np.ndarray:
        """What was set last."""
        return self._data[field]

    def _bytes(self):
        flat = np.frombuffer(self._content, np.float32)
        return gpu.types.Buffer("FLOAT", flat.size, flat.copy())
