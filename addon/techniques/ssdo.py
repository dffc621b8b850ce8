"""Screen-space bounce: indirect light between the surfaces that the picture shows, by bits of visibility.

    L_ind(x) = albedo / pi * integral over the hemisphere of  L(y(w)) cos(w) dw

y(w) is sought on the screen alone. Half planes through x and the viewer ("fans") are lines there: a walk along one
meets the surfaces in the order of their distance from x. Each step stands for the piece of the tangent plane that it
finds between its two ends, takes those of the fan's 32 sectors that nothing before it took, and sends its radiance
through them. Sectors are equal shares of the cosine-weighted solid angle (shaders/ssdo/fan.glsl), so a step's weight is
the form factor of what is seen of its patch: bounded by the sectors, where A cos cos / d^2 of the thesis needs a clamp.
Patches that face away take their sectors and send nothing. What is seen from the viewer is `thickness` thick, so that
light passes behind posts.

L is the direct diffuse light of this very sample (the difference of two sums), with glossy reflection counted as
diffuse; the next bounce sends what the one before brought. The mean over the samples has no lag: what is left is bias.

`visibility` POINTS is the thesis's own way for comparison: as many points as bits have steps, in a half ball of the
radius; those below what is seen are solid, and each sends as a patch of pi r^2 / N, bounded by the directions that it
stands for. A blocker at distance t is met with the chance 1 - t / r, so it fits small radii only.

Sources: Ritschel, Grosch and Seidel 2009 (SSDO, the bounce); Therrien, Levesque and Gilet 2023 (bits for sectors).

| cost | per sample |
|---|---|
| passes | 2 + 3 per bounce, over the screen |
| fetches per pixel and bounce | `fans` x `steps` x 3; later bounces have half the fans of the one before |

Instead of instant_radiosity, never beside it: both estimate the whole integral (see there how near and far light share
it without being doubled), and one slot holds one of them.

Bias, all in diffuse indirect light, and by design: surfaces off the screen, behind others or turned away from the
viewer send nothing and hide nothing, and hidden sides are as thick as `thickness`. Metals send nothing, and nothing is
reflected on glossy surfaces.
"""

from __future__ import annotations

import numpy as np

from ..frame.run import Frame
from ..frame.settings import Settings
from ..frame.technique import Param, Technique, Write
from ..frame.view import VIEW
from ..gfx import images, passes
from ..gfx.library import Program
from ..snapshot.scene import Snapshot
from .instant_radiosity import INDIRECT_WRITES, no_indirect_light
from .neighbours import reflect
from .surfaces import SURFACE_TEXTURES, SURFACES, surface_bindings

FAN_TEXTURES = (*SURFACE_TEXTURES, ("FLOAT_2D", "energy_table"))
FAN_CONSTANTS = (("INT", "fan_count"), ("INT", "step_count"), ("FLOAT", "farthest"), ("FLOAT", "thickness"))
BITS, POINTS = "BITS", "POINTS"
BOUNCE_BITS, BOUNCE_POINTS = (
    passes.fullscreen_program(
        f"screen-space bounce, {kind}",
        f"ssdo/{file}.frag.glsl",
        textures=(*FAN_TEXTURES, ("FLOAT_2D", "senders")),
        blocks=((VIEW, "film_view"),),
        constants=FAN_CONSTANTS,
        outputs=(("VEC4", "out_arriving"),),
    )
    for kind, file in (("bits", "bounce"), ("points", "bounce_points"))
)
BOUNCE = {BITS: BOUNCE_BITS, POINTS: BOUNCE_POINTS}
SENDERS_OF_SUMS, SENDERS = (
    passes.fullscreen_program(
        name,
        "ssdo/senders.frag.glsl",
        textures=(*FAN_TEXTURES, *(("FLOAT_2D", texture) for texture in textures)),
        blocks=((VIEW, "film_view"),),
        defines=defines,
        outputs=(("VEC4", "out_senders"),),
    )
    for name, textures, defines in (
        ("senders of direct light", ("sum_now", "sum_before"), (("FROM_SUMS", ""),)),
        ("senders of a bounce", ("arriving",), ()),
    )
)
KEEP = passes.fullscreen_program(
    "sums so far", "ssdo/keep.frag.glsl", textures=(("FLOAT_2D", "sum_now"),), outputs=(("VEC4", "out_sum"),)
)


