"""Directional occlusion: light of the world where nothing that the picture shows stands before it.

    L(x) = albedo * mean over fans of  sum over groups of sectors  L_world(w) (sectors that nothing hides) / 32

Half planes through x and the viewer are searched on the screen as in ssdo.py; of their 32 sectors, equal shares of the
cosine-weighted solid angle, the hidden ones are marked, and groups of eight read the world in a direction of their own.
So shadows have the colour, direction and softness of the light that is missing there (Ritschel, Grosch and Seidel 2009;
sectors after Therrien, Levesque and Gilet 2023). An open plane has all its light at every tilt: no sector is lost to
the surface itself, and the fans' weights are equal.

| cost | per sample |
|---|---|
| passes | 2 over the screen (3 if the sample is shown alone), no depth map |
| fetches per pixel | `fans` x (2 x `steps` + 16) |

For pictures of one sample, outdoors: there it replaces a few hard shadows of environment_light by smooth shade. Auto
takes environment_light, whose error falls with the samples.

Bias, in diffuse direct light, by design: what is off the screen, hidden, or farther than `radius` hides nothing, so
light gets into rooms through walls that the camera does not see; hidden sides are as thick as `thickness`. The world is
blurred to cells of 5.6 degrees, and small suns in it are noise. Glossy lobes get the world by rays (traced_glossy), not
from here; translucent and velvet ones get none.
"""

from __future__ import annotations

import numpy as np

from ..frame.environment import WORLD, Environment
from ..frame.run import Frame
from ..frame.settings import Settings
from ..frame.technique import Technique
from ..frame.view import VIEW
from ..gfx import images, passes
from ..snapshot.scene import Snapshot
from .direct_light import DIRECT_WRITES
from .environment_light import no_environment_light
from .neighbours import reflect
from .ssdo import BITS, FAN_CONSTANTS, FAN_TEXTURES, POINTS, fan_bindings, fan_params
from .surfaces import SURFACES

CELLS = (32, 64)
OCCLUSION_BITS, OCCLUSION_POINTS = (
    passes.fullscreen_program(
        f"directional occlusion, {kind}",
        f"ssdo/{file}.frag.glsl",
        textures=(*FAN_TEXTURES, ("FLOAT_2D", "environment_map"), ("FLOAT_2D", "environment_density_map")),
        blocks=((VIEW, "film_view"), (WORLD, "world_light")),
        constants=FAN_CONSTANTS,
        outputs=(("VEC4", "out_arriving"),),
    )
    for kind, file in (("bits", "occlusion"), ("points", "occlusion_points"))
)
OCCLUSION = {BITS: OCCLUSION_BITS, POINTS: OCCLUSION_POINTS}


class DirectionalOcclusion(Technique):
    name = "directional_occlusion"
    label = "Directional occlusion"
    slot = "environment"
    params = fan_params(radius=1.0, thickness=0.2)
    reads = SURFACES
    writes = DIRECT_WRITES

    def __init__(self):
        self._blurred: tuple[Environment, images.Image] | None = None

    def skip(self, snapshot: Snapshot, settings: Settings) -> str | None:
        reason = no_environment_light(snapshot)
        return reason or (None if snapshot.world.visibility.diffuse else "the world is hidden from diffuse surfaces")

    def run(self, frame: Frame) -> None:
        if frame.receivers is None or not len(frame.receivers.distance):
            return
        if self._blurred is None or self._blurred[0] is not frame.environment:
            pixels = blurred(frame.environment.pixels)
            self._blurred = frame.environment, images.upload(np.dstack([pixels, np.ones(pixels.shape[:2])]))
        bindings = fan_bindings(frame, self)
        bindings["textures"]["environment_map"] = self._blurred[1]
        bindings["textures"]["environment_density_map"] = frame.environment.density_map
        bindings["blocks"]["world_light"] = frame.environment.block
        with images.borrowed(*frame.size, "RGBA32F") as arriving:
            passes.fullscreen(OCCLUSION[frame.settings.get(self, "visibility")], arriving, **bindings)
            reflect(frame, self, arriving.colors[0], "radiance.diffuse_direct")
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
