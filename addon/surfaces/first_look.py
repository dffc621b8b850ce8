"""A first look at a scene: every surface in one colour under its strongest lamps, without shadows.

Programs of a scene take a driver seconds to compile. Those of a first look are one and the same for all scenes, so that
a viewport has something to show at once, and again wherever an edit needs programs that are not there yet. The image
beside it, the guide, tells surfaces apart: normal and inverse distance.
"""

from __future__ import annotations

import numpy as np

from ..gfx import images, passes
from ..gfx.library import Program
from ..gfx.struct import Block, Struct
from ..materials.compiled import CompiledMaterial
from ..scene.culling import calls
from ..scene.geometry import SceneGeometry
from ..scene.view import VIEW, View
from ..snapshot.scene import Snapshot, World
from ..sources.lights import ELLIPSE, RECTANGLE, SPOT_FLAG, SUN, Emitter, emitters

MOST_LAMPS = 8  # the strongest; of the others half of what they give stands in the ambient light
HEADLIGHT = 0.35  # irradiance from the eye, by the exposure: shapes are seen where nothing lights them
UNKNOWN_WORLD = 0.5  # radiance of a world whose node tree has to be run to be known
WHOLE, LAMBERTIAN = 2.0, -2.0  # in place of the cosine of a cone: to all sides, and as a surface shines

LAMPS = Struct(
    "FirstLamps",
    ("vec4", "eye"),  # place; w = 1: the direction towards an orthographic camera
    ("vec4", "ambient"),  # irradiance; w: of the headlight
    ("vec4", "count"),
    # Of each: place (w = 1) or direction of a sun; axis, cosine of a cone; intensity, least squared distance.
    ("vec4", f"lamp[{3 * MOST_LAMPS}]"),
)
FIRST_LOOK = Program(
    name="first look",
    vertex="surface/first_look.vert.glsl",
    fragment="surface/first_look.frag.glsl",
    inputs=(("VEC3", "position"), ("VEC3", "normal"), ("INT", "local_instance")),
    varyings=(("smooth", "VEC3", "world_position"), ("smooth", "VEC3", "world_normal")),
    outputs=(("VEC4", "out_look"), ("VEC4", "out_guide")),
    textures=(("RGBA32F", "instances"),),
    blocks=((VIEW, "film_view"), (LAMPS, "first_lamps")),
    constants=(("INT", "first_instance"), ("VEC4", "flat_color"), ("VEC4", "flat_glow")),
    defines=(
        ("PROJECTION", "film_view.row_x, film_view.row_y, film_view.row_w, film_view.row_q, film_view.backward.w"),
        ("VISIBILITY_FLAG", "film_view.visibility"),
    ),
)

FINE = passes.fullscreen_program(
    "first look guides",
    "surface/first_look_guides.frag.glsl",
    textures=(("RGBA16F", "guide"), ("RGBA16F", "look"), ("RGBA32F", "coarse")),
    constants=(("FLOAT", "faint"),),
    outputs=(("VEC4", "out_fine"),),
)
FILL = passes.fullscreen_program(
    "first look fills in",
    "surface/first_look_fill.frag.glsl",
    textures=(("RGBA16F", "look"), ("RGBA32F", "coarse")),
    outputs=(("VEC4", "out_fine"),),
)
FILLED = 0.1  # radiance of a white surface that faces the eye, by the exposure, in place of indirect light
SOLID = 0.9  # opacity from which on a surface hides what is behind
FAINT = 0.02  # radiance, by the exposure, that is as good as black where colours are compared


