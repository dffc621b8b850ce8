"""Image data-blocks to float arrays.

Blender keeps 8-bit images as stored in the file, in the file's colour space and with straight alpha; all others as
float in scene-linear colours with alpha multiplied in. Both are handed on as they are, and `encoding` and
`alpha_mode` say which it is: 'PREMUL' where alpha is multiplied into the stored colours.
"""

from __future__ import annotations

import zlib
from pathlib import Path

import bpy
import numpy as np

from ..materials.sky import Sky, sky_pixels
from .cache import ImageEntry, SnapshotCache, next_version
from .scene import Image, Note

# Byte images in these colour spaces need no decoding; sRGB is decoded after filtering, as in Cycles.
_LINEAR_SPACES = ("Non-Color", "Raw", "Linear", "Linear Rec.709", "Generic Data", "Utility - Raw", "scene_linear")
MAGENTA = (1.0, 0.0, 1.0, 1.0)  # what Cycles shows for an image that is not there


class ImageTable:
    """Images of one sync: hand it `bpy.types.Image`s, get keys, and at the end `images` and `notes`."""

    def __init__(self, cache: SnapshotCache):
        self.images: dict[str, Image] = {}
        self.notes: list[Note] = []
        self.read = self.reused = 0
        self._cache = cache

    def key_of(self, image, user=None) -> str:
        """Image.key of a data-block, which is read at most once per sync.

        `user` (ImageUser) says which frame of a sequence is meant. It is not followed: Image.pixels knows no frames.
        """
        original = image.original or image
        key = f"image {original.session_uid}"
        if key in self.images:
            return key
        entry = self._cache.images.get(key)
        # A painted image that is not saved, and one that moves, changes without a trace: the pixels are compared.
        restless = original.is_dirty or original.source in ("SEQUENCE", "MOVIE")
        if entry is None or restless or entry.state != _state(original):
            entry = self._read(key, original, entry)
        else:
            self.reused += 1
        self._cache.images[key] = entry
        self.images[key] = entry.image
        self.notes.extend(entry.notes)
        return key

    def key_of_sky(self, sky: Sky) -> str:
        """Image.key of the table of a Sky Texture, which depends on its settings alone."""
        key = sky.name
        if key not in self.images:
            self.images[key] = Image(key, 0, sky_pixels(sky), "LINEAR", "NONE", "Sky")
        return key

    def _read(self, key: str, original, old: ImageEntry | None) -> ImageEntry:
        pixels, notes = _pixels(original)
        # The state is taken after reading: asking for pixels makes Blender load the file.
        state = _state(original)
        encoding, space_notes = _encoding(original)
        alpha = original.alpha_mode
        if alpha in ("STRAIGHT", "PREMUL") and original.colorspace_settings.is_data:
            alpha = "CHANNEL_PACKED"  # what is no colour is not covered by alpha
        elif alpha in ("STRAIGHT", "PREMUL"):
            alpha = "PREMUL" if original.is_float else "STRAIGHT"
        same = (
            old is not None
            and (old.image.encoding, old.image.alpha_mode) == (encoding, alpha)
            and np.array_equal(old.image.pixels, pixels)
        )
        if same:
            self.reused += 1
            return ImageEntry(old.image, state, (*notes, *space_notes))
        self.read += 1
        missing = pixels.shape == (1, 1, 4) and not len(original.pixels)
        made = Image(key, next_version(), pixels, encoding, alpha, original.name, missing)
        return ImageEntry(made, state, (*notes, *space_notes))


def _pixels(original) -> tuple[np.ndarray, tuple[Note, ...]]:
    """(H, W, 4) float32, bottom row first, and what is to be said about it."""
    subject, notes = f"Image '{original.name}'", ()
    if original.source == "TILED" and len(original.tiles) > 1:
        notes = (Note(subject, f"only the first UDIM tile of {len(original.tiles)} is drawn."),)
    moving = original.source in ("SEQUENCE", "MOVIE")
    if moving:
        notes = (Note(subject, "the image moves, but is drawn as the one frame that Blender has loaded."),)
    width, height = original.size  # makes Blender load the file
    count = len(original.pixels)
    if width == 0 or height == 0 or count == 0:
        text = "the image is missing or cannot be read and is drawn magenta; check its file path."
        if moving:
            text = "frames of image sequences and movies cannot be read and are drawn magenta; use a still image."
        return np.array([[MAGENTA]], np.float32), (Note(subject, text),)
    flat = np.empty(count, np.float32)
    original.pixels.foreach_get(flat)
    return _four_channels(flat.reshape(height, width, count // (width * height))), notes


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


def _encoding(original) -> tuple[str, tuple[Note, ...]]:
    space = original.colorspace_settings.name
    if original.is_float or original.colorspace_settings.is_data or space in _LINEAR_SPACES:
        return "LINEAR", ()
    if space == "sRGB":
        return "SRGB", ()
    text = f"colour space '{space}' is not supported for 8-bit images and is drawn as sRGB."
    return "SRGB", (Note(f"Image '{original.name}'", text),)


def _state(original) -> tuple:
    """Facts that change when the pixels of a saved or generated image do."""
    path = bpy.path.abspath(original.filepath_raw, library=original.library) if original.filepath_raw else ""
    try:
        file = Path(path).stat() if path and original.packed_file is None else None
    except OSError:
        file = None
    packed = original.packed_file
    return (
        original.source,
        path,
        (file.st_mtime_ns, file.st_size) if file else None,
        zlib.crc32(packed.data) if packed is not None else None,
        tuple(original.size),
        original.is_float,
        original.alpha_mode,
        original.colorspace_settings.name,
        (original.generated_type, tuple(original.generated_color)) if original.source == "GENERATED" else None,
    )
