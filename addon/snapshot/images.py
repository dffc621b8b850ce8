"""Image data-blocks to float arrays.

Blender keeps 8-bit images as stored in the file, in the file's colour space and with straight alpha; all others as
float in scene-linear colours with alpha multiplied in. Both are handed on as they are, and `encoding` and
`alpha_mode` say which it is: 'PREMUL' where alpha is multiplied into the stored colours. 8-bit images in colour spaces
that no shader decodes are converted here.
"""

from __future__ import annotations

import io
import time
import zlib
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np

from ..materials import working_space
from ..materials.atlas import WIDEST, layout, packed
from ..materials.estimate import srgb_decode
from ..materials.ies import Profile, profile_pixels
from ..materials.sky import Sky, working_sky_pixels
from .cache import ImageEntry, SnapshotCache, next_version
from .image_files import (
    frame_of,
    read_file,
    read_layer,
    scaled,
    sequence_path,
    shape_of_bytes,
    tile_path,
    to_scene_linear,
    turn_movie,
)
from .scene import Image, Note

# Byte images in these colour spaces need no decoding; sRGB is decoded after filtering, as in Cycles.
_LINEAR_SPACES = ("Non-Color", "Raw", "Linear", "Linear Rec.709", "Generic Data", "Utility - Raw", "scene_linear")
PROFILES_FADE = bpy.app.version < (5, 0)  # see materials/ies.py
# Cycles before Blender 5.1: bytes have straight alpha and floats premultiplied alpha, whatever their alpha mode says.
BYTES_ARE_STRAIGHT = FLOATS_ARE_PREMULTIPLIED = bpy.app.version < (5, 1)
LOOK_S = 5e-8  # between two looks at a file that is newer than its pixels, per number: some ten times what one takes
STAND_IN = 8  # pixels a side of what stands in for an image; they vary
MAGENTA = (1.0, 0.0, 1.0, 1.0)  # what Cycles shows for an image that is not there


class ImageTable:
    """Images of one sync: hand it `bpy.types.Image`s, get keys, and at the end `images` and `notes`."""

    def __init__(self, cache: SnapshotCache, frame: int = 1):
        """`frame`: of the scene, which says what a sequence shows."""
        self.images: dict[str, Image] = {}
        self.notes: list[Note] = []
        self.read = self.reused = 0
        self._cache, self._frame = cache, frame
        self._with_alpha: set[int] | None = None  # session_uids of images whose alpha is read; asked for stand-ins only

    def key_of(self, image, user=None) -> str:
        """Image.key of a data-block, which is read at most once per sync.

        `user` (ImageUser) says which frame of a sequence is meant, and which pass of a multilayer file.
        """
        original = image.original or image
        if self._cache.stands_in and (shape := byte_shape(original)):
            return self._stand_in(whole_key(original.session_uid), original, shape)
        dropped = not original.has_data  # as by Reload: asking for anything then loads the file
        part = _part(original, user, self._frame)
        key = whole_key(original.session_uid) + (f" {part}" if part else "")
        if key in self.images:
            return key
        entry = self._cache.images.get(key)
        # A painted image that is not saved changes without a trace: the pixels are compared.
        loaded = dropped and part is None
        if entry is None or loaded or original.is_dirty or _is_stale(entry, _state(original, part)):
            entry = self._read(key, original, part, entry, loaded)
        else:
            self.reused += 1
        self._cache.images[key] = entry
        self.images[key] = entry.image
        self.notes.extend(entry.notes)
        return key

    def key_of_sky(self, sky: Sky) -> str:
        """Image.key of the table of a Sky Texture, which depends on its settings alone."""
        space = working_space.current()
        key = sky.name if space.usual else f"{sky.name} {space.name}"
        if key not in self.images:
            self.images[key] = Image(key, 0, working_sky_pixels(sky), "LINEAR", "NONE", "Sky")
        return key

    def key_of_profile(self, profile: Profile, label: str) -> str:
        """Image.key of the table of an IES Texture, which depends on the file's text alone."""
        key = profile.name
        pixels, remark = profile_pixels(profile, PROFILES_FADE)
        if remark:
            self.notes.append(Note(f"Node '{label}'", remark))
        if key not in self.images:
            self.images[key] = Image(key, 0, pixels, "LINEAR", "NONE", "IES")
        return key

    def _stand_in(self, key: str, original, shape: tuple[int, int, int]) -> str:
        """Opaque, unless the file has alpha and some node's Alpha is linked, which is seldom done for one that is 1."""
        pixels = np.ones((STAND_IN, STAND_IN, 4), np.float32)
        pixels[::2, :, :3] = 0.25
        if self._with_alpha is None:
            self._with_alpha = _with_alpha()
        if shape[2] in (2, 4) and original.session_uid in self._with_alpha:
            pixels[::2, :, 3] = 0.25
        shown, encoding, alpha, bits = _as_shown(original, None, pixels, False, False)
        self.images[key] = Image(
            key, next_version(), shown, encoding, alpha, original.name, bits=bits, stands_for=shape[:2]
        )
        return key

    def _read(self, key: str, original, part: Part, old: ImageEntry | None, loaded: bool) -> ImageEntry:
        """`loaded`: Blender has just read the file."""
        pixels, tiles, missing, notes = _pixels(original, part)
        # The state is taken after reading: asking for pixels makes Blender load the file.
        state = _state(original, part)
        pixels, encoding, alpha, bits = _as_shown(original, part, pixels, missing, original.is_float)
        same = (
            old is not None
            and (old.image.encoding, old.image.alpha_mode, old.image.tiles, old.image.bits)
            == (encoding, alpha, tiles, bits)
            and np.array_equal(old.image.pixels, pixels)
        )
        if same:
            self.reused += 1
            if part is None and not loaded and state[1:] == old.state[1:] and state != old.state:
                # Of a new file Blender may still hold the old pixels: it is looked at again, large ones now and then.
                return ImageEntry(old.image, old.state, notes, time.monotonic() + pixels.size * LOOK_S)
            return ImageEntry(old.image, state, notes)
        self.read += 1
        made = Image(key, next_version(), pixels, encoding, alpha, original.name, missing, tiles, bits)
        return ImageEntry(made, state, notes)


