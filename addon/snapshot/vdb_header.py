"""Lengths that an OpenVDB file names, checked before OpenVDB believes them.

OpenVDB takes memory for as many bytes as a damaged file says that a text has, minutes for two gigabytes, and
goes through as many entries as it says that there are. Here headers are walked first: those of the file and of each
grid, up to its voxels. Layout: openvdb/io/Archive.cc, GridDescriptor.cc, MetaMap.cc.
"""

from __future__ import annotations

import os
import struct
from pathlib import Path
from typing import BinaryIO

MAGIC = b" BDV\0\0\0\0"
OLDEST, NEWEST = 222, 225  # versions of the format that have this layout; those before or soon after are not looked at
LATER = 250  # versions that there are not
UUID = 36  # bytes


def check(path: str | Path) -> None:
    """ValueError with a sentence where a header names more than the file holds. OSError as `open`."""
    with Path(path).open("rb") as file:
        if file.read(8) != MAGIC:
            raise ValueError("it is no OpenVDB file")
        (version,) = _numbers(file, "<I")
        if version > LATER:
            raise ValueError(f"its format has the version {version}, so that it is damaged")
        if not OLDEST <= version <= NEWEST:
            return
        *_, has_offsets = _numbers(file, "<II?")
        file.seek(UUID, os.SEEK_CUR)
        _skip_metadata(file)
        (count,) = _numbers(file, "<I")
        if not has_offsets:
            return
        for _ in range(count):  # each reads some bytes, so that the file's end ends it
            for _ in range(3):  # name, type, the grid whose voxels it shares
                _skip(file, *_numbers(file, "<I"))
            begin, _, end = _numbers(file, "<qqq")
            _seek(file, begin)
            _numbers(file, "<I")  # compression
            _skip_metadata(file)
            _skip(file, *_numbers(file, "<I"))  # kind of the transform
            _seek(file, end)


def _skip_metadata(file: BinaryIO) -> None:
    (count,) = _numbers(file, "<I")
    for _ in range(count):
        for _ in range(3):  # name, type, value
            _skip(file, *_numbers(file, "<I"))


def _numbers(file: BinaryIO, form: str) -> tuple:
    data = file.read(struct.calcsize(form))
    if len(data) < struct.calcsize(form):
        raise ValueError("it ends too early")
    return struct.unpack(form, data)


def _skip(file: BinaryIO, count: int) -> None:
    _seek(file, file.tell() + count)


def _seek(file: BinaryIO, place: int) -> None:
    if not 0 <= place <= os.fstat(file.fileno()).st_size:
        raise ValueError("it is damaged: it names a place beyond its end")
    file.seek(place)
