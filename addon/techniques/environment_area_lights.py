"""Environment light by area lights: the world as some dozens of lights with extent, each with one soft shadow map.

    L(x, v) = sum over lights of  f(x, v, w_l) E_l(x) V_l(x)

with E_l the irradiance of a cone of even radiance in closed form (shaders/light/whole.glsl) and V_l its visibility by
variance or convolution soft shadow maps, with the settings of those. The lights are fitted to the map once per world
(addon/sources/area_fit.py); a small bright part becomes a small light with a sharp shadow, an even sky a few wide ones.

One sample shows all of the world, smoothly, where environment_light shows a few hard shadows. With more samples each
map stands for a part of its light, so that shadows get better; what stays is that the world is even within each light.
In the open that is the better picture of one sample; in rooms far too much light leaks in. Hence Auto does not take it.

| cost | per sample |
|---|---|
| maps | `lights` orthographic views, filtered (vssm.py, cssm.py) |
| passes | 1 over the screen per round of lights |
| per pixel and light | closed form; where the min-max pyramid does not decide, the lookup of the shadows |

Bias (direct diffuse light): the world is even within each light, whose shape is a cone; shadows as in vssm and cssm.
Glossy light comes from traced rays; without them closures see four points per light.

Fails: light leaks below roofs and behind walls that stand at an angle in the maps: a court with an arcade is 1.3 times
as bright as it should be, its dark parts many times, and a closed room with a window is lit at all its walls. Figures:
docs/log/2026-11-26-environment.md.

Source: Annen et al., "Real-time, all-frequency shadows in dynamic scenes", SIGGRAPH 2008. The source shadows its lights
by convolution maps; here variance maps are the default.
"""

from __future__ import annotations

import weakref
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ..frame.picture import Frame
from ..frame.settings import AUTO, Settings
from ..frame.technique import Param, Technique
from ..lighting import depth_maps
from ..lighting.loop import DIRECT_WRITES, light_surfaces
from ..lighting.soft_maps import SoftMaps
from ..lighting.visibility import LightPoint, map_resolution
from ..snapshot.scene import Snapshot
from ..sources import area_fit, lights
from ..sources.environment import Environment
from ..surfaces.draw import LIT_SURFACES
from .cssm import ConvolutionSoftShadows
from .environment_light import EnvironmentLight
from .vssm import VarianceSoftShadows

SHADOWS = (
    ("VARIANCE", "Variance", 0, "Variance soft shadow maps"),
    ("CONVOLUTION", "Convolution", 1, "Convolution soft shadow maps"),
)
NO_SHARE = 1e-9  # of traced lobes: rays bring all of the world's light to them


class EnvironmentAreaLights(Technique):
    name = "environment_area_lights"
    label = "Environment area lights"
    fills = ("environment",)
    params = (
        Param("lights", "Lights", 45, "Maximum number of area lights that the world is split into", 24, 64),
        Param(
            "texels_per_pixel", "Map resolution", 1.0,
            "Shadow map resolution, in texels per pixel of the picture's longer side",
            0.125, 4.0,
        ),
        Param("shadows", "Shadows", "VARIANCE", "Kind of soft shadow maps", items=SHADOWS),
    )  # fmt: skip
    reads = LIT_SURFACES
    writes = DIRECT_WRITES

    def __init__(self):
        self._shadows: dict[str, SoftMaps] = {
            "VARIANCE": _with_resolution_of(self, VarianceSoftShadows),
            "CONVOLUTION": _with_resolution_of(self, ConvolutionSoftShadows),
        }
        self._sources = lights.Sources()
        self._fitted: tuple[weakref.ref, int, list[area_fit.AreaLight]] | None = None

    def skip(self, snapshot: Snapshot, settings: Settings) -> str | None:
        chosen = settings.passes is not None or settings.slots.get(self.fills[0], AUTO) == self.name
        if not chosen:
            return "unless it is chosen, directions are drawn from the world, which leak nothing into rooms"
        return EnvironmentLight().skip(snapshot, settings)

    def sample(self, frame: Frame) -> Iterator[None]:
        if frame.receivers is None or not len(frame.receivers.distance):
            return
        seen = frame.snapshot.world.visibility
        flags = lights.DIFFUSE_FLAG * seen.diffuse + lights.GLOSSY_FLAG * seen.glossy
        flags += lights.SHADOW_FLAG + lights.TRACED_FLAG
        maps_of = self._shadows[frame.settings.get(self, "shadows")]
        resolution = maps_of.resolution(frame)
        cell = maps_of.cell(frame, frame.sample, frame.settings.samples)
        shadows = frame.snapshot.casts_shadows
        jitter = (*frame.random("map/environment"), *frame.random("map/environment/turn"))
        kinds = 1 << lights.SUN | (cell >= 1.0) << lights.WHOLE
        points = []
        for light in self._lights(frame):
            emitter = _emitter(light, flags)
            sample = emitter.middle() if cell >= 1.0 else emitter.sample(*frame.random_volume("light"))
            views = []
            if shadows:
                reach = cell * np.tan(min(emitter.radius, 1.5))
                views = depth_maps.directional_views(sample, frame.receivers, frame.geometry, jitter, resolution, reach)
                views = [replace(view, cell=cell) for view in views]
            row = emitter.row(sample, 0, len(views))
            row[lights.LIGHT.at.flags] += lights.WHOLE_FLAG * (cell >= 1.0)
            row[lights.LIGHT.at.rate] = NO_SHARE
            points.append(LightPoint(row, maps_of, views))
        frame.count(self, "maps", sum(len(point.views) for point in points))
        yield from light_surfaces(frame, self, points, kinds, self._sources)

    def _lights(self, frame: Frame) -> list[area_fit.AreaLight]:
        """Fitted anew when the world or the number of lights has changed."""
        world, budget = frame.environment, frame.settings.get(self, "lights")
        if self._fitted is None or self._fitted[0]() is not world or self._fitted[1] != budget:
            self._fitted = weakref.ref(world), budget, fitted(world, budget)
            frame.count(self, "fits")
        frame.count(self, "area lights", len(self._fitted[2]))
        return self._fitted[2]

    def release(self) -> None:
        for shadows in self._shadows.values():
            shadows.release()
        self._sources.release()
        self._fitted = None


def _with_resolution_of(owner: Technique, kind: type[SoftMaps]) -> SoftMaps:
    """Maps with the settings of their own technique, apart from the resolution; so many lights look for no contacts."""

    class Owned(kind):
        contact_rays = 0

        def resolution(self, frame: Frame) -> int:
            return 1 << round(np.log2(map_resolution(frame, frame.settings.get(owner, "texels_per_pixel"))))

    return Owned()


def fitted(world: Environment, budget: int) -> list[area_fit.AreaLight]:
    """The world's lights."""
    return area_fit.fit(area_fit.cube_energy(world.pixels * world.color, world.rotation), budget)


def _emitter(light: area_fit.AreaLight, flags: int) -> lights.Emitter:
    """The light as a sun of even radiance; no light of the scene belongs to it."""
    zero = np.zeros(3)
    return lights.Emitter(
        None, lights.SUN, flags, light.direction, light.half_angle, light.energy / light.solid_angle,
        light.solid_angle, -light.direction, 0.0, zero, zero, zero,
    )  # fmt: skip