class FirstLook:
    """Draws first looks, and keeps the last one."""

    def __init__(self):
        self._fine: images.Target | None = None
        self._target: images.Target | None = None
        self._view: Block | None = None
        self._lamps: Block | None = None

    @property
    def picture(self) -> images.Image | None:
        """Scene-linear, premultiplied by alpha."""
        return self._target.colors[0] if self._target else None

    @property
    def guide(self) -> images.Image | None:
        """xyz: the normal on the viewer's side; w: inverse of the distance along the axis, 0 where nothing is hit."""
        return self._target.colors[1] if self._target else None

    def draw(
        self, snapshot: Snapshot, geometry: SceneGeometry, materials: list[CompiledMaterial], view: View,
        guides: bool = False, fills: bool = False,
    ) -> images.Image:  # fmt: skip
        """The scene as `geometry` holds it, through a view of it. What lets light pass hides every other pixel; of what
        `guides` a draft glass is whole, and other such surfaces, whose shape stands in an image, are left out. What
        `fills` in has a faint light from the eye alone."""
        values = view.values(0, 0, (0.0, 0.0), geometry.size)
        lamps = lamp_values(snapshot, geometry, values)
        if fills:
            head = FILLED * np.pi / max(snapshot.film.exposure, 1e-6)
            lamps |= {"ambient": (0.0, 0.0, 0.0, head), "count": (0.0,) * 4}
        self._view = _updated(self._view, VIEW, values)
        self._lamps = _updated(self._lamps, LAMPS, lamps)
        if self._target is None or self._target.size != view.size:
            self.release()
            formats = ("RGBA16F", "RGBA16F", "DEPTH_COMPONENT32F")
            look, guide, depth = (images.pool.take(*view.size, one) for one in formats)
            self._target = images.Target((look, guide), depth)
        self._target.clear((0.0, 0.0, 0.0, 0.0), 1.0)
        images.Target((self._target.colors[0],)).clear((0.0,) * 4 if fills else background(snapshot))
        rows = np.array([values[row] for row in ("row_x", "row_y", "row_w", "row_q")])
        shader, material = passes.get(FIRST_LOOK), None
        with passes.drawing(self._target):
            for call in calls(geometry.draws, np.flatnonzero(geometry.boxes.seen(rows))):
                shown = materials[call.draw.material]
                if shown.bounds_alone or (guides and _lets_pass(shown) and shown.glass is None):
                    continue
                if material is None:
                    shader.bind(
                        textures={"instances": geometry.instances},
                        blocks={"film_view": self._view, "first_lamps": self._lamps},
                        constants={"first_instance": call.first, **_look_of(shown, guides, fills)},
                    )
                elif call.draw.material != material:
                    shader.change(constants=_look_of(shown, guides, fills))
                material = call.draw.material
                shader.set_constant("first_instance", call.first)
                passes.draw(shader, call.draw.batch, call.count)
        return self._target.colors[0]

    def refined(self, coarse: images.Image, exposure: float) -> images.Image:
        """A coarse picture of what was drawn last in the pixels of that: edges and shapes of the first look, and the
        light of the picture."""
        size = self._target.size
        if self._fine is None or self._fine.size != size:
            self._give_fine()
            self._fine = images.Target((images.pool.take(*size, "RGBA16F"),))
        textures = {"guide": self.guide, "look": self.picture, "coarse": coarse}
        faint = FAINT / max(exposure, 1e-6)
        passes.fullscreen(FINE, self._fine, textures=textures, constants={"faint": faint})
        return self._fine.colors[0]

    def fill_in(self, lit: images.Image, target: images.Target, *scene) -> None:
        """Into the target a picture that has direct light alone, with a faint light from the eye in its shadows.
        `scene`: as of `draw`, through the picture's own view."""
        self.draw(*scene, fills=True)
        passes.fullscreen(FILL, target, textures={"look": self.picture, "coarse": lit})

    def _give_fine(self) -> None:
        if self._fine is not None:
            images.pool.give(self._fine.colors[0])
            self._fine = None

    def release(self) -> None:
        """Give back the images."""
        self._give_fine()
        if self._target is not None:
            for image in (*self._target.colors, self._target.depth):
                images.pool.give(image)
            self._target = None


def _updated(block: Block | None, struct: Struct, values: dict) -> Block:
    if block is None:
        return Block(struct, **values)
    block.update(**values)
    return block


