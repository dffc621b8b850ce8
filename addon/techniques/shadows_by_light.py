"""Shadow maps by light: each light gets the kind of map that suits its penumbrae, in pictures of one sample.

| light | kind | why |
|---|---|---|
| without extent | plain | nothing to filter |
| widest penumbra below one texel of a plain map | plain | filtered or not, the map shows the same |
| round and nearer than four radii, or a spot whose size blurs its cone's edge; rays | plain | see below |
| points of it have the least error times time | plain | see lighting/shadow_costs.py |
| few silhouette edges before each pixel | edges (depth_complexity.py) | less than equal rays or maps cost |
| the `important` strongest of the others | variance (vssm.py) | the least error of one map |
| all others | convolution (cssm.py) with 2 x 2 boxes and one contact ray | a lookup that costs less |

The widest penumbra of a light is bounded by its angle a from the nearest receiver and the space s that a blocker can
stand in: 2 a s, s the light's distance or the scene's size, whichever is less. A light's strength is the median of its
unblocked irradiance over the picture's tiles: power, size, distance and the part of the picture that it can reach.

What edges cost is known for this device and this picture (lighting/edge_costs.py), and how much points of a light
differ where light probes asked (`few_points`): then the least error times time decides between points, edges and maps
(lighting/shadow_costs.py). The ledger says what was compared.

Auto takes this technique for pictures of one sample in which a light has extent and casts shadows. With more samples
points of the lights (accumulated_maps.py) converge, and which is better is left to what the benchmark measured. Drafts
of a moving view keep points too: their maps are drawn in half the time. As a whole, a
light has one cone and one distance: a spot's cone would stay sharp that its size blurs, and penumbrae of a large round
light near by are others. Where rays cost no more than maps, points take them. Few lights have soft maps of 512 texels a
side at least.

Measured with one sample at 128x96 against Cycles, relMSE of the direct diffuse light, by this technique and by points
with 6 maps per sample: Cornell box 0.036 and 0.059, door ajar 0.066 and 0.63, garden 0.19 and 0.24; colonnade 2.2, 1.9.
"""

from __future__ import annotations

import numpy as np

from ..frame.picture import Frame
from ..frame.settings import Settings
from ..frame.technique import Param
from ..lighting import edge_costs, edge_tiles, shadow_costs
from ..lighting.caustic_casters import answered
from ..lighting.edge_costs import FEW_EDGES
from ..lighting.edge_shadows import NEAR
from ..lighting.light_rates import WORLD, LightRates
from ..lighting.loop import tinted_casters
from ..lighting.maps_or_rays import Compared
from ..lighting.point_maps import PointMaps
from ..lighting.shadow_costs import Foreseen, Weighed
from ..lighting.silhouettes import Extent
from ..lighting.soft_maps import SoftMaps
from ..lighting.visibility import VisibilityProvider, drawn_stochastically, has_extent, rays_beside
from ..snapshot.scene import Snapshot
from ..sources import lights
from .accumulated_maps import AccumulatedMaps
from .cssm import ConvolutionSoftShadows
from .depth_complexity import DepthComplexity
from .vssm import VarianceSoftShadows

PLAIN = "lights by points: rays or plain maps"
EDGES = "soft lights with few edges: depth complexity"
VARIANCE, CONVOLUTION = "important soft lights: variance maps", "other soft lights: convolution maps"


