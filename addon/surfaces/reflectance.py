"""Mean reflectance of each material: what surfaces out of the camera's sight reflect of the light that meets them.

A node tree is only known as a program that runs per pixel. So each material is drawn once, all its surfaces over one
another, from the two directions of scene/overview.py, and the pixels are averaged.

| cost | once per set of materials and geometry |
|---|---|
| draws | 2 of each material's meshes (not of all of their instances), into 16 x 16 pixels each |

Fails: where a texture that the camera does not see is lit in its dark parts only, its mean is too bright there.
"""

from __future__ import annotations

import numpy as np

from ..frame.light_paths import LIGHT_SPECULAR_DIFFUSE
from ..frame.picture import Frame
from ..gfx import images, passes
from ..gfx.context import to_hold
from ..gfx.library import Program
from ..gfx.struct import Block
from ..materials import gloss
from ..scene.culling import calls
from ..scene.materials import SURFACE_IMAGES
from ..scene.overview import DIRECTIONS, overview, some
from ..scene.view import STRAIGHT, VIEW
from ..sources.environment import Environment
from .draw import STOCHASTIC, SURFACE_TEXTURES, drawing_constants

SIDE = 16  # pixels of one view
COLUMNS = 16  # materials in a row of the result
MOST_CELLS = 32  # that are averaged one by one
BANDS = 9  # of rows in the result, as in shaders/indirect/bands.glsl
SKY_ROWS = 8  # above them, of the world's wide light, as there
EVERY_FLAG = -1  # instances hidden from the camera reflect light too
VIEW_COSINE = 0.577  # between a view and the faces of a box, on average
REFLECTANCE = passes.fullscreen_program(
    "reflectance",
    "indirect/reflectance.frag.glsl",
    textures=(*SURFACE_TEXTURES, ("RGBA32F", "energy_table")),
    constants=(("IVEC2", "extent"), ("INT", "rows"), ("FLOAT", "view_cosine"), ("INT", "mirrors")),
    defines=(("THROWS", f"{gloss.THROWS + 1e-4:.4f}"),),
    outputs=(("VEC4", "out_reflectance"),),
)
# For programs that read the image where a technique brings what mirrors and glass throw on diffuse surfaces.
MIRRORS_OWNED = (("MIRRORS_OWNED", "1"),)
TURNED = (("TURNED_NORMALS", "1"),)  # where a material turns normals
# Where a material is smooth metal or glass: up to this mean of the mirror's alpha.
MIRRORS = (("SMOOTH_MIRRORS", f"{(gloss.SMOOTH + 1e-4) ** 2:.6f}"),)
GLASS_MIRRORS = (("GLASS_MIRRORS", "1"),)  # where one is smooth glass
MIRRORS_DROPPED = (("MIRRORS_DROPPED", "1"),)  # where Blender's Reflective Caustics are off
MATT = (("MATT", "1"),)  # where all materials are diffuse, and programs hold what a scene needs
TURNING = ("ShaderNodeNormalMap", "ShaderNodeBump")


