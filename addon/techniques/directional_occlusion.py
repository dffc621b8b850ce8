"""Directional occlusion: light of the world where nothing blocks it, tested on the screen first, then by a ray.

    L(x) = albedo * mean over fans of  V * sum over groups of sectors  L_world(w) (sectors that nothing hides) / 32

Half planes through x and the viewer ("fans") are searched on the screen as in ssdo.py. Of their 32 sectors, equal
shares of the cosine-weighted solid angle, the hidden ones are marked, and groups of eight read the world in a direction
of their own. So shadows have the colour, direction and softness of the light that is missing there. An open plane has
all its light at every tilt: no sector is lost to the surface itself, and the fans' weights are equal. V: one ray
(`rays`), in a direction drawn in proportion to the light that the screen leaves of a fan, finds casters that the
picture does not show.

Sources: Ritschel, Grosch and Seidel 2009 (SSDO); sectors after Therrien, Levesque and Gilet 2023.

| cost | per sample |
|---|---|
| passes | 2 over the screen (4 if the sample is shown alone), no depth map |
| fetches per pixel | `fans` x (2 x `steps` + 16) |
| rays per pixel | `fans` |

For pictures of one sample, where it replaces a few hard shadows of environment_light by smooth shading. Auto does not
take it: the others light every closure, this one diffuse closures only, and the error of environment_light falls to
zero with the samples. Errors beside both: docs/log/2026-11-26-environment.md.

Bias (diffuse direct light), by design: surfaces hide up to a step more than they are (0.94 to 0.99 of the light is
left), hidden sides are as thick as `thickness`, and the world is blurred to cells of 5.6 degrees; small suns in it are
noise.

Fails: without rays, or with more than 4 million triangles, what is off the screen, hidden, or farther than `radius`
blocks nothing, so light enters rooms through walls that the camera does not see. Glossy lobes get the world by rays
(traced_glossy); translucent and sheen lobes get none.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..film.neighbours import reflect
from ..frame.picture import Frame
from ..frame.settings import Settings
from ..frame.technique import Param, Technique
from ..gfx import images, passes
from ..lighting import repeated_light
from ..lighting.asked import asked
from ..lighting.loop import DIRECT_WRITES
from ..scene import acceleration
from ..scene.view import VIEW
from ..snapshot.panorama import bends_lines
from ..snapshot.scene import Snapshot
from ..sources.environment import WORLD, Environment
from ..surfaces.draw import SURFACES
from .environment_light import no_environment_light
from .ssdo import BITS, FAN_CONSTANTS, FAN_TEXTURES, fan_bindings, fan_params

CELLS = (32, 64)
ENVIRONMENT_TEXTURES = (("RGBA32F", "environment_map"), ("R32F", "environment_density_map"))
OCCLUSION_BITS, OCCLUSION_POINTS, OCCLUSION_RAYS = (
    passes.fullscreen_program(
        f"directional occlusion, {kind}",
        f"ssdo/{file}.frag.glsl",
        textures=(*FAN_TEXTURES, *ENVIRONMENT_TEXTURES, *textures),
        blocks=((VIEW, "film_view"), (WORLD, "world_light")),
        constants=(*FAN_CONSTANTS, *constants),
        defines=defines,
        outputs=(("VEC4", "out_arriving"),),
    )
    for kind, file, textures, constants, defines in (
        ("bits", "occlusion", (), (), ()),
        ("points", "occlusion_points", (), (), ()),
        (
            "bits and rays",
            "occlusion",
            acceleration.HIERARCHY_TEXTURES,
            (("FLOAT", "offset_size"),),
            (("RAYS", ""),),
        ),
    )
)


class DirectionalOcclusion(Technique):
    name = "directional_occlusion"
    label = "Directional occlusion"
    fills = ("environment",)
    params = (
        *fan_params(radius=1.0, thickness=0.02),
        Param("rays", "Rays", True, "Trace one ray for each screen direction, for what the screen does not show"),
    )
    reads = SURFACES
    writes = DIRECT_WRITES

    def __init__(self):
        self._blurred: tuple[Environment, images.Image] | None = None

    def skip(self, snapshot: Snapshot, settings: Settings) -> str | None:
        reason = no_environment_light(snapshot) or bends_lines(snapshot)
        return reason or (None if snapshot.world.visibility.diffuse else "the world is hidden from diffuse surfaces")

    def sample(self, frame: Frame) -> Iterator[None]:
        if frame.receivers is None or not len(frame.receivers.distance):
            return
        if self._blurred is None or self._blurred[0] is not frame.environment:
            pixels = blurred(frame.environment.pixels)
            self._blurred = frame.environment, images.upload(np.dstack([pixels, np.ones(pixels.shape[:2])]))
        bindings = fan_bindings(frame, self)
        bindings["textures"]["environment_map"] = self._blurred[1]
        bindings["textures"]["environment_density_map"] = frame.environment.density_map
        bindings["blocks"]["world_light"] = frame.environment.block
        program = OCCLUSION_POINTS
        traced = False
        if frame.settings.get(self, "visibility") == BITS:
            hierarchy = frame.hierarchy("shadow") if frame.settings.get(self, "rays") else None
            traced = hierarchy is not None
            program = OCCLUSION_RAYS if traced else OCCLUSION_BITS
        if traced:
            bindings["textures"] |= hierarchy.textures
            bindings["constants"] |= {
                "offset_size": frame.offset_size,
            }  # fmt: skip
            frame.count(self, "rays", frame.size[0] * frame.size[1] * frame.settings.get(self, "fans"))
        program = asked(frame, program, bindings["textures"])
        with images.borrowed(*frame.size, "RGBA32F") as arriving:
            for rows in frame.bands(self):
                passes.fullscreen(program, arriving, rows=rows, **bindings)
                yield
            reflect(frame, self, arriving.colors[0], "radiance.diffuse_direct", noisy=traced)
            repeated_light.forbid(frame)
        frame.count(self, "passes", 2)

    def release(self) -> None:
        self._blurred = None


def blurred(pixels: np.ndarray) -> np.ndarray:
    """An equirectangular image (H, W, 3) as means over at most CELLS cells, weighted by solid angle."""
    height, width = pixels.shape[:2]
    rows, columns = min(height, CELLS[0]), min(width, CELLS[1])
    edges = np.sin((np.arange(height + 1) / height - 0.5) * np.pi)
    weight = np.diff(edges)[:, None, None] * np.ones((1, width, 1))
    first_row, first_column = np.arange(rows) * height // rows, np.arange(columns) * width // columns

    def total(values):
        return np.add.reduceat(np.add.reduceat(values, first_row, axis=0), first_column, axis=1)

    return (total(pixels * weight) / total(weight)).astype(np.float32)
