"""Reading multilayer OpenEXR files as Blender writes them, with numpy and zlib alone.

Blender's Python has no OpenEXR reader that shows the passes of a render: `bpy.data.images` gives only the
combined picture, and OpenImageIO is missing from the bpy wheel. What Blender writes is a small part of the format,
and that part is read here: scan lines (no tiles, no deep data), one part or several, channels of 32-bit float,
16-bit half or 32-bit unsigned integers, compression NONE, RLE, ZIPS or ZIP.

Source: "OpenEXR File Layout" and "Technical Introduction to OpenEXR" (openexr.com). A file is a magic number, a
header of named attributes per part, a table of chunk offsets per part, then the chunks. A chunk holds 1 or 16 scan
lines; a scan line holds one row of each channel in the header's (alphabetical) order. ZIP deflates a chunk after
two reversible steps that help it: bytes are split into even and odd ones, then replaced by their differences.
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

MAGIC = 20000630
TILED, DEEP, MULTIPART = 0x200, 0x800, 0x1000  # bits of the version field
PIXEL_TYPES = {0: np.dtype("<u4"), 1: np.dtype("<f2"), 2: np.dtype("<f4")}
LINES_PER_CHUNK = {0: 1, 1: 1, 2: 1, 3: 16}  # NONE, RLE, ZIPS, ZIP
COMPRESSION_NAMES = ("NONE", "RLE", "ZIPS", "ZIP", "PIZ", "PXR24", "B44", "B44A", "DWAA", "DWAB", "HTJ2K")
CHANNEL_ORDER = "RGBAXYZWUV"  # how the channels of one pass are stacked


MOST_SHRUNK = 1032  # times that deflate, of all compressions that are read, can shrink anything


class ExrError(ValueError):
    """The file is no EXR, is damaged, or uses a part of the format that Blender's scan-line files do not."""


