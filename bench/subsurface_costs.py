"""What light below surfaces costs, painted maps and thin parts: `python -m bench subsurface_costs --page`.

Parts for docs/subsurface.md: the cost of a picture by points, by range in pixels, by resolution and by number of
materials, beside diffuse ones; painted scenes (a face with tinted cheeks that are soft or sharp, veins, a candle with
an opaque wick, a leaf and ears lit from behind that glow where they are painted) with maps and without, and a picture
of the last two; walks through slabs from .25 to 8 mean free paths thick that are lit from behind, beside Cycles; closed
forms of slabs; and dipole splats (subsurface_splats.py). Seconds are medians of renders of 4 samples after one that
compiled.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from . import markdown, subsurface
from .subsurface_splats import splats

PAGE = Path(__file__).resolve().parent.parent / "docs" / "subsurface.md"
COMMAND = "python -m bench subsurface_costs --page"
SIZE, SAMPLES, REPEATS, ROUNDS = (96, 96), 4, 2, 4
PARTS = ("cost", "painted", "glows", "thin", "slabs", "splats")
GLOWS = PAGE.parent / "images" / "subsurface_glows.png"
MAP = 256  # pixels of a side of painted maps


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=PARTS, metavar="PART", help=", ".join(PARTS))
    parser.add_argument("--page", action="store_true", help="write the tables into docs/subsurface.md, too")
    parser.add_argument("--pictures", type=Path, metavar="FOLDER", help="write pictures of painted scenes there")


def command(options: argparse.Namespace) -> int:
    import addon

    addon.register()
    for name in options.parts:
        if name == "glows":
            glows()
            continue
        made = {
            "cost": costs,
            "painted": lambda: painted(options.pictures),
            "thin": thin,
            "slabs": slabs,
            "splats": splats,
        }
        table = made[name]()
        print(table, flush=True)
        if options.page:
            markdown.put_between(PAGE, f"{COMMAND} --parts {name}", table)
    return 0


def _seconds(size=SIZE, samples=SAMPLES) -> tuple[float, np.ndarray, dict]:
    """Median seconds, the picture and the counters of the technique."""
    import bpy

    from addon.compare.reference import render_passes
    from addon.frame import ledger

    taken = []
    for k in range(REPEATS + 1):
        start = time.perf_counter()
        images = render_passes(bpy.context.scene, "CANDELA", samples, k, size=size, bounces=2).images
        if k:
            taken.append(time.perf_counter() - start)
    rows = [row for row in ledger.latest().rows if row.name == "image_space_subsurface"]
    counters = dict(rows[0].counters) if rows else {}
    return float(np.median(taken)), images["combined"][..., :3].astype(np.float64), counters


def costs() -> str:
    import bpy

    scene = bpy.context.scene
    rows = [["", "value", "seconds", "passes", "points", "rays"]]

    def add(label: str, value: str, size=SIZE) -> None:
        seconds, _, counters = _seconds(size)
        rows.append([label, value, f"{seconds:.2f}", *(str(counters.get(k, 0)) for k in ("passes", "points", "rays"))])
        print(rows[-1], flush=True)

    def skin(scale: float = 0.15, weight: float = 1.0):
        subsurface.clear()
        made = subsurface.material("BURLEY", *subsurface.SKIN, scale)
        made.node_tree.nodes["Principled BSDF"].inputs["Subsurface Weight"].default_value = weight
        subsurface._suzanne(made)

    skin(weight=0.0)
    add("diffuse", "")
    for points in (512, 1024, 4096, 16384):
        skin()
        scene.candela.image_space_subsurface_points = points
        add("points", str(points))
    scene.candela.property_unset("image_space_subsurface_points")
    for taps in (8, 24, 96):
        skin()
        scene.candela.image_space_subsurface_taps = taps
        add("taps", str(taps))
    scene.candela.property_unset("image_space_subsurface_taps")
    per_metre = SIZE[0] / 3.1  # pixels at the distance of the head
    for pixels in (0.2, 2, 8, 32, 96):
        skin(pixels / per_metre)
        add("radius of the profile, pixels", f"{pixels:g}")
    for side in (48, 96, 192, 384):
        skin()
        add("resolution", f"{side}x{side}", (side, side))
    for count in (1, 4, 16):
        subsurface.clear()
        for k in range(count):
            shown = subsurface.material("BURLEY", (0.2 + 0.6 * k / 16, 0.5, 0.4), (1, 0.5, 0.3), 0.1)
            side = int(np.ceil(np.sqrt(count)))
            place = (2.4 * ((k % side + 0.5) / side - 0.5), 0, 2.4 * ((k // side + 0.5) / side - 0.5))
            subsurface._shape(
                bpy.ops.mesh.primitive_uv_sphere_add, shown, radius=1.1 / side, location=place, segments=32,
                ring_count=16,
            )  # fmt: skip
        subsurface.light("AREA", (3, -3, 3), (0.9, 0, 0.8), energy=300, size=1.0)
        subsurface.camera((0, -4, 0), (np.pi / 2, 0, 0), 0.75)
        add("materials, as many spheres", str(count))
    return markdown.table(rows)


# Painted --------------------------------------------------------------------------------------------------------------


def _image(name: str, color: Callable[[np.ndarray, np.ndarray], np.ndarray]):
    """A map by a function of u and v, each (MAP, MAP): (MAP, MAP, 3) or (MAP, MAP)."""
    import bpy

    made = bpy.data.images.new(name, MAP, MAP, float_buffer=True)
    made.colorspace_settings.name = "Non-Color"
    v, u = (np.mgrid[0:MAP, 0:MAP] + 0.5) / MAP
    values = np.asarray(color(u, v), np.float32)
    pixels = np.ones((MAP, MAP, 4), np.float32)
    pixels[..., :3] = values[..., None] if values.ndim == 2 else values
    made.pixels.foreach_set(pixels.ravel())
    return made


def _set(material, **maps) -> None:
    for name in ("blur_map", "tint_map", "translucency_map"):
        setattr(material.candela, f"image_space_subsurface_{name}", maps.get(name))


def _cheeks(u, v):
    """Two discs on the front of a sphere of latitudes and longitudes."""
    spots = sum((np.hypot((u - x) * 2, v - 0.47) < 0.08) for x in (0.18, 0.32))
    return np.where(spots[..., None] > 0, (1.0, 0.35, 0.3), (1.0, 1.0, 1.0))


def _veins(u, v):
    depth = np.min([np.abs(v - 0.5 - 0.15 * k - 0.05 * np.sin(40 * u + 5 * k)) for k in (-2, -1, 0, 1, 2)], axis=0)
    return np.where((depth < 0.012)[..., None], (0.35, 0.4, 0.8), (1.0, 1.0, 1.0))


def head(shown) -> None:
    import bpy

    subsurface._shape(bpy.ops.mesh.primitive_uv_sphere_add, shown, segments=64, ring_count=32)
    subsurface.light("AREA", (3, -3, 3), (0.9, 0, 0.8), energy=300, size=1.0)
    subsurface.light("AREA", (-3, 2, 2), (1.1, 0, 4.1), energy=200, size=1.0)
    subsurface.camera((0, -4, 0), (np.pi / 2, 0, 0))


def wick_candle(shown) -> None:
    import bpy

    subsurface.candle("BURLEY")
    for one in bpy.data.objects:
        if one.type == "MESH" and len(one.data.vertices) == 128:
            one.data.materials[0] = shown


def _wick(u, v):
    """Black in the middle of the top face, which Blender's cylinder maps to the circle at (.25, .25)."""
    return np.where(np.hypot(u - 0.25, v - 0.25) < 0.05, 0.0, 1.0)


