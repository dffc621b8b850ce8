"""From measured cells to figures: curves of time against error, their staircases, speed-ups, and bias floors.

Two curves are compared where both have something to say. At equal error: the least error that both reach; how many
times longer the peer takes for it (a bound, where even the fastest point of one has less error than that). At equal
time: the time of Candela's 16 samples, at most that of the peer's slowest picture (what it would do with more is not
known), at least that of the peer's fastest; how many times larger the peer's error is; and the same at the time of the
longest picture that both have. Between measured points both are interpolated on logarithmic axes, along the staircase
of points that no other point beats in time and error at once.

An error below the reference's noise is quoted as that noise. The noise is also part of every error above it and makes
two engines look more alike than they are; `without_noise` takes it off.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bench.cells import NO_TRUTH

OWN, FAST, DRAFT = "Candela", "Candela, Fast preset", "Candela, Draft preset"
MIDDLE = 16  # samples of Candela at which figures are quoted
RESOLVED = 0.1  # of the reference's noise
FLAT = (
    0.5  # log error over log samples: noise falls at least like 1 / n, so what falls more slowly than this has a floor
)


@dataclass(frozen=True)
class Point:
    """One cell of a curve: median seconds of a whole render, relMSE of one light path."""

    samples: int
    seconds: float
    error: float


@dataclass(frozen=True)
class Results:
    """A results file, as `python -m bench run` writes it."""

    about: dict
    references: dict
    cells: list[dict]
    left_out: list[str]

    @property
    def scenes(self) -> list[str]:
        """Those that have a truth."""
        return [name for name in dict.fromkeys(cell["scene"] for cell in self.cells) if name not in NO_TRUTH]

    def labels(self, scene: str) -> list[str]:
        return list(dict.fromkeys(cell["series"]["label"] for cell in self.cells if cell["scene"] == scene))

    def cell(self, scene: str, label: str, samples: int) -> dict | None:
        for cell in self.cells:
            if (cell["scene"], cell["series"]["label"], cell["samples"]) == (scene, label, samples):
                return cell
        return None

    def curve(self, scene: str, label: str, path: str = "combined") -> list[Point]:
        """Points by samples; cells without this path, or whose error is not finite, are left out."""
        found = []
        for cell in self.cells:
            if cell["scene"] == scene and cell["series"]["label"] == label:
                error = cell.get("errors", {}).get(path, {})
                if error.get("relmse") is not None:
                    quoted = max(error["relmse"], self.floor(scene, path))
                    found.append(Point(cell["samples"], float(np.median(cell["times"])), quoted))
        return sorted(found, key=lambda point: point.samples)

    def own_curve(self, scene: str) -> list[Point]:
        """Combined by Candela with its defaults, then by its Fast and Draft presets: what a peer is held against."""
        return self.curve(scene, OWN) + self.curve(scene, FAST) + self.curve(scene, DRAFT)

    def floor(self, scene: str, path: str = "combined") -> float:
        """relMSE of the reference's own noise."""
        return self.references.get(scene, {}).get("floors", {}).get(path, {}).get("relmse", 0.0)

    def paths(self, scene: str, least: float = 0.01) -> list[str]:
        """Light paths that bring at least a share `least` of the scene's light, Combined first."""
        share = self.references.get(scene, {}).get("share", {})
        return [path for path, value in share.items() if path == "combined" or value >= least]


def load(path: Path) -> Results:
    data = json.loads(path.read_text(encoding="utf-8"))
    return Results(data["about"], data["references"], data["cells"], data["left_out"])


# -------------------------------------------------------------------------------------------------------------- curves


def without_noise(points: list[Point], noise: float) -> list[Point]:
    """The points with the reference's noise taken off: squared errors that do not know of each other add up.

    At least RESOLVED of the noise is left, below which the difference is chance.
    """
    return [replace(point, error=max(point.error - noise, RESOLVED * noise)) for point in points]


