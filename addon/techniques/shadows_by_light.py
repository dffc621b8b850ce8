"""Shadow maps by light: each light gets the kind of map that suits its penumbrae, in pictures of one sample.

| light | kind | why |
|---|---|---|
| without extent | plain | nothing to filter |
| widest penumbra below one texel of a plain map | plain | filtered or not, the map shows the same |
| few silhouette edges before each pixel | edges (depth_complexity.py) | less than equal rays or maps cost |
| the `important` strongest of the others | variance (vssm.py) | the least error of one map |
| all others | convolution (cssm.py) with 2 x 2 boxes and one contact ray | a lookup that costs less |

The widest penumbra of a light is bounded by its angle a from the nearest receiver and the space s that a blocker can
stand in: 2 a s, s the light's distance or the scene's size, whichever is less. A light's strength is the median of its
unblocked irradiance over the picture's tiles: power, size, distance and the part of the picture that it can reach.

What edges cost is known for this device and this picture (lighting/edge_costs.py); the ledger says what was compared.

Auto takes this technique for pictures of one sample in which a light has extent and casts shadows. With more samples
points of the lights (accumulated_maps.py) converge, and which is better is left to what the benchmark measured. Drafts
of a moving view keep points too: their maps are drawn in half the time.

Few lights have soft maps of at least 512 texels a side. Each kind keeps its own parameters. Cost and bias (direct
diffuse and glossy light) are those of the kinds; lights of one kind share atlas and pass.

Measured with one sample at 128x96 against Cycles, relMSE of the direct diffuse light, by this technique and by points
with the same 6 maps per sample: Cornell box 0.036 and 0.059, door ajar 0.066 and 0.63, garden 0.19 and 0.24, window
0.54 and 0.57, instances 0.60 and 0.64, foliage 0.31 and 0.33; colonnade 2.2 and 1.9. All figures include the film's
filter, and are from before one sample showed several points of it (film/points.py). Round lights, whose points are
asked by rays where they are near, are no exception: with rays to them the garden has 0.20.
"""

from __future__ import annotations

import numpy as np

from ..frame.picture import Frame
from ..frame.settings import Settings
from ..frame.technique import Param
from ..lighting import edge_costs
from ..lighting.caustic_casters import answered
from ..lighting.edge_costs import FEW_EDGES
from ..lighting.loop import tinted_casters
from ..lighting.point_maps import PointMaps
from ..lighting.silhouettes import Extent
from ..lighting.soft_maps import SoftMaps
from ..lighting.visibility import VisibilityProvider, drawn_stochastically, has_extent, rays_beside
from ..snapshot.scene import Snapshot
from ..sources import lights
from .accumulated_maps import AccumulatedMaps
from .cssm import ConvolutionSoftShadows
from .depth_complexity import DepthComplexity
from .vssm import VarianceSoftShadows

PLAIN = "lights without penumbra: plain maps"
EDGES = "soft lights with few edges: depth complexity"
VARIANCE, CONVOLUTION = "important soft lights: variance maps", "other soft lights: convolution maps"


# Of soft maps, texels, where few lights have some: in small pictures a finer map costs little beside its lookups.
LEAST_SIDE, FEW_LIGHTS = 512, 4


class FewBoxes(ConvolutionSoftShadows):
    """Convolution maps for lights that matter little each."""

    contact_rays = 1

    def cells(self, frame: Frame) -> int:
        return min(super().cells(frame), 2)


class FewEdges(DepthComplexity):
    """Edges for lights that were found to have few, each taken as a whole."""

    def begin(self, frame: Frame) -> None:
        """Lights are served as they are chosen."""

    def points(self, frame: Frame) -> int:
        return 0