BLURRED = 0.5  # of the width of a spot's blend, from which on what its size adds to it is seen
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
    requests = (LightRates,)
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
        Param(
            "few_points", "Points where better", True,
            "In pictures of one sample, use points of a light where these have less error for their time than a soft "
            "map: where its penumbrae are narrow, and where rays cost little",
        ),
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
        self._draw_points(frame)
        frame.provide(self, VisibilityProvider)

    def _draw_points(self, frame: Frame) -> None:
        """As many points of the lights without soft map as there would be if no light had one."""
        rates = frame.service(LightRates)
        if rates is None or not frame.settings.get(self, "few_points") or frame.settings.samples > 1:
            return
        by_points = {key for key, kind in self._kinds.items() if kind == PLAIN}
        alone = by_points == set(self._kinds)
        chosen = {key: rate for key, rate in rates.of_points.items() if key in by_points or (alone and key == WORLD)}
        rates.by_light |= chosen

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
            sharp = penumbra(frame, emitter) * self._providers[PLAIN].resolution(frame) < 1.0
            if sharp or self.is_absorbed(frame, emitter) or self._is_seen_in_parts(frame, emitter):
                kinds[emitter.light.key] = PLAIN
            else:
                soft.append(emitter)
        served = self._weighed(frame, soft) if soft else {}
        kinds |= served
        soft = [emitter for emitter in soft if emitter.light.key not in served]
        soft.sort(key=lambda emitter: -strength(frame, emitter))
        for kind in (VARIANCE, CONVOLUTION):
            self._providers[kind].least_side = LEAST_SIDE if len(soft) <= FEW_LIGHTS else SoftMaps.least_side
        most = frame.settings.get(self, "important")
        kinds |= {emitter.light.key: VARIANCE for emitter in soft[:most]}
        return kinds | {emitter.light.key: CONVOLUTION for emitter in soft[most:]}

    def _is_seen_in_parts(self, frame: Frame, emitter: lights.Emitter) -> bool:
        """Whether the light, taken as a whole, would err more than one point of it does, which rays can ask for."""
        plain = self._providers[PLAIN]
        if frame.settings.samples > 1 or not seen_in_parts(frame, emitter):
            return False
        plain.begin(frame)
        traced = plain.traces(frame, emitter)
        if traced:
            why = "it is near, round and large" if is_near(frame, emitter) else "its size blurs the edge of its cone"
            frame.account.chose(self, emitter.light.name, f"rays to its points, because {why}")
        return traced

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

    def _weighed(self, frame: Frame, soft: list[lights.Emitter]) -> dict[str, str]:
        """EDGES or PLAIN for those of the lights by key that do better so than by soft maps."""
        edges, kinds = self._may_have_edges(frame), {}
        weighed = self._weights(frame)
        if weighed is not None and not edges:
            self._providers[PLAIN].begin(frame)
        for emitter in soft:
            key = emitter.light.key
            if weighed is not None and key in weighed.rates.variance:
                kind = self._by_error_and_time(frame, emitter, weighed, edges)
            else:
                kind = EDGES if edges and self._by_edges(frame, emitter) else None
            if kind is not None:
                kinds[key] = kind
        return kinds

    def _weights(self, frame: Frame) -> Weighed | None:
        """What is known of lights' errors, where probes asked and the user wants it weighed. Of casters that maps draw
        at random, texel by texel, probes know the mean alone: points of the light would be noisier than they tell."""
        if drawn_stochastically(frame):
            return None
        rates = frame.service(LightRates)
        known = rates is not None and rates.variance and frame.settings.samples == 1
        return Weighed(frame.size, rates) if known and frame.settings.get(self, "few_points") else None

    def _by_error_and_time(self, frame: Frame, emitter: lights.Emitter, weighed: Weighed, edges: bool) -> str | None:
        """The kind with the least error times time; None: a soft map. Silhouettes are looked for where they may win."""
        key, plain = emitter.light.key, self._providers[PLAIN]
        views = plain.views(frame, emitter, emitter.middle(), 0)
        if not views:
            return None
        each = rays_beside(frame, views, plain.resolution(frame))
        found: dict[str, Foreseen] = {
            shadow_costs.POINTS: weighed.points(key, each),
            shadow_costs.MAPS: weighed.maps(key, each, len(views) * self._soft_side(frame) ** 2),
        }
        triangles = frame.geometry.triangles
        if edges and weighed.edges(key, 0.0, triangles).product < min(one.product for one in found.values()):
            extent = self._extent(frame, emitter)
            if extent is not None:
                found[shadow_costs.EDGES] = weighed.edges(key, self._edges_before(frame, extent), triangles)
        name = min(found, key=lambda one: found[one].product)
        others = ", ".join(f"{one} {worth}" for one, worth in found.items() if one != name)
        frame.account.chose(
            self,
            emitter.light.name,
            f"{name}, because error and time of the picture are {found[name]} here, of {others}",
        )
        if name == shadow_costs.EDGES:
            self._edges.serve(emitter, extent)
        return {shadow_costs.POINTS: PLAIN, shadow_costs.EDGES: EDGES}.get(name)

    def _soft_side(self, frame: Frame) -> int:
        return max(self._providers[VARIANCE].resolution(frame), LEAST_SIDE)

    def _extent(self, frame: Frame, emitter: lights.Emitter) -> Extent | None:
        """Of a light that edges may serve."""
        # A share of a textured lamp does not say which part of it is hidden; nor one number what tints its light.
        told_apart = frame.lamp_maps.textured(emitter.light) or tinted_casters(frame) or answered(frame, emitter)
        return None if told_apart else self._edges.suits(frame, emitter)[1]

    def _by_edges(self, frame: Frame, emitter: lights.Emitter) -> bool:
        """Whether edges cost so little for this light; then they serve it, and the ledger says why."""
        extent, plain = self._extent(frame, emitter), self._providers[PLAIN]
        views = plain.views(frame, emitter, emitter.middle(), 0) if extent is not None else []
        if not views:
            return False
        found = self._compared(frame, extent, rays_beside(frame, views, plain.resolution(frame)))
        frame.account.chose(self, emitter.light.name, found.why)
        if found.by_edges:
            self._edges.serve(emitter, extent)
        return found.by_edges

    def _compared(self, frame: Frame, extent: Extent, others: Compared) -> edge_costs.EdgesCompared:
        before, (width, height) = self._edges_before(frame, extent), frame.size
        return edge_costs.compared(width * height, before, others, rays=not drawn_stochastically(frame))

    def _edges_before(self, frame: Frame, extent: Extent) -> float:
        """How many edges of a light a pixel is asked about, in the mean; cards count as several."""
        found, cards = self._edges.silhouettes(frame, extent), self._edges.cards.cards(frame)
        frame.count(self, "edges", found.count)
        before = edge_costs.edges_before(frame.receivers, found.wedges)
        return before + edge_costs.OF_CARD * (cards.count if cards is not None else 0)

    def release(self) -> None:
        for service in self._providers.values():
            service.release()
        self._kinds = {}


