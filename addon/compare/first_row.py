"""The first impression of an engine: one sample, four, the whole picture, and Cycles denoised in the time of that.

Pictures of one sample and of four are rendered once before, so that their programs are compiled and the time is that of
a whole render; pictures of more samples need the same programs as those of four. Cycles has as many samples as fit: its
own time limit is set to CYCLES_SHARE of the time that it is to match, since denoising comes on top; the page tells what
it took.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from . import metrics

FEW = (1, 4)  # samples
CYCLES_SHARE, LEAST_S = 0.75, 0.05
MOST_SAMPLES = 4096


@dataclass(frozen=True)
class Shown:
    """One picture of the row: (H, W, C) float32 linear, bottom row first, with its time and error."""

    label: str
    pixels: np.ndarray
    seconds: float
    relmse: float


def few_samples(scene, seed: int, direct_only: bool, size, view_layer) -> list:
    """Passes of the pictures of few samples. Raises `reference.RenderFailed`."""
    from . import reference

    alone = reference.combined_alone(view_layer)
    found = []
    for count in FEW:
        for turn in (1, 0):  # the first one compiles
            made = reference.render_passes(
                scene, "CANDELA", count, seed + turn, direct_only, size, view_layer, extra=alone
            )
        found.append(made)
    return found


def first_row(few: list, whole, truth, scene, seed: int, direct_only: bool, size, view_layer) -> tuple[Shown, ...]:
    """The pictures `few` and `whole` (Passes), and Cycles' beside `truth`. Raises `reference.RenderFailed`."""
    from . import reference

    cycles = scene.cycles
    limit = max(CYCLES_SHARE * whole.seconds, LEAST_S)
    extra = [*reference.combined_alone(view_layer), (cycles, "use_denoising", True), (cycles, "time_limit", limit)]
    peer = reference.render_passes(scene, "CYCLES", MOST_SAMPLES, seed, direct_only, size, view_layer, extra=extra)

    def shown(label: str, made) -> Shown:
        pixels = made.images["combined"]
        error = metrics.compare_radiance("Combined", pixels, truth.images["combined"], truth.half["combined"])
        return Shown(label, pixels, made.seconds, error.relmse)

    row = [shown(f"{made.samples} sample{'s' * (made.samples > 1)}", made) for made in (*few, whole)]
    return (*row, shown("Cycles, denoised", peer))
