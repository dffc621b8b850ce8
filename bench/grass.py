"""Grass from a patch beside real blades: `python -m bench grass --page`.

Compression: the tile of the specification (0.25 m, blades up to 0.1 m, 500 of them, 81 views, 21 lights, 64 x 64
texels, 16 samples), by components, with the errors of decoded pictures. Its views are kept in the cache of references,
so that a second run takes seconds.

Pictures: the shipped patch beside the field of blades that it was made of, by Cycles: means and contrast (standard
deviation of luminance over a row of the picture, or over a tile) for one sun. Both are rendered twice, with other
random numbers: what two pictures have in common is free of noise, of which there is as much as contrast far away. Time:
Candela's second render of the same view, of the patch and of instanced blades.

Outline: a hill against nothing, by the patch and by blades that stand on it: mean and deviation of how high
the outline of the coverage stands above the ground's own.
"""

from __future__ import annotations

import argparse
import math
import time
from pathlib import Path

import numpy as np

from . import markdown
from .shading import one_shader
from .study import PICTURES, Study

SIZE = (128, 96)
SUN = (0.7, 0.0, 0.5)
SAMPLES_OF_CYCLES = 96  # of each of two pictures
SEEDS = (1, 2)
HELD_OUT = ((10.0, 40.0), (30.0, 200.0), (50.0, 100.0), (68.0, 310.0), (80.0, 10.0))  # degrees
FIELD = 6  # tiles from the middle to a side, for times
BLADES = (1, 4)  # times as many in a tile


# Compression ---------------------------------------------------------------------------------------------------------


def compression(options: argparse.Namespace) -> str:
    from addon.compare.reference import cache_folder
    from addon.grass import compression as by
    from addon.grass.generate import Order, read_view, studio, view_file, write_view

    order, folder = Order(finer=False), cache_folder() / "grass_views"
    missing = [view for view in range(order.views.number) if read_view(order, folder, view) is None]
    if missing:
        with studio(order) as stage:
            for view in missing:
                found = stage.render(order.views.vectors[view], order.lights.vectors)
                write_view(order, folder, view, *found, np.zeros((0, 3)))
                print(view_file(folder, view), flush=True)
    data = np.stack([read_view(order, folder, view)[0] for view in range(order.views.number)])
    white = by.white_of(data)
    flat = data.reshape(-1, order.texels**2, 3).transpose(1, 0, 2).astype(np.float32)
    rows = [["components of luma / chroma", "RGB rmse / mean", "luma rmse / mean", "contrast kept"]]
    for luma, chroma in ((4, 6), (40, 6), (140, 6)):
        found = by.errors(flat, by.compressed(flat, luma, chroma, white))
        rows.append([f"of all views, {luma} / {chroma}", *(f"{value:.3f}" for value in found.values())])
    level = moved_to_mean_height(data, order, folder)
    found = by.errors(level, by.compressed(level, 140, 6, white))
    rows.append(["and views moved to their mean height, 140 / 6", *(f"{value:.3f}" for value in found.values())])
    found = by.errors(level, by.compressed(level, 140, 6, white, weighted=True))
    rows.append(["and errors weighted by the pictures' luma, 140 / 6", *(f"{value:.3f}" for value in found.values())])
    for luma, chroma in ((4, 1), (8, 1), (8, 2)):
        views = [view.reshape(-1, order.texels**2, 3).transpose(1, 0, 2) for view in data]
        found = by.errors(flat, np.concatenate([by.compressed(one, luma, chroma, white) for one in views], axis=1))
        rows.append([f"of each view, {luma} / {chroma}", *(f"{value:.3f}" for value in found.values())])
    return f"**Error of compression, tile of the specification**\n\n{markdown.table(rows)}"


