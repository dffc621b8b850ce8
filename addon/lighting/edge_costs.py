"""The choice between the edges of a light and maps or rays, by what both cost on this device with the same error.

One sample by 64 points of a light errs as little as 33 to 71 samples of a ray each (docs/edge_shadows.md, "The same
error by edges, rays and maps"). What edges cost follows from how many of them a pixel is asked about:

    edges = pixels x (edges before a pixel + PIXEL) x edge + passes
    others = EQUAL x the less of a ray of each pixel and a depth map

`edge` is measured with the device's other figures (frame/device_probe.py). Edges before a pixel are counted as tiles
on the GPU count them, by wedges and boxes around the picture's receivers, for at most ASKED of either: a product of
matrices on the processor. What a light's edges cost is known once its silhouettes are, which few triangles make fast:
above MOST_TRIANGLES nobody looks. Auto takes edges where they cost four fifths, as figures of a device are no
forecasts: then they take no longer than the filtered maps that it has else (`python -m bench auto`), and err less.

What else would be taken for one sample, a filtered map, costs less than either and errs two to four times as much as
edges, by an amount that no scene tells beforehand.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..frame.technique import Param
from ..gfx import device
from ..gfx.device import milliseconds
from ..scene.receivers import Receivers
from .maps_or_rays import Compared

EQUAL = 35  # samples of a ray each: the least that was measured
GAIN = 1.25
PIXEL = 4.0  # edges' worth of receivers, counts, the mean over points and over neighbours
PASSES = 8
OF_CARD = 8.0  # edges' worth of a triangle with alpha, whose opacity every point asks
MOST_TRIANGLES = 5_000
ASKED = 128  # edges and boxes
FEW_EDGES = Param(
    "few_edges", "Edges where few", True,
    "In pictures of one sample, use the silhouette edges of a light where these are so few that they cost less than "
    "rays or maps with the same error",
)  # fmt: skip


@dataclass(frozen=True)
class EdgesCompared:
    """Nanoseconds of the visibility of a light in a picture of one sample, with the error of its edges."""

    edges: float
    others: float
    name: str  # of the others

    @property
    def by_edges(self) -> bool:
        return GAIN * self.edges <= self.others

    @property
    def why(self) -> str:
        """For the ledger."""
        both = f"{milliseconds(self.edges)} against {milliseconds(self.others)} of {self.name} with the same error here"
        return f"edges, because {both}" if self.by_edges else f"soft maps, because edges would take {both}"


def edges_before(receivers: Receivers, wedges: np.ndarray) -> float:
    """How many of the edges with these wedges (E, 4, 4) a pixel is asked about, on average."""
    boxes = len(receivers.distance)
    if not len(wedges) or not boxes:
        return 0.0
    planes = wedges[_evenly(len(wedges))]
    some = _evenly(boxes)
    low, high = receivers.low[some].astype(np.float32), receivers.high[some].astype(np.float32)
    middle, extent = (low + high) / 2, (high - low) / 2
    normal, offset = planes[..., :3].reshape(-1, 3), planes[..., 3].reshape(-1, 1)
    beyond = normal @ middle.T + offset - np.abs(normal) @ extent.T
    inside = (beyond <= 0.0).reshape(len(planes), 4, -1).all(axis=1)
    return len(wedges) * float(inside.mean())


def _evenly(count: int) -> np.ndarray:
    """At most ASKED numbers below `count`."""
    return np.unique(np.linspace(0, count - 1, min(count, ASKED)).astype(np.int64))


def edges_ns(pixels: int, before_pixel: float) -> float:
    costs = device.current()
    return pixels * (before_pixel + PIXEL) * costs.edge + PASSES * costs.render_pass


def compared(pixels: int, before_pixel: float, others: Compared, rays: bool = True) -> EdgesCompared:
    """Edges beside a ray of each pixel (where those can be traced) or depth maps."""
    by_rays = rays and others.by_rays
    least = others.rays if by_rays else others.maps
    return EdgesCompared(edges_ns(pixels, before_pixel), EQUAL * least, "rays" if by_rays else "maps")


def foreseen(pixels: int, triangles: int, others: Compared) -> str:
    """What is to be expected before anything is drawn, as a sentence."""
    if triangles > MOST_TRIANGLES:
        return f"soft maps, because {triangles} triangles have too many edges"
    costs = device.current()
    least = EQUAL / GAIN * min(others.rays, others.maps) - PASSES * costs.render_pass
    most = int(least / (pixels * costs.edge) - PIXEL)
    if most < 1:
        return "soft maps, because edges cost more here than rays or maps with the same error"
    return f"edges, if at most {most} lie before a pixel, because they then cost less than equal {others.name} here"
