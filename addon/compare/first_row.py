"""The first impression of an engine: one sample, four, the whole picture; Cycles denoised in the time of that; EEVEE.

Pictures of one sample and of four are rendered once before, so that their programs are compiled and the time is that of
a whole render; pictures of more samples need the same programs as those of four. Cycles has as many samples as fit: its
own time limit is set to CYCLES_SHARE of the time that it is to match, since denoising comes on top; the page tells what
it took. EEVEE has as many samples as Candela's whole picture, with its ray tracing, and is compiled before, too.
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
    floor: float = 0.0  # relMSE of the truth's own noise
    peer: bool = False  # another engine


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

    alone = reference.combined_alone(view_layer)

    def shown(label: str, made, peer: bool = False) -> Shown:
        pixels = made.images["combined"]
        error = metrics.compare_radiance("Combined", pixels, truth.images["combined"], truth.half["combined"])
        return Shown(label, pixels, made.seconds, error.relmse, error.floor, peer)

    def by(engine: str, samples: int, turn: int, *settings):
        return reference.render_passes(
            scene, engine, samples, seed + turn, direct_only, size, view_layer, extra=[*alone, *settings]
        )

    row = [shown(_samples(made.samples), made) for made in (*few, whole)]
    limit = max(CYCLES_SHARE * whole.seconds, LEAST_S)
    cycles = by("CYCLES", MOST_SAMPLES, 0, (scene.cycles, "use_denoising", True), (scene.cycles, "time_limit", limit))
    row.append(shown("Cycles, denoised", cycles, True))
    traced = (scene.eevee, "use_raytracing", True)
    by("BLENDER_EEVEE", 1, 1, traced)  # compiles
    row.append(shown(f"EEVEE, {_samples(whole.samples)}", by("BLENDER_EEVEE", whole.samples, 0, traced), True))
    return tuple(row)


def _samples(count: int) -> str:
    return f"{count} sample{'s' * (count > 1)}"