def moved_to_mean_height(data: np.ndarray, order, folder: Path) -> np.ndarray:
    """Pictures (places, pictures, 3), those of a view shifted so that what lies at its mean height is in place:
    they stand in the plane on top of the blades."""
    from addon.grass.generate import read_view

    moved, recipe = np.empty_like(data), order.recipe
    for view, way in enumerate(order.views.vectors):
        below = recipe.height - read_view(order, folder, view)[1].mean()
        x, y = np.round(-below * way[:2] / way[2] / recipe.size * order.texels).astype(int)
        moved[view] = np.roll(data[view], (y, x), axis=(1, 2))
    return moved.reshape(-1, order.texels**2, 3).transpose(1, 0, 2).astype(np.float32)


# Scenes --------------------------------------------------------------------------------------------------------------


def recipe(blades: int = 1):
    from addon.grass.blades import Recipe

    return Recipe(0.4, 0.1, 1300 * blades, 3)  # of the shipped patch


def clear() -> None:
    import bpy

    bpy.ops.wm.read_factory_settings(use_empty=True)


def field(patch: bool, tiles: int, blades: int = 1) -> None:
    """Square ground of 2 x `tiles` tiles along each side, with grass from the patch or with blades; one sun."""
    import bpy

    from addon.grass.blades import SOIL
    from addon.grass.generate import field_of

    scene = bpy.context.scene
    half = tiles * recipe().size
    if not patch:
        field_of(recipe(blades), scene, range(-tiles, tiles), ground=False)
    mesh = bpy.data.meshes.new("Ground")
    mesh.from_pydata([(-half, -half, 0), (half, -half, 0), (half, half, 0), (-half, half, 0)], [], [(0, 1, 2, 3)])
    soil = one_shader("Soil", "ShaderNodeBsdfDiffuse", Color=(*SOIL, 1.0))
    soil.candela.grass_patch = "MEADOW" if patch else "NONE"
    mesh.materials.append(soil)
    scene.collection.objects.link(bpy.data.objects.new("Ground", mesh))
    sun = bpy.data.lights.new("Sun", "SUN")
    sun.energy, sun.angle = 3.0, 0.0
    lamp = bpy.data.objects.new("Sun", sun)
    lamp.rotation_euler = SUN
    scene.collection.objects.link(lamp)


def camera(location, turn, span: float = 0.0, angle: float = 0.9):
    import bpy

    data = bpy.data.cameras.new("Camera")
    data.angle = angle
    if span:
        data.type, data.ortho_scale = "ORTHO", span
    made = bpy.data.objects.new("Camera", data)
    made.location, made.rotation_euler = location, turn
    bpy.context.scene.collection.objects.link(made)
    bpy.context.scene.camera = made


def seen_from(polar: float, azimuth: float, span: float) -> None:
    from mathutils import Vector

    a, b = math.radians(polar), math.radians(azimuth)
    way = Vector((math.sin(a) * math.cos(b), math.sin(a) * math.sin(b), math.cos(a)))
    camera(5.0 * way, way.to_track_quat("Z", "Y").to_euler(), span)


def shown(engine: str, samples: int, size=SIZE, seed: int = SEEDS[0]) -> tuple[np.ndarray, float]:
    """Luminance (H, W), and seconds."""
    import bpy

    from addon.compare.reference import render_passes
    from addon.grass.compression import LUMA

    done = render_passes(bpy.context.scene, engine, samples, seed, size=size, bounces=4 if engine == "CYCLES" else 0)
    return done.images["combined"][..., :3] @ LUMA, done.seconds


def both(view, tiles: int, size=SIZE, to: Path | None = None) -> list[np.ndarray]:
    """The field by Candela from the patch, and by Cycles of blades, from a view that `view()` sets: (2, H, W) each."""
    found = []
    for patch in (True, False):
        clear()
        field(patch, tiles)
        view()
        engine, samples = ("CANDELA", 64) if patch else ("CYCLES", SAMPLES_OF_CYCLES)
        found.append(np.stack([shown(engine, samples, size, seed)[0] for seed in SEEDS]))
    if to:
        from addon.compare.png import png

        light = np.repeat(np.concatenate(found, axis=2).mean(axis=0)[::-1, :, None], 3, axis=2)
        to.mkdir(parents=True, exist_ok=True)
        (to / f"grass_{len(list(to.glob('grass_*.png')))}.png").write_bytes(
            png(np.uint8(255 * np.sqrt(light.clip(0, 1))))
        )
    return found


