"""How far a picture is from its reference: relMSE, bias, FLIP and surface-data error, per light path.

Order of checks: shape, then every pixel finite, then no negative radiance, and only then the metrics. A mean hides
one infinite pixel in sixty thousand, and a threshold on a NaN is never crossed; so both are counted and said first.

relMSE = mean over pixels of |x - r|^2 / (r_lum^2 + (0.1 mean r_lum)^2), channels averaged; r_lum is the luminance of
the reference pixel (Rec. 709). The second term is what the eye forgives in the dark: a tenth of the mean luminance.
It is given untrimmed and with the worst 0.1 % of pixels dropped (a few fireflies in the reference are not an error).

The noise floor is the relMSE of the reference itself: half the difference of two seeds has the same variance as the
error of their mean. An error below the floor cannot be told from the reference's noise and is reported as "<= floor".
"""

from __future__ import annotations

import functools
import importlib.util
import subprocess
import sys
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

LUMINANCE = np.array([0.2126, 0.7152, 0.0722])  # Rec. 709, of linear RGB
DARK_FRACTION = 0.1  # of the mean luminance: below it, errors count as absolute
WORST_PIXELS = 0.001  # share of pixels that the trimmed figure drops
FLIP_SECONDS = 120  # per picture; a 4K picture takes about ten seconds
EMPTY_DEPTH = 1e9  # Blender writes 1e10 where no surface is
BLACK = 1e-9  # mean radiance below this is black: a 100 W lamp a thousand kilometres away


@dataclass(frozen=True)
class PathError:
    """Error of one picture against its reference. `nan` in a figure means: not defined here, `remark` says why."""

    name: str
    relmse: float = float("nan")
    relmse_trimmed: float = float("nan")
    bias: float = float("nan")  # mean(x) / mean(r), 1 is none
    flip: float | None = None  # mean FLIP at a fixed exposure, 0..1; None when it was not evaluated
    floor: float = 0.0  # relMSE of the reference's own noise
    bias_floor: float = 0.0  # relative uncertainty of the reference's mean
    median: float = float("nan")  # surface data: relative error at half and at 95 % of the pixels
    percentile_95: float = float("nan")
    negative: int = 0  # pixels of x below zero
    not_finite: int = 0
    remark: str = ""

    @property
    def below_floor(self) -> bool:
        """True when the error cannot be told from the reference's noise."""
        return bool(self.floor > 0 and self.relmse <= self.floor)

    @property
    def reported_relmse(self) -> float:
        """relMSE as it may be quoted: never below what the reference resolves."""
        return max(self.relmse, self.floor) if np.isfinite(self.relmse) else self.relmse


def compare_radiance(
    name: str,
    x: np.ndarray | None,
    reference: np.ndarray | None,
    half_difference: np.ndarray | None = None,
) -> PathError:
    """Compare two linear pictures (H, W, C >= 3); only the first three channels count.

    `half_difference` is half the difference of the reference's two seeds, of the same shape.
    """
    refused = _refuse(name, x, reference)
    if refused:
        return refused
    x, r = _rgb(x), _rgb(reference)
    negative = int(np.count_nonzero((x < 0).any(axis=-1)))
    remark = f"{_pixels(negative)} of negative radiance" if negative else ""
    floor = bias_floor = 0.0
    x_mean, r_mean = float(x.mean()), float(r.mean())
    if half_difference is not None and np.isfinite(half_difference).all():
        half = _rgb(half_difference)
        floor = float(relative_squared_error(r + half, r).mean())
        bias_floor = abs(float(half.mean())) / r_mean if r_mean > BLACK else 0.0

    if r_mean <= BLACK:
        if np.abs(x).max(initial=0) <= BLACK:
            return PathError(name, 0.0, 0.0, 1.0, flip=0.0, remark="both black")
        said = f"the reference is black, this picture is not (mean {x_mean:.3g})"
        return PathError(
            name, float("inf"), float("inf"), negative=negative, remark="; ".join(filter(None, (said, remark)))
        )

    squared = relative_squared_error(x, r)
    return PathError(
        name,
        relmse=float(squared.mean()),
        relmse_trimmed=trimmed_mean(squared),
        bias=x_mean / r_mean,
        floor=floor,
        bias_floor=bias_floor,
        negative=negative,
        remark=remark,
    )


