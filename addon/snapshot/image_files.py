"""Pixels of image files that `Image.pixels` does not give: frames of sequences, tiles of UDIM images, layers of EXR
files, and 8-bit images in colour spaces that no shader decodes.

Blender 5.2 reads files without a data-block (`imbuf`). Before, and where a colour space has to be applied, a data-block
is made for the moment.
"""

from __future__ import annotations

import os
import re
import struct
import tempfile
from pathlib import Path
from typing import BinaryIO

import bpy
import numpy as np

from .exr import ExrError, read_exr

FIRST_TILE = 1001  # UDIM
HEAD = 32  # bytes of a file that say what it is
FRAMES_OF_JPEG = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}  # markers of segments with the size
MOST_AT_ONCE = 1 << 23  # numbers of an image that are summed in double precision at a time


def frame_of(user, frame: int) -> int:
    """The frame of a sequence that an ImageUser shows at a frame of the scene, by Blender's rules."""
    length = user.frame_duration
    shown = frame - user.frame_start + 1
    if length <= 0:
        return 0
    if user.use_cyclic:
        shown = shown % length or length
    return min(max(shown, 0), length) + user.frame_offset


def sequence_path(path: str, frame: int) -> str:
    """The file of another frame: the last number in the file's name is replaced, with as many digits."""
    folder, name = os.path.split(path)
    stem, dot, ending = name.rpartition(".")
    found = re.search(r"(\d+)(?!.*\d)", stem)
    if found is None:
        return path
    number = str(frame).zfill(len(found.group(1)))
    return str(Path(folder) / f"{stem[: found.start()]}{number}{stem[found.end() :]}{dot}{ending}")


def turn_movie(image, frame: int) -> bool:
    """Make `Image.pixels` of a movie those of a frame, counted from 1; whether there is such a movie.

    `Image.pixels` has the frame that Blender read last, and a texture says which one it reads (all of 4.5 to 5.3).
    """
    if not image.frame_duration:
        return False
    texture = bpy.data.textures.new("candela movie", "IMAGE")
    try:
        texture.image = image
        texture.image_user.frame_duration = image.frame_duration
        texture.image_user.frame_current = frame
        texture.evaluate((0.0, 0.0, 0.0))
    finally:
        bpy.data.textures.remove(texture)
    return image.has_data


def tile_path(path: str, number: int) -> str:
    """The file of a UDIM tile."""
    index = number - FIRST_TILE
    return path.replace("<UDIM>", str(number)).replace("<UVTILE>", f"u{index % 10 + 1}_v{index // 10 + 1}")


def shape_of_bytes(file: BinaryIO) -> tuple[int, int, int] | None:
    """Width, height and channels of a file that Blender holds as bytes, by its head: of PNG with 8 bits or fewer and of
    JPEG. None for any other."""
    head = file.read(HEAD)
    if head[:8] == b"\x89PNG\r\n\x1a\n" and len(head) > 25 and head[24] <= 8:
        channels = {0: 1, 2: 3, 3: 4, 4: 2, 6: 4}.get(head[25])
        return (*struct.unpack(">2I", head[16:24]), channels) if channels else None
    if head[:3] != b"\xff\xd8\xff":
        return None
    at = 2
    while True:  # segments of a JPEG file: marker, length, content; one of them is the frame's
        file.seek(at)
        segment = file.read(9)
        if len(segment) < 9 or segment[0] != 0xFF:
            return None
        if segment[1] in FRAMES_OF_JPEG:
            height, width = struct.unpack(">2H", segment[5:])
            return width, height, 3
        at += 2 + struct.unpack(">H", segment[2:4])[0]


def read_file(path: str, space: str) -> np.ndarray | None:
    """(H, W, channels) float32 as Blender stores it, bottom row first; None where there is no such image."""
    if not Path(path).is_file():
        return None
    try:
        import imbuf

        buffer = imbuf.load(path)
        if getattr(buffer, "buffer_type", "") == "BYTE":
            with buffer.with_buffer() as pixels:
                return np.array(pixels, np.float32) / 255.0
    except (ImportError, AttributeError, OSError, RuntimeError, TypeError, ValueError):
        pass
    return _by_data_block(path, space)