def over_meadow() -> None:
    camera((0, -5.0, 1.7), (math.radians(70), 0, 0), angle=0.95)


def varied_meadow(tiles: int) -> np.ndarray:
    """The meadow by Candela with shifted tiles."""
    import bpy

    clear()
    field(True, tiles)
    bpy.data.materials["Soil"].candela.grass_varied = True
    over_meadow()
    return np.stack([shown("CANDELA", 64, seed=seed)[0] for seed in SEEDS])


def contrast(pair: np.ndarray, axis=None) -> float:
    """Standard deviation over `axis` that two pictures (2, H, W) have in common: root of the mean covariance."""
    a, b = pair - pair.mean(axis=(1, 2) if axis is None else axis + 1, keepdims=True)
    return float(np.sqrt(max((a * b).mean(), 0.0)))


def pictures(options: argparse.Namespace) -> str:
    rows = [["seen from", "mean / Cycles", "contrast / Cycles"]]
    for polar, azimuth in HELD_OUT:
        mine, true = both(
            lambda polar=polar, azimuth=azimuth: seen_from(polar, azimuth, 0.8), 14, (64, 64), options.pictures
        )
        rows.append(
            [f"{polar:.0f} degrees", f"{mine.mean() / true.mean():.3f}", f"{contrast(mine) / contrast(true):.3f}"]
        )
    mine, true = both(over_meadow, 24, SIZE, options.pictures)
    varied = varied_meadow(24)
    height, width = mine.shape[1:]
    up = np.tan(0.95 / 2) * (2 * (np.arange(height) + 0.5) - height) / width
    polar = 70.0 + np.degrees(np.arctan(up))  # of the view along each row, from straight down
    meadow = [
        ["rows seen from", "mean / Cycles", "farthest row", "contrast / Cycles", "tiles varied: mean", "contrast"]
    ]
    for low, high in ((40, 60), (60, 70), (70, 75), (75, 80), (80, 82)):
        own = (polar >= low) & (polar < high)
        if own.any():
            mine_here, true_here, varied_here = (one[:, own] for one in (mine, true, varied))
            row_means = mine_here.mean(axis=(0, 2)) / true_here.mean(axis=(0, 2))
            mean = true_here.mean()
            farthest = row_means[np.abs(row_means - 1).argmax()]
            meadow.append([f"{low} to {high} degrees", f"{mine_here.mean() / mean:.3f}", f"{farthest:.3f}"])
            meadow[-1] += [f"{contrast(mine_here, 1) / contrast(true_here, 1):.3f}", f"{varied_here.mean() / mean:.3f}"]
            meadow[-1] += [f"{contrast(varied_here, 1) / contrast(true_here, 1):.3f}"]
    first = f"**A tile from directions that were not sampled, sun at 40 degrees**\n\n{markdown.table(rows)}"
    second = f"**A meadow from 1.7 m, by polar angle of its rows, sun at 40 degrees**\n\n{markdown.table(meadow)}"
    return f"{first}\n\n{second}"


HILL = 5.0  # m, radius of a cylinder along x whose top is the origin
HILL_ROWS, HILL_COLUMNS = range(-9, 12), range(-3, 3)  # tiles on it
OUTLINE_SIZE, OUTLINE_WIDTH = (128, 64), 0.8  # two tiles; pixels as large as the meadow's texels
LOOKING_DOWN = (2.0, 5.0, 8.0, 11.0, 14.0, 17.0, 20.0)  # degrees; each has another row of the tile on the crest