def _place_as(scene: Callable[[str], None], shown) -> None:
    """Places a scene of subsurface.py with `shown` as the material of its only mesh."""
    import bpy

    scene("BURLEY")
    next(one for one in bpy.data.objects if one.type == "MESH").data.materials[0] = shown


def leaf(shown) -> None:
    _place_as(subsurface.leaf, shown)


def ears(shown) -> None:
    _place_as(subsurface.ears, shown)


def _between_veins(u, v):
    """White between the veins of a leaf, black along them."""
    along, across = u, np.abs(v - 0.5)
    middle = across < 0.02
    side = np.abs((along - 0.7 * across) * 8 % 1.0 - 0.5) < 0.08
    return np.where(middle | side, 0.0, 1.0)


def _ears_alone(u, v):
    """White about where Suzanne's ears lie in her UV map, black elsewhere."""
    import bpy

    mesh = next(one for one in bpy.data.objects if one.type == "MESH").data
    places = [
        mesh.uv_layers.active.uv[loop.index].vector
        for loop in mesh.loops if abs(mesh.vertices[loop.vertex_index].co.x) > 0.85
    ]  # fmt: skip
    near = np.min([np.hypot(u - x, v - y) for x, y in {tuple(place) for place in places}], axis=0)
    return np.clip(2.0 - near / 0.02, 0.0, 1.0)


