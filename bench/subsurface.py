"""Light below surfaces beside Cycles and EEVEE: `python -m bench subsurface --page docs/subsurface.md`.

Scenes made here: with `--opaque` a slab under a pattern, a sphere lit from behind, Suzanne as skin and as wax under two
area lights, a leaf, a candle, a marble tile, a sphere under the world alone; else light that comes through: Suzanne's
ears and a block of wax lit from behind, grapes, a hollow candle with its flame inside, a leaf, an open sheet of cloth
of either winding, a marble bust with fine contours, milk in a glass, balls whose radius of scattering is .1 to 2 of
their own.
Each with the methods that Cycles has. The error is relMSE of Combined (no speculars: it is diffuse light) against the
mean of two renders by Cycles, with the noise of that mean (a quarter of what the two differ by) taken off, and the mean
beside Cycles'. Seconds are those of processors, of renders after one that compiled. A first table takes Candela's least
error in the time that Cycles takes for 16 samples and its denoiser, and in EEVEE's.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from time import process_time

import numpy as np

from . import ages, markdown
from .quick import size_of, table
from .shading import even_world, node_of, one_shader

METHODS = ("BURLEY", "RANDOM_WALK_SKIN", "RANDOM_WALK")
# Radii of the random walk are mean free paths, a twelfth of what looks alike with the others.
WALK_SCALE = 1.0 / (4.0 * np.pi)
DENOISED = "CYCLES denoised"
GLASS_BOUNCES = 16
BOUNCES = {"milk": 16}  # else 2: what glass reflects inwards goes below the milk's surface again
ENTRANTS = (
    ("CANDELA", 1), ("CANDELA", 4), ("CANDELA", 16), ("CANDELA", 64), ("BLENDER_EEVEE", 16), ("CYCLES", 4),
    (DENOISED, 4), ("CYCLES", 16), (DENOISED, 16),
)  # fmt: skip
LABELS = {"CANDELA": "Candela", "BLENDER_EEVEE": "EEVEE", "CYCLES": "Cycles", DENOISED: "Cycles denoised"}
HEAD = ("scene", "method", "renderer", "relMSE", "mean / Cycles", "processor s", "noise of the reference")
THROUGH_HEAD = (*HEAD, "commit")  # rows of a page may be of several


def material(method: str, color, radius, scale: float):
    """A Principled material without speculars."""
    import bpy

    made = bpy.data.materials.new("Scattering")
    node = node_of(made, "BSDF_PRINCIPLED")
    node.subsurface_method = method
    scale *= WALK_SCALE if method == "RANDOM_WALK" else 1.0
    values = {
        "Base Color": (*color, 1), "Subsurface Weight": 1.0, "Subsurface Radius": radius, "Subsurface Scale": scale,
        "Specular IOR Level": 0.0,
    }  # fmt: skip
    for name, value in values.items():
        node.inputs[name].default_value = value
    return made


def _link(name: str, data, location=(0, 0, 0), turn=(0, 0, 0)):
    import bpy

    made = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(made)
    made.location, made.rotation_euler = location, turn
    return made


def light(kind: str, location=(0, 0, 0), turn=(0, 0, 0), **settings):
    import bpy

    data = bpy.data.lights.new(kind, kind)
    for name, value in settings.items():
        setattr(data, name, value)
    return _link(kind, data, location, turn)


def camera(location, turn, angle=0.6, span=0.0) -> None:
    import bpy

    data = bpy.data.cameras.new("Camera")
    data.angle = angle
    if span:
        data.type, data.ortho_scale = "ORTHO", span
    bpy.context.scene.camera = _link("Camera", data, location, turn)


def _shape(operator, shown, smooth=True, **placement):
    import bpy

    operator(**placement)
    made = bpy.context.object
    for polygon in made.data.polygons:
        polygon.use_smooth = smooth
    made.data.materials.append(shown)
    return made


SKIN = ((0.8, 0.55, 0.45), (1.0, 0.35, 0.2))
WAX = ((0.85, 0.75, 0.5), (1.0, 0.8, 0.5))
MARBLE = ((0.83, 0.79, 0.75), (1.0, 0.8, 0.7))
LEAF = ((0.3, 0.6, 0.15), (0.6, 1.0, 0.4))


def slab(method: str) -> None:
    import bpy

    _shape(bpy.ops.mesh.primitive_cube_add, material(method, *MARBLE, 0.5), False, size=6, location=(0, 0, -3))
    black = bpy.data.materials.new("Bars")
    for x in (-1.5, -0.5, 0.5, 1.5):
        bar = _shape(bpy.ops.mesh.primitive_cube_add, black, False, size=1, location=(x, 0, 1), scale=(0.5, 8, 0.1))
        bar.visible_camera = False
        bar.visible_diffuse = False
    light("SUN", energy=3.0, angle=0.0)
    camera((0, 0, 8), (0, 0, 0), span=3.5)


def sphere_from_behind(method: str) -> None:
    import bpy

    _shape(bpy.ops.mesh.primitive_uv_sphere_add, material(method, *WAX, 1.0), segments=64, ring_count=32)
    light("SUN", turn=(1.2, 0, 2.4), energy=6.0, angle=0.1)
    camera((0, -4, 0), (np.pi / 2, 0, 0))


def _suzanne(shown) -> None:
    import bpy

    made = _shape(bpy.ops.mesh.primitive_monkey_add, shown, size=2)
    made.modifiers.new("Subdivision", "SUBSURF").render_levels = 1
    light("AREA", (3, -3, 3), (0.9, 0, 0.8), energy=300, size=1.0)
    light("AREA", (-3, 2, 2), (1.1, 0, 4.1), energy=300, size=1.0)
    camera((0, -4, 0), (np.pi / 2, 0, 0), 0.75)


def suzanne_as_skin(method: str) -> None:
    _suzanne(material(method, *SKIN, 0.15))


def suzanne_as_wax(method: str) -> None:
    _suzanne(material(method, *WAX, 0.6))


def leaf(method: str) -> None:
    import bpy

    made = _shape(bpy.ops.mesh.primitive_grid_add, material(method, *LEAF, 0.3), size=2, x_subdivisions=8)
    for vertex in made.data.vertices:
        vertex.co.z = 0.25 * vertex.co.x**2
        vertex.co.y *= 1.0 - 0.6 * abs(vertex.co.x)
    made.modifiers.new("Solidify", "SOLIDIFY").thickness = 0.03
    made.rotation_euler = (1.2, 0, 0.3)
    light("SUN", turn=(-1.9, 0.3, 0), energy=6.0, angle=0.05)
    camera((0, -4, 0), (np.pi / 2, 0, 0))


def candle(method: str) -> None:
    import bpy

    shown = material(method, *WAX, 0.8)
    _shape(bpy.ops.mesh.primitive_cylinder_add, shown, vertices=64, radius=0.6, depth=2.0, location=(0, 0, -0.4))
    glow = bpy.data.materials.new("Flame")
    node = node_of(glow, "BSDF_PRINCIPLED")
    node.inputs["Emission Color"].default_value = (1, 0.7, 0.4, 1)
    node.inputs["Emission Strength"].default_value = 60.0
    _shape(bpy.ops.mesh.primitive_uv_sphere_add, glow, radius=0.12, segments=16, ring_count=8, location=(0, 0, 0.9))
    camera((0, -4.5, 0.8), (np.pi / 2 - 0.18, 0, 0))


def marble_tile(method: str) -> None:
    import bpy

    shown = material(method, *MARBLE, 0.3)
    _shape(bpy.ops.mesh.primitive_cube_add, shown, False, size=2, scale=(1, 1, 0.1), location=(0, 0, -0.1))
    light("POINT", (0.4, 0.2, 0.5), energy=15.0, shadow_soft_size=0.02)
    camera((0, -2.4, 2.6), (0.72, 0, 0))


def under_the_world(method: str) -> None:
    import bpy

    _shape(bpy.ops.mesh.primitive_uv_sphere_add, material(method, *SKIN, 0.5), segments=64, ring_count=32)
    even_world((1, 1, 1), 1.0)
    camera((0, -4, 0), (np.pi / 2, 0, 0))


def _ball(shown, location, radius) -> None:
    import bpy

    _shape(bpy.ops.mesh.primitive_uv_sphere_add, shown, segments=32, ring_count=16, radius=radius, location=location)


def ears(method: str) -> None:
    import bpy

    made = _shape(bpy.ops.mesh.primitive_monkey_add, material(method, *SKIN, 1.0), size=2)
    made.modifiers.new("Subdivision", "SUBSURF").render_levels = 1
    light("AREA", (1.5, 4, 2), (1.15, 0, 2.79), energy=600, size=1.0)
    camera((0, -4, 0), (np.pi / 2, 0, 0), 0.75)


def block(method: str) -> None:
    import bpy

    made = _shape(bpy.ops.mesh.primitive_cube_add, material(method, *WAX, 2.0), False, size=1.2)
    made.rotation_euler = (0.2, 0.1, 0.5)
    light("AREA", (0.5, 2.5, 1), (1.19, 0, 2.94), energy=150, size=1.0)
    camera((0, -4, 0), (np.pi / 2, 0, 0))


GRAPE = ((0.6, 0.75, 0.25), (0.8, 1.0, 0.3))


def grapes(method: str) -> None:
    shown = material(method, *GRAPE, 3.0)
    for k in range(12):
        row, angle = k // 4, 2.4 * k
        _ball(shown, (0.45 * np.cos(angle), 0.45 * np.sin(angle), 0.6 - 0.5 * row), 0.32)
    light("AREA", (-1, 3, 1.5), (1.13, 0, 3.46), energy=250, size=1.0)
    light("AREA", (3, -3, 3), (0.9, 0, 0.8), energy=30, size=1.0)
    camera((0, -4, 0), (np.pi / 2, 0, 0), 0.65)


def hollow_candle(method: str) -> None:
    import bpy

    steps, wall = 48, 0.12
    rings = [(0.6, -0.9), (0.6, 0.9), (0.6 - wall, 0.9), (0.6 - wall, -0.6)]
    angles = np.linspace(0, 2 * np.pi, steps, endpoint=False)
    corners = [(r * np.cos(a), r * np.sin(a), z) for r, z in rings for a in angles]
    faces = [(i * steps + k, i * steps + (k + 1) % steps, (i + 1) * steps + (k + 1) % steps, (i + 1) * steps + k)
             for i in range(3) for k in range(steps)]  # fmt: skip
    faces += [tuple(reversed(range(steps))), tuple(3 * steps + k for k in range(steps))]
    data = bpy.data.meshes.new("Candle")
    data.from_pydata(corners, [], faces)
    data.materials.append(material(method, *WAX, 1.0))
    _link("Candle", data)
    light("POINT", (0, 0, 0.1), energy=60.0, shadow_soft_size=0.1, color=(1, 0.8, 0.5))
    camera((0, -4.5, 0.6), (np.pi / 2 - 0.13, 0, 0))


def _cloth(method: str, flipped: bool) -> None:
    import bpy

    made = _shape(bpy.ops.mesh.primitive_grid_add, material(method, *MARBLE, 1.0), x_subdivisions=32, y_subdivisions=32)
    for vertex in made.data.vertices:
        x, y = vertex.co.x, vertex.co.y
        vertex.co.z = 0.15 * np.cos(5 * x + y)
    if flipped:
        made.data.flip_normals()
    made.rotation_euler = (0.9, 0, 0.3)
    light("AREA", (2, -3, 3), (0.9, 0, 0.6), energy=200, size=1.0)
    light("AREA", (-1, 3, 1), (1.25, 0, 3.46), energy=200, size=1.0)
    camera((0, -4, 0), (np.pi / 2, 0, 0))


def cloth(method: str) -> None:
    _cloth(method, False)


def cloth_flipped(method: str) -> None:
    _cloth(method, True)


def milk(method: str) -> None:
    import bpy

    glass = bpy.data.materials.new("Glass")
    node = node_of(glass, "BSDF_PRINCIPLED")
    for name, value in {"Transmission Weight": 1.0, "Roughness": 0.0, "IOR": 1.45}.items():
        node.inputs[name].default_value = value
    shown = material(method, (0.95, 0.93, 0.88), (1.0, 0.9, 0.7), 1.5)
    tube = bpy.ops.mesh.primitive_cylinder_add
    _shape(tube, glass, vertices=48, radius=0.7, depth=1.8)
    _shape(tube, shown, vertices=48, radius=0.6, depth=1.3, location=(0, 0, -0.1))
    light("AREA", (2, 2.5, 2), (1.0, 0, 2.47), energy=300, size=1.5)
    even_world((1, 1, 1), 0.1)
    camera((0, -4.5, 0.6), (np.pi / 2 - 0.13, 0, 0))


def bust(method: str) -> None:
    """Marble with contours finer than light spreads."""
    import bpy

    made = _shape(bpy.ops.mesh.primitive_monkey_add, material(method, *MARBLE, 0.3), size=2)
    made.modifiers.new("Subdivision", "SUBSURF").render_levels = 2
    rough = made.modifiers.new("Contours", "DISPLACE")
    rough.texture = bpy.data.textures.new("Contours", "CLOUDS")
    rough.texture.noise_scale, rough.strength = 0.08, 0.06
    light("AREA", (3, -3, 3), (0.9, 0, 0.8), energy=300, size=0.5)
    camera((0, -4, 0), (np.pi / 2, 0, 0), 0.75)


def hair_on_skin(method: str) -> None:
    """Strands above a ball of skin, lit from the side: tubes in Cycles, too, whose ribbons shade less."""
    import bpy

    bpy.context.scene.cycles_curves.shape = "THICK"
    _ball(material(method, *SKIN, 1.0), (0, 0, 0), 1.0)
    k = np.arange(400)
    height, turn = 1.0 - (k + 0.5) / 400, 2.399963 * k
    out = np.stack([np.sqrt(1 - height**2) * np.cos(turn), np.sqrt(1 - height**2) * np.sin(turn), height], axis=1)
    points = out[:, None] * np.array([0.98, 1.15, 1.3])[:, None] - np.array([0.0, 0.02, 0.08])[:, None] * [0, 0, 1]
    curves = bpy.data.hair_curves.new("Hair")
    curves.add_curves([3] * len(points))
    curves.attributes["position"].data.foreach_set("vector", np.ravel(points))
    radii = curves.attributes.get("radius") or curves.attributes.new("radius", "FLOAT", "POINT")
    radii.data.foreach_set("value", [0.012] * len(radii.data))
    curves.materials.append(one_shader("Strands", "ShaderNodeBsdfDiffuse", Color=(0.1, 0.06, 0.03, 1)))
    _link("Hair", curves)
    light("AREA", (3, -2, 3), (0.9, 0, 0.98), energy=300, size=0.5)
    light("AREA", (-1, 3, 1), (1.25, 0, 3.46), energy=200, size=1.0)
    camera((0, -4.5, 0.6), (np.pi / 2 - 0.13, 0, 0))


def linked_lamps(method: str) -> None:
    """A lamp from behind that lights the right one of two blocks alone, and one whose shadow a board does not throw."""
    import bpy

    shown = material(method, *WAX, 2.0)
    blocks = [
        _shape(bpy.ops.mesh.primitive_cube_add, shown, False, size=0.9, location=(x, 0, 0), rotation=(0.2, 0.1, 0.5))
        for x in (-0.7, 0.7)
    ]
    board = _shape(bpy.ops.mesh.primitive_cube_add, bpy.data.materials.new("Board"), False, location=(0, -1.5, 1.5))
    board.scale, board.visible_camera = (2.0, 0.5, 0.02), False
    behind = light("AREA", (0.5, 2.5, 1), (1.19, 0, 2.94), energy=150, size=1.0)
    above = light("AREA", (0, -3, 3), (0.785, 0, 0), energy=60, size=0.5)
    lit, blockers = bpy.data.collections.new("Lit"), bpy.data.collections.new("Blockers")
    lit.objects.link(blocks[1])
    for one in blocks:
        blockers.objects.link(one)
    behind.light_linking.receiver_collection = lit
    above.light_linking.blocker_collection = blockers
    camera((0, -4, 0), (np.pi / 2, 0, 0))


def _radius(share: float) -> Callable[[str], None]:
    """A ball lit from the side whose radius of scattering is this share of its own."""

    def scene(method: str) -> None:
        _ball(material(method, (0.8, 0.6, 0.4), (1.0, 0.6, 0.3), share / WALK_SCALE), (0, 0, 0), 1.0)
        light("SUN", turn=(1.2, 0, 1.2), energy=3.0, angle=0.1)
        camera((0, -4, 0), (np.pi / 2, 0, 0))

    return scene


SCENES: dict[str, Callable[[str], None]] = {
    "slab under bars": slab, "sphere from behind": sphere_from_behind, "Suzanne, skin": suzanne_as_skin,
    "Suzanne, wax": suzanne_as_wax, "leaf": leaf, "candle": candle, "marble tile": marble_tile,
    "world alone": under_the_world,
}  # fmt: skip
THROUGH: dict[str, Callable[[str], None]] = {
    "ears": ears, "wax block": block, "grapes": grapes, "hollow candle": hollow_candle,
    "thin leaf": leaf, "cloth": cloth, "cloth, flipped": cloth_flipped, "marble bust": bust, "milk": milk,
    "hair on skin": hair_on_skin, "linked lamps": linked_lamps,
    **{f"radius {share:g}": _radius(share) for share in (0.1, 0.5, 1.0, 2.0)},
}  # fmt: skip


def clear() -> None:
    import bpy

    bpy.context.scene.cycles_curves.shape = "RIBBONS"
    bpy.data.batch_remove([*bpy.data.objects, *bpy.data.meshes, *bpy.data.lights, *bpy.data.cameras])
    bpy.data.batch_remove([*bpy.data.materials, *bpy.data.worlds, *bpy.data.hair_curves, *bpy.data.collections])


Shown = Callable[..., tuple[np.ndarray, float]]


def opened(name: str, method: str, size: tuple[int, int]) -> Shown:
    """Leaves the scene open and returns what renders it: of engine, samples and seed (0) the colour, (height, width,
    3), and the processor seconds that it took."""
    import bpy

    from addon.compare.reference import render_passes

    clear()
    (SCENES | THROUGH)[name](method)
    cycles = bpy.context.scene.cycles
    cycles.use_denoising = False

    def shown(engine: str, samples: int, seed: int = 0):
        extra = [(cycles, "use_denoising", True)] if engine == DENOISED else []
        # Light that glass bends on its way to milk and back is no bounce in Candela.
        extra += [(cycles, "max_bounces", GLASS_BOUNCES), (cycles, "transmission_bounces", GLASS_BOUNCES)]
        engine = "CYCLES" if engine == DENOISED else engine
        before = process_time()
        bounces = BOUNCES.get(name, 2)
        passes = render_passes(bpy.context.scene, engine, samples, seed, size=size, bounces=bounces, extra=extra)
        taken = process_time() - before
        return passes.images["combined"][..., :3].astype(np.float64), taken

    return shown


def scale_of(right: np.ndarray) -> np.ndarray:
    """What squared errors are divided by, (height, width, 1): of relMSE beside this picture, (height, width, 3)."""
    bright = (right @ [0.2126, 0.7152, 0.0722])[..., None]
    return bright**2 + (0.1 * bright.mean()) ** 2


_eevee: dict[tuple, tuple[np.ndarray, float]] = {}  # by scene and size: it knows no methods


def lines(
    name: str, method: str, size, reference: int, pictures: Path | None, entrants=ENTRANTS
) -> list[tuple[str, ...]]:
    """Rows of the table for one scene and method."""
    from addon.compare.png import png

    shown = opened(name, method, size)
    first, second = (shown("CYCLES", reference, seed)[0] for seed in (11, 12))
    right = (first + second) / 2
    scale = scale_of(right)
    noise = float((((first - second) / 2) ** 2 / scale).mean())
    rows, beside, compiled = [], [right], set()
    for engine, samples in entrants:
        if engine == "BLENDER_EEVEE" and (name, size) in _eevee:
            picture, seconds = _eevee[name, size]
        else:
            if engine not in compiled:
                shown(engine, 1)
                compiled.add(engine)
            picture, seconds = shown(engine, samples, 1)
        if engine == "BLENDER_EEVEE":
            _eevee[name, size] = picture, seconds
        error = max(float(((picture - right) ** 2 / scale).mean()) - noise, 0.0)
        label = f"{LABELS[engine]} {samples}"
        mean = f"{picture.mean() / max(right.mean(), 1e-30):.3f}"
        if name in THROUGH:
            mean = " ".join(f"{c:.3f}" for c in picture.mean(axis=(0, 1)) / np.maximum(right.mean(axis=(0, 1)), 1e-30))
        rows.append((name, method, label, f"{error:.4f}", mean, f"{seconds:.2f}", f"{noise:.4f}"))
        if (engine, samples) in (("CANDELA", 1), ("CANDELA", 64), ("BLENDER_EEVEE", 16)):
            beside.append(picture)
    if pictures is not None:
        row = np.concatenate([*beside[1:3], beside[0], *beside[3:]], axis=1)
        shades = (np.clip(row, 0.0, 1.0) ** (1 / 2.2) * 255).astype(np.uint8)[::-1]
        pictures.mkdir(parents=True, exist_ok=True)
        file = pictures / f"{name.replace(' ', '_').replace(',', '')}_{method.lower()}.png"
        file.write_bytes(png(np.ascontiguousarray(shades)))
    return rows


SUMMARY_HEAD = (
    "scene", "method", "Candela 1", "Candela 64", "mean", "EEVEE 16", "Candela's least error in EEVEE's time",
    "Cycles denoised 16", "Candela's least error in its time",
)  # fmt: skip


def summary(rows: list[tuple[str, ...]]) -> str:
    """The aims, a row for each scene and method: errors at 1 and 64 samples, and at the time of others."""
    found = [SUMMARY_HEAD]
    for scene, method in dict.fromkeys(row[:2] for row in rows):
        by_label = {row[2]: row for row in rows if row[:2] == (scene, method)}

        def at_time_of(other: str, by_label=by_label) -> tuple[str, str]:
            if other not in by_label:
                return "–", "–"
            seconds = float(by_label[other][5])
            candela = [(float(row[3]), label.removeprefix("Candela ")) for label, row in by_label.items()
                       if label.startswith("Candela") and float(row[5]) <= seconds]  # fmt: skip
            least = "{:.4f} ({} samples)".format(*min(candela)) if candela else "none as fast"
            return f"{by_label[other][3]} in {seconds:.2f} s", least

        whole = by_label["Candela 64"]
        found.append(
            (scene, method, by_label["Candela 1"][3], whole[3], whole[4], *at_time_of("EEVEE 16"),
             *at_time_of("Cycles denoised 16"))
        )  # fmt: skip
    return markdown.table(found)


def page(rows: list[tuple[str, ...]], size: tuple[int, int], reference: int) -> str:
    """The rows as a part of the documentation."""
    return "\n".join([
        f"Pictures of {size[0]} x {size[1]} pixels, two bounces, against two renders of {reference} samples by Cycles",
        "whose noise is taken off the errors. A number behind a renderer's name: samples.", "",
        summary(rows), "", markdown.table([HEAD, *rows]),
    ])  # fmt: skip


def with_others(page: str, rows: list[tuple[str, ...]], size: tuple[int, int], reference: int) -> list[tuple[str, ...]]:
    """These rows in the place of the page's of the same scene and method, whose others stay; if the page's are of other
    pictures, these alone."""
    if page_through([], size, reference).partition("\n\n")[0] not in page:
        return rows
    kept: dict[tuple[str, ...], list] = {}
    for row in markdown.rows_of(page, COMMAND, THROUGH_HEAD):
        kept.setdefault(tuple(row[:2]), []).append(tuple(row))
    for key in dict.fromkeys(row[:2] for row in rows):
        kept[key] = [row for row in rows if row[:2] == key]
    return [row for of_scene in kept.values() for row in of_scene]


def page_through(rows: list[tuple[str, ...]], size: tuple[int, int], reference: int) -> str:
    """The same of light that comes through: means by channel, the commit of each row, and no summary."""
    return "\n".join([
        f"Pictures of {size[0]} x {size[1]} pixels, two bounces (of milk 16, in glass 16), against two renders of",
        f"{reference} samples by Cycles whose noise is taken off the errors; means of red, green and blue.", "",
        markdown.table([THROUGH_HEAD, *rows]),
    ])  # fmt: skip


EQUAL = (*(("CANDELA", n) for n in (1, 4, 16)), *((DENOISED, n) for n in (1, 4, 16, 64)))  # entrants of `--equal`
EQUAL_HEAD = ("scene", "method", "Candela", "relMSE", "processor s", "Cycles denoised that errs no more", "processor s")


def equal(rows: list[tuple[str, ...]]) -> list[tuple[str, ...]]:
    """What denoised Cycles takes to err no more than Candela, for each row of Candela's: its fewest samples that do."""
    found = []
    for scene, method, label, error, _, seconds, _ in rows:
        if not label.startswith("Candela"):
            continue
        others = [row for row in rows if row[:2] == (scene, method) and row[2].startswith(LABELS[DENOISED])]
        enough = [(float(row[5]), row[2].split()[-1], row[3]) for row in others if float(row[3]) <= float(error)]
        least = min(enough) if enough else None
        cycles = (f"{least[1]} samples, {least[2]}", f"{least[0]:.2f}") if least else ("none of these", "–")
        found.append((scene, method, label.split()[-1], error, seconds, *cycles))
    return found


