"""Errors in equal time, from what each engine was measured to need: `bench reflections --few`, `bench caustics`."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from . import markdown

Points = Iterable[tuple[str, float, float]]  # engine, processor seconds, relMSE; of Candela by number of samples


def head(samples: Sequence[int]) -> list[str]:
    return ["scene", *(f"{what}{n}" for n in samples for what in ("s, ", "relMSE, ", "Cycles in that time, "))]


def row(name: str, points: Points) -> list[str]:
    """Seconds and error of Candela by number of samples, and the error of Cycles in as long."""
    points = list(points)
    cycles = sorted((seconds, wrong) for engine, seconds, wrong in points if engine == "CYCLES")
    cells = [name]
    for engine, seconds, wrong in points:
        if engine == "CANDELA":
            cells += [f"{seconds:.2f}", f"{wrong:.4f}", f"{at_time(cycles, seconds):.4f}"]
    return cells


def at_time(known: list[tuple[float, float]], seconds: float) -> float:
    """The error after so long, of (seconds, error) in order: along lines in logarithms of the least that is known until
    then. Of less time than the first takes it is the first's, of more than the last takes the last's."""
    times = np.log([one for one, _ in known])
    errors = np.minimum.accumulate(np.log([max(one, 1e-6) for _, one in known]))
    return float(np.exp(np.interp(np.log(seconds), times, errors)))


def table(rows: list[list[str]], samples: Sequence[int]) -> str:
    """Markdown, with in how many scenes Candela errs less."""
    told = ", ".join(
        f"with {n} in {sum(float(cells[k]) < float(cells[k + 1]) for cells in rows)} of {len(rows)} scenes"
        for n, k in zip(samples, range(2, 3 * len(samples), 3))
    )
    return f"Less error than denoised Cycles in equal time: {told}.\n\n{markdown.table([head(samples), *rows])}"
