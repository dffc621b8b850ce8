"""Screen-space bounce: indirect light between the surfaces that the picture shows, and rays for what it does not.

    L_ind(x) = albedo / pi * integral over the hemisphere of  L(y(w)) cos(w) dw

y(w) is sought on the screen first. Half planes through x and the viewer ("fans") are lines there: a walk along one
meets the surfaces in the order of their distance from x. Each step stands for the piece of the tangent plane between
its two ends, takes those of the fan's 32 sectors that nothing before it took, and sends its radiance through them.
Sectors are equal shares of the cosine-weighted solid angle (shaders/ssdo/fan.glsl), so that a step's weight is the
bounded form factor of what is seen of its patch. Patches that face away take their sectors and send nothing; what is
seen is `thickness` thick.

Of the sectors that brought no light one is drawn and traced (`rays`), with the light of its further reflections; glossy
surfaces trace one ray of their lobe. So each direction is estimated once, by the screen or by a ray. L is the direct
diffuse light of this very sample, gloss counted as diffuse, and each bounce sends what the one before brought.

`visibility` POINTS is the thesis's own way, for comparison: points in a half ball, solid where below what is seen.
Sources: Ritschel, Grosch and Seidel 2009 (SSDO, the bounce); Therrien, Levesque and Gilet 2023 (bits for sectors).

| cost | per sample |
|---|---|
| passes | 3 per bounce, over the screen, and 1 with rays |
| fetches per pixel and bounce | `fans` x `steps` x 3; later bounces have half the fans of the one before |
| rays per pixel | 1 or 2 per vertex of one path, of 1 / (1 - albedo) vertices in the mean |

Bias (diffuse indirect light), by design: surfaces reach up to a step beyond their edges and hidden sides are
`thickness` thick: up to a tenth of the light where posts stand close. Metals send nothing on the screen. The last
bounces before the limit may be counted once more than allowed. Beyond `radius` steps are wider than a lit door at the
end of a corridor, so rays look (.67 of the light to .95). Fails: without rays, what is off the screen or hidden sends
nothing (up to four fifths); for part of it the thesis peels layers and adds cameras, rays see all. Auto takes instant
radiosity, whose error goes to zero. Figures: docs/log/2026-11-26-indirect-light.md.
"""

from __future__ import annotations

from collections.abc import Iterator

from ..film.neighbours import reflect
from ..frame.picture import Frame
from ..frame.settings import Settings
from ..frame.technique import Param, Technique, Write
from ..gfx import images, passes
from ..gfx.library import Program
from ..lighting.asked import lit_at_hits
from ..lighting.virtual_lights import PATH_BLOCKS, PATH_CONSTANTS, PATH_TEXTURES, VirtualLights
from ..scene import acceleration
from ..scene.view import VIEW
from ..snapshot.panorama import bends_lines
from ..snapshot.scene import Snapshot
from ..surfaces.draw import SURFACE_TEXTURES, SURFACES, surface_bindings
from .instant_radiosity import INDIRECT_WRITES, no_indirect_light

FAN_TEXTURES = (*SURFACE_TEXTURES, ("RGBA32F", "energy_table"))
FAN_CONSTANTS = (("INT", "fan_count"), ("INT", "step_count"), ("FLOAT", "farthest"), ("FLOAT", "thickness"))
BITS, POINTS = "BITS", "POINTS"
BOUNCE_BITS, BOUNCE_POINTS, BOUNCE_RAYS = (
    passes.fullscreen_program(
        f"screen-space bounce, {kind}",
        f"ssdo/{file}.frag.glsl",
        textures=(*textures, ("FLOAT_2D", "senders")),
        blocks=blocks,
        constants=(*constants, *FAN_CONSTANTS),
        defines=defines,
        outputs=(("VEC4", "out_arriving"),),
    )
    for kind, file, textures, blocks, constants, defines in (
        ("bits", "bounce", FAN_TEXTURES, ((VIEW, "film_view"),), (), ()),
        ("points", "bounce_points", FAN_TEXTURES, ((VIEW, "film_view"),), (), ()),
        ("bits and rays", "bounce", PATH_TEXTURES, PATH_BLOCKS, PATH_CONSTANTS, (("RAYS", ""),)),
    )
)
GLOSSY = passes.fullscreen_program(
    "glossy reflection of surfaces",
    "ssdo/glossy.frag.glsl",
    textures=PATH_TEXTURES,
    blocks=PATH_BLOCKS,
    constants=(*PATH_CONSTANTS, *FAN_CONSTANTS),
    outputs=(("VEC4", "out_glossy"),),
)
SENDERS_OF_LIGHT, SENDERS = (
    passes.fullscreen_program(
        name,
        "ssdo/senders.frag.glsl",
        textures=(*FAN_TEXTURES, *(("FLOAT_2D", texture) for texture in textures)),
        blocks=((VIEW, "film_view"),),
        defines=defines,
        outputs=(("VEC4", "out_senders"),),
    )
    for name, textures, defines in (
        ("senders of direct light", ("direct",), (("FROM_LIGHT", ""),)),
        ("senders of a bounce", ("arriving",), ()),
    )
)