def compare_depth(name: str, x: np.ndarray | None, reference: np.ndarray | None) -> PathError:
    """Depth (H, W, 1): relative error |x - r| / r where both see a surface; the remark counts where only one does."""
    refused = _refuse(name, x, reference)
    if refused:
        return refused
    x, r = x[..., 0].astype(np.float64), reference[..., 0].astype(np.float64)
    x_hit, r_hit = x < EMPTY_DEPTH, r < EMPTY_DEPTH
    both = x_hit & r_hit
    error = np.abs(x - r)[both] / np.maximum(np.abs(r)[both], 1e-12)
    return _surface_error(name, error, int(np.count_nonzero(x_hit != r_hit)))


def compare_normal(name: str, x: np.ndarray | None, reference: np.ndarray | None) -> PathError:
    """Normals (H, W, 3): |x - r| where both hold one. They are averages over a pixel, not of unit length."""
    refused = _refuse(name, x, reference)
    if refused:
        return refused
    x, r = _rgb(x), _rgb(reference)
    x_hit, r_hit = (np.linalg.norm(n, axis=-1) > 1e-6 for n in (x, r))
    both = x_hit & r_hit
    error = np.linalg.norm(x - r, axis=-1)[both]
    return _surface_error(name, error, int(np.count_nonzero(x_hit != r_hit)))


def relative_squared_error(x: np.ndarray, r: np.ndarray) -> np.ndarray:
    """The summand of relMSE per pixel, (H, W) float64. The reference must not be black throughout."""
    luminance = r @ LUMINANCE
    dark = DARK_FRACTION * abs(luminance.mean())
    return ((x - r) ** 2).mean(axis=-1) / (luminance**2 + max(dark, BLACK) ** 2)


def trimmed_mean(values: np.ndarray, share: float = WORST_PIXELS) -> float:
    """Mean without the largest `share` of the values (rounded up, so that small pictures lose one pixel)."""
    drop = int(np.ceil(values.size * share))
    keep = values.size - drop
    return float(np.partition(values.ravel(), keep - 1)[:keep].mean()) if keep > 0 else float(values.mean())


# FLIP ----------------------------------------------------------------------------------------------------------------

# Runs in its own process: flip_evaluator's C code calls exit() on input it dislikes.
_FLIP_PROGRAM = """
import sys
import flip_evaluator, numpy
pairs = numpy.load(sys.argv[1])
for name in sorted({key[1:] for key in pairs}):
    _, mean, _ = flip_evaluator.evaluate(pairs["r" + name], pairs["x" + name], "LDR", inputsRGB=True, applyMagma=False)
    print("FLIP", name, float(mean), flush=True)
"""


@functools.cache
def flip_installed() -> bool:
    """True when the PyPI package flip-evaluator can be imported by this Python."""
    return importlib.util.find_spec("flip_evaluator") is not None


def flips(pairs: list[tuple[np.ndarray, np.ndarray]]) -> list[float | None]:
    """Mean FLIP of each pair (picture, reference), both linear, (H, W, >= 3), finite and of one size; 0 is equal.

    Taken at exposure 0 on an sRGB display. The exposure is fixed, so that figures of different techniques and days
    compare. None where it cannot be had: the package is missing, or it gave up.
    Source: Andersson et al., "FLIP: A Difference Evaluator for Alternating Images", 2020.
    """
    found: list[float | None] = [None] * len(pairs)
    if not flip_installed() or not pairs:
        return found
    with tempfile.TemporaryDirectory(prefix="candela_flip_") as folder:
        path = Path(folder) / "pairs.npz"
        arrays = {}
        for number, (x, reference) in enumerate(pairs):
            arrays[f"x{number}"], arrays[f"r{number}"] = display(x), display(reference)
        np.savez(path, **arrays)
        command = [sys.executable, "-I", "-c", _FLIP_PROGRAM, str(path)]  # -I: imports nothing from the working folder
        try:
            done = subprocess.run(
                command, capture_output=True, text=True, timeout=FLIP_SECONDS * len(pairs), check=False
            )
        except (OSError, subprocess.TimeoutExpired):
            return found
    for line in done.stdout.splitlines():
        words = line.split()
        if len(words) == 3 and words[0] == "FLIP":
            found[int(words[1])] = float(words[2])
    return found


def with_flip(errors: list[PathError], pictures: list[tuple[np.ndarray | None, np.ndarray | None]]) -> list[PathError]:
    """The errors with FLIP added to every radiance row whose pictures can be compared, in one process for all."""
    chosen = [
        i
        for i, error in enumerate(errors)
        if np.isfinite(error.relmse) and error.flip is None and not is_surface(error)
    ]
    values = flips([pictures[i] for i in chosen])
    result = list(errors)
    for i, value in zip(chosen, values, strict=True):
        result[i] = replace(errors[i], flip=value)
    return result


