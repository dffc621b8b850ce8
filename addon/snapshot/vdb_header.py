"""What an OpenVDB file says of lengths and counts, checked before OpenVDB believes it.

OpenVDB takes memory for as many bytes as a damaged file says that a text has, minutes for two gigabytes, goes through
as many nodes as it says that there are, and does not look whether the file has ended. Here all of a file is walked
first but its voxels: its header, those of its grids, and their trees down to the masks of the leaves; a step for each
node above these. Layout: openvdb/io/Archive.cc, GridDescriptor.cc, Compression.h, DelayedLoadMetadata.cc; MetaMap.cc;
math/Maps.h; tree/RootNode.h, InternalNode.h, LeafNode.h.
"""

from __future__ import annotations

import os
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

MAGIC = b" BDV\0\0\0\0"
OLDEST, NEWEST = 222, 225  # versions of the format that have this layout; those before or soon after are not looked at
LATER = 250  # versions that there are not
UUID = 36  # bytes
BYTES = {
    "bool": 1, "mask": 1, "half": 2, "float": 4, "double": 8, "int32": 4, "int64": 8, "ptidx32": 4, "ptdataidx32": 4,
    "vec2i": 8, "vec2s": 8, "vec2d": 16, "vec3i": 12, "vec3s": 12, "vec3d": 24, "vec4i": 16, "vec4s": 16, "vec4d": 32,
    "mat4s": 64, "mat4d": 128,
}  # fmt: skip
AS_HALF = {"float": 2, "double": 2, "vec2s": 4, "vec2d": 4, "vec3s": 6, "vec3d": 6}  # bytes of a "_HalfFloat" grid's
MAPS = {
    "AffineMap": 128, "UnitaryMap": 128, "ScaleMap": 120, "UniformScaleMap": 120, "TranslationMap": 24,
    "ScaleTranslateMap": 144, "UniformScaleTranslateMap": 144,
}  # fmt: skip
FRUSTUM = 64  # bytes before the name of the map that it goes on with
COORDINATES = 12  # bytes of a place
LEAF_MASK = 64  # bytes of a leaf that stand before all voxels
LEAF_VOXELS = {"bool": 140, "mask": 76}  # bytes; of other types at least the mask again, and a flag
ZIP, ACTIVE_MASK, BLOSC = 1, 2, 4  # bits of a grid's compression
INACTIVE = ((0, 0), (0, 0), (1, 0), (0, 1), (1, 1), (2, 1), (0, 0))  # by a node's flag: values, masks
ALL_VALUES = 6  # the flag with which inactive values are not left out
NO_LENGTHS = 0xFFFFFFFF
LISTED = [6, 2]  # OpenVDB takes no lists of leaves from libraries before


@dataclass(frozen=True)
class _Values:
    """How a grid's values are stored: bytes of one by itself, of one in a list, whether those are halves, bits."""

    alone: int
    listed: int
    halved: bool
    compression: int


def check(path: str | Path) -> None:
    """ValueError with a sentence where a file names more than it holds. OSError as `open`."""
    with Path(path).open("rb") as file:
        if file.read(8) != MAGIC:
            raise ValueError("it is no OpenVDB file")
        (version,) = _numbers(file, "<I")
        if version > LATER:
            raise ValueError(f"its format has the version {version}, so that it is damaged")
        if not OLDEST <= version <= NEWEST:
            return
        *library, has_offsets = _numbers(file, "<II?")
        _skip(file, UUID)
        _skip_metadata(file)
        (count,) = _numbers(file, "<I")
        for _ in range(count):  # each reads some bytes, so that the file's end ends it
            _, kind, shared = (_text(file) for _ in range(3))
            begin, _, end = _numbers(file, "<qqq")
            if not (file.tell() <= begin <= end if has_offsets else begin == end == 0):
                raise ValueError("it is damaged: its grids do not lie one behind the other")
            if has_offsets:
                _seek(file, begin)
            _check_grid(file, kind, bool(shared), library, end if has_offsets else _length(file))
            if not has_offsets:  # voxels alone tell where the next one begins
                return
            _seek(file, end)