class ShadowsByLight(PointMaps):
    name = "shadows_by_light"
    label = "Shadow maps by light"
    fills = ("shadow",)
    params = (
        Param(
            "important", "Important lights", 8,
            "Number of lights with wide penumbrae that use variance soft shadow maps; the others use convolution maps",
            0, 64,
        ),
        Param(
            "soft_maps", "Soft maps", True,
            "In pictures of one sample, use filtered maps for soft lights; otherwise several hard maps for each",
        ),
        FEW_EDGES,
    )  # fmt: skip

    def __init__(self):
        self._edges = FewEdges()
        self._providers = {
            PLAIN: AccumulatedMaps(),
            EDGES: self._edges,
            VARIANCE: VarianceSoftShadows(),
            CONVOLUTION: FewBoxes(),
        }
        self._kinds: dict[str, str] = {}

    def claims(self, snapshot: Snapshot, settings: Settings) -> bool:
        if settings.samples > 1 or settings.schedule.is_draft or not settings.get(self, "soft_maps"):
            return False
        return any(has_extent(light) for light in snapshot.lights)

    def begin(self, frame: Frame) -> None:
        self._kinds = self._chosen(frame)
        for kind in self._kinds.values():
            frame.count(self, kind)
        for kind in dict.fromkeys(self._kinds.values()):
            self._providers[kind].begin(frame)
        frame.provide(self, VisibilityProvider)

    def serving(self, emitter: lights.Emitter) -> PointMaps:
        return self._providers[self._kinds.get(emitter.light.key, PLAIN)]

    def _chosen(self, frame: Frame) -> dict[str, str]:
        """Kind by light."""
        found = (lights.emitter(light, frame.geometry.origin) for light in frame.snapshot.lights if light.cast_shadow)
        emitters = [emitter for emitter in found if emitter is not None]
        if frame.receivers is None or not len(frame.receivers.distance):
            return {}
        kinds, soft = {}, []
        for emitter in emitters:
            if penumbra(frame, emitter) * self._providers[PLAIN].resolution(frame) < 1.0:
                kinds[emitter.light.key] = PLAIN
            else:
                soft.append(emitter)
        if soft and self._may_have_edges(frame):
            served = {emitter.light.key for emitter in soft if self._by_edges(frame, emitter)}
            kinds |= dict.fromkeys(served, EDGES)
            soft = [emitter for emitter in soft if emitter.light.key not in served]
        soft.sort(key=lambda emitter: -strength(frame, emitter))
        for kind in (VARIANCE, CONVOLUTION):
            self._providers[kind].least_side = LEAST_SIDE if len(soft) <= FEW_LIGHTS else SoftMaps.least_side
        most = frame.settings.get(self, "important")
        kinds |= {emitter.light.key: VARIANCE for emitter in soft[:most]}
        return kinds | {emitter.light.key: CONVOLUTION for emitter in soft[most:]}

    def _may_have_edges(self, frame: Frame) -> bool:
        """Whether it is worth to find silhouettes: one sample, and few triangles."""
        if not frame.settings.get(self, "few_edges") or frame.settings.samples > 1:
            return False
        if frame.geometry.triangles > edge_costs.MOST_TRIANGLES:
            return False
        # Of what a shader finds within a shell (relief), edges and cards know the mesh below it alone.
        if any(frame.materials.compiled[draw.material].own_surface for draw in drawn_stochastically(frame)):
            return False
        self._edges.find_casters(frame)
        self._providers[PLAIN].begin(frame)
        return True

    def _by_edges(self, frame: Frame, emitter: lights.Emitter) -> bool:
        """Whether edges cost so little for this light; then they serve it, and the ledger says why."""
        # A share of a textured lamp says nothing of which part of it is hidden; nor one number of what tints its light.
        told_apart = frame.lamp_maps.textured(emitter.light) or tinted_casters(frame) or answered(frame, emitter)
        extent = None if told_apart else self._edges.suits(frame, emitter)[1]
        plain = self._providers[PLAIN]
        views = plain.views(frame, emitter, emitter.middle(), 0) if extent is not None else []
        if not views:
            return False
        found = self._compared(frame, extent, views)
        frame.account.chose(self, emitter.light.name, found.why)
        if found.by_edges:
            self._edges.serve(emitter, extent)
        return found.by_edges

    def _compared(self, frame: Frame, extent: Extent, views: list) -> edge_costs.EdgesCompared:
        found, cards = self._edges.silhouettes(frame, extent), self._edges.cards.cards(frame)
        before = edge_costs.edges_before(frame.receivers, found.wedges)
        before += edge_costs.OF_CARD * (cards.count if cards is not None else 0)
        others = rays_beside(frame, views, self._providers[PLAIN].resolution(frame))
        frame.count(self, "edges", found.count)
        width, height = frame.size
        return edge_costs.compared(width * height, before, others, rays=not drawn_stochastically(frame))

    def release(self) -> None:
        for service in self._providers.values():
            service.release()
        self._kinds = {}


def penumbra(frame: Frame, emitter: lights.Emitter) -> float:
    """Bound of the widest penumbra, as a share of what the picture's receivers span; 0 for a light without extent."""
    if not emitter.extended:
        return 0.0
    receivers, size = frame.receivers, frame.geometry.size
    span = max(float((receivers.high.max(axis=0) - receivers.low.min(axis=0)).max()), 1e-6 * size)
    if emitter.kind == lights.SUN:
        return 2.0 * np.tan(min(emitter.radius, 1.5)) * size / span
    nearest = np.clip(emitter.centre, receivers.low, receivers.high)
    distance = max(float(np.linalg.norm(nearest - emitter.centre, axis=1).min()), 1e-6 * size)
    return 2.0 * emitter.reach / distance * min(distance, size) / span


def strength(frame: Frame, emitter: lights.Emitter) -> float:
    """Median over the picture's tiles of the irradiance that the light brings unblocked, by its middle, W/m2."""
    power = float(np.abs(emitter.radiance).max()) * emitter.area
    if emitter.kind == lights.SUN:
        return power
    receivers = frame.receivers
    offset = (receivers.low + receivers.high) / 2 - emitter.centre
    squared = np.maximum((offset**2).sum(axis=1), max(emitter.reach, 1e-6 * frame.geometry.size) ** 2)
    reached = offset @ emitter.axis > 0 if emitter.has_span else True
    return float(np.median(np.where(reached, power / squared, 0.0)))
