"""Errors of light below surfaces told apart into bias and noise, and the page's picture: parts of `bench subsurface`.

Of several seeds of one renderer and several references, m the mean of the seeds at a pixel and v their variance, m' and
v' of the references, n and n' their numbers, s what relMSE divides by:

    noise = mean of v / s          bias^2 = mean of ((m - m')^2 - v / n - v' / n') / s

so that their sum is the relMSE of one picture beside the truth, whatever the noise of the references. Both are free of
bias themselves; bias^2 of few seeds may come out below zero, which is shown as it is.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from . import markdown, subsurface

COMMAND = "python -m bench subsurface --parts split --page docs/subsurface.md"
HEAD = (
    "scene", "method", "renderer", "relMSE", "noise", "bias²", "mean of 8 seeds", "mean / Cycles", "± of the last",
    "reference ±",
)  # fmt: skip
SCENES = ("ears", "wax block", "milk")
SEEDS, REFERENCES = 8, 4
ENTRANTS = (("CANDELA", 1), ("CANDELA", 16), (subsurface.DENOISED, 16))
PICTURE = Path(__file__).resolve().parent.parent / "docs" / "images" / "subsurface_through.png"
PICTURED = ("ears", "hollow candle", "thin leaf")


def parts_of_error(pictures: np.ndarray, references: np.ndarray) -> tuple[float, float]:
    """Noise and squared bias of a picture; pictures and references are (number, height, width, 3), two or more."""
    right = references.mean(axis=0)
    scale = subsurface.scale_of(right)
    noise = pictures.var(axis=0, ddof=1)
    unsure = noise / len(pictures) + references.var(axis=0, ddof=1) / len(references)
    squared = (pictures.mean(axis=0) - right) ** 2 - unsure
    return float((noise / scale).mean()), float((squared / scale).mean())


def means_of(pictures: np.ndarray, references: np.ndarray) -> tuple[str, str, str]:
    """Means by channel over those of the references, their standard errors, and the references' own, in per cent."""

    def unsure(found: np.ndarray) -> np.ndarray:
        each = found.mean(axis=(1, 2))
        return 100.0 * each.std(axis=0, ddof=1) / np.sqrt(len(each)) / np.maximum(each.mean(axis=0), 1e-30)

    ratio = pictures.mean(axis=(0, 1, 2)) / np.maximum(references.mean(axis=(0, 1, 2)), 1e-30)
    told = (
        " ".join(f"{c:.3f}" for c in ratio),
        *(" ".join(f"{c:.1f}" for c in unsure(one)) for one in (pictures, references)),
    )
    return told  # type: ignore[return-value]


def split(options: argparse.Namespace) -> Iterator[str]:
    """The table so far, after each scene and method."""
    rows: list[tuple[str, ...]] = [HEAD]
    for name in options.scenes or SCENES:
        for method in options.methods:
            shown = subsurface.opened(name, method, options.size)
            references = np.stack([shown("CYCLES", options.reference, 100 + k)[0] for k in range(REFERENCES)])
            for engine, samples in ENTRANTS:
                pictures = np.stack([shown(engine, samples, 1 + k)[0] for k in range(SEEDS)])
                noise, bias = parts_of_error(pictures, references)
                label = f"{subsurface.LABELS[engine]} {samples}"
                figures = (f"{noise + bias:.4f}", f"{noise:.4f}", f"{bias:.4f}", f"{noise / SEEDS + bias:.4f}")
                rows.append((name, method, label, *figures, *means_of(pictures, references)))
                print(rows[-1], flush=True)
                if options.pictures is not None:
                    options.pictures.mkdir(parents=True, exist_ok=True)
                    file = options.pictures / f"split_{name}_{method}_{label}.npz".replace(" ", "_").lower()
                    np.savez(file, pictures=pictures, references=references)
            yield "\n".join([
                "Pictures of {} x {} pixels, two bounces (of milk 16), {} seeds of each renderer beside {}".format(
                    *options.size, SEEDS, REFERENCES
                ),
                f"references of {options.reference} samples by Cycles; standard errors in per cent.", "",
                markdown.table(rows),
            ])  # fmt: skip


def through(options: argparse.Namespace) -> Path:
    """Ears, a candle and a leaf by Random Walk: Candela at 16 samples beside a reference. Writes the page's picture."""
    from addon.compare.png import png

    rows = []
    for name in options.scenes or PICTURED:
        shown = subsurface.opened(name, "RANDOM_WALK", options.size)
        ours, right = shown("CANDELA", 16, 1)[0], shown("CYCLES", options.reference, 11)[0]
        exposure = 1.0 / max(float(np.percentile(right, 98)), 1.0)
        rows.append(exposure * np.concatenate([ours, right], axis=1)[::-1])
    whole = np.concatenate(rows).repeat(2, axis=0).repeat(2, axis=1)
    shades = (np.clip(whole, 0.0, 1.0) ** (1 / 2.2) * 255).astype(np.uint8)
    PICTURE.write_bytes(png(np.ascontiguousarray(shades)))
    return PICTURE
