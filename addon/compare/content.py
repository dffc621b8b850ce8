"""A hash of a .blend file's content that is the same in every session, so that a reference render is found again.

Some things in a .blend file say nothing about the scene and are taken out first. Memory addresses: every pointer is
replaced by the number of the block it points to. As when Blender reads the file, that is a block of the same data-block
or another data-block: parts of two data-blocks may have stood at the same address, one after the other. Padding, time
stamps and session numbers of data-blocks. The output format. And Candela's own settings (the property groups named
`candela`), so that tuning Candela does not throw its reference away.

Source for the file format: doc/blender_file_format in Blender's repository. A file is a header, then blocks (code,
length, old address, struct number, count, data); the block DNA1 describes the fields of every struct.
"""

from __future__ import annotations

import hashlib
import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

FOREIGN = (b"REND", b"TEST", b"GLOB", b"USER", b"DNA1")  # blocks about the file, not about the scene
RAW = 0  # struct number of blocks without fields: arrays of numbers or of pointers
POINTER = 8  # bytes; files of 32-bit Blender are not written any more
SHORTEST_TEXT = 16  # bytes; shorter arrays of characters are numbers
OWN_SETTINGS = b"candela"
MEANINGLESS = {  # (struct, field)
    ("ID", "session_uid"),
    ("bNode", "identifier"),  # random: lights of older files are given nodes when they are loaded; links are pointers
    ("PreviewImage", "changed_timestamp[2]"),
    ("CurveMapping", "changed_timestamp"),
    ("CurveProfile", "changed_timestamp"),
    ("bNodeTree", "inputs"),  # 4.x writes these for older versions from memory that it reuses; the interface follows
    ("bNodeTree", "outputs"),
    ("Mesh", "face_sets_color_seed"),  # random, of each new mesh; colours that sculpting shows
    ("Object", "base_flag"),  # what is selected, and hidden in viewports
    ("Object", "base_local_view_bits"),
    ("Base", "flag"),
    ("Base", "local_view_bits"),
    ("RenderData", "im_format"),
    ("RenderData", "pic[1024]"),
    ("IDProperty", "*next"),
    ("IDProperty", "*prev"),
    ("IDProperty", "len"),
    ("IDProperty", "totallen"),
    ("IDPropertyData", "group"),
}