def fan_params(radius: float, thickness: float) -> tuple[Param, ...]:
    """Parameters of a technique that walks along fans, with its own defaults; lengths in median distances."""
    return (
        Param(
            "visibility", "Visibility", BITS,
            "How occlusion is found: by a bit mask of sectors in half planes, or by points in a hemisphere of a "
            "small radius",
            items=(
                (BITS, "Bits", 0, "One bit for each sector of a half plane: surfaces near and far"),
                (POINTS, "Points", 1, "Points in a half ball of the radius"),
            ),
        ),
        Param("fans", "Fans", 4, "Screen directions that each pixel searches in a sample", 1, 64, draft=2),
        Param("steps", "Steps", 16, "Steps along each screen direction", 2, 64, draft=12),
        Param(
            "radius", "Radius", radius,
            "Search radius, as a multiple of the median distance of visible surfaces",
            0.01, 100.0,
        ),
        Param(
            "thickness", "Thickness", thickness,
            "Assumed thickness of visible surfaces, as a multiple of their median distance",
            0.0, 10.0,
        ),
    )  # fmt: skip


class ScreenSpaceBounce(Technique):
    name = "ssdo"
    label = "Screen-space bounce"
    fills = ("indirect",)
    params = (
        *fan_params(radius=1.0, thickness=0.1),
        Param("rays", "Rays", True, "Trace one ray per pixel and sample for what the screen does not show"),
        Param("bounces", "Bounces", 8, "Maximum number of bounces, up to that of the scene", 1, 16, draft=2),
    )
    reads = (*SURFACES, "radiance.diffuse_direct")
    writes = (
        *INDIRECT_WRITES,
        Write("ssdo.senders", "RGBA32F", "Radiance that surfaces send to each other in this sample"),
    )

    def __init__(self):
        self._paths = VirtualLights()

    def skip(self, snapshot: Snapshot, settings: Settings) -> str | None:
        return no_indirect_light(snapshot, settings) or bends_lines(snapshot)

    def begin(self, frame: Frame) -> None:
        if self._traces(frame):
            self._paths.begin(frame)

    def sample(self, frame: Frame) -> Iterator[None]:
        if frame.receivers is None or not len(frame.receivers.distance):
            return
        self._send(frame, SENDERS_OF_LIGHT, {"direct": frame.images["radiance.diffuse_direct"]})
        traced = self._traces(frame)
        if traced:
            self._paths.draw_sources(frame)
            target = frame.target("radiance.glossy_indirect")
            yield from self._in_bands(frame, GLOSSY, target, self._bindings(frame, True), "ADDITIVE_PREMULT")
        bounces = min(frame.settings.bounces, frame.settings.get(self, "bounces"))
        with images.borrowed(*frame.size, "RGBA32F") as arriving:
            for bounce in range(bounces):
                if bounce:
                    self._send(frame, SENDERS, {"arriving": arriving.colors[0]})
                fans = max(frame.settings.get(self, "fans") >> bounce, 1)
                with_rays = traced and not bounce
                yield from self._gather(frame, arriving, fans, with_rays)
                reflect(frame, self, arriving.colors[0], "radiance.diffuse_indirect", noisy=with_rays)
        frame.count(self, "passes", traced + 3 * bounces)
        if traced:
            frame.count(self, "paths", frame.size[0] * frame.size[1])

    def _traces(self, frame: Frame) -> bool:
        """Whether rays look for what the screen does not show."""
        wanted = frame.settings.get(self, "rays") and frame.settings.get(self, "visibility") == BITS
        return wanted and not acceleration.too_many(frame.snapshot)

    def _send(self, frame: Frame, program: Program, light: dict[str, images.Image]) -> None:
        passes.fullscreen(
            program,
            frame.target("ssdo.senders"),
            textures={**surface_bindings(frame), "energy_table": frame.materials.energy_table, **light},
            blocks={"film_view": frame.view_block},
        )

    def _gather(self, frame: Frame, arriving: images.Target, fans: int, with_rays: bool) -> Iterator[None]:
        program = BOUNCE_POINTS if frame.settings.get(self, "visibility") == POINTS else BOUNCE_BITS
        bindings = self._bindings(frame, with_rays)
        bindings["textures"]["senders"] = frame.images["ssdo.senders"]
        bindings["constants"]["fan_count"] = fans
        yield from self._in_bands(frame, BOUNCE_RAYS if with_rays else program, arriving, bindings)

    def _bindings(self, frame: Frame, with_rays: bool) -> dict:
        bindings = fan_bindings(frame, self)
        if with_rays:
            paths = self._paths.path_bindings(frame)
            bindings = {kind: {**bound, **paths[kind]} for kind, bound in bindings.items()}
        return bindings

    def _in_bands(self, frame: Frame, program: Program, target, bindings: dict, blend="NONE") -> Iterator[None]:
        program = lit_at_hits(frame, program, bindings["textures"])
        for rows in frame.bands(self):
            passes.fullscreen(program, target, rows=rows, blend=blend, **bindings)
            yield

    def release(self) -> None:
        self._paths.release()


def fan_bindings(frame: Frame, technique: Technique) -> dict:
    """What shaders/ssdo/fan.glsl needs, by the parameters that `fan_params` declares."""
    distance = frame.typical_distance
    return {
        "textures": {**surface_bindings(frame), "energy_table": frame.materials.energy_table},
        "blocks": {"film_view": frame.view_block},
        "constants": {
            "fan_count": frame.settings.get(technique, "fans"), "step_count": frame.settings.get(technique, "steps"),
            "farthest": frame.settings.get(technique, "radius") * distance,
            "thickness": frame.settings.get(technique, "thickness") * distance,
        },
    }  # fmt: skip