def _as_shown(original, part: Part, pixels: np.ndarray, missing: bool, is_float: bool) -> tuple:
    """Pixels, encoding, alpha mode and bits of an Image; `is_float`: of what Blender holds of the file."""
    encoding = "LINEAR" if isinstance(part, Layer) else _encoding(original, is_float)
    turned = not missing and not isinstance(part, Layer) and _is_rec709(original, is_float)
    is_float = is_float or isinstance(part, Layer)
    alpha = original.alpha_mode
    if alpha in ("STRAIGHT", "PREMUL") and original.colorspace_settings.is_data:
        alpha = "CHANNEL_PACKED"  # what is no colour is not covered by alpha
    elif alpha in ("STRAIGHT", "PREMUL"):
        kept = original.source != "GENERATED" and not BYTES_ARE_STRAIGHT
        alpha = "PREMUL" if is_float else alpha if kept else "STRAIGHT"
    if turned:
        pixels, encoding = _turned(pixels, encoding), "LINEAR"
    if encoding == "" and not missing:
        turned = True
        pixels, encoding = to_scene_linear(pixels, original.colorspace_settings.name), "LINEAR"
    as_stored = not is_float and not turned
    return pixels, encoding, alpha, 8 if as_stored else 32 if original.colorspace_settings.is_data else 16


def byte_shape(original) -> tuple[int, int, int] | None:
    """Width, height and channels of an image of bytes in one piece, as far as they are known without loading it."""
    if original.type != "IMAGE" or original.source not in ("FILE", "GENERATED"):
        return None
    if original.has_data:
        return None if original.is_float else (*original.size, original.channels)
    packed = original.packed_file
    try:
        if packed is not None:
            return shape_of_bytes(io.BytesIO(packed.data))
        path = Path(_path(original))
        if not path.is_file():  # to open a pipe would wait
            return None
        with path.open("rb") as file:
            return shape_of_bytes(file)
    except OSError:
        return None


def _with_alpha() -> set[int]:
    """session_uids of images whose alpha some node tree reads."""
    owners = (*bpy.data.materials, *bpy.data.worlds, *bpy.data.lights)
    trees = (*bpy.data.node_groups, *(owner.node_tree for owner in owners if owner.node_tree is not None))
    return {
        node.image.session_uid for tree in trees for node in tree.nodes
        if node.bl_idname == "ShaderNodeTexImage" and node.image is not None and node.outputs["Alpha"].is_linked
    }  # fmt: skip


