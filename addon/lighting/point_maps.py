"""Depth maps of points of lights: the base of techniques that tell visibility by maps."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ..frame.picture import Frame
from ..frame.settings import Settings
from ..frame.technique import Param, Technique
from ..scene import acceleration
from ..snapshot.scene import Snapshot
from ..sources import lights
from . import depth_maps
from .caustic_casters import answered, stopped_by_all
from .visibility import (
    ATLAS_TEXELS,
    EDGES,
    FINER_FROM,
    FINER_STOCHASTIC,
    Batch,
    DepthMapService,
    LightPoint,
    Maps,
    VisibilityProvider,
    by_rays,
    drawn_stochastically,
    glass_absorbs,
    map_resolution,
    ray_bindings,
    rounds,
)

CUTOFF = Param(
    "cutoff", "Shadow cutoff", 0.001,
    "Leave a light's shadows out where it contributes less than this share of the picture's median light",
    0.0, 0.1, "FACTOR",
)  # fmt: skip
EDGE_RAYS = Param(
    "edge_rays", "Edge rays", True,
    "Trace a ray where neighbouring texels of a shadow map disagree and the penumbra is narrow, for exact edges",
    draft=False,
)  # fmt: skip


class PointMaps(Technique, VisibilityProvider):
    fills = ("shadow",)
    provides = (VisibilityProvider,)
    atlas_texels = ATLAS_TEXELS

    def __init__(self):
        self.service = DepthMapService()
        self._reached: dict[str, depth_maps.Receivers] = {}

    def skip(self, snapshot: Snapshot, settings: Settings) -> str | None:
        if not any(light.cast_shadow and np.any(light.strength) for light in snapshot.lights):
            return "no light casts a shadow"
        if not snapshot.casts_shadows:
            return "no object casts a shadow"
        return None

    def begin(self, frame: Frame) -> None:
        frame.provide(self, VisibilityProvider)
        self._find_reached(frame)

    def _find_reached(self, frame: Frame) -> None:
        """For each light the receivers where its shadows can be seen (see CUTOFF)."""
        self._reached = {}
        receivers = frame.receivers
        emitters = frame.emitters
        if receivers is None or not len(receivers.distance) or not emitters:
            return
        centre = (receivers.low + receivers.high) / 2
        typical = np.zeros(len(centre))  # irradiance at the tiles' centres if nothing is blocked
        largest = []
        for emitter in emitters:
            if emitter.maps is not None:  # its light falls off otherwise, and is stronger than in the mean somewhere
                largest.append(np.full(len(centre), np.inf))
                continue
            strength = float(np.abs(emitter.radiance).max())
            if emitter.kind == lights.SUN:
                typical += strength * emitter.area
                largest.append(np.full(len(centre), np.inf))
                continue
            strength *= emitter.area if emitter.area > 0 else 1.0
            strength *= emitter.concentration
            nearest = np.clip(emitter.centre, receivers.low, receivers.high)
            reach = float(np.linalg.norm(emitter.u[:3]) + np.linalg.norm(emitter.v[:3])) if emitter.has_span else 0
            gap = np.maximum(np.linalg.norm(nearest - emitter.centre, axis=1) - reach, 1e-6 * frame.geometry.size)
            largest.append(strength / gap**2)
            middle = np.linalg.norm(centre - emitter.centre, axis=1)
            typical += strength / np.maximum(middle, max(reach, emitter.radius, 1e-6 * frame.geometry.size)) ** 2
        # The median, not the mean: the tile next to a lamp must not decide for the room.
        least = frame.settings.get(self, "cutoff") * float(np.median(typical))
        for emitter, most in zip(emitters, largest):
            keep = most >= least
            self._reached[emitter.light.key] = replace(
                receivers, low=receivers.low[keep], high=receivers.high[keep], distance=receivers.distance[keep]
            )

    def resolution(self, frame: Frame) -> int:
        stochastic = frame.settings.samples >= FINER_FROM and drawn_stochastically(frame, stopped_by_all(frame))
        finer = FINER_STOCHASTIC if stochastic else 1.0
        return map_resolution(frame, finer * frame.settings.get(self, "texels_per_pixel"))

    def traces(self, frame: Frame, emitter: lights.Emitter) -> bool:
        """Whether rays take the place of this light's maps."""
        return by_rays(
            frame, lambda: self.views(frame, emitter, emitter.middle(), 0), self.resolution(frame), self,
            emitter.light.name if emitter.light else "light", self.is_absorbed(frame, emitter),
        )  # fmt: skip

    @staticmethod
    def is_absorbed(frame: Frame, emitter: lights.Emitter) -> bool:
        """Whether glass absorbs this light's on straight ways, which maps do not know."""
        return not answered(frame, emitter) and glass_absorbs(frame)

    def views(self, frame: Frame, emitter: lights.Emitter, sample: np.ndarray, number: int, cell: float = 0.0) -> list:
        """Views that cover point `number` of the light, at `sample`, for all receivers."""
        of_world_or_mesh = emitter.light is None
        receivers = frame.receivers if of_world_or_mesh else self._reached.get(emitter.light.key)
        shadowed = of_world_or_mesh or emitter.light.cast_shadow
        if not shadowed or receivers is None or not len(receivers.distance):
            return []
        found = self._views(frame, emitter, sample, receivers, self.jitter(frame, emitter, number), cell)
        return [replace(view, glass_blocks=True) for view in found] if answered(frame, emitter) else found

    def _views(self, frame: Frame, emitter: lights.Emitter, sample: np.ndarray, receivers, jitter, cell: float) -> list:
        if emitter.kind == lights.SUN:
            reach = cell * np.tan(min(emitter.radius, 1.5))
            return depth_maps.directional_views(
                sample, frame.receivers, frame.geometry, jitter, self.resolution(frame), reach
            )
        axis, cone = None, np.inf
        if emitter.kind in (lights.RECTANGLE, lights.ELLIPSE):
            axis, cone = emitter.axis, emitter.spread or np.inf
        elif emitter.flags & lights.SPOT_FLAG:
            half = emitter.light.spot_angle / 2
            if half < np.pi / 2 - 0.01:
                axis, cone = emitter.axis, _spot_tangent(emitter, half)
        return depth_maps.point_views(
            emitter.position(sample), axis, cone, receivers, frame.geometry, jitter, self.resolution(frame),
            cell * emitter.reach,
        )  # fmt: skip

    def jitter(self, frame: Frame, emitter: lights.Emitter, number: int) -> tuple[float, float, float, float]:
        """Shift and turn of the maps of point `number`."""
        return (*frame.random("map", number), *frame.random("map/turn", number))

    def most_texels(self, frame: Frame) -> int:
        """Of the views of a round."""
        return self.atlas_texels

    def batches(self, frame: Frame, technique: Technique, points: list[LightPoint]) -> Iterator[Batch]:
        for own, views in rounds(frame, points, self.resolution(frame), self.most_texels(frame)):
            yield own, self.draw(frame, views)

    def draw(self, frame: Frame, views: list) -> Maps:
        """Draw the views of a round. The maps may be asked once `drawing` is exhausted."""
        maps = self.service.draw(frame, self, views, self.resolution(frame))
        if not (views and frame.settings.get(self, "edge_rays")) or acceleration.too_many(frame.snapshot):
            return maps
        textures, constants = ray_bindings(frame)
        return replace(maps, lookup=EDGES, textures=textures, constants=constants)

    def release(self) -> None:
        self.service.release()


def _spot_tangent(emitter: lights.Emitter, half: float) -> float:
    """Tangent of the cone's half angle; a scaled spot object has an elliptic cone, its wider side counts."""
    scale = np.linalg.norm(emitter.light.matrix[:3, :3], axis=0)
    stretch = max(scale[0], scale[1]) / max(scale[2], 1e-12)
    return float(np.tan(half) * stretch) * 1.001