def _painted_cases() -> dict:
    """By label: values of the material, what places its body, and the maps that are painted, by name."""
    skin = (*subsurface.SKIN, 0.25)
    return {
        "cheeks, soft": (skin, head, {"tint_map": _cheeks}),
        "cheeks, sharp (blur an eighth there)": (
            skin, head, {"tint_map": _cheeks, "blur_map": lambda u, v: np.where(_cheeks(u, v)[..., 1] < 1, 0.0, 0.5)},
        ),
        "veins": (skin, head, {"tint_map": _veins}),
        "candle, opaque wick": ((*subsurface.WAX, 0.8), wick_candle, {"translucency_map": _wick}),
        "leaf, opaque veins": ((*subsurface.LEAF, 0.3), leaf, {"translucency_map": _between_veins}),
        "ears alone": ((*subsurface.SKIN, 1.0), ears, {"translucency_map": _ears_alone}),
    }  # fmt: skip


def with_maps(label: str) -> None:
    """Leave the scene of one of these cases open, with its maps."""
    values, place, maps = _painted_cases()[label]
    subsurface.clear()
    shown = subsurface.material("BURLEY", *values)
    place(shown)
    _set(shown, **{k: _image(k, paint) for k, paint in maps.items()})


def painted(folder: Path | None) -> str:
    neutral = {"blur_map": 0.5, "tint_map": 1.0, "translucency_map": 1.0}
    rows = [["scene", "seconds without maps", "with neutral maps", "with its maps", "ratio", "neutral maps change"]]
    for label, (values, place, maps) in _painted_cases().items():
        subsurface.clear()
        shown = subsurface.material("BURLEY", *values)
        place(shown)
        even_maps = {k: _image(k, lambda u, v, x=x: np.full((MAP, MAP), x)) for k, x in neutral.items()}
        own_maps = {k: _image(k, paint) for k, paint in maps.items()}
        taken: list[list[float]] = [[], [], []]
        for _ in range(ROUNDS):  # in turn, and the least of each: others use the machine, too
            for k, given in enumerate(({}, even_maps, own_maps)):
                _set(shown, **given)
                seconds, found, _ = _seconds()
                taken[k].append(seconds)
                if k == 0:
                    without = found
                elif k == 1:
                    same = found
                else:
                    picture = found
        plain, even, seconds = (min(one) for one in taken)
        difference = np.abs(same - without).max()
        rows.append(
            [label, f"{plain:.2f}", f"{even:.2f}", f"{seconds:.2f}", f"{seconds / plain:.2f}",
             "nothing" if difference == 0 else f"{difference:.1e}"]
        )  # fmt: skip
        print(rows[-1], flush=True)
        if folder is not None:
            _keep(folder, label, np.concatenate([without, picture], axis=1))
    return markdown.table(rows)


def glows() -> None:
    """The picture of docs/subsurface.md: a leaf and ears lit from behind, each without its map and with it."""
    import bpy

    from addon.compare.reference import render_passes

    shown = []
    for label in ("leaf, opaque veins", "ears alone"):
        with_maps(label)
        body = next(one for one in bpy.data.objects if one.type == "MESH").data.materials[0]
        painted_map = body.candela.image_space_subsurface_translucency_map
        for given in ({}, {"translucency_map": painted_map}):
            _set(body, **given)
            found = render_passes(bpy.context.scene, "CANDELA", 16, 1, size=(192, 192), bounces=1)
            shown.append(found.images["combined"][..., :3])
    _write(GLOWS, np.concatenate(shown, axis=1))


def _keep(folder: Path, label: str, row: np.ndarray) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    _write(folder / f"painted_{label.split(' (')[0].replace(' ', '_').replace(',', '')}.png", row)


def _write(file: Path, row: np.ndarray) -> None:
    from addon.compare.png import png

    shades = (np.clip(row, 0.0, 1.0) ** (1 / 2.2) * 255).astype(np.uint8)[::-1]
    file.write_bytes(png(np.ascontiguousarray(shades)))


# Thin parts -----------------------------------------------------------------------------------------------------------


