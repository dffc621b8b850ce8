"""`render --show NAME`: an image by which a picture is made, in the place of the picture."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np

from .. import engine
from ..compare.exr_write import write_exr
from ..compare.png import png
from ..gfx import images
from .refused import USAGE, Refused


def write_intermediate(scene: bpy.types.Scene, name: str, path: Path) -> str:
    """Write an image of the frame that was just rendered, as it stands after the last sample: sums as sums.

    EXR holds its numbers. PNG shows three channels between the lowest and the highest of them. Returns a line that says
    what they are. Raises Refused with the names that there are.
    """
    frame = engine.session(scene, "final").renderer.frame
    if name not in frame.images:
        known = ", ".join(sorted(one for one, image in frame.images.items() if "DEPTH" not in image.format))
        raise Refused(f"The picture has no image {name}; it has {known}.", USAGE)
    image = frame.images[name]
    if "DEPTH" in image.format:
        raise Refused(f"{name} is a depth buffer, which Blender cannot read back; film.depth shows distances.", USAGE)
    pixels = images.read(image).astype(np.float32)
    if path.suffix.lower() == ".exr":
        write_exr(path, {name: pixels}, {"candela_image": name})
    else:
        path.write_bytes(png(_shown(pixels)))
    ranges = "; ".join(f"{low:g} to {high:g}" for low, high in _ranges(pixels))
    return f"{name}: {image.format}, channels from {ranges}"


def _ranges(pixels: np.ndarray) -> list[tuple[float, float]]:
    finite = np.where(np.isfinite(pixels), pixels, 0.0)
    return [(float(channel.min()), float(channel.max())) for channel in np.moveaxis(finite, -1, 0)]


def _shown(pixels: np.ndarray) -> np.ndarray:
    """(H, W, 3) uint8, top row first, of (H, W, C)."""
    finite = np.where(np.isfinite(pixels), pixels, 0.0)[::-1, :, :3]
    missing = 3 - finite.shape[2]
    three = np.pad(finite, ((0, 0), (0, 0), (0, missing)), mode="edge" if missing == 2 else "constant")
    low, high = min(float(three.min()), 0.0), float(three.max())
    return (255.0 * (three - low) / max(high - low, 1e-30) + 0.5).astype(np.uint8)