def display(linear: np.ndarray, exposure: float = 0.0) -> np.ndarray:
    """Linear radiance -> sRGB-encoded float32 in [0, 1]: 2^exposure, the piecewise sRGB curve, clipped per channel."""
    value = np.clip(np.nan_to_num(linear[..., :3]) * 2.0**exposure, 0.0, 1.0)
    return np.where(value <= 0.0031308, 12.92 * value, 1.055 * np.power(value, 1 / 2.4) - 0.055).astype(np.float32)


# Checks --------------------------------------------------------------------------------------------------------------


def _refuse(name: str, x: np.ndarray | None, reference: np.ndarray | None) -> PathError | None:
    """The checks that come before any metric; a PathError that says what is wrong, or None."""
    if reference is None or x is None:
        return PathError(name, remark="missing in the reference" if reference is None else "missing in this picture")
    if x.shape[:2] != reference.shape[:2]:
        sizes = " against ".join(f"{image.shape[1]}x{image.shape[0]}" for image in (x, reference))
        return PathError(name, remark=f"sizes differ: {sizes}")
    bad = int(np.count_nonzero(~np.isfinite(x).all(axis=-1)))
    if bad:
        return PathError(name, float("inf"), float("inf"), not_finite=bad, remark=f"{_pixels(bad)} not finite")
    bad = int(np.count_nonzero(~np.isfinite(reference).all(axis=-1)))
    if bad:
        return PathError(name, remark=f"the reference has {_pixels(bad)} not finite")
    return None


def _surface_error(name: str, error: np.ndarray, alone: int) -> PathError:
    remark = f"{_pixels(alone)} with a surface in only one of the two" if alone else ""
    if error.size == 0:
        return PathError(
            name,
            median=0.0 if not alone else float("nan"),
            percentile_95=0.0 if not alone else float("nan"),
            remark=remark or "no surface in view",
        )
    return PathError(name, median=float(np.median(error)), percentile_95=float(np.percentile(error, 95)), remark=remark)


def _rgb(image: np.ndarray) -> np.ndarray:
    return image[..., :3].astype(np.float64)


def _pixels(count: int) -> str:
    return f"{count} pixel" if count == 1 else f"{count} pixels"


# Table ---------------------------------------------------------------------------------------------------------------


def table(errors: list[PathError] | tuple[PathError, ...]) -> str:
    """The errors as lines for a terminal. Radiance rows first; rows of surface data have their own two columns."""
    head = ("path", "relMSE", "trimmed", "floor", "bias", "FLIP", "remark")
    rows = [head]
    surface = [("surface", "median", "95 %", "", "", "", "remark")]
    for error in errors:
        if is_surface(error):
            percentiles = (_number(value, ".2e") for value in (error.median, error.percentile_95))
            surface.append((error.name, *percentiles, "", "", "", error.remark))
        else:
            rows.append((error.name, *figures(error), error.remark))
    if len(surface) > 1:
        rows += surface
    widths = [max(len(row[i]) for row in rows) for i in range(len(head) - 1)]
    lines = []
    for row in rows:
        cells = [
            row[0].ljust(widths[0]),
            *(cell.rjust(width) for cell, width in zip(row[1:-1], widths[1:], strict=True)),
        ]
        lines.append("  ".join([*cells, row[-1]]).rstrip())
    return "\n".join(lines)


def figures(error: PathError) -> tuple[str, str, str, str, str]:
    """relMSE, trimmed, floor, bias, FLIP of a radiance row as text; the report's table shows the same."""
    relmse = f"≤ {error.floor:.2e}" if error.below_floor else _number(error.relmse, ".2e")
    if np.isnan(error.relmse):
        return ("–",) * 5
    if error.flip is None:
        flip_text = "–" if flip_installed() else "not installed"
    else:
        flip_text = f"{error.flip:.4f}"
    return (
        relmse,
        _number(error.relmse_trimmed, ".2e"),
        _number(error.floor, ".1e"),
        _number(error.bias, ".4f"),
        flip_text,
    )


def is_surface(error: PathError) -> bool:
    """True for rows of depth and normals, which have percentiles instead of relMSE."""
    return error.name.lower() in ("depth", "normal")


def _number(value: float, form: str) -> str:
    return "–" if np.isnan(value) else "∞" if np.isinf(value) else format(value, form)