def thin() -> str:
    """Radiance that leaves a slab lit from behind, by thickness in mean free paths: Candela over Cycles."""
    import bpy

    from addon.compare.reference import render_passes

    rows = [["method", "colour", "thickness / mean free path", "Cycles", "Candela", "ratio"]]
    free = 0.1  # m, of every channel
    for method in ("BURLEY", "RANDOM_WALK_SKIN", "RANDOM_WALK"):
        for color in (0.5, 0.9):
            for thick in (0.25, 1.0, 3.0, 8.0):
                subsurface.clear()
                shown = subsurface.material("RANDOM_WALK", (color,) * 3, (1.0, 1.0, 1.0), 4.0 * np.pi * free)
                node = next(one for one in shown.node_tree.nodes if one.type == "BSDF_PRINCIPLED")
                node.subsurface_method = method
                if method != "RANDOM_WALK":
                    node.inputs["Subsurface Scale"].default_value = 4.0 * np.pi * free
                subsurface._shape(
                    bpy.ops.mesh.primitive_cube_add, shown, False, size=1, scale=(6, 6, thick * free)
                )  # fmt: skip
                subsurface.light("SUN", turn=(np.pi, 0, 0), energy=np.pi, angle=0.0)
                subsurface.camera((0, 0, 8), (0, 0, 0), span=1.0)
                means = []
                for engine, samples in (("CYCLES", 256), ("CANDELA", 8)):
                    found = render_passes(bpy.context.scene, engine, samples, 1, size=(24, 24), bounces=2)
                    means.append(float(found.images["combined"][..., :3].mean()))
                rows.append(
                    [method, f"{color}", f"{thick:g}", *(f"{m:.4f}" for m in means), f"{means[1] / means[0]:.2f}"]
                )  # fmt: skip
                print(rows[-1], flush=True)
    return markdown.table(rows)


# Closed forms ---------------------------------------------------------------------------------------------------------


def walked(paths: float, albedo: float, walks: int = 400_000) -> tuple[float, float]:
    """Shares of walks, straight into a slab so many free paths thick, that leave it in front and behind."""
    random = np.random.default_rng(1)
    z, along, left = np.zeros(walks), np.ones(walks), np.zeros(2)
    while len(z):
        z = z - along * np.log(random.random(len(z)))
        left += (z < 0.0).sum(), (z > paths).sum()
        stays = (z >= 0.0) & (z <= paths) & (random.random(len(z)) < albedo)
        z, along = z[stays], random.uniform(-1.0, 1.0, stays.sum())
    return float(left[0]) / walks, float(left[1]) / walks


def slabs() -> str:
    """Slabs of Random Walk, seen and lit straight, by thickness in mean free paths: what leaves on the lit side and on
    the other, beside plain walks and diffusion (multipole); and a white ball in an even world."""
    import bpy

    from addon.compare.reference import render_passes
    from addon.kernels import diffusion

    color, free = 0.8, 0.1
    albedo = 1.0 - float(diffusion.walk_absorption(np.array(color))) ** 2
    medium = diffusion.Medium((1.0 - albedo) / free, albedo / free, 0.0, 1.0)

    def rendered() -> float:
        found = render_passes(bpy.context.scene, "CANDELA", 8, 1, size=(24, 24), bounces=0)
        return float(found.images["combined"][..., :3].mean())

    head = ["thickness / mean free path", "side", "plain walk", "Candela", "ratio", "diffusion"]
    rows = [head]
    for thick in (0.25, 0.5, 1.0, 2.0, 4.0, 8.0):
        plain = walked(thick, albedo)
        diffuse = [float(one) for one in diffusion.multipole(medium, thick * free)]
        for side, turn in ((0, 0.0), (1, np.pi)):
            subsurface.clear()
            shown = subsurface.material("RANDOM_WALK", (color,) * 3, (1.0, 1.0, 1.0), 4.0 * np.pi * free)
            subsurface.node_of(shown, "BSDF_PRINCIPLED").inputs["Roughness"].default_value = 0.0
            cube = bpy.ops.mesh.primitive_cube_add
            subsurface._shape(cube, shown, False, size=1, scale=(6, 6, thick * free))
            subsurface.light("SUN", turn=(turn, 0, 0), energy=np.pi, angle=0.0)
            subsurface.camera((0, 0, 8), (0, 0, 0), span=0.5)
            mean = rendered()
            name = ("lit", "other")[side]
            rows.append([
                f"{thick:g}", name, f"{plain[side]:.4f}", f"{mean:.4f}", f"{mean / plain[side]:.3f}",
                f"{diffuse[side]:.4f}",
            ])  # fmt: skip
            print(rows[-1], flush=True)
    subsurface.clear()
    white = subsurface.material("RANDOM_WALK", (1.0, 1.0, 1.0), (1.0, 1.0, 1.0), 4.0 * np.pi * 0.3)
    subsurface._ball(white, (0, 0, 0), 1.0)
    subsurface.even_world((1, 1, 1), 1.0)
    subsurface.camera((0, 0, 5), (0, 0, 0), span=0.5)
    mean = rendered()
    rows.append(["white ball in a white world", "all", "1.0000", f"{mean:.4f}", f"{mean:.3f}", "1.0000"])
    return markdown.table(rows)