def seen_in_parts(frame: Frame, emitter: lights.Emitter) -> bool:
    """Whether a light, taken as a whole, has another cone or other penumbrae than its points have together."""
    return is_near(frame, emitter) or blurs_its_cone(frame, emitter)


def is_near(frame: Frame, emitter: lights.Emitter) -> bool:
    """Whether it is a ball whose radius is much beside its distance from what is seen."""
    round_light = emitter.kind in (lights.POINT, lights.SPHERE)
    return round_light and emitter.radius > NEAR * edge_tiles.nearest_receiver(frame, emitter)


def blurs_its_cone(frame: Frame, emitter: lights.Emitter) -> bool:
    """Whether the edge of a spot's cone is blurred by its size about as much as by its own blend."""
    light = emitter.light
    if light.kind != "SPOT" or not emitter.radius:
        return False
    half = np.clip(light.spot_angle, 1e-3, np.pi - 1e-3) / 2
    blend = (1.0 - np.cos(half)) * light.spot_blend / np.sin(half)
    return 2.0 * emitter.radius / max(float(np.median(distances(frame, emitter))), 1e-9) > BLURRED * blend


def distances(frame: Frame, emitter: lights.Emitter) -> np.ndarray:
    """From a light to the nearest receiver of each of the picture's tiles, m."""
    nearest = np.clip(emitter.centre, frame.receivers.low, frame.receivers.high)
    return np.linalg.norm(nearest - emitter.centre, axis=1)


def penumbra(frame: Frame, emitter: lights.Emitter) -> float:
    """Bound of the widest penumbra, as a share of what the picture's receivers span; 0 for a light without extent."""
    if not emitter.extended:
        return 0.0
    receivers, size = frame.receivers, frame.geometry.size
    span = max(float((receivers.high.max(axis=0) - receivers.low.min(axis=0)).max()), 1e-6 * size)
    if emitter.kind == lights.SUN:
        return 2.0 * np.tan(min(emitter.radius, 1.5)) * size / span
    distance = max(float(distances(frame, emitter).min()), 1e-6 * size)
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
