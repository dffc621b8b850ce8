"""Volume caustics: light that glass and mirrors focus into media, as beams.

Rays leave a point of each lamp in the cone around all specular objects, are bent and mirrored by the hierarchy, and
each stretch that then lies in a medium is drawn as a quad on the screen. At a pixel it leaves the radiance

    L = flux * sigma_s(x) p(x) T(start, x) T(x, eye) * k(u) / sin(gamma)

with u the distance between the two lines, gamma their angle, and k a tent of area one whose half width is the beam's
own (half the distance to the next ray) or `BEAM_PIXELS`, whichever is more. What smooth glass mirrors is few rays that
bulging sides send apart: their kernels are wider, and grow on their way by the curvature (ray cones). The weight is
that of a photon beam with a one-dimensional kernel: neither rays nor pixels change the sum. Rays take other places in
their texels in each sample.

Airlight's shadow rays take glass for opaque where this runs, so that no light arrives twice.

| cost | per sample and lamp |
|---|---|
| rays | as many as their beams need side by side, at most `rays` squared, up to 10 interfaces each |
| quads | 2 per ray, empty ones clipped; fragments: as long as beams are on screen, times their width |
| memory | 96 bytes per ray |

Sources: Hu, Dong, Ihrke, Grosch, Yuan, Seidel, "Interactive Volume Caustics in Single-Scattering Media", I3D 2010;
Jarosz, Nowrouzezahrai, Sadeghi, Jensen, "A Comprehensive Theory of Volumetric Radiance Estimation Using Photon Points
and Beams", TOG 2011 (weight). Changed: rays by the hierarchy instead of depth maps, so that several bounces and concave
objects are right; quads with the normalised weight instead of lines; cones of Akenine-Möller, Crassin, Boksansky,
Belcour, Panteleev, Wright, "Improved Shader and Texture Level of Detail Using Ray Cones", JCGT 2021.

Bias: the kernel's width; a beam seen nearly end-on is bounded (sine of 1/20). Rough glass and mirrors are taken as
smooth up to SMOOTH and left out beyond. Materials count by their mean colour. The world and shining meshes throw no
beams: their light passes glass straight. A beam behind glass or in a mirror is not seen (said in the ledger).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..frame.light_paths import LIGHT_SPECULAR_MEDIUM
from ..frame.picture import Frame
from ..frame.settings import Settings
from ..frame.technique import Param, Technique, Write
from ..gfx import images, passes
from ..gfx.library import Program
from ..lighting.media import MediaService, is_endless
from ..materials.compiler import may_refract
from ..materials.graph import Graph
from ..scene import acceleration
from ..scene.media import ATTENUATION_TEXTURES, MEDIA_TEXTURES, has_media
from ..scene.view import VIEW
from ..snapshot.panorama import bends_lines
from ..snapshot.scene import Snapshot
from ..sources import lights
from ..surfaces.seen_layers import SeenLayers
from .airlight import may_send, volume_graphs

SMOOTH = 0.2  # roughness
# Half widths of beams on the screen. Tents of one pixel add up to the same wherever among pixels a beam runs, as those
# of one and a half do not: at the waist of a ball lens, between two columns of pixels, two per cent were missing.
BEAM_PIXELS, MOST_PIXELS = 1.0, 8.0
MOST_LAMPS = 8  # in a sample
GLASS, MIRROR = 1.0, 2.0
STRETCHES = 2
TRACE = passes.fullscreen_program(
    "beams traced",
    "media/beam_trace.frag.glsl",
    textures=(*acceleration.HIERARCHY_TEXTURES, *ATTENUATION_TEXTURES, ("RGBA32F", "beam_table")),
    blocks=((VIEW, "film_view"), (lights.SOURCES, "sources")),
    constants=(
        ("INT", "light_number"), ("INT", "ray_side"), ("VEC2", "beam_jitter"), ("VEC4", "casters"),
        ("FLOAT", "scene_size"), ("FLOAT", "offset_size"), ("FLOAT", "closer"),
    ),
    outputs=tuple(("VEC4", f"out_{name}{k}") for k in range(STRETCHES) for name in ("start", "end", "flux")),
)  # fmt: skip
BEAMS = Program(
    name="beams",
    vertex="media/beam.vert.glsl",
    fragment="media/beam.frag.glsl",
    inputs=passes.QUAD_INPUTS,
    varyings=tuple(("flat", "VEC4", f"beam_{name}") for name in ("start", "end", "flux")),
    textures=(
        *(("RGBA32F", f"beam_{name}") for name in ("starts", "ends", "fluxes")), ("RGBA32F", "surface_position"),
        *MEDIA_TEXTURES,
    ),
    blocks=((VIEW, "film_view"),),
    constants=(("INT", "ray_side"), ("FLOAT", "beam_pixels"), ("FLOAT", "beam_most_pixels")),
    outputs=(("VEC4", "out_volume"),),
)  # fmt: skip
# Rays of a picture of one sample for each pixel of the width of what bends them: their beams lie side by side across
# it, each several pixels wide, however many start at the same place of it. With more samples all have more, and each
# fewer.
RAYS_A_PIXEL = 160
LEAST_SIDE = 8
MOST_VERTICES = 50_000  # of all that bends light: beyond, corners of boxes stand for them


class VolumeCaustics(Technique):
    name = "volume_caustics"
    label = "Volume caustics"
    params = (
        Param(
            "rays", "Rays", 192,
            "Light rays along each side of the grid that each lamp sends to glass and mirrors in a sample, fewer where "
            "these are small in the picture",
            8, 1024, draft=64,
        ),
    )  # fmt: skip
    reads = ("surface.position",)
    requests = (MediaService,)
    owns = (LIGHT_SPECULAR_MEDIUM,)
    writes = (Write("radiance.volume_indirect", "RGBA32F", "Light that glass and mirrors focus into media", True),)

    def __init__(self):
        self._sources = lights.Sources()
        self._table: images.Image | None = None
        self._emitters: list[lights.Emitter] = []

    def skip(self, snapshot: Snapshot, settings: Settings) -> str | None:
        if not has_media(snapshot) or not any(may_send(graph) for graph in volume_graphs(snapshot)):
            return "the scene has no volume that scatters"
        used = snapshot.used_materials
        if not any(may_bend(snapshot.materials[k].graph) for k in used):
            return "no material is smooth glass or a smooth mirror"
        if not any(np.any(light.strength) and light.visibility.volume for light in snapshot.lights):
            return "no lamp shines into the volumes"
        if settings.bounces == 0:
            return "the scene's bounces are set to 0"
        return bends_lines(snapshot) or acceleration.too_many(snapshot)

    def begin(self, frame: Frame) -> None:
        """Find what bends light and the sphere around it, and the lamps that may reach it."""
        rows = [
            _row(material, frame.snapshot.materials[k].graph) for k, material in enumerate(frame.materials.compiled)
        ]
        table = np.array(rows, np.float32).reshape(-1, 2, 4)
        self._table = images.upload(table)
        bending = set(np.flatnonzero(table[:, 1, 0] > 0))
        self._casters = casters_of(frame.snapshot, bending, frame.geometry.origin)
        endless = is_endless(frame)
        self._emitters = [
            one for one in frame.emitters if self._casters and one.light.visibility.volume and one.light.cast_shadow
            and not (endless and one.kind == lights.SUN)
        ]  # fmt: skip

    def sample(self, frame: Frame) -> Iterator[None]:
        media = frame.service(MediaService)
        if media is None or not self._emitters or not media.media.scatters:
            return
        centre, radius = self._casters
        each = RAYS_A_PIXEL / np.sqrt(frame.settings.samples)
        enough = int(np.ceil(np.sqrt(each * pixels_across(frame, centre, radius))))
        side = min(frame.settings.get(self, "rays"), max(enough, LEAST_SIDE))
        chosen, weight = lights.spread_choice(len(self._emitters), MOST_LAMPS, frame.uniform("beams/choose"))
        turn = [self._emitters[k] for k in chosen]
        drawn = [one.sample(*frame.random_volume("beams/light")) for one in turn]
        sources = self._sources.set([e.row(point, 0, 1, weight) for e, point in zip(turn, drawn)])
        traced = [images.pool.take(side, side, "RGBA32F") for _ in range(3 * STRETCHES)]
        surfaces = {"surface_position": frame.kept(SeenLayers).position(frame, self)}
        for number in range(len(turn)):
            passes.fullscreen(
                TRACE,
                images.Target(tuple(traced)),
                textures={**frame.hierarchy("volume").textures, **media.media.attenuation(), "beam_table": self._table},
                blocks={"film_view": frame.view_block, "sources": sources},
                constants={
                    "light_number": number, "ray_side": side, "beam_jitter": frame.random("beams/place"),
                    "casters": (*centre, radius), "scene_size": max(frame.geometry.size, 2 * radius),
                    "offset_size": frame.offset_size, "closer": frame.settings.samples**-0.5,
                },
            )  # fmt: skip
            yield
            read = {**surfaces, **media.media.textures}
            shader = passes.get_for(BEAMS, read)
            read |= surfaces["surface_position"].beside
            with passes.drawing(
                frame.target("radiance.volume_indirect"), blend="ADDITIVE_PREMULT", depth_test="NONE", depth_write=False
            ):
                for k in range(STRETCHES):
                    start, end, flux = traced[3 * k : 3 * k + 3]
                    shader.bind(
                        textures={"beam_starts": start, "beam_ends": end, "beam_fluxes": flux, **read},
                        blocks={"film_view": frame.view_block},
                        constants={"ray_side": side, "beam_pixels": BEAM_PIXELS, "beam_most_pixels": MOST_PIXELS},
                    )  # fmt: skip
                    passes.draw_quads(shader, side * side)
            frame.count(self, "passes", 1 + STRETCHES)
            frame.count(self, "rays", side * side)
            yield
        for image in traced:
            images.pool.give(image)

    def release(self) -> None:
        self._sources.release()
        self._table = None
        self._emitters = []


def pixels_across(frame: Frame, centre: np.ndarray, radius: float) -> float:
    """How wide a sphere is in the picture, at most as wide as from its surface."""
    camera = frame.snapshot.camera
    left, right = camera.frame[:2]
    away = 1.0
    if camera.kind != "ORTHOGRAPHIC":
        away = max(float(np.linalg.norm(centre + frame.geometry.origin - camera.matrix[:3, 3])), radius)
    return 2.0 * radius / away * frame.size[0] / max(abs(right - left), 1e-20)


_MIRRORS = ("ShaderNodeBsdfGlossy", "ShaderNodeBsdfAnisotropic", "ShaderNodeBsdfMetallic")


def mirror_color(graph: Graph) -> tuple[float, float, float] | None:
    """Colour of a material that mirrors like metal and is smooth; None of others."""
    node = graph.nodes.get(graph.surface[0]) if graph.surface else None
    if node is None:
        return None
    metal = node.type == "ShaderNodeBsdfPrincipled" and _number(node, "Metallic") > 0.5
    if not (metal or node.type in _MIRRORS) or _number(node, "Roughness", 1.0) > SMOOTH:
        return None
    color = next((node.inputs[name] for name in ("Base Color", "Color") if name in node.inputs), None)
    value = (0.8, 0.8, 0.8) if color is None or color.link is not None or color.value is None else color.value
    return tuple(float(x) for x in np.broadcast_to(value, (len(np.ravel(value)),))[:3])


def _number(node, name: str, unknown: float = 0.0) -> float:
    socket = node.inputs.get(name)
    if socket is None or socket.link is not None or socket.value is None:
        return unknown
    return float(np.ravel(socket.value)[0])


def may_bend(graph: Graph) -> bool:
    """Whether a material may focus light."""
    return may_refract(graph) or mirror_color(graph) is not None


def _row(material, graph: Graph) -> tuple:
    """Two texels for shaders/media/beam_trace.frag.glsl: colour and index; kind and absorption."""
    if material.glass is not None and material.glass.roughness <= SMOOTH and material.glass.share > 0.5:
        absorbed = np.clip(material.medium.absorption, 0.0, 1e10) if material.medium else np.zeros(3)
        return *material.glass.color, material.glass.ior, GLASS, *absorbed
    color = mirror_color(graph)
    return (*color, 1.0, MIRROR, 0.0, 0.0, 0.0) if color is not None else (0.0,) * 8


def casters_of(snapshot: Snapshot, bending: set[int], origin: np.ndarray) -> tuple[np.ndarray, float] | None:
    """Centre, relative to the origin, and radius of a sphere around all that bends light."""
    chosen = [
        one for one in snapshot.instances
        if not bending.isdisjoint(one.materials) and snapshot.meshes[one.mesh].triangle_count and one.visibility.volume
    ]  # fmt: skip
    few = sum(len(snapshot.meshes[one.mesh].positions) for one in chosen) <= MOST_VERTICES
    places = []
    for one in chosen:
        mesh = snapshot.meshes[one.mesh]
        low, high = np.asarray(mesh.bounds_min), np.asarray(mesh.bounds_max)
        corners = np.array([(x, y, z) for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
        corners = np.asarray(mesh.positions, float) if few else corners
        places.append(corners @ one.matrix[:3, :3].T + one.matrix[:3, 3] - origin)
    if not places:
        return None
    places = np.concatenate(places)
    centre = (places.min(axis=0) + places.max(axis=0)) / 2
    return centre, float(np.linalg.norm(places - centre, axis=1).max()) or 1e-6