def _lets_pass(material: CompiledMaterial) -> bool:
    return material.transparent and material.opacity < SOLID


def _look_of(material: CompiledMaterial, guides: bool, fills: bool) -> dict[str, tuple[float, ...]]:
    solid = float(guides or not (_lets_pass(material) or material.glass is not None))
    glow = np.zeros(3) if fills else np.clip(np.nan_to_num(material.emission, posinf=1e4), 0.0, 1e4)
    return {"flat_color": (*np.clip(material.color, 0.0, 1.0), solid), "flat_glow": (*glow, 0.0)}


def background(snapshot: Snapshot) -> tuple[float, float, float, float]:
    """What is seen where no surface is."""
    if snapshot.film.transparent:
        return 0.0, 0.0, 0.0, 0.0
    return (*mean_radiance(snapshot.world), 1.0) if snapshot.world.visibility.camera else (0.0, 0.0, 0.0, 1.0)


def mean_radiance(world: World) -> np.ndarray:
    """(3,) of the world over all directions, roughly: not by its node tree, which would have to be compiled."""
    if world.graph is not None:
        return np.full(3, UNKNOWN_WORLD)
    color = np.asarray(world.color, float)
    if world.image is not None:
        height, width = world.image.pixels.shape[:2]
        color = color * world.image.pixels[:: -(-height // 64), :: -(-width // 64), :3].mean(axis=(0, 1))
    return np.clip(np.nan_to_num(color), 0.0, 1e4)


def lamp_values(snapshot: Snapshot, geometry: SceneGeometry, view: dict) -> dict:
    """Fields of LAMPS. `view`: those of VIEW."""
    eye = np.asarray(view["eye"][:3])
    found = [(_lamp(one), one) for one in emitters(snapshot, geometry.origin)]
    middle = (geometry.bounds_min + geometry.bounds_max) / 2 - geometry.origin

    def seen(entry) -> float:
        rows, one = entry
        near = min(np.sum((place - rows[0, :3]) ** 2) for place in (eye, middle))
        return float(rows[2, :3].sum() / (max(near, rows[2, 3]) if one.kind != SUN else 1.0))

    found.sort(key=seen, reverse=True)
    rows = np.zeros((MOST_LAMPS, 3, 4))
    for k, (lamp, _) in enumerate(found[:MOST_LAMPS]):
        rows[k] = lamp
    rest = 0.5 * sum(seen(entry) for entry in found[MOST_LAMPS:]) / 3.0
    ambient = np.pi * mean_radiance(snapshot.world) + rest
    orthographic = view["eye"][3]
    towards = view["backward"][:3] if orthographic else eye
    head = HEADLIGHT * np.pi / max(snapshot.film.exposure, 1e-6)
    return {
        "eye": (*towards, orthographic), "ambient": (*ambient, head),
        "count": (min(len(found), MOST_LAMPS), 0.0, 0.0, 0.0), "lamp": rows.reshape(-1, 4),
    }  # fmt: skip


def _lamp(one: Emitter) -> np.ndarray:
    """(3, 4) of LAMPS."""
    least = max(one.reach**2, 1e-4) if one.kind != SUN else 1.0
    if one.kind == SUN:
        disc = np.pi * np.sin(one.radius) ** 2 if one.radius > 0 else 1.0
        return np.array([(*one.centre, 0.0), (0.0, 0.0, 0.0, WHOLE), (*one.radiance * disc, 1.0)])
    if one.kind in (RECTANGLE, ELLIPSE):
        return np.array([(*one.centre, 1.0), (*one.axis, LAMBERTIAN), (*one.radiance * one.area, least)])
    cone = float(one.u[3]) if one.flags & SPOT_FLAG else WHOLE
    intensity = one.radiance * (one.area if one.radius > 0 else 1.0)
    return np.array([(*one.centre, 1.0), (*one.axis, cone), (*intensity, least)])
