"""What Auto knows about the techniques of a slot: their error and time by sample count, as the benchmark measured them.

technique_costs.json is written by `python -m bench costs` and holds, for each slot with a choice, each technique's
error (relMSE of the whole picture) and time (of a whole render) relative to the slot's first technique at the same
samples, as geometric means over the scenes that it names (one, as yet). Auto takes the technique with the least error x
time: the variance of an unbiased method falls as its time grows, so that the product does not depend on the samples; of
a biased one it rises with them. Another technique than the first must win by more than the figures scatter from run to
run.
"""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

PATH = Path(__file__).with_name("technique_costs.json")
SCATTER = 0.15  # of ratios between two runs of the benchmark


@dataclass(frozen=True)
class Cost:
    """Error and time of a technique at a number of samples, relative to the first technique of its slot."""

    error: float
    seconds: float

    @property
    def product(self) -> float:
        return self.error * self.seconds


Costs = dict[str, dict[str, dict[int, Cost]]]  # slot -> technique -> samples -> cost


@cache
def known() -> Costs:
    """The committed table."""
    return read(PATH)


def read(path: Path) -> Costs:
    data = json.loads(path.read_text(encoding="utf-8"))
    return {
        slot: {
            technique: {int(samples): Cost(*pair) for samples, pair in rows.items()}
            for technique, rows in techniques.items()
        }
        for slot, techniques in data["slots"].items()
    }


def predicted(costs: Costs, slot: str, technique: str, samples: int) -> Cost | None:
    """Cost at the measured number of samples that is nearest on a logarithmic scale; None where nothing is known."""
    rows = costs.get(slot, {}).get(technique)
    if not rows:
        return None
    return rows[min(rows, key=lambda n: (abs(math.log(n / samples)), n))]


def preferred(costs: Costs, slot: str, techniques: Sequence[str], samples: int) -> str:
    """The technique that Auto takes among those that the scene can use, given in the registry's order."""
    first = techniques[0]
    found = {name: predicted(costs, slot, name, samples) for name in techniques}
    if found[first] is None:
        return first
    best = min((name for name in techniques if found[name]), key=lambda name: found[name].product)
    return best if found[best].product < (1 - SCATTER) * found[first].product else first