COMMAND = "python -m bench subsurface --page docs/subsurface.md"
COMMAND_OPAQUE = "python -m bench subsurface --opaque --page docs/subsurface.md"
PARTS = ("table", "split", "through")
FEW = (("CANDELA", 1), ("CANDELA", 16), (DENOISED, 16))  # entrants of light that comes through


def add_options(parser: argparse.ArgumentParser) -> None:
    every = [*SCENES, *THROUGH]
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=PARTS[:1], metavar="PART", help=", ".join(PARTS))
    parser.add_argument("--scenes", nargs="+", choices=every, metavar="NAME", help="default all of either table")
    parser.add_argument("--opaque", action="store_true", help="scenes in which little light comes through, and EEVEE")
    parser.add_argument("--methods", nargs="+", default=list(METHODS), choices=METHODS, metavar="METHOD")
    parser.add_argument("--equal", action="store_true", help="processor seconds for equal error beside denoised Cycles")
    parser.add_argument("--no-eevee", action="store_true", help="leave EEVEE out, which compiles for minutes")
    parser.add_argument("--size", type=size_of, default=(96, 96), metavar="WxH", help="default 96x96")
    parser.add_argument("--reference", type=int, default=512, metavar="N", help="of each of two (default 512)")
    parser.add_argument("--page", type=Path, metavar="PATH", help="write the table between its marks, too")
    parser.add_argument("--pictures", type=Path, metavar="FOLDER", help="write rows of pictures there")