@dataclass(frozen=True)
class Part:
    """One header: what the chunks that follow it hold."""

    channels: tuple[tuple[str, np.dtype], ...]  # in file order
    compression: int
    data_window: tuple[int, int, int, int]  # x_min, y_min, x_max, y_max, all inclusive, y downwards

    @property
    def size(self) -> tuple[int, int]:
        x_min, y_min, x_max, y_max = self.data_window
        return x_max - x_min + 1, y_max - y_min + 1

    @property
    def byte_count(self) -> int:
        """Bytes of all pixels. Raises ExrError for a window without any."""
        width, height = self.size
        if width < 1 or height < 1:
            raise ExrError(f"the EXR file is damaged: its window is {width} x {height} pixels.")
        return width * height * sum(dtype.itemsize for _, dtype in self.channels)

    @property
    def chunk_count(self) -> int:
        return -(-self.size[1] // LINES_PER_CHUNK[self.compression])


def read_exr(path: str | Path) -> dict[str, np.ndarray]:
    """Every layer of the file: full name ("ViewLayer.Diffuse Direct") -> (H, W, C) float32, bottom row first.

    Bottom row first, as Blender's images and the GPU have it; EXR itself stores the top row first. A channel's layer
    is its name up to the last dot; a channel without a dot belongs to the layer "". Channels are stacked in the order
    R G B A, X Y Z W, U V. The pixels are those of the data window (a cropped render gives the cropped rectangle).
    Raises `ExrError` with a sentence that names the file.
    """
    path = Path(path)
    data = path.read_bytes()
    try:
        return _stack(_read_channels(data))
    except ExrError as error:
        raise ExrError(f"{path}: {error}") from None
    except (struct.error, zlib.error, IndexError, ValueError, KeyError, OverflowError) as error:
        raise ExrError(f"{path}: the EXR file is damaged or cut short ({error}).") from error


def _read_channels(data: bytes) -> dict[str, np.ndarray]:
    magic, version = struct.unpack_from("<II", data, 0)
    if magic != MAGIC:
        raise ExrError("this is not an OpenEXR file.")
    if version & (TILED | DEEP):
        raise ExrError("tiled and deep EXR files are not read; render to scan lines.")
    multipart = bool(version & MULTIPART)
    parts, at = _read_headers(data, 8, multipart)

    channels: dict[str, np.ndarray] = {}
    if sum(part.byte_count for part in parts) > MOST_SHRUNK * len(data):
        raise ExrError("the EXR file is damaged: it has more pixels than a file of its length can hold.")
    for number, part in enumerate(parts):
        width, height = part.size
        offsets = struct.unpack_from(f"<{part.chunk_count}Q", data, at)
        at += 8 * part.chunk_count
        rows = {name: np.zeros((height, width), dtype) for name, dtype in part.channels}
        for offset in offsets:
            if multipart:
                owner = struct.unpack_from("<I", data, offset)[0]
                if owner != number:
                    raise ExrError(f"the EXR file is damaged: a chunk of part {number} names part {owner}.")
                offset += 4
            _read_chunk(data, offset, part, rows)
        channels.update(rows)
    return channels


def _read_headers(data: bytes, at: int, multipart: bool) -> tuple[list[Part], int]:
    """All headers and where the chunk tables begin. Several headers end with an empty one."""
    parts = []
    while True:
        attributes, at = read_attributes(data, at)
        if attributes:
            parts.append(_part({name: value for name, (_, value) in attributes.items()}))
        if not multipart or not attributes:
            return parts, at


def read_attributes(data: bytes, at: int) -> tuple[dict[str, tuple[str, bytes]], int]:
    """Type and value of each attribute of the header that begins at `at`, and where the header ends."""
    attributes = {}
    while data[at] != 0:
        name, at = _text(data, at)
        kind, at = _text(data, at)
        (size,) = struct.unpack_from("<I", data, at)
        attributes[name] = kind, data[at + 4 : at + 4 + size]
        at += 4 + size
    return attributes, at + 1


def _part(attributes: dict[str, bytes]) -> Part:
    compression = attributes["compression"][0]
    if compression not in LINES_PER_CHUNK:
        name = COMPRESSION_NAMES[compression] if compression < len(COMPRESSION_NAMES) else str(compression)
        raise ExrError(f"compression {name} is not read; save with ZIP.")
    channels = []
    text, at = attributes["channels"], 0
    while text[at] != 0:
        name, at = _text(text, at)
        kind, _linear, x_sampling, y_sampling = struct.unpack_from("<iB3xii", text, at)
        at += 16
        if (x_sampling, y_sampling) != (1, 1):
            raise ExrError(f"channel {name} is subsampled, which is not read.")
        channels.append((name, PIXEL_TYPES[kind]))
    return Part(tuple(channels), compression, struct.unpack("<4i", attributes["dataWindow"]))


def _read_chunk(data: bytes, offset: int, part: Part, rows: dict[str, np.ndarray]) -> None:
    """Decode one chunk into the rows that it covers."""
    width, height = part.size
    y, packed_size = struct.unpack_from("<ii", data, offset)
    first = y - part.data_window[1]
    lines = min(LINES_PER_CHUNK[part.compression], height - first)
    if first < 0 or lines <= 0 or packed_size < 0 or offset + 8 + packed_size > len(data):
        raise ExrError("the EXR file is damaged or cut short.")
    line_bytes = width * sum(dtype.itemsize for _, dtype in part.channels)
    packed = data[offset + 8 : offset + 8 + packed_size]
    raw = _unpack(packed, part.compression, lines * line_bytes).reshape(lines, line_bytes)
    start = 0
    for name, dtype in part.channels:
        stop = start + width * dtype.itemsize
        rows[name][first : first + lines] = np.ascontiguousarray(raw[:, start:stop]).view(dtype)
        start = stop


def _unpack(packed: bytes, compression: int, size: int) -> np.ndarray:
    """The chunk's bytes, uint8 of length `size`. A chunk that did not shrink is stored as it was."""
    if compression == 0 or len(packed) == size:
        raw = np.frombuffer(packed, np.uint8)
    else:
        deltas = np.frombuffer(_run_lengths(packed) if compression == 1 else _inflated(packed, size), np.uint8).copy()
        deltas[1:] -= 128  # differences are stored with an offset of 128, modulo 256
        halves = np.cumsum(deltas, dtype=np.uint8)
        raw = np.empty_like(halves)
        raw[0::2] = halves[: (len(halves) + 1) // 2]
        raw[1::2] = halves[(len(halves) + 1) // 2 :]
    if len(raw) != size:
        raise ExrError(f"the EXR file is damaged: a chunk holds {len(raw)} bytes where {size} belong.")
    return raw


def _inflated(packed: bytes, size: int) -> bytes:
    """The first size + 1 bytes at most: more are damage, and may be any number."""
    return zlib.decompressobj().decompress(packed, size + 1)


def _run_lengths(packed: bytes) -> bytes:
    """RLE: a negative count -n, then n literal bytes; or a count n, then one byte that is repeated n + 1 times."""
    out, at = bytearray(), 0
    while at < len(packed):
        (count,) = struct.unpack_from("<b", packed, at)
        if count < 0:
            out += packed[at + 1 : at + 1 - count]
            at += 1 - count
        else:
            out += packed[at + 1 : at + 2] * (count + 1)
            at += 2
    return bytes(out)


def _stack(channels: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    layers: dict[str, list[tuple[int, str]]] = {}
    for name in channels:
        layer, _, channel = name.rpartition(".")
        rank = CHANNEL_ORDER.find(channel) if len(channel) == 1 else -1
        layers.setdefault(layer, []).append((rank if rank >= 0 else len(CHANNEL_ORDER), name))
    return {
        layer: np.stack([channels[name][::-1].astype(np.float32) for _, name in sorted(members)], axis=-1)
        for layer, members in layers.items()
    }


def _text(data: bytes, at: int) -> tuple[str, int]:
    """A zero-terminated string and the position behind it."""
    end = data.index(b"\0", at)
    return data[at:end].decode("utf-8", "replace"), end + 1