def _is_stale(entry: ImageEntry, state: tuple) -> bool:
    if entry.state == state:
        return False
    return entry.state[1:] != state[1:] or time.monotonic() >= entry.again


def whole_key(uid: int) -> str:
    """Image.key of a data-block of which no ImageUser picks a frame or pass."""
    return f"image {uid}"


@dataclass(frozen=True)
class OfSequence:
    """A frame of an image sequence or of a movie."""

    frame: int

    def __str__(self) -> str:
        return f"frame {self.frame}"


@dataclass(frozen=True)
class Layer:
    """A pass of a multilayer file."""

    layer: int
    number: int

    def __str__(self) -> str:
        return f"layer {self.layer} pass {self.number}"


Part = OfSequence | Layer | None


def _part(original, user, frame: int) -> Part:
    _ = original.size[0]  # makes Blender load the file, and find out what it holds
    if original.source in ("SEQUENCE", "MOVIE"):
        return OfSequence(frame_of(user, frame) if user is not None else 1)
    if original.type == "MULTILAYER":
        return Layer(getattr(user, "multilayer_layer", 0), getattr(user, "multilayer_pass", 0))
    return None


def _path(original) -> str:
    return bpy.path.abspath(original.filepath_raw, library=original.library) if original.filepath_raw else ""


def _pixels(original, part: Part) -> tuple[np.ndarray, tuple, bool, tuple[Note, ...]]:
    """(H, W, 4) float32, bottom row first; where its tiles stand (Image.tiles); whether it is missing; and what is
    to be said about it."""
    subject = f"Image '{original.name}'"
    space, tiles = original.colorspace_settings.name, ()
    text = "the image is missing or cannot be read and is drawn magenta; check its file path."
    found, notes = None, ()
    if original.source == "MOVIE":
        found = _own_pixels(original) if turn_movie(original, part.frame) else None
        text = (
            f"frame {part.frame} of the movie cannot be read and is drawn magenta; check its file path and its codec."
        )
    elif isinstance(part, OfSequence):
        found = read_file(sequence_path(_path(original), part.frame), space)
        text = f"frame {part.frame} of the sequence is missing and is drawn magenta; check its file path."
    elif isinstance(part, Layer):
        found = read_layer(_path(original), part.layer, part.number)
        if isinstance(found, str):
            found, text = None, found
    elif original.source == "TILED" and len(original.tiles) > 1:
        numbers = [tile.number for tile in original.tiles]
        parts = [(number, _tile(original, number, space)) for number in numbers]
        parts = [(number, _four_channels(pixels)) for number, pixels in parts if pixels is not None]
        if parts:
            parts, notes = _tiles_that_fit(parts, subject)
            corners, _ = layout([(pixels.shape[1], pixels.shape[0]) for _, pixels in parts])
            tiles = tuple(
                (number, *corner, pixels.shape[1], pixels.shape[0]) for (number, pixels), corner in zip(parts, corners)
            )
            found = packed([pixels for _, pixels in parts])
    else:
        # The file has what is meant: of premultiplied bytes, which Blender divides by alpha, and, where Cycles takes
        # all floats as premultiplied, of straight floats, which Blender multiplies.
        mode = "STRAIGHT" if original.is_float and FLOATS_ARE_PREMULTIPLIED else "PREMUL"
        by_file = not original.is_float or FLOATS_ARE_PREMULTIPLIED
        if by_file and original.alpha_mode == mode and original.packed_file is None and not original.is_dirty:
            found = read_file(_path(original), space)
        found = _own_pixels(original) if found is None else found
    if found is None or not found.size:
        return np.array([[MAGENTA]], np.float32), (), True, (Note(subject, text),)
    height, width = found.shape[:2]
    if max(width, height) > WIDEST:
        size = min(width, WIDEST), min(height, WIDEST)
        limit, made = f"{width} x {height} pixels are more than GPUs take, {WIDEST} a side", f"{size[0]} x {size[1]}"
        text = f"its {limit}; it is scaled to {made}."
        found, notes = scaled(found, *size), (Note(subject, text),)
    return _four_channels(found), tiles, False, notes


