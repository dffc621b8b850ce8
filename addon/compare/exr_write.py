"""Writing multilayer OpenEXR files of 32-bit floats, with numpy and zlib alone: what exr.py reads, and Blender.

Blender itself writes only what a render result holds. Slices (addon/frame/slices.py) hold sums with an alpha of their
own and a few words about themselves. Scan lines, one part, compression ZIP; see exr.py for the format. Names of
channels are longer than 31 bytes, which bit 0x400 of the version says.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from ..snapshot.exr import LINES_PER_CHUNK, MAGIC, ExrError, read_attributes

LONG_NAMES = 0x400
ZIP = 3
CHANNELS = "RGBA"


def write_exr(path: Path, layers: Mapping[str, np.ndarray], about: Mapping[str, str]) -> None:
    """Layers by full name ("ViewLayer.Combined"), (H, W, 1 to 4) float32, bottom row first; `about`: text attributes.

    Raises ValueError when layers differ in size, OSError when the file cannot be written.
    """
    sizes = {pixels.shape[:2] for pixels in layers.values()}
    if len(sizes) != 1:
        raise ValueError(f"Layers of one file must have one size, not {sorted(sizes)}.")
    (height, width), planes = sizes.pop(), {}
    for name, pixels in layers.items():
        for k in range(pixels.shape[2]):
            planes[f"{name}.{CHANNELS[k]}"] = np.ascontiguousarray(pixels[::-1, :, k], "<f4")
    names = sorted(planes, key=lambda name: name.encode())
    header = _header(names, width, height, about)
    lines = LINES_PER_CHUNK[ZIP]
    chunks = []
    for first in range(0, height, lines):
        rows = [planes[name][y].tobytes() for y in range(first, min(first + lines, height)) for name in names]
        packed = _pack(b"".join(rows))
        chunks.append(struct.pack("<ii", first, len(packed)) + packed)
    place = len(header) + 8 * len(chunks)
    offsets = []
    for chunk in chunks:
        offsets.append(place)
        place += len(chunk)
    with path.open("wb") as file:
        file.write(header + struct.pack(f"<{len(offsets)}Q", *offsets))
        for chunk in chunks:
            file.write(chunk)


def read_about(path: Path) -> dict[str, str]:
    """The text attributes of a file's header. Raises `ExrError`."""
    try:
        with path.open("rb") as file:
            start = file.read(1 << 20)  # headers are short
        if struct.unpack_from("<I", start, 0)[0] != MAGIC:
            raise ExrError(f"{path}: this is not an OpenEXR file.")
        attributes, _ = read_attributes(start, 8)
        return {name: value.decode("utf-8") for name, (kind, value) in attributes.items() if kind == "string"}
    except (struct.error, ValueError, IndexError, OverflowError) as error:
        raise ExrError(f"{path}: the EXR file is damaged or cut short ({error}).") from None


def _header(names: list[str], width: int, height: int, about: Mapping[str, str]) -> bytes:
    channels = b"".join(name.encode() + b"\0" + struct.pack("<iB3xii", 2, 0, 1, 1) for name in names) + b"\0"
    window = struct.pack("<4i", 0, 0, width - 1, height - 1)
    attributes = [
        ("channels", "chlist", channels),
        ("compression", "compression", bytes((ZIP,))),
        ("dataWindow", "box2i", window),
        ("displayWindow", "box2i", window),
        ("lineOrder", "lineOrder", b"\0"),
        ("pixelAspectRatio", "float", struct.pack("<f", 1.0)),
        ("screenWindowCenter", "v2f", struct.pack("<2f", 0.0, 0.0)),
        ("screenWindowWidth", "float", struct.pack("<f", 1.0)),
        *((name, "string", text.encode()) for name, text in about.items()),
    ]
    body = b"".join(
        name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<i", len(value)) + value
        for name, kind, value in attributes
    )
    return struct.pack("<II", MAGIC, 2 | LONG_NAMES) + body + b"\0"


def _pack(raw: bytes) -> bytes:
    """Bytes split into even and odd ones, replaced by their differences, deflated; unless that is longer."""
    data = np.frombuffer(raw, np.uint8)
    halves = np.concatenate([data[0::2], data[1::2]])
    deltas = halves.copy()
    deltas[1:] = halves[1:] - halves[:-1] + np.uint8(128)
    packed = zlib.compress(deltas.tobytes(), 4)
    return packed if len(packed) < len(raw) else raw