def fan_params(radius: float, thickness: float) -> tuple[Param, ...]:
    """Parameters of a technique that walks along fans, with its own defaults; lengths in median distances."""
    return (
        Param(
            "visibility", "Visibility", BITS,
            "How surfaces hide each other: bits for sectors of half planes, or points in a half ball of a small radius",
            items=((BITS, "Bits", 0), (POINTS, "Points", 1)),
        ),
        Param("fans", "Fans", 4, "Directions on the screen that each pixel searches in a sample", 1, 64, draft=2),
        Param("steps", "Steps", 16, "Places that are looked at along each", 2, 64, draft=12),
        Param("radius", "Radius", radius, "How far surfaces matter, in median distances of what is seen", 0.01, 100.0),
        Param(
            "thickness", "Thickness", thickness,
            "How far surfaces reach behind what is seen of them, in median distances of what is seen", 0.0, 10.0,
        ),
    )  # fmt: skip


class ScreenSpaceBounce(Technique):
    name = "ssdo"
    label = "Screen-space bounce"
    slot = "indirect"
    params = (
        *fan_params(radius=4.0, thickness=0.1),
        Param("bounces", "Bounces", 4, "At most so many of the scene's bounces are gathered", 1, 8, draft=2),
    )
    reads = (*SURFACES, "radiance.diffuse_direct")
    writes = (
        *INDIRECT_WRITES,
        Write("ssdo.direct", "RGBA32F", "Sum of direct diffuse light up to the sample before"),
        Write("ssdo.senders", "RGBA32F", "Radiance that surfaces send to each other in this sample"),
    )

    def skip(self, snapshot: Snapshot, settings: Settings) -> str | None:
        return no_indirect_light(snapshot, settings)

    def run(self, frame: Frame) -> None:
        if frame.receivers is None or not len(frame.receivers.distance):
            return
        if frame.sample == 0:
            frame.target("ssdo.direct").clear()
        direct = {"sum_now": frame.images["radiance.diffuse_direct"], "sum_before": frame.images["ssdo.direct"]}
        self._send(frame, SENDERS_OF_SUMS, direct)
        bounces = min(frame.settings.bounces, frame.settings.get(self, "bounces"))
        with images.borrowed(*frame.size, "RGBA32F") as arriving:
            for bounce in range(bounces):
                if bounce:
                    self._send(frame, SENDERS, {"arriving": arriving.colors[0]})
                self._gather(frame, arriving, max(frame.settings.get(self, "fans") >> bounce, 1))
                reflect(frame, self, arriving.colors[0], "radiance.diffuse_indirect")
        passes.fullscreen(KEEP, frame.target("ssdo.direct"), textures={"sum_now": direct["sum_now"]})
        frame.count(self, "passes", 2 + 3 * bounces)

    def _send(self, frame: Frame, program: Program, light: dict[str, images.Image]) -> None:
        passes.fullscreen(
            program,
            frame.target("ssdo.senders"),
            textures={**surface_bindings(frame), "energy_table": frame.materials.energy_table, **light},
            blocks={"film_view": frame.view_block},
        )

    def _gather(self, frame: Frame, arriving: images.Target, fans: int) -> None:
        bindings = fan_bindings(frame, self)
        bindings["textures"]["senders"] = frame.images["ssdo.senders"]
        bindings["constants"]["fan_count"] = fans
        passes.fullscreen(BOUNCE[frame.settings.get(self, "visibility")], arriving, **bindings)


def fan_bindings(frame: Frame, technique: Technique) -> dict:
    """What shaders/ssdo/fan.glsl needs, by the parameters of a technique that has FAN_PARAMS."""
    distance = float(np.median(frame.receivers.distance))
    return {
        "textures": {**surface_bindings(frame), "energy_table": frame.materials.energy_table},
        "blocks": {"film_view": frame.view_block},
        "constants": {
            "fan_count": frame.settings.get(technique, "fans"), "step_count": frame.settings.get(technique, "steps"),
            "farthest": frame.settings.get(technique, "radius") * distance,
            "thickness": frame.settings.get(technique, "thickness") * distance,
        },
    }  # fmt: skip
