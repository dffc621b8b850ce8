"""Writing PNG files with zlib alone: 8-bit RGB, or 8-bit indices into a palette of 256 colours.

Source: PNG specification (W3C, third edition), sections 5 (chunks), 9.2 (filters) and 11.2 (critical chunks).
"""

from __future__ import annotations

import base64
import struct
import zlib

import numpy as np

RGB, PALETTE = 2, 3  # colour types
FILTER_UP = 2  # a row is stored as its difference from the row above: smooth pictures shrink by a third


def png(pixels: np.ndarray, palette: np.ndarray | None = None) -> bytes:
    """PNG file of (H, W, 3) uint8, or of (H, W) uint8 with a (256, 3) uint8 palette. Top row first."""
    height, width = pixels.shape[:2]
    rows = np.ascontiguousarray(pixels, np.uint8).reshape(height, -1)
    if palette is None:
        filtered = np.diff(rows, axis=0, prepend=np.zeros_like(rows[:1]))  # modulo 256, as uint8 wraps
        lines = np.insert(filtered, 0, FILTER_UP, axis=1)
    else:
        lines = np.insert(rows, 0, 0, axis=1)  # differences of indices mean nothing
    header = struct.pack(">IIBBBBB", width, height, 8, RGB if palette is None else PALETTE, 0, 0, 0)
    chunks = [(b"IHDR", header)]
    if palette is not None:
        chunks.append((b"PLTE", np.ascontiguousarray(palette, np.uint8).tobytes()))
    chunks += [(b"IDAT", zlib.compress(lines.tobytes(), 6)), (b"IEND", b"")]
    out = [b"\x89PNG\r\n\x1a\n"]
    for kind, data in chunks:
        out += [struct.pack(">I", len(data)), kind, data, struct.pack(">I", zlib.crc32(kind + data))]
    return b"".join(out)


def data_url(file: bytes) -> str:
    """A PNG file as text for the `src` of an image, so that a page needs no second file."""
    return "data:image/png;base64," + base64.b64encode(file).decode("ascii")