def hill(patch: bool) -> None:
    """Grass on a part of a cylinder, from the patch or of blades, each tile of which stands on its middle's tangent."""
    import bpy

    from addon.grass.generate import field_of

    clear()
    field(patch, 1)
    bpy.data.objects.remove(bpy.data.objects["Ground"])
    size, scene = recipe().size, bpy.context.scene
    if not patch:
        for copy in [one for one in scene.objects if one.instance_collection]:
            bpy.data.objects.remove(copy)
        field_of(recipe(), scene, range(1), ground=False)
        (first,) = (one for one in scene.objects if one.instance_collection)
        for row in HILL_ROWS:
            angle = (row + 0.5) * size / HILL
            for column in HILL_COLUMNS:
                copy = first.copy()
                copy.rotation_euler = (-angle, 0.0, 0.0)
                back = 0.5 * size  # from the tile's middle to its corner, along the slope
                y, z = HILL * math.sin(angle), HILL * (math.cos(angle) - 1.0)
                copy.location = (column * size, y - back * math.cos(angle), z + back * math.sin(angle))
                scene.collection.objects.link(copy)
        bpy.data.objects.remove(first)
    angles = np.linspace(HILL_ROWS[0] * size / HILL, (HILL_ROWS[-1] + 1) * size / HILL, 48)
    sides = (HILL_COLUMNS[0] * size, (HILL_COLUMNS[-1] + 1) * size)
    places = [(x, HILL * math.sin(a), HILL * (math.cos(a) - 1.0)) for a in angles for x in sides]
    mesh = bpy.data.meshes.new("Hill")
    mesh.from_pydata(places, [], [(2 * k, 2 * k + 1, 2 * k + 3, 2 * k + 2) for k in range(len(angles) - 1)])
    mesh.shade_smooth()
    mesh.materials.append(bpy.data.materials["Soil"])
    scene.collection.objects.link(bpy.data.objects.new("Hill", mesh))
    scene.render.film_transparent = True


def outline_of(engine: str, samples: int, down: float, to: Path | None) -> np.ndarray:
    """Metres of the picture's outline above that of the ground, by column, seen from `down` degrees above."""
    import bpy

    from addon.compare.reference import render_passes

    angle = math.radians(down)
    seen_from(90.0 - down, -90.0, OUTLINE_WIDTH)
    bpy.context.scene.camera.location.y += HILL * math.sin(angle)
    bpy.context.scene.camera.location.z += HILL * (math.cos(angle) - 1.0)
    done = render_passes(bpy.context.scene, engine, samples, 1, size=OUTLINE_SIZE, bounces=0)
    covered = done.images["combined"][..., 3]
    if to:
        from addon.compare.png import png

        to.mkdir(parents=True, exist_ok=True)
        shown = np.repeat(covered[::-1, :, None], 3, axis=2)
        (to / f"outline_{engine.lower()}_{down:.0f}.png").write_bytes(png(np.uint8(255 * shown.clip(0, 1))))
    height = OUTLINE_SIZE[1]
    top = height - (covered[::-1] > 0.5).argmax(axis=0)  # rows below the outline
    return (top - 0.5 * height) * OUTLINE_WIDTH / OUTLINE_SIZE[0]


def outline(options: argparse.Namespace) -> str:
    found = {}
    for patch, engine in ((True, "CANDELA"), (False, "CYCLES")):
        for down in LOOKING_DOWN:
            hill(patch)
            found[engine, down] = outline_of(engine, 32, down, options.pictures)
    rows = [["seen from above by", "mean, mm", "Cycles", "ratio", "deviation, mm", "Cycles", "ratio"]]
    for label, angles in (*((f"{down:.0f} degrees", (down,)) for down in LOOKING_DOWN), ("all", LOOKING_DOWN)):
        mine, true = (np.stack([found[engine, down] for down in angles]) for engine in ("CANDELA", "CYCLES"))
        rows.append([label])
        for a, b in ((mine.mean(), true.mean()), (mine.std(axis=1).mean(), true.std(axis=1).mean())):
            rows[-1] += [f"{1000 * a:.1f}", f"{1000 * b:.1f}", f"{a / b:.2f}"]
    return f"**Outline of a hill of 5 m above its ground**\n\n{markdown.table(rows)}"


PATH_FINE = 16  # texels of the map in a tile
LOW_SUN = (math.radians(65.0), 0.0, 0.0)