def read_layer(path: str, layer: int, number: int) -> np.ndarray | str:
    """Pass `number` of a layer of a multilayer EXR file, in Blender's order; or the sentence that says why not."""
    try:
        found = read_exr(path)
    except (ExrError, OSError) as error:
        return f"the multilayer file cannot be read and is drawn magenta: {error}"
    layers: dict[str, list[str]] = {}
    for name in found:
        owner, _, own = name.rpartition(".")
        own_passes = layers.setdefault(owner, [])
        own_passes.insert(0, name) if own == "Combined" else own_passes.append(name)
    every = [*layers.values()]
    if not 0 <= layer < len(every) or not 0 <= number < len(every[layer]):
        return "the layer or pass that a node shows is not in the file; it is drawn magenta."
    return found[every[layer][number]]


def scaled(pixels: np.ndarray, width: int, height: int) -> np.ndarray:
    """(height, width, channels) float32 of an image (H, W, channels) that is at least as large: each pixel is the mean
    of what it covers, of the numbers as they are stored."""
    return _means(_means(pixels, width, 1), height, 0)


def _means(pixels: np.ndarray, count: int, axis: int) -> np.ndarray:
    """`count` means along an axis."""
    length = pixels.shape[axis]
    if count == length:
        return pixels
    edges = np.linspace(0.0, length, count + 1)
    whole = np.minimum(np.floor(edges).astype(int), length - 1)
    share = (edges - whole).reshape(-1, *(1 for _ in range(pixels.ndim - 1)))
    other = 1 - axis
    made = np.empty([count if k == axis else size for k, size in enumerate(pixels.shape)], np.float32)
    step = max(1, MOST_AT_ONCE // (length * pixels.shape[2]))
    for first in range(0, pixels.shape[other], step):
        part = np.moveaxis(pixels[(slice(None),) * other + (slice(first, first + step),)], axis, 0).astype(np.float64)
        sums = np.concatenate([np.zeros_like(part[:1]), np.cumsum(part, axis=0)])
        means = np.diff(sums[whole] + share * part[whole], axis=0) * (count / length)
        made[(slice(None),) * other + (slice(first, first + step),)] = np.moveaxis(means, 0, axis)
    return made


def to_scene_linear(pixels: np.ndarray, space: str) -> np.ndarray:
    """Colours (H, W, 4) of a colour space of Blender's configuration, scene-linear: a file of them is loaded so."""
    with tempfile.TemporaryDirectory(prefix="candela_") as folder:
        path = Path(folder) / "colors.exr"
        path.write_bytes(_exr_bytes(pixels[..., :3]))
        found = _by_data_block(str(path), space)
    if found is None or found.shape[:2] != pixels.shape[:2]:
        return pixels
    return np.concatenate([found[..., :3], pixels[..., 3:]], axis=2)


def _by_data_block(path: str, space: str) -> np.ndarray | None:
    try:
        image = bpy.data.images.load(path)
    except RuntimeError:
        return None
    try:
        image.colorspace_settings.name = space
        width, height = image.size
        count = len(image.pixels)
        if not width * height * count:
            return None
        flat = np.empty(count, np.float32)
        image.pixels.foreach_get(flat)
        return flat.reshape(height, width, -1)
    finally:
        bpy.data.images.remove(image)


def _exr_bytes(pixels: np.ndarray) -> bytes:
    """An uncompressed OpenEXR file of (H, W, 3) colours, bottom row first."""
    height, width = pixels.shape[:2]

    def attribute(name: str, kind: str, value: bytes) -> bytes:
        return name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<i", len(value)) + value

    channels = b"".join(name + b"\0" + struct.pack("<iB3xii", 2, 0, 1, 1) for name in (b"B", b"G", b"R")) + b"\0"
    box = struct.pack("<4i", 0, 0, width - 1, height - 1)
    head = struct.pack("<II", 20000630, 2) + b"".join((
        attribute("channels", "chlist", channels), attribute("compression", "compression", b"\0"),
        attribute("dataWindow", "box2i", box), attribute("displayWindow", "box2i", box),
        attribute("lineOrder", "lineOrder", b"\0"), attribute("pixelAspectRatio", "float", struct.pack("<f", 1.0)),
        attribute("screenWindowCenter", "v2f", struct.pack("<2f", 0, 0)),
        attribute("screenWindowWidth", "float", struct.pack("<f", 1.0)),
    )) + b"\0"  # fmt: skip
    line = 8 + 12 * width
    first = len(head) + 8 * height
    table = struct.pack(f"<{height}Q", *(first + line * k for k in range(height)))
    rows = np.ascontiguousarray(pixels[::-1, :, ::-1].transpose(0, 2, 1), np.float32)
    return head + table + b"".join(struct.pack("<ii", y, 12 * width) + rows[y].tobytes() for y in range(height))
