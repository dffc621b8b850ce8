"""Principal components of a tile's pictures: few numbers for each place instead of one for each direction of light.

    F(x, y, light) = mu(x, y) + sum over k of U(x, y, k) c(k, light)

for each view of its own (local principal components, as Sattler et al. 2003), or for all views and lights at once
(the thesis in docs/grass.md). Data is encoded first: the root 2.2 of F / F_max, as luma and two differences of colour,
since of differences of linear light six components say little. Cutting components off in that space darkens what is
decoded; the ratio of true to decoded mean, kept for each picture, puts it back.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

GAMMA = 2.2
WHITE_PERCENTILE = 99.9  # F_max; what is brighter is cut off
LUMA = np.array([0.2126, 0.7152, 0.0722])


def encoded(light: np.ndarray, white: float) -> np.ndarray:
    """Linear (..., 3) in the space of the components: luma Y, B - Y, R - Y of the encoded picture."""
    rgb = np.clip(light / white, 0.0, 1.0) ** (1.0 / GAMMA)
    luma = rgb @ LUMA
    return np.stack([luma, rgb[..., 2] - luma, rgb[..., 0] - luma], axis=-1)


def decoded(values: np.ndarray, white: float) -> np.ndarray:
    """The inverse of `encoded`; what truncation made negative is 0."""
    luma, blue, red = (values[..., k] for k in range(3))
    r, b = luma + red, luma + blue
    g = (luma - LUMA[0] * r - LUMA[2] * b) / LUMA[1]
    return white * np.maximum(np.stack([r, g, b], axis=-1), 0.0) ** GAMMA


@dataclass(frozen=True)
class Components:
    """`mean` (P,) of P places, `parts` (P, K) within -1..1, and `weights` (K, I) for I pictures."""

    mean: np.ndarray
    parts: np.ndarray
    weights: np.ndarray

    def pictures(self) -> np.ndarray:
        """(P, I)."""
        return self.mean[:, None] + self.parts @ self.weights


def components(data: np.ndarray, count: int, weight: np.ndarray | float = 1.0) -> Components:
    """The first `count` principal components of pictures (P, I), through their Gram matrix (I, I); `weight` (I,): how
    much an error of each counts."""
    mean = data.mean(axis=1)
    off = (data - mean[:, None]) * weight
    values, vectors = np.linalg.eigh(off.T @ off)
    order = np.argsort(values)[::-1][: min(count, off.shape[1])]
    sizes, vectors = np.sqrt(np.maximum(values[order], 0.0)), vectors[:, order]
    parts = off @ vectors / np.where(sizes > 0.0, sizes, 1.0)
    weights = sizes[:, None] * vectors.T / weight
    most = np.maximum(np.abs(parts).max(axis=0), 1e-12)
    return Components(mean, parts / most, weights * most[:, None])


def white_of(light: np.ndarray) -> float:
    """F_max of linear pictures."""
    return max(float(np.percentile(light, WHITE_PERCENTILE)), 1e-6)


def mean_ratio(true: np.ndarray, found: np.ndarray) -> np.ndarray:
    """(I, 3): what pictures found (P, I, 3) are multiplied by to have the mean of the true ones."""
    return true.mean(axis=0) / np.maximum(found.mean(axis=0), 1e-8)


def errors(true: np.ndarray, found: np.ndarray) -> dict[str, float]:
    """Of decoded pictures (P, I, 3): root mean square over the mean, of all three channels and of luminance, and what
    remains of each picture's contrast (mean standard deviation of luminance over that of the true ones)."""
    luma_true, luma_found = true @ LUMA, found @ LUMA
    mean = luma_true.mean()
    return {
        "rgb": float(np.sqrt(((true - found) ** 2).mean()) / true.mean()),
        "luma": float(np.sqrt(((luma_true - luma_found) ** 2).mean()) / mean),
        "contrast": float(luma_found.std(axis=0).mean() / luma_true.std(axis=0).mean()),
    }


def compressed(
    light: np.ndarray, luma: int, chroma: int, white: float | None = None, weighted: bool = False
) -> np.ndarray:
    """Pictures (P, I, 3) after compression to these numbers of components, decoded, with their true means. `weighted`:
    errors count by the mean luma of their picture, about as much as they are worth once decoded."""
    white = white_of(light) if white is None else white
    data = encoded(light, white)
    weight = data[..., 0].mean(axis=0) if weighted else 1.0
    parts = [components(data[..., k], luma if k == 0 else chroma, weight).pictures() for k in range(3)]
    found = decoded(np.stack(parts, axis=-1), white)
    return found * mean_ratio(light, found)
