"""A first look at a scene: every surface in one colour under its strongest lamps, without shadows.

Programs of a scene take a driver seconds to compile. Those of a first look are one and the same for all scenes, so that
a viewport has something to show at once, and again wherever an edit needs programs that are not there yet. The image
beside it, the guide, tells surfaces apart: normal and inverse distance. Where something emits, a third one holds what
the eye sees of that: a coarse picture in the pixels of the guide so shows whole what is smaller than its own pixels.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np

from ..gfx import images, passes
from ..gfx.library import Program
from ..gfx.struct import Block, Struct
from ..materials.compiled import CompiledMaterial
from ..scene.culling import Call, calls
from ..scene.geometry import SceneGeometry
from ..scene.view import VIEW, View
from ..snapshot.scene import Snapshot, World
from ..sources import lights
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
    # flat_glow: radiance, of the side with the normal; w > 0: it alone is drawn in place of a look, with that alpha.
    constants=(("INT", "first_instance"), ("VEC4", "flat_color"), ("VEC4", "flat_glow"), ("VEC3", "flat_glow_behind")),
    defines=(
        ("PROJECTION", "film_view.row_x, film_view.row_y, film_view.row_w, film_view.row_q, film_view.backward.w"),
        ("VISIBILITY_FLAG", "film_view.visibility"),
    ),
)

FINE = passes.fullscreen_program(
    "first look guides",
    "surface/first_look_guides.frag.glsl",
    textures=(
        ("RGBA16F", "guide"), ("RGBA16F", "look"), ("RGBA32F", "coarse"), ("RGBA16F", "glow"), ("R32F", "shines"),
        ("RGBA32F", "emission"),
    ),
    # What glow is multiplied by as the picture shows it, 0 where nothing glows; the same of the picture's own emission.
    constants=(("FLOAT", "faint"), ("FLOAT", "shows_glow"), ("FLOAT", "emission_scale")),
    outputs=(("VEC4", "out_fine"),),
)  # fmt: skip
LAMPS_SEEN = passes.fullscreen_program(
    "first look lamps",
    "surface/first_look_lamps.frag.glsl",
    textures=(("RGBA16F", "guide"),),
    blocks=((VIEW, "film_view"), (lights.SOURCES, "sources")),
    constants=(("INT", "light_count"), ("FLOAT", "known")),  # alpha of glow, which adds up with a surface's
    defines=(("LIGHT_KINDS", str(lights.LAMPS)),),
    outputs=(("VEC4", "out_glow"),),
)
SHINES = passes.fullscreen_program(
    "first look shines",
    "surface/first_look_shines.frag.glsl",
    textures=(("RGBA16F", "glow"),),
    constants=(("INT", "finer"),),
    outputs=(("FLOAT", "out_shines"),),
)
FILL = passes.fullscreen_program(
    "first look fills in",
    "surface/first_look_fill.frag.glsl",
    textures=(("RGBA16F", "look"), ("RGBA32F", "coarse")),
    outputs=(("VEC4", "out_fine"),),
)
FILLED = 0.1  # radiance of a white surface that faces the eye, by the exposure, in place of indirect light
MIRROR = 2.0  # alpha of a guide's colour whose light does not follow its side towards lamps: it has gloss alone
SOLID = 0.9  # opacity from which on a surface hides what is behind
FAINT = 0.02  # radiance, by the exposure, that is as good as black where colours are compared
EVEN, VARIED = 1.0, 0.5  # alpha of glow: its colour is known; only the coarse picture's mean of its surface is


@dataclass(frozen=True)
class Emitted:
    """What a picture shows of what emits."""

    image: images.Image  # sums of it, in the picture's pixels
    scale: float  # what these are multiplied by as the picture shows them
    exposure: float  # the same of radiance
    lamps: list[Emitter]  # which the camera may see


class FirstLook:
    """Draws first looks, and keeps the last one."""

    def __init__(self):
        self._fine: images.Target | None = None
        self._target: images.Target | None = None
        self._view: Block | None = None
        self._lamps: Block | None = None
        self._sources = lights.Sources()
        self._glow: images.Image | None = None  # what surfaces emit, and lamps; alpha as of `flat_glow`
        self._glows = False  # something is in it
        self._dims = False  # something that lets light pass may stand before it, and is not in the guide
        self._rows = np.zeros((4, 4))  # of the view

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
        rows = self._rows = np.array([values[row] for row in ("row_x", "row_y", "row_w", "row_q")])
        self._glows = False
        met = list(calls(geometry.draws, np.flatnonzero(geometry.boxes.seen(rows))))
        shown = [call for call in met if not _is_left_out(materials[call.draw.material], guides)]
        self._dims = guides and any(
            _lets_pass(m) and m.glass is None for m in (materials[c.draw.material] for c in met)
        )
        self._draw(self._target, shown, geometry, lambda k: _look_of(materials[k], guides, fills))
        shining = [call for call in shown if guides and materials[call.draw.material].emissive]
        if shining:
            target = images.Target((self._begin_glow(), self.guide), self._target.depth)
            self._draw(target, shining, geometry, lambda k: _glow_of(materials[k], self._dims))
        return self._target.colors[0]

    def _draw(
        self, target: images.Target, shown: list[Call], geometry: SceneGeometry, look_of: Callable[[int], dict]
    ) -> None:
        """Draw meshes; `look_of`: constants by number of the material."""
        shader, material = passes.get(FIRST_LOOK), None
        with passes.drawing(target):
            for call in shown:
                if material is None:
                    shader.bind(
                        textures={"instances": geometry.instances},
                        blocks={"film_view": self._view, "first_lamps": self._lamps},
                        constants={"first_instance": call.first, **look_of(call.draw.material)},
                    )
                elif call.draw.material != material:
                    shader.change(constants=look_of(call.draw.material))
                material = call.draw.material
                shader.set_constant("first_instance", call.first)
                passes.draw(shader, call.draw.batch, call.count)

    def _begin_glow(self) -> images.Image:
        """The image of what emits, black where nothing is in it yet."""
        if self._glow is None:
            self._glow = images.pool.take(*self._target.size, "RGBA16F")
        if not self._glows:
            images.Target((self._glow,)).clear((0.0,) * 4)
            self._glows = True
        return self._glow

    def refining(self, coarse: images.Image, exposure: float, emitted: Emitted | None = None) -> Iterator[None]:
        """Draw `fine`: a coarse picture of what was drawn last in the pixels of that: edges and shapes of the first
        look, and the light of the picture. What it shows of what is `emitted` is drawn in fine pixels, too. In parts,
        one for each program."""
        size = self._target.size
        if self._fine is None or self._fine.size != size:
            self._give_fine()
            self._fine = images.Target((images.pool.take(*size, "RGBA16F"),))
        if emitted is not None and self._add(emitted.lamps):
            yield
        glows = emitted is not None and self._glows
        with images.borrowed(*coarse.size, "R32F") as shines:
            if glows:
                finer = max(size[0] // coarse.size[0], 1)
                passes.fullscreen(SHINES, shines, textures={"glow": self._glow}, constants={"finer": finer})
                yield
            textures = {
                "guide": self.guide, "look": self.picture, "coarse": coarse, "shines": shines.colors[0],
                "glow": self._glow if glows else self.guide, "emission": emitted.image if glows else coarse,
            }  # fmt: skip
            constants = {
                "faint": FAINT / max(exposure, 1e-6), "shows_glow": emitted.exposure if glows else 0.0,
                "emission_scale": emitted.scale if glows else 0.0,
            }  # fmt: skip
            passes.fullscreen(FINE, self._fine, textures=textures, constants=constants)

    def refined(self, coarse: images.Image, exposure: float, emitted: Emitted | None = None) -> images.Image:
        """`fine`, at once."""
        for _ in self.refining(coarse, exposure, emitted):
            pass
        return self.fine

    @property
    def fine(self) -> images.Image:
        """What was refined last."""
        return self._fine.colors[0]

    def _add(self, lamps: list[Emitter]) -> bool:
        """Add lamps in view to what emits; whether there are any."""
        rows = {id(one): rows_seen(one, self._rows, self._target.size[1]) for one in lamps}
        seen = lights.traceable([one for one in lamps if rows[id(one)] is not None])
        if not seen:
            return False
        low, high = zip(*(rows[id(one)] for one in seen))
        passes.fullscreen(
            LAMPS_SEEN, images.Target((self._begin_glow(),)), blend="ADDITIVE_PREMULT", rows=(min(low), max(high)),
            textures={"guide": self.guide},
            constants={"light_count": len(seen), "known": VARIED / 2.0 if self._dims else EVEN},
            blocks={
                "film_view": self._view, "sources": self._sources.set([one.row(one.centre, 0, 0) for one in seen]),
            },
        )  # fmt: skip
        return True

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
        if self._glow is not None:
            images.pool.give(self._glow)
            self._glow = None
        if self._target is not None:
            for image in (*self._target.colors, self._target.depth):
                images.pool.give(image)
            self._target = None


def _updated(block: Block | None, struct: Struct, values: dict) -> Block:
    if block is None:
        return Block(struct, **values)
    block.update(**values)
    return block


def _is_left_out(material: CompiledMaterial, guides: bool) -> bool:
    return material.bounds_alone or (guides and _lets_pass(material) and material.glass is None)


def _lets_pass(material: CompiledMaterial) -> bool:
    return material.transparent and material.opacity < SOLID


def _look_of(material: CompiledMaterial, guides: bool, fills: bool) -> dict[str, tuple[float, ...]]:
    solid = float(guides or not (_lets_pass(material) or material.glass is not None))
    if guides and material.glossy and not material.diffuse:
        solid = MIRROR
    front, behind = np.zeros((2, 3)) if fills or guides else _radiance_of(material)
    return {
        "flat_color": (*np.clip(material.color, 0.0, 1.0), solid), "flat_glow": (*front, 0.0),
        "flat_glow_behind": tuple(behind),
    }  # fmt: skip


def _glow_of(material: CompiledMaterial, dimmed: bool) -> dict[str, tuple[float, ...]]:
    """The same where it alone is drawn. `dimmed`: something that the guide leaves out may stand before it."""
    front, behind = _radiance_of(material)
    known = VARIED if dimmed or material.uneven_emission else EVEN
    return {
        "flat_color": (0.0, 0.0, 0.0, 1.0), "flat_glow": (*front, known),
        "flat_glow_behind": tuple(behind),
    }  # fmt: skip


def _radiance_of(material: CompiledMaterial) -> np.ndarray:
    """(2, 3) that both sides emit."""
    return np.clip(np.nan_to_num([material.emission, material.emission_behind], posinf=1e4), 0.0, 1e4)


def rows_seen(lamp: Emitter, rows: np.ndarray, height: int) -> tuple[int, int] | None:
    """Rows of pixels (from, to) that the box around a lamp may be seen in; None: none. `rows`: (4, 4) of the view."""
    if lamp.kind == SUN:
        return 0, height
    corners = lamp.centre + lamp.reach * np.array(list(product((-1.0, 1.0), repeat=3)))
    x, y, w, _ = rows @ np.column_stack((corners, np.ones(8))).T
    if any(np.all(beyond) for beyond in (w <= 0.0, x > w, x < -w, y > w, y < -w)):
        return None
    if np.any(w <= 0.0):
        return 0, height
    low, high = (np.clip((end(y / w) * 0.5 + 0.5) * height, 0, height) for end in (np.min, np.max))
    return int(low), min(int(high) + 1, height)


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