class Reflectance:
    """The image of mean reflectances: material m stands at (m & 15, m >> 4) of each of its bands of rows."""

    def __init__(self):
        self._keys: dict[int, object] = {}  # by material: of what its cell shows
        self._sky: tuple = ()  # what the rows of the world show
        self.image: images.Image | None = None
        self.mirrors_box = np.zeros((2, 3))  # corners around all that mirrors, relative to the scene's origin
        self._defines: tuple[tuple[str, str], ...] = ()  # of the image, by what materials do
        self._known: tuple | None = None  # the snapshot and the origin that both are of

    def update(self, frame: Frame) -> None:
        """Draw anew the materials that have changed or whose surfaces have."""
        self._update(frame)
        origin = tuple(frame.geometry.origin)
        if self._known is None or self._known[0] is not frame.snapshot or self._known[1] != origin:
            self._known = frame.snapshot, origin  # techniques ask in every sample
            self.mirrors_box, self._defines = _mirrors_box(frame), _defines(frame)
        owned = MIRRORS_OWNED if frame.plan.owns(LIGHT_SPECULAR_DIFFUSE) else ()
        self.image.defines = (*owned, *self._defines)

    def _update(self, frame: Frame) -> None:
        keys = keys_of(frame)
        rows = -(-len(frame.materials.compiled) // COLUMNS)
        kept = self.image is not None and self.image.size == (COLUMNS, BANDS * rows + SKY_ROWS)
        if not kept:
            self.release()
            self.image = images.pool.take(COLUMNS, BANDS * rows + SKY_ROWS, "RGBA32F")
            self._put_sky(np.zeros((SKY_ROWS, COLUMNS, 3)))  # programs of other paths' sheets may read it
        changed = [material for material, key in keys.items() if self._keys.get(material) != key]
        self._keys = keys
        if kept and not changed:
            return
        # A new image is undefined, also where no surface shows the material: all of it is drawn.
        few = kept and BANDS * len(changed) <= MOST_CELLS
        changed = changed if few else list(keys)
        size = (COLUMNS * SIDE, 2 * rows * SIDE)
        seen = [images.pool.take(*size, "RGBA32F") for _ in SURFACE_IMAGES]
        target = images.Target(tuple(seen))
        target.clear()
        for number, direction in enumerate(DIRECTIONS):
            for material in changed:
                corner = (material % COLUMNS * SIDE, (2 * (material // COLUMNS) + number) * SIDE)
                program = frame.materials.surface_program(material)
                constants = drawing_constants(STOCHASTIC, False)
                draw_overview(frame, target, (*corner, SIDE, SIDE), material, direction, program, {}, constants)
        cells = [(k % COLUMNS, band * rows + k // COLUMNS, 1, 1) for k in changed for band in range(BANDS)]
        for viewport in cells if few else [(0, 0, COLUMNS, BANDS * rows)]:
            self._average(frame, seen, viewport, rows, mirrors=0)
        for k in filter(lambda k: _throws(frame, k), changed):
            for band in (0, 1):  # those whose fourth number is about mirrors
                self._average(frame, seen, (k % COLUMNS, band * rows + k // COLUMNS, 1, 1), rows, mirrors=1)
        for image in seen:
            images.pool.give(image)

    def _average(self, frame: Frame, seen: list[images.Image], viewport, rows: int, mirrors: int) -> None:
        passes.fullscreen(
            REFLECTANCE,
            images.Target((self.image,)),
            viewport=viewport,
            textures={
                **{f"surface_{name}": image for name, image in zip(SURFACE_IMAGES, seen)},
                "energy_table": frame.materials.energy_table,
            },
            constants={"extent": (SIDE, 2 * SIDE), "rows": rows, "view_cosine": VIEW_COSINE, "mirrors": mirrors},
        )

    @property
    def mirrors_glass(self) -> bool:
        """Whether rays go on by the mirrors of smooth glass."""
        return set(GLASS_MIRRORS) <= set(self._defines)

    def show_sky(self, environment: Environment, most: float) -> None:
        """Put the world's wide light above the bands, for rays that sheets of glass mirror: without what is of more
        luminance than `most`, W / (m2 sr)."""
        if self._sky != (environment, most):
            self._sky = environment, most
            self._put_sky(environment.mean_radiance(SKY_ROWS, COLUMNS, most))

    def _put_sky(self, radiance: np.ndarray) -> None:
        """Fill the rows of the world: (SKY_ROWS, COLUMNS, 3), W / (m2 sr)."""
        texels = np.zeros((self.image.size[1], COLUMNS, 4))
        texels[-SKY_ROWS:, :, :3] = radiance
        viewport = (0, self.image.size[1] - SKY_ROWS, COLUMNS, SKY_ROWS)
        textures = {"original": images.upload(texels)}
        passes.fullscreen(passes.COPY, images.Target((self.image,)), viewport=viewport, textures=textures)

    def release(self) -> None:
        if self.image is not None:
            self.image.defines = ()
            images.pool.give(self.image)
        self.image, self._keys, self._sky = None, {}, ()


def _goes_on(frame: Frame, material: int) -> bool:
    """Whether photons and paths go on from it as from a mirror: glass, or metal up to a roughness of gloss.SMOOTH."""
    return smooth_metal(frame, material) or frame.materials.compiled[material].glass is not None


def _throws(frame: Frame, material: int) -> bool:
    """Whether it throws caustics as lighting/caustic_casters.py has it: glass, or metal up to a roughness of
    gloss.THROWS. Polish over another surface does not, however dark that is."""
    return smooth_metal(frame, material, gloss.THROWS) or frame.materials.compiled[material].glass is not None


def _mirrors_box(frame: Frame) -> np.ndarray:
    """(2, 3) corners of a box around all objects of `_goes_on`, with a margin for those that are flat."""
    own = {k for k in frame.snapshot.used_materials if _goes_on(frame, k)}
    boxes = []
    for one in frame.snapshot.instances if own else ():
        mesh = frame.snapshot.meshes[one.mesh]
        if not own.isdisjoint(one.materials) and mesh.triangle_count and np.isfinite(one.matrix).all():
            centre, half = (mesh.bounds_min + mesh.bounds_max) / 2, (mesh.bounds_max - mesh.bounds_min) / 2
            world, reach = one.matrix[:3, :3] @ centre + one.matrix[:3, 3], np.abs(one.matrix[:3, :3]) @ half
            boxes.append((world - reach, world + reach))
    if not boxes:
        return np.zeros((2, 3))
    low, high = np.min([box[0] for box in boxes], axis=0), np.max([box[1] for box in boxes], axis=0)
    margin = 1e-3 * np.linalg.norm(high - low) + 1e-5 * frame.geometry.size
    return np.stack([low - margin, high + margin]) - frame.geometry.origin


def smooth_metal(frame: Frame, material: int, most: float = gloss.SMOOTH) -> bool:
    return min(gloss.mirrors(frame.snapshot.materials[material].graph), default=1.0) <= most


def mirrors_as_glass(frame: Frame, material: int) -> bool:
    """Whether it is smooth glass, which stops rays by chance and mirrors those."""
    glass = frame.materials.compiled[material].glass
    return glass is not None and glass.fresnel and glass.roughness <= gloss.SMOOTH


def keys_of(frame: Frame) -> dict[int, object]:
    """By material that is shown: what its overview depends on."""
    prints, count = frame.materials.fingerprint(), len(frame.materials.compiled)
    shown: dict[int, list] = {}
    for draw in frame.geometry.draws:
        shown.setdefault(draw.material, []).append((draw.batch.number, draw.first, draw.count))
    return {
        material: (
            prints[material], prints[count:], shown[material],
            frame.materials.around(material, frame.geometry),
        )
        for material in sorted(shown)
    }  # fmt: skip


def draw_overview(
    frame: Frame, target: images.Target, viewport, material: int, backward: np.ndarray, program: Program,
    textures: dict[str, images.Image], constants: dict[str, object],
) -> None:  # fmt: skip
    """Draw all surfaces of a material over one another with its `program`, as seen from afar along `backward`."""
    all_draws = frame.geometry.draws
    own = some([k for k, draw in enumerate(all_draws) if draw.material == material], all_draws)
    draws = [all_draws[k] for k in own]
    shader = passes.get(program)
    bindings, own_constants = frame.materials.drawing(material, program, frame.geometry.instances)
    low, high = np.min([d.low for d in draws], axis=0), np.max([d.high for d in draws], axis=0)
    bindings["textures"] = {**bindings["textures"], **textures}
    bindings["blocks"]["film_view"] = Block(VIEW, **_values(overview(low, high, backward)))
    with passes.drawing(target, viewport=viewport, depth_test="NONE", depth_write=False):
        values = {"first_instance": 0, **constants, **own_constants}
        shader.bind(**bindings, constants=values)
        for call in calls(all_draws, own):
            shader.set_constant("first_instance", call.first)
            passes.draw(shader, call.draw.batch, call.count)


def _values(view: dict) -> dict:
    """Fields of VIEW for an overview."""
    return {
        **view, "film": (SIDE, SIDE, 0.0, 4 * view["frame"][1]), "sample_index": 0, "seed": 0,
        **dict.fromkeys(("bits_x", "bits_y", "bits_z", "bits_w"), 0), "visibility": EVERY_FLAG,
        "footprint_exact": 0.0, "footprint_first": 0.0, **STRAIGHT,
    }  # fmt: skip


def _defines(frame: Frame) -> tuple[tuple[str, str], ...]:
    """What programs that read the image need, by what the materials do that are shown."""
    used, snapshot = frame.snapshot.used_materials, frame.snapshot
    glass = GLASS_MIRRORS if any(mirrors_as_glass(frame, k) for k in used) else ()
    mirrors = MIRRORS if glass or any(smooth_metal(frame, k) for k in used) else ()
    dropped = () if snapshot.film.caustics_reflective else MIRRORS_DROPPED
    turned = any(node.type in TURNING for k in used for node in snapshot.materials[k].graph.nodes.values())
    shines = to_hold(frame.materials.glossy or frame.materials.soft, True)
    return (*mirrors, *glass, *dropped, *(TURNED if turned else ()), *(() if shines else MATT))