def staircase(points: list[Point]) -> list[Point]:
    """Points that no other point beats in time and error at once, by rising time and falling error."""
    found: list[Point] = []
    for point in sorted(points, key=lambda point: (point.seconds, point.error)):
        if not found or point.error < found[-1].error:
            found.append(point)
    return found


def seconds_for(points: list[Point], error: float) -> float | None:
    """Time to reach an error; None if no point does. An error above all points takes the fastest point's time."""
    steps = staircase(points)
    if not steps or steps[-1].error > error:
        return None
    if steps[0].error <= error:
        return steps[0].seconds
    falling = steps[::-1]
    logarithm = np.interp(
        math.log(error), [math.log(step.error) for step in falling], [math.log(step.seconds) for step in falling]
    )
    return math.exp(logarithm)


def error_after(points: list[Point], seconds: float) -> float | None:
    """Error reached within a time; None if no point is so fast."""
    steps = staircase(points)
    if not steps or steps[0].seconds > seconds:
        return None
    logarithm = np.interp(
        math.log(seconds), [math.log(step.seconds) for step in steps], [math.log(step.error) for step in steps]
    )
    return math.exp(logarithm)


@dataclass(frozen=True)
class Against:
    """Candela against one peer on one scene. More than 1: Candela is faster, has less error."""

    peer: str
    speed_up: float | None  # at equal error
    error: float | None  # that error, the least that both reach
    bound: str  # of the speed-up: ">" where Candela's worst point has less error already, "<" where the peer's has
    gain: float | None  # the peer's error over Candela's at equal time
    seconds: float | None  # that time
    late_gain: float | None  # and at the time of the longest picture that both have


def against(own: list[Point], peer: list[Point], name: str) -> Against:
    """Both figures, or None where a curve has no point."""
    if not own or not peer:
        return Against(name, None, None, "", None, None, None)
    error = max(min(point.error for point in own), min(point.error for point in peer))
    speed_up = seconds_for(peer, error) / seconds_for(own, error)
    bound = ">" if staircase(own)[0].error < error else "<" if staircase(peer)[0].error < error else ""
    middle = next((point.seconds for point in own if point.samples == MIDDLE), own[-1].seconds)
    middle = min(middle, max(point.seconds for point in peer))
    seconds = max(middle, *(min(point.seconds for point in curve) for curve in (own, peer)))
    late = max(seconds, min(max(point.seconds for point in curve) for curve in (own, peer)))
    gain, late_gain = (error_after(peer, time) / error_after(own, time) for time in (seconds, late))
    return Against(name, speed_up, error, bound, gain, seconds, late_gain)


def geometric_mean(values: list[float]) -> float | None:
    return math.exp(sum(map(math.log, values)) / len(values)) if values else None


def bias_floor(points: list[Point], noise: float) -> float | None:
    """What the error tends to: b of e = b + c / n through the last three points; None where it still falls."""
    last = points[-3:]
    if len(last) < 3 or last[-1].error <= noise:
        return None
    fall = math.log(last[-2].error / last[-1].error) / math.log(last[-1].samples / last[-2].samples)
    weights = np.array([1.0 / point.error for point in last])  # relative residuals count
    rows = np.array([[1.0, 1.0 / point.samples] for point in last]) * weights[:, None]
    (b, _), *_ = np.linalg.lstsq(rows, np.ones(len(last)), rcond=None)
    return float(b) if fall < FLAT and b > noise else None


def at_fault(results: Results, scene: str, label: str = OWN) -> list[tuple[str, float]]:
    """Light paths by what they add to the error of Combined at the most samples, as shares, largest first.

    A path's relMSE is relative to its own light; times the square of its share of the light, it is relative to all.
    """
    share = results.references.get(scene, {}).get("share", {})
    found = {}
    for path in ("diffuse_direct", "glossy_direct", "diffuse_indirect", "glossy_indirect", "transmission_indirect"):
        points = results.curve(scene, label, path)
        if points and path in share:
            found[path] = points[-1].error * share[path] ** 2
    total = sum(found.values())
    ranked = sorted(found.items(), key=lambda item: -item[1])
    return [(path, value / total) for path, value in ranked] if total else []