def path_through(patch: bool, tiles: int = 6) -> None:
    """A row of tiles without grass, from y = 0 on, into which a low sun shines over the blades beside it."""
    import bpy

    clear()
    field(patch, tiles)
    size = recipe().size
    bpy.data.objects["Sun"].rotation_euler = LOW_SUN
    if patch:
        side = 2 * tiles * PATH_FINE
        grown = np.ones((side, side, 4), np.float32)
        grown[tiles * PATH_FINE : (tiles + 1) * PATH_FINE, :, :3] = 0.0
        image = bpy.data.images.new("Path", side, side, float_buffer=True, is_data=True)
        image.pixels.foreach_set(grown.ravel())
        image.pack()
        own = bpy.data.materials["Soil"].candela
        own.grass_density_map, own.grass_map_size = image, 2 * tiles * size
    else:
        for copy in [one for one in bpy.data.objects if one.instance_collection and abs(one.location.y) < 0.1 * size]:
            bpy.data.objects.remove(copy)
    seen_from(0.0, 0.0, size)
    bpy.context.scene.camera.location = (0.5 * size, 0.5 * size, 5.0)
    bpy.context.scene.camera.rotation_euler = (0.0, 0.0, 0.0)


def shadows(options: argparse.Namespace) -> str:
    """How bright a bare path is in the shadow of the grass beside it, in light that is not reflected on its way."""
    import bpy

    from addon.compare.reference import render_passes
    from addon.grass.blades import SOIL
    from addon.grass.compression import LUMA

    found = []
    for patch, engine, samples in ((True, "CANDELA", 64), (False, "CYCLES", 128)):
        path_through(patch)
        images = render_passes(bpy.context.scene, engine, samples, 1, size=(48, 48), bounces=0).images
        found.append(images["combined"][..., :3] @ LUMA)
    lit = float(np.array(SOIL) @ LUMA) / math.pi * 3.0 * math.cos(LOW_SUN[0])
    rows = [["of the path, from the sun's side", "Candela", "Cycles"]]
    for k in range(4):
        part = slice(12 * k, 12 * (k + 1))
        rows.append([f"quarter {k + 1}", *(f"{one[part].mean() / lit:.3f}" for one in found)])
    rows.append(["all", *(f"{one.mean() / lit:.3f}" for one in found)])
    return (
        f"**Light on a path of 0.4 m beside grass, sun 65 degrees from above, 1: no shadow**\n\n{markdown.table(rows)}"
    )


def times(options: argparse.Namespace) -> str:
    rows = [["field", "triangles of blades", "first render, s", "second, ms"]]
    whole = recipe().blades * 10 * (2 * FIELD) ** 2

    def timed(label: str, triangles: int, patch: bool, blades: int) -> None:
        clear()
        field(patch, FIELD, blades)
        camera((0, -2.4, 1.7), (math.radians(65), 0, 0), angle=0.95)
        started = time.perf_counter()
        shown("CANDELA", 4)
        first = time.perf_counter() - started
        import bpy

        bpy.context.scene.candela.seed += 1  # else nothing is drawn anew
        again = []
        for _ in range(2):
            bpy.context.scene.candela.seed += 1
            again.append(_second())
        rows.append([label, f"{triangles:,}", f"{first:.2f}", f"{1000 * min(again):.0f}"])
        print(rows[-1], flush=True)

    timed("patch, any number of blades", 0, True, 1)
    for factor in BLADES:
        timed(f"instances, {recipe(factor).blades:,} blades a tile", whole * factor, False, factor)
    return f"**Time of {SIZE[0]} x {SIZE[1]} pixels, 4 samples, by Candela**\n\n{markdown.table(rows)}"


def _second() -> float:
    import bpy

    from addon.compare.reference import render_passes

    seed = bpy.context.scene.candela.seed
    return render_passes(bpy.context.scene, "CANDELA", 4, seed, size=SIZE, bounces=0).seconds


PARTS = {"compression": compression, "pictures": pictures, "outline": outline, "shadows": shadows, "time": times}
STUDY = Study("grass", PARTS, {"--pictures": PICTURES})
add_options, command = STUDY.add_options, STUDY.command
