"""Environment light: the world as directional lights, drawn in proportion to its radiance, each with a depth map.

The light probes guide the drawing (light_probes.py): a room lit through a window spends its directions on the window,
and no scene spends them on the ground below it.

    L(x, v) = mean over samples of  f(x, v, w) cos(w) L_world(w) V(x, w) / p(w)

Directions w come from a low-discrepancy set warped by the world's luminance (addon/frame/environment.py); V is an
orthographic depth map along w over what the camera sees, so it converges to the truth with any occluder.

| cost | per sample |
|---|---|
| maps | `directions` orthographic views (more where the picture reaches from near to far) |
| passes | 1 over the screen |

Fails: a mirror-like lobe sees single directions as dots; traced rays take its light instead (see traced_glossy).
Few samples under an even sky show faint overlapping hard shadows.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..frame import depth_maps, lights
from ..frame.rates import Rate
from ..frame.run import Frame
from ..frame.settings import Settings
from ..frame.technique import Param, Technique
from ..snapshot.scene import Snapshot
from .accumulated_maps import RESOLUTION, DepthMapService, map_resolution, rounds
from .direct_light import DIRECT_WRITES, shade
from .light_probes import WORLD
from .surfaces import SURFACES


def directions_rate(frame: Frame) -> Rate:
    """How many directions of the world a sample draws. Auto asks the probes, or shares six maps with the lights."""
    asked = frame.settings.values.get((EnvironmentLight.name, "directions"), 0)
    if not asked and WORLD in frame.rates:
        return frame.rates[WORLD]
    return Rate(int(np.log2(asked or max(2, 6 - len(frame.snapshot.lights)))))


def no_environment_light(snapshot: Snapshot) -> str | None:
    """Why the world lights nothing, as a sentence; None if it does. For every technique of the slot."""
    world = snapshot.world
    if not np.any(world.color) or (world.image is not None and not np.any(world.image.pixels[..., :3])):
        return "the world is black"
    if not (world.visibility.diffuse or world.visibility.glossy):
        return "the world is hidden from all surfaces"
    if not snapshot.instances:
        return "the scene has no surface"
    return None


class EnvironmentLight(Technique):
    name = "environment_light"
    label = "Environment light"
    slot = "environment"
    params = (
        Param(
            "directions",
            "Directions",
            0,
            "Directions of the world that are drawn per sample, as a power of two; 0: by the error they leave",
            0,
            64,
        ),
        RESOLUTION,
    )
    reads = SURFACES
    writes = DIRECT_WRITES
    uses = ("rates",)

    def __init__(self):
        self.service = DepthMapService()
        self._sources = lights.Sources()

    def skip(self, snapshot: Snapshot, settings: Settings) -> str | None:
        return no_environment_light(snapshot)

    def run(self, frame: Frame) -> Iterator[None]:
        if frame.receivers is None or not len(frame.receivers.distance):
            return
        seen = frame.snapshot.world.visibility
        flags = (
            lights.SHADOW_FLAG
            + lights.TRACED_FLAG
            + lights.DIFFUSE_FLAG * seen.diffuse
            + lights.GLOSSY_FLAG * seen.glossy
        )
        resolution = map_resolution(frame, frame.settings.get(self, "texels_per_pixel"))
        rate = directions_rate(frame)
        shadows = any(instance.visibility.shadow for instance in frame.snapshot.instances)
        items = []
        for number in rate.points(frame.sample):
            direction, radiance, density = frame.environment.draw(*frame.random_at(number, "environment"))
            views = []
            if shadows:
                jitter = (
                    *frame.random_at(number, "map/environment"), *frame.random_at(number, "map/environment/turn")
                )  # fmt: skip
                views = depth_maps.directional_views(direction, frame.receivers, frame.geometry, jitter, resolution)
            row = lights.direction_row(direction, radiance / density, density, flags, 0, len(views), rate.per_sample)
            items.append((row, views))
        for rows, views in rounds(items, resolution):
            maps = self.service.draw(frame, self, views, resolution)
            yield
            yield from shade(frame, self, rows, 1 << lights.DIRECTION, self._sources, maps)

    def release(self) -> None:
        self.service.release()
        self._sources.release()