def command(options: argparse.Namespace) -> int:
    import addon

    addon.register()
    from . import subsurface_split as split

    if "split" in options.parts:
        for text in split.split(options):
            print(text, flush=True)
            if options.page:
                markdown.put_between(options.page, split.COMMAND, text)
    if "through" in options.parts:
        print(split.through(options))
    return table_of(options) if "table" in options.parts else 0


def table_of(options: argparse.Namespace) -> int:
    rows: list[tuple[str, ...]] = []
    entrants = tuple(one for one in ENTRANTS if not (options.no_eevee and one[0] == "BLENDER_EEVEE"))
    through = not options.opaque
    entrants = EQUAL if options.equal else FEW if through else entrants
    for name in options.scenes or (THROUGH if through else SCENES):
        for method in options.methods:
            added = lines(name, method, options.size, options.reference, options.pictures, entrants)
            print(table([HEAD, *added]), flush=True)
            rows += [(*row, ages.commit()) for row in added] if through else added
            if options.equal:
                print(table([EQUAL_HEAD, *equal(added)]), flush=True)
            elif options.page:
                shown = options.size, options.reference
                every = with_others(options.page.read_text(encoding="utf-8"), rows, *shown) if through else rows
                text = (page_through if through else page)(every, *shown)
                markdown.put_between(options.page, COMMAND if through else COMMAND_OPAQUE, text)
    return 0