def blend_hash(data: bytes) -> bytes:
    """Hash of an uncompressed .blend file's content without addresses, session numbers and Candela's settings."""
    blocks = read_blocks(data)
    description = next((block for block in blocks if block.code == b"DNA1"), None)
    if description is None:
        raise ValueError("This is not a complete .blend file: it does not describe its structs.")
    dna = Dna(data[description.start : description.start + description.length])
    blocks = _without_foreign(blocks)
    skipped = _own_settings(data, blocks, dna)
    kept = [block for block in blocks if block.address not in skipped]

    digest = hashlib.blake2b(digest_size=20)
    for block, (addresses, numbers) in zip(kept, _targets(kept), strict=True):
        content = np.frombuffer(data, np.uint8, block.length, block.start).copy()
        name, size = dna.structs[block.struct] if block.struct else ("", 0)
        if block.struct and size and block.length >= size:
            items = content[: block.length // size * size].reshape(-1, size)
            _renumber_fields(items, dna.pointers(name), addresses, numbers)
            for offset, length in dna.meaningless(name):
                items[:, offset : offset + length] = 0
            for offset, length in dna.texts(name):
                text = items[:, offset : offset + length]
                text[np.logical_or.accumulate(text == 0, axis=1)] = 0  # behind its end stands what was there before
        else:
            _renumber_words(content, addresses, numbers)
        digest.update(struct.pack("<4sqi", block.code, block.length, block.struct))
        digest.update(content)
    return digest.digest()


def _targets(blocks: list[Block]) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """For each block where its pointers may point: addresses in ascending order, and for each the place of that block
    in the file (from 1 on; 0 is "points nowhere")."""
    starts = [k for k, block in enumerate(blocks) if block.code != b"DATA"]
    for first, end in zip(starts, [*starts[1:], len(blocks)], strict=True):
        own = [*range(first, end), *starts]  # of equal addresses the first counts
        addresses, place = np.unique(np.array([blocks[k].address for k in own], np.uint64), return_index=True)
        numbers = np.array(own, np.uint64)[place] + np.uint64(1)
        yield from [(addresses, numbers)] * (end - first)


# Blocks and their description ----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Block:
    code: bytes
    address: int  # where the data was in memory; pointers in the file hold this number
    start: int  # of the data in the file
    length: int  # in bytes
    struct: int  # number of the struct in DNA1


def read_blocks(data: bytes) -> list[Block]:
    """All blocks of an uncompressed .blend file. Raises `ValueError` when it is none."""
    if data[:7] != b"BLENDER":
        raise ValueError("This is not an uncompressed .blend file.")
    if data[7:9].isdigit():  # 5.0 and later: "BLENDER17-01v0500", where 17 is the length of this header
        at, head = int(data[7:9]), struct.Struct("<4siQqq")
    else:  # "BLENDER-v405"
        at, head = 12, struct.Struct("<4siQii")
    modern = head.size == 32
    blocks = []
    while at + head.size <= len(data):
        code, a, address, b, _count = head.unpack_from(data, at)
        number, length = (a, b) if modern else (b, a)
        at += head.size
        if code == b"ENDB":
            break
        blocks.append(Block(code.rstrip(b"\0"), address, at, length, number))
        at += length
    return blocks


@dataclass(frozen=True)
class Places:
    """Where in a struct the things stand that are treated by their meaning; bytes from its start."""

    pointers: list[int] | np.ndarray
    meaningless: list[tuple[int, int]]  # offset, bytes
    texts: list[tuple[int, int]]


class Dna:
    """The fields of all structs of one file, read from its DNA1 block."""

    def __init__(self, data: bytes):
        self._at = 4  # behind "SDNA"
        self._data = data
        field_names = self._strings(b"NAME")
        types = self._strings(b"TYPE")
        sizes = self._numbers(b"TLEN", len(types))
        (count,) = self._section(b"STRC")
        self.sizes = dict(zip(types, sizes, strict=True))
        self.structs: list[tuple[str, int]] = []  # name, bytes
        self._fields: dict[str, list[tuple[str, str]]] = {}  # struct -> (type, declared name) per field
        for _ in range(count):
            kind, fields = struct.unpack_from("<HH", data, self._at)
            pairs = struct.unpack_from(f"<{2 * fields}H", data, self._at + 4)
            self._at += 4 + 4 * fields
            self.structs.append((types[kind], sizes[kind]))
            self._fields[types[kind]] = [(types[t], field_names[n]) for t, n in zip(*[iter(pairs)] * 2, strict=True)]
        self._scanned: dict[str, Places] = {}

    def layout(self, name: str) -> list[tuple[str, str, int, int]]:
        """Fields of a struct: type, declared name ("*next", "mat[4][4]"), byte offset, bytes."""
        rows, offset = [], 0
        for kind, declared in self._fields[name]:
            size = POINTER if declared.startswith(("*", "(")) else self.sizes[kind]
            size *= int(np.prod([int(n) for n in re.findall(r"\[(\d+)\]", declared)], initial=1))
            rows.append((kind, declared, offset, size))
            offset += size
        return rows

    def pointers(self, name: str) -> np.ndarray:
        """Byte offsets of all pointers in a struct, also in the structs it contains, (N,) int64."""
        return self._scan(name).pointers

    def meaningless(self, name: str) -> list[tuple[int, int]]:
        """(offset, bytes) of fields that say nothing about the scene.

        Of a property that is also its links to siblings and children and their number, which change when Candela's
        group among them is left out. The values of properties are kept.
        """
        return self._scan(name).meaningless

    def texts(self, name: str) -> list[tuple[int, int]]:
        """(offset, bytes) of fields that hold a text: arrays of characters long enough for a name."""
        return self._scan(name).texts

    def _scan(self, name: str) -> Places:
        if name in self._scanned:
            return self._scanned[name]
        found = Places([], [], [])
        for kind, declared, offset, size in self.layout(name):
            if (name, declared) in MEANINGLESS or declared.startswith("_pad"):
                found.meaningless.append((offset, size))
            elif declared.startswith(("*", "(")):
                found.pointers.extend(range(offset, offset + size, POINTER))
            elif kind == "char" and declared.count("[") == 1 and size >= SHORTEST_TEXT:
                found.texts.append((offset, size))
            elif kind in self._fields and self.sizes[kind]:
                inner = self._scan(kind)
                for start in range(offset, offset + size, self.sizes[kind]):
                    found.pointers.extend((inner.pointers + start).tolist())
                    found.meaningless.extend((start + o, s) for o, s in inner.meaningless)
                    found.texts.extend((start + o, s) for o, s in inner.texts)
        self._scanned[name] = Places(np.array(found.pointers, np.int64), found.meaningless, found.texts)
        return self._scanned[name]

    def _section(self, code: bytes) -> tuple[int]:
        self._at += -self._at % 4
        if self._data[self._at : self._at + 4] != code:
            raise ValueError(f"This .blend file describes its structs in an unknown way: no {code.decode()} section.")
        self._at += 4
        if code == b"TLEN":
            return (0,)
        self._at += 4
        return struct.unpack_from("<i", self._data, self._at - 4)

    def _strings(self, code: bytes) -> list[str]:
        (count,) = self._section(code)
        found = []
        for _ in range(count):
            end = self._data.index(b"\0", self._at)
            found.append(self._data[self._at : end].decode("ascii"))
            self._at = end + 1
        return found

    def _numbers(self, code: bytes, count: int) -> tuple[int, ...]:
        self._section(code)
        self._at += 2 * count
        return struct.unpack_from(f"<{count}H", self._data, self._at - 2 * count)


# What is taken out ---------------------------------------------------------------------------------------------------


def _without_foreign(blocks: list[Block]) -> list[Block]:
    """Without blocks about the file itself; a block "DATA" belongs to the last block of another code."""
    kept, foreign = [], False
    for block in blocks:
        if block.code != b"DATA":
            foreign = block.code in FOREIGN
        if not foreign:
            kept.append(block)
    return kept


def _own_settings(data: bytes, blocks: list[Block], dna: Dna) -> set[int]:
    """Addresses of the property groups named `candela` and of all that hangs below them."""
    number = next((i for i, (name, _) in enumerate(dna.structs) if name == "IDProperty"), -1)
    layout = {field: (offset, size) for _, field, offset, size in dna.layout("IDProperty")}
    name_at = next(offset for field, (offset, _) in layout.items() if field.startswith("name["))
    by_address = {block.address: block for block in blocks}
    siblings = {layout["*next"][0], layout["*prev"][0]}
    found: set[int] = set()
    for block in blocks:
        start = block.start + name_at
        if block.struct != number or data[start : start + len(OWN_SETTINGS) + 1] != OWN_SETTINGS + b"\0":
            continue
        waiting = [(block, siblings)]  # of the group itself, its siblings stay; of its children, all go
        while waiting:
            member, ignored = waiting.pop()
            if member.address in found:
                continue
            found.add(member.address)
            for offset in range(0, member.length - POINTER + 1, POINTER):  # any word that is an address is a pointer
                (target,) = struct.unpack_from("<Q", data, member.start + offset)
                if offset not in ignored and target in by_address and by_address[target].code == b"DATA":
                    waiting.append((by_address[target], set()))
    return found


def _renumber_fields(items: np.ndarray, offsets: np.ndarray, addresses: np.ndarray, numbers: np.ndarray) -> None:
    """Replace the pointers at `offsets` of every item, in place; those that point to no kept block become 0."""
    if offsets.size == 0:
        return
    columns = (offsets[:, None] + np.arange(POINTER)).ravel()
    targets = np.ascontiguousarray(items[:, columns]).view(np.uint64)
    place = np.minimum(np.searchsorted(addresses, targets), len(addresses) - 1)
    targets = np.where(addresses[place] == targets, numbers[place], np.uint64(0))
    items[:, columns] = targets.view(np.uint8)


def _renumber_words(content: np.ndarray, addresses: np.ndarray, numbers: np.ndarray) -> None:
    """Replace every aligned word of a block without fields that equals a block's address, in place."""
    words = content[: content.size // POINTER * POINTER].view(np.uint64)
    candidates = np.flatnonzero((words >= addresses[0]) & (words <= addresses[-1]) & (words != 0))
    place = np.minimum(np.searchsorted(addresses, words[candidates]), len(addresses) - 1)
    match = addresses[place] == words[candidates]
    words[candidates[match]] = numbers[place[match]]
