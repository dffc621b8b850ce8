"""Environment light: the world as directional lights, drawn in proportion to its radiance, each with a depth map.

Before the first sample, probes spread over the picture trace one ray into each cell of a grid of directions; how often
light from there arrives guides the drawing (addon/frame/environment.py: guide). A room lit through a window then
spends its directions on the window, and no scene spends them on the ground below it.

    L(x, v) = mean over samples of  f(x, v, w) cos(w) L_world(w) V(x, w) / p(w)

Directions w come from a low-discrepancy set warped by the world's luminance (addon/frame/environment.py); V is an
orthographic depth map along w over what the camera sees, so it converges to the truth with any occluder.

| cost | per sample |
|---|---|
| maps | `directions` orthographic views (more where the picture reaches from near to far) |
| passes | 1 over the screen |
| first sample | 48 x 512 rays |

Fails: a mirror-like lobe sees single directions as dots; traced rays take its light instead (see traced_glossy).
Few samples under an even sky show faint overlapping hard shadows.
"""

from __future__ import annotations

import numpy as np

from ..frame import depth_maps, environment, lights
from ..frame.run import Frame
from ..frame.settings import Settings
from ..frame.technique import Param, Technique
from ..frame.view import VIEW
from ..gfx import images, passes
from ..snapshot.scene import Snapshot
from .accumulated_maps import RESOLUTION, DepthMapService, map_resolution, rounds
from .direct_light import DIRECT_WRITES, shade
from .surfaces import SURFACE_TEXTURES, SURFACES, surface_bindings

PROBES = (8, 6)
GUIDE = passes.fullscreen_program(
    "environment guide",
    "light/guide.frag.glsl",
    textures=(*SURFACE_TEXTURES, ("FLOAT_2D", "trace_nodes"), ("FLOAT_2D", "trace_leaves")),
    blocks=((VIEW, "film_view"),),
    constants=(
        ("INT", "trace_levels"), ("INT", "columns"), ("INT", "rows"), ("IVEC2", "probes"), ("FLOAT", "offset_size"),
    ),
    outputs=(("FLOAT", "out_useful"),),
)  # fmt: skip


def directions_per_sample(frame: Frame) -> int:
    """How many directions of the world each sample draws. Auto shares a budget of six maps with the lights."""
    asked = frame.settings.values.get((EnvironmentLight.name, "directions"), 0)
    return asked or max(2, 6 - len(frame.snapshot.lights))


class EnvironmentLight(Technique):
    name = "environment_light"
    label = "Environment light"
    slot = "environment"
    params = (
        Param(
            "directions",
            "Directions",
            0,
            "Directions of the world that are drawn per sample; 0: more where fewer lights need the time",
            0,
            64,
        ),
        RESOLUTION,
        Param("guiding", "Guiding", True, "Draw more directions from where light reaches what the camera sees"),
    )
    reads = SURFACES
    writes = DIRECT_WRITES

    def __init__(self):
        self.service = DepthMapService()
        self._sources = lights.Sources()

    def skip(self, snapshot: Snapshot, settings: Settings) -> str | None:
        world = snapshot.world
        if not np.any(world.color) or (world.image is not None and not np.any(world.image.pixels[..., :3])):
            return "the world is black"
        if not (world.visibility.diffuse or world.visibility.glossy):
            return "the world is hidden from all surfaces"
        if not snapshot.instances:
            return "the scene has no surface"
        return None

    def run(self, frame: Frame) -> None:
        if frame.receivers is None or not len(frame.receivers.distance):
            return
        if frame.sample == 0:
            self._guide(frame)
        seen = frame.snapshot.world.visibility
        flags = (
            lights.SHADOW_FLAG
            + lights.TRACED_FLAG
            + lights.DIFFUSE_FLAG * seen.diffuse
            + lights.GLOSSY_FLAG * seen.glossy
        )
        resolution = map_resolution(frame, frame.settings.get(self, "texels_per_pixel"))
        count = directions_per_sample(frame)
        shadows = any(instance.visibility.shadow for instance in frame.snapshot.instances)
        items = []
        for k in range(count):
            x, y = frame.random(f"environment{k}")
            direction, radiance, density = frame.environment.draw(x, y)
            views = []
            if shadows:
                jitter = (*frame.random(f"map/environment{k}"), *frame.random(f"map/environment{k}/turn"))
                views = depth_maps.directional_views(direction, frame.receivers, frame.geometry, jitter, resolution)
            row = lights.direction_row(direction, radiance / (density * count), density, flags, 0, len(views))
            items.append((row, views))
        for rows, views in rounds(items, resolution):
            shade(frame, self, rows, self._sources, self.service.draw(frame, self, views, resolution))

    def _guide(self, frame: Frame) -> None:
        hierarchy = frame.hierarchy() if frame.settings.get(self, "guiding") else None
        if hierarchy is None:
            frame.environment.guide(None)
            return
        cells = environment.GUIDE_ROWS * environment.GUIDE_COLUMNS
        target = images.Target((images.pool.take(cells, PROBES[0] * PROBES[1], "R32F"),))
        passes.fullscreen(
            GUIDE,
            target,
            textures={**surface_bindings(frame), "trace_nodes": hierarchy.nodes, "trace_leaves": hierarchy.leaves},
            blocks={"film_view": frame.view_block},
            constants={
                "trace_levels": hierarchy.levels, "columns": environment.GUIDE_COLUMNS, "rows": environment.GUIDE_ROWS,
                "probes": PROBES, "offset_size": 1e-6 * frame.geometry.size,
            },
        )  # fmt: skip
        useful = images.read(target.colors[0]).mean(axis=(0, 2))
        images.pool.give(target.colors[0])
        frame.environment.guide(useful.reshape(environment.GUIDE_ROWS, environment.GUIDE_COLUMNS))
        frame.count(self, "guiding rays", cells * PROBES[0] * PROBES[1])

    def release(self) -> None:
        self.service.release()
        self._sources.release()
