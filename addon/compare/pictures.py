"""Pictures of differences and errors: false colours, and two pictures side by side. numpy only.

All take and give (H, W, C) float32, bottom row first. What is meant to be read as a colour scale comes out linear, so
that a display with the standard view shows exactly the colours of the scale.
"""

from __future__ import annotations

import numpy as np

from .metrics import LUMINANCE, display, relative_squared_error

# Dark blue to pale yellow, of even steps in lightness, as sRGB in 0..255: in grey it reads as dark to light.
SCALE = ((0, 7, 40), (38, 30, 115), (110, 38, 128), (178, 55, 110), (230, 94, 72), (250, 160, 60), (252, 240, 170))
ERROR_RANGE = (1e-5, 1e1)  # relative squared error of a pixel at the ends of the scale


def difference(x: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """|x - reference| per channel, linear."""
    x, reference = fitted(x, reference)
    return np.abs(np.nan_to_num(x[..., :3]) - np.nan_to_num(reference[..., :3])).astype(np.float32)


def error_map(x: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """relMSE's summand per pixel on a logarithmic colour scale over ERROR_RANGE."""
    x, reference = fitted(x, reference)
    # Values that a square cannot hold are as wrong as can be shown anyway.
    x, r = (np.clip(np.nan_to_num(image[..., :3].astype(np.float64)), -1e30, 1e30) for image in (x, reference))
    squared = relative_squared_error(x, r)
    low, high = np.log10(ERROR_RANGE)
    return colors((np.log10(np.maximum(squared, 1e-30)) - low) / (high - low))


def false_color(image: np.ndarray, lowest_stop: float, highest_stop: float) -> np.ndarray:
    """Luminance in stops (powers of two of scene-linear light) on the colour scale."""
    luminance = np.nan_to_num(image[..., :3].astype(np.float64)) @ LUMINANCE if image.shape[-1] >= 3 else image[..., 0]
    stops = np.log2(np.maximum(luminance, 1e-30))
    return colors((stops - lowest_stop) / max(highest_stop - lowest_stop, 1e-6))


def split_view(left: np.ndarray, right: np.ndarray, share: float) -> np.ndarray:
    """`left` up to `share` of the width, then `right`; a light line between them."""
    left, right = fitted(left, right)
    width = left.shape[1]
    edge = int(np.clip(round(share * width), 0, width))
    out = right[..., :3].copy()
    out[:, :edge] = left[:, :edge, :3]
    if 0 < edge < width:
        out[:, edge] = 1.0
    return out


def colors(share: np.ndarray) -> np.ndarray:
    """(H, W) on 0..1 to the scale's colours, (H, W, 3) linear float32; beyond its ends the end's colour."""
    at = np.linspace(0.0, 1.0, len(SCALE))
    encoded = np.stack([np.interp(share, at, [color[k] / 255 for color in SCALE]) for k in range(3)], axis=-1)
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4).astype(np.float32)


def fitted(x: np.ndarray, other: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Both with three channels and of the size of both: where one is larger, only its lower left part is taken."""
    height, width = min(x.shape[0], other.shape[0]), min(x.shape[1], other.shape[1])
    three = lambda image: np.repeat(image, 3, axis=-1) if image.shape[-1] < 3 else image  # noqa: E731
    return three(x)[:height, :width], three(other)[:height, :width]


def thumbnail(image: np.ndarray, longest: int = 128) -> np.ndarray:
    """A small picture for the interface, (h, w, 4) in 0..1 as a display shows it."""
    step = max(-(-max(image.shape[:2]) // longest), 1)
    small = fitted(image, image)[0][::step, ::step]
    out = np.ones((*small.shape[:2], 4), np.float32)
    out[..., :3] = display(small)
    return out