def _tiles_that_fit(parts: list[tuple[int, np.ndarray]], subject: str) -> tuple[list, tuple[Note, ...]]:
    """Tiles (number, pixels) that fit into one image of WIDEST pixels a side, and what is to be said of that."""
    halvings, sizes = 0, [pixels.shape[1::-1] for _, pixels in parts]
    while max(layout(sizes)[1]) > WIDEST:
        halvings += 1
        sizes = [(max(width // 2, 1), max(height // 2, 1)) for width, height in sizes]
    if not halvings:
        return parts, ()
    parts = [(number, scaled(pixels, *size)) for (number, pixels), size in zip(parts, sizes, strict=True)]
    text = (
        f"its tiles are more than GPUs take in one image; they are scaled to 1/{2**halvings} of their width and height."
    )
    return parts, (Note(subject, text),)


def _tile(original, number: int, space: str) -> np.ndarray | None:
    if number == original.tiles[0].number and original.source == "TILED":
        own = _own_pixels(original)  # with what was painted on it
        if own is not None:
            return own
    return read_file(tile_path(_path(original), number), space)


def _own_pixels(original) -> np.ndarray | None:
    width, height = original.size  # makes Blender load the file
    count = len(original.pixels)
    if width == 0 or height == 0 or count == 0:
        return None
    flat = np.empty(count, np.float32)
    original.pixels.foreach_get(flat)
    return flat.reshape(height, width, count // (width * height))


def _four_channels(pixels: np.ndarray) -> np.ndarray:
    """Grey and RGB made RGBA with alpha 1; two channels are grey and alpha."""
    channels = pixels.shape[2]
    if channels == 4:
        return pixels
    full = np.ones((*pixels.shape[:2], 4), np.float32)
    full[..., :3] = pixels[..., :3] if channels == 3 else pixels[..., :1]
    if channels == 2:
        full[..., 3] = pixels[..., 1]
    return full


def _encoding(original, is_float: bool) -> str:
    """LINEAR, SRGB, or nothing where colours have to be converted before they are filtered, as in Cycles."""
    space = original.colorspace_settings.name
    if is_float or original.colorspace_settings.is_data or space in _LINEAR_SPACES:
        return "LINEAR"
    return "SRGB" if space == "sRGB" else ""


def _is_rec709(original, is_float: bool) -> bool:
    """Whether the pixels are colours of Rec. 709 while others are wanted. Floats are what Blender made of them."""
    space = original.colorspace_settings.name
    colours = not is_float and not original.colorspace_settings.is_data
    return colours and not working_space.current().usual and space in ("sRGB", "Linear", "Linear Rec.709")


def _turned(pixels: np.ndarray, encoding: str) -> np.ndarray:
    """Colours of Rec. 709, stored in that way, in the working space."""
    colors = srgb_decode(pixels[..., :3]) if encoding == "SRGB" else pixels[..., :3]
    turned = colors @ working_space.current().from_rec709.T
    return np.concatenate([turned, pixels[..., 3:]], axis=2).astype(np.float32)


def _state(original, part: Part) -> tuple:
    """Facts that change when the pixels of a saved or generated image do; first those of its files."""
    path = _path(original)
    paths = [path] if path and original.packed_file is None else []
    if isinstance(part, OfSequence) and original.source == "SEQUENCE":
        paths = [sequence_path(path, part.frame)]
    elif original.source == "TILED" and path:
        paths = [tile_path(path, tile.number) for tile in original.tiles]
    packed = original.packed_file
    return (
        (path, *(_file_state(one) for one in paths)),
        original.source,
        original.is_dirty,
        zlib.crc32(packed.data) if packed is not None else None,
        tuple(original.size),
        tuple(tile.number for tile in original.tiles) if original.source == "TILED" else (),
        original.is_float,
        original.alpha_mode,
        original.colorspace_settings.name,
        working_space.current().name,
        (original.generated_type, tuple(original.generated_color)) if original.source == "GENERATED" else None,
    )


def _file_state(path: str) -> tuple[int, int] | None:
    try:
        found = Path(path).stat()
    except OSError:
        return None
    return found.st_mtime_ns, found.st_size