def _check_grid(file: BinaryIO, kind: str, shares: bool, library: list[int], end: int) -> None:
    """`kind`: as "Tree_float_5_4_3_HalfFloat". `shares`: its tree is another grid's. `library`: version that wrote."""
    (compression,) = _numbers(file, "<I")
    listed = _skip_metadata(file)
    _skip_map(file)
    kind, half, _ = kind.partition("_HalfFloat")
    name = kind.removeprefix("Tree_").removesuffix("_5_4_3")
    if shares or name not in BYTES:  # OpenVDB knows no other
        return
    halved = bool(half) and name in AS_HALF
    values = _Values(BYTES[name], AS_HALF[name] if halved else BYTES[name], halved, compression)
    (buffers,) = _numbers(file, "<i")
    if buffers != 1:
        raise ValueError(f"it is damaged: a tree has {buffers} buffers")
    _skip(file, values.alone)  # background
    tiles, children = _numbers(file, "<II")
    _skip(file, tiles * (COORDINATES + values.alone + 1))
    leaves = 0
    for _ in range(children):
        _skip(file, COORDINATES)
        for _ in range(_skip_node(file, 1 << 15, values)):
            found = _skip_node(file, 1 << 12, values)
            _skip(file, found * LEAF_MASK)
            leaves += found
    if file.tell() + leaves * LEAF_VOXELS.get(name, LEAF_MASK + 1) > end:
        raise ValueError("it is damaged: a grid has more leaves than fit before its end")
    if listed is not None and library >= LISTED and listed != leaves:
        raise ValueError(f"it is damaged: a grid has {leaves} leaves, and lists {listed}")


def _skip_node(file: BinaryIO, size: int, values: _Values) -> int:
    """How many children the node has, which follow. `size`: places for them."""
    children, active = (int.from_bytes(_bytes(file, size // 8)).bit_count() for _ in range(2))
    (flag,) = _numbers(file, "<B")
    if flag >= len(INACTIVE):
        raise ValueError("it is damaged: it has a node of a kind that there is not")
    alone, masks = INACTIVE[flag]
    _skip(file, alone * values.alone + masks * size // 8)
    count = active if values.compression & ACTIVE_MASK and flag != ALL_VALUES else size
    if not count and values.halved:
        return children
    length = count * values.listed
    if values.compression & (ZIP | BLOSC):
        (packed,) = _numbers(file, "<q")
        if packed <= 0 and -packed != length:
            raise ValueError("it is damaged: a node has values of another length")
        length = abs(packed)
    _skip(file, length)
    return children


def _skip_map(file: BinaryIO) -> None:
    kind = _text(file)
    if kind == "NonlinearFrustumMap":
        _skip(file, FRUSTUM)
        kind = _text(file)
    if kind not in MAPS:
        raise ValueError("it is damaged: its transform is of a kind that there is not")
    _skip(file, MAPS[kind])


def _skip_metadata(file: BinaryIO) -> int | None:
    """How many leaves they list, None without a list. OpenVDB reads a value by its type, whatever length is said."""
    listed = None
    (count,) = _numbers(file, "<I")
    for _ in range(count):
        _, kind = _text(file), _text(file)
        (length,) = _numbers(file, "<I")
        end = file.tell() + length
        if BYTES.get(kind, length) != length:
            raise ValueError(f"it is damaged: a value of the type {kind} has {length} bytes")
        if kind == "__delayedload" and length:
            listed = _skip_delayed_load(file)
            if file.tell() > end:
                raise ValueError("it is damaged: its list of leaves is longer than it says")
        _seek(file, end)
    return listed


def _skip_delayed_load(file: BinaryIO) -> int:
    """How many leaves are listed: of each one byte and, perhaps, how long its voxels are. OpenVDB goes on there."""
    (count,) = _numbers(file, "<I")
    if count * LEAF_MASK > _length(file):
        raise ValueError("it is damaged: it lists more leaves than it can hold")
    for size in (1, 8):
        (packed,) = _numbers(file, "<I")
        if packed == NO_LENGTHS and size == 8:
            break
        data = _bytes(file, packed or count * size)
        if packed:  # by Blosc, whose header repeats both lengths; what is short is padded
            if packed < 16 or struct.unpack_from("<4xI4xI", data) != (max(count * size, 128), packed):
                raise ValueError("it is damaged: its list of leaves does not have the length that it says")
        elif size == 8 and any(not 0 <= length <= _length(file) for (length,) in struct.iter_unpack("<q", data)):
            raise ValueError("it is damaged: it lists a leaf that goes beyond its end")
    return count


def _text(file: BinaryIO) -> str:
    return _bytes(file, *_numbers(file, "<I")).decode("latin-1")


def _numbers(file: BinaryIO, form: str) -> tuple:
    return struct.unpack(form, _bytes(file, struct.calcsize(form)))


def _bytes(file: BinaryIO, count: int) -> bytes:
    start = file.tell()
    _skip(file, count)
    file.seek(start)
    return file.read(count)


def _skip(file: BinaryIO, count: int) -> None:
    _seek(file, file.tell() + count)


def _length(file: BinaryIO) -> int:
    return os.fstat(file.fileno()).st_size


def _seek(file: BinaryIO, place: int) -> None:
    if not 0 <= place <= _length(file):
        raise ValueError("it is damaged: it names a place beyond its end")
    file.seek(place)
