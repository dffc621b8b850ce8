"""Scenes as people make them, beside Cycles: `python -m bench cases`, which takes a few minutes.

Scenes (case_scenes.py): images, attributes, working space, lamps' trees, displacement and Blender 5's nodes, each a
picture with all its light at 64 samples beside Cycles at 512. relMSE and the ratio of means; the reference's own noise
is half the difference of two seeds. Mixes: noise of one and of two closures on a plane at 8 samples, the standard
deviation of pixels over their mean from Cycles' at 512, own and Cycles'. Instances: 100,489 cubes by geometry nodes,
seconds of wall and of processor of reading the scene (sync) and of its way to the GPU (upload): first, nothing changed,
moved.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from unittest import mock

import numpy as np

from bench.case_scenes import SCENES
from bench.markdown import put_between, table

COMMAND = "python -m bench cases"
PAGE = Path(__file__).resolve().parents[1] / "docs" / "cases.md"
SIZE, SAMPLES, REFERENCE_SAMPLES = (64, 64), 64, 512
MOST = 0.01  # relMSE
SIDE = 317  # instances along a side


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--part", choices=("scenes", "mixes", "instances"), action="append", help="all, if none is named"
    )
    parser.add_argument("--scenes", nargs="*", default=list(SCENES), choices=list(SCENES))
    parser.add_argument("--page", action="store_true", help="write the tables into docs/cases.md")
    parser.add_argument("--pictures", type=Path, metavar="FOLDER", help="write both engines' pictures as PNG")


def command(options: argparse.Namespace) -> int:
    import addon

    addon.register()
    good = True
    for part in options.part or ["scenes", "mixes", "instances"]:
        rows = {"scenes": scenes, "mixes": mixes, "instances": instances}[part](options)
        print(table(rows), flush=True)
        if options.page:
            put_between(PAGE, f"{COMMAND} --part {part}", table(rows))
        if part == "scenes":
            good = all(float(row[1]) <= MOST for row in rows[1:])
    return 0 if good else 1


def stage():
    """An empty scene to fill."""
    from tests.techniques.conftest import Stage

    return Stage()


# Scenes -------------------------------------------------------------------------------------------------------------


def scenes(options) -> list[list[str]]:
    from addon.compare.metrics import compare_radiance
    from addon.compare.reference import render_passes
    from addon.frame import ledger

    rows = [["scene", "relMSE", "reference's noise", "mean over Cycles'", "said to differ"]]
    for name in options.scenes:
        import bpy

        if bpy.app.version < (5, 0) and name in ("working space", "nodes"):
            continue
        made = stage()
        SCENES[name](made)
        own = render_passes(made.scene, "CANDELA", SAMPLES, 1, size=SIZE).images["combined"]
        notes = [str(note) for note in ledger.latest().notes]
        seeds = [render_passes(made.scene, "CYCLES", REFERENCE_SAMPLES // 2, seed, size=SIZE).images["combined"]
                 for seed in (1, 2)]  # fmt: skip
        reference, half = (seeds[0] + seeds[1]) / 2, (seeds[0] - seeds[1]) / 2
        error = compare_radiance("combined", own, reference, half)
        rows.append([name, f"{error.relmse:.4f}", f"{error.floor:.4f}", f"{error.bias:.3f}", "; ".join(notes)])
        print("  ".join(rows[-1]), flush=True)
        if options.pictures:
            write_pictures(options.pictures, name, own, reference)
        if name == "working space":
            bpy.ops.wm.set_working_color_space(working_space="Linear Rec.709", convert_colors=False)
    return rows


def write_pictures(folder: Path, name: str, own, reference) -> None:
    """Both beside each other, own left, by the standard view's curve."""
    from PIL import Image

    folder.mkdir(parents=True, exist_ok=True)
    both = np.concatenate([own, reference], axis=1)[::-1, :, :3]
    shown = np.where(both > 0.0031308, 1.055 * np.maximum(both, 1e-9) ** (1 / 2.4) - 0.055, 12.92 * both)
    picture = Image.fromarray((255 * np.clip(shown, 0, 1) + 0.5).astype(np.uint8))
    picture.resize((4 * both.shape[1], 4 * both.shape[0]), Image.Resampling.NEAREST).save(folder / f"{name}.png")


# Mixes --------------------------------------------------------------------------------------------------------------


def mixes(options) -> list[list[str]]:
    """Noise of pixels in the middle of a plane, where neighbours are lit alike."""
    from addon.compare.reference import render_passes

    rows = [["plane", "Candela", "Cycles", "mean over Cycles'"]]
    for label, closures, behind in MIXES:
        made = stage()
        made.scene.render.filter_size = 1.5
        made.camera_above(span=0.5)
        made.world((1, 1, 1), 0.2)
        made.light("AREA", (0.0, 0.0, 4.0), size=1.0, energy=100.0)
        material = mixed(made, closures)
        made.floor(material=material)
        if behind:
            made.floor(z=-0.5, material=made.material("ShaderNodeEmission", Strength=behind))
        found = []
        for engine, samples in (("CANDELA", 8), ("CYCLES", 8), ("CYCLES", 512)):
            pixels = render_passes(made.scene, engine, samples, 1, size=(48, 48)).images["combined"][..., 1]
            found.append(pixels)
        own, other, even = (pixels / pixels.mean() for pixels in found)
        ratio = found[0].mean() / found[2].mean()
        rows.append([label, f"{(own - even).std():.4f}", f"{(other - even).std():.4f}", f"{ratio:.3f}"])
        print("  ".join(rows[-1]), flush=True)
    return rows


DIFFUSE = ("ShaderNodeBsdfDiffuse", {"Color": (0.8, 0.4, 0.2, 1)})
OTHER_DIFFUSE = ("ShaderNodeBsdfDiffuse", {"Color": (0.1, 0.6, 0.9, 1)})
GLOSSY = ("ShaderNodeBsdfGlossy", {"Color": (0.9, 0.8, 0.7, 1), "Roughness": 0.3})
OTHER_GLOSSY = ("ShaderNodeBsdfGlossy", {"Color": (0.3, 0.5, 0.9, 1), "Roughness": 0.6})
EMISSION = ("ShaderNodeEmission", {"Color": (0.9, 0.3, 0.2, 1), "Strength": 2.0})
CLEAR = ("ShaderNodeBsdfTransparent", {})
MIXES = (
    ("diffuse", (DIFFUSE,), 0.0),
    ("glossy .3", (GLOSSY,), 0.0),
    ("glossy .6", (OTHER_GLOSSY,), 0.0),
    ("diffuse, emission", (DIFFUSE, EMISSION), 0.0),
    ("diffuse, diffuse", (DIFFUSE, OTHER_DIFFUSE), 0.0),
    ("diffuse, glossy", (DIFFUSE, GLOSSY), 0.0),
    ("glossy, glossy", (GLOSSY, OTHER_GLOSSY), 0.0),
    ("transparent, emission", (CLEAR, EMISSION), 0.5),
    ("transparent, diffuse", (CLEAR, DIFFUSE), 0.5),
    ("transparent, glossy", (CLEAR, GLOSSY), 0.5),
)


def mixed(made, closures):
    """A material of one closure, or of two by halves."""
    kind, inputs = closures[0]
    material = made.material(kind, **inputs)
    tree = material.node_tree
    if len(closures) == 2:
        first = next(one for one in tree.nodes if one.type != "OUTPUT_MATERIAL")
        second, mix = tree.nodes.new(closures[1][0]), tree.nodes.new("ShaderNodeMixShader")
        for name, value in closures[1][1].items():
            second.inputs[name].default_value = value
        tree.links.new(first.outputs[0], mix.inputs[1])
        tree.links.new(second.outputs[0], mix.inputs[2])
        tree.links.new(mix.outputs[0], next(n for n in tree.nodes if n.type == "OUTPUT_MATERIAL").inputs["Surface"])
    return material


# Instances ----------------------------------------------------------------------------------------------------------


def instances(options) -> list[list[str]]:
    from addon.compare.reference import render_passes
    from addon.frame import ledger
    from tests.snapshot.test_instances import cube_on_points

    made = stage()
    step = 0.3
    points = made.mesh([(step * x, step * y, 0.0) for x in range(SIDE) for y in range(SIDE)])
    group = cube_on_points()
    cube = next(node for node in group.nodes if node.bl_idname == "GeometryNodeMeshCube")
    cube.inputs["Size"].default_value = (0.2, 0.2, 0.2)
    points.modifiers.new("Cubes", "NODES").node_group = group
    made.camera((step * SIDE / 2, step * SIDE / 2, 100), (0, 0, 0))
    made.light("SUN")
    rows = [["", "sync, s", "upload, s", "sync, processor s", "upload, processor s"]]
    for label in ("first", "nothing changed", "moved", "moved again"):
        cells = [label]
        for clock in (time.perf_counter, time.process_time):
            if label == "first":
                from addon import engine

                engine.free_sessions()
            if label.startswith("moved"):
                points.location.x += 0.1
            with mock.patch("time.perf_counter", clock):
                render_passes(made.scene, "CANDELA", 1, 1, size=(64, 64))
            times = ledger.latest().times
            cells += [f"{times['sync']:.2f}", f"{times['upload']:.2f}"]
        rows.append(cells)
        print("  ".join(cells), flush=True)
    wall, processor = time.perf_counter(), time.process_time()
    render_passes(made.scene, "CYCLES", 1, 1, size=(64, 64))
    wall, processor = time.perf_counter() - wall, time.process_time() - processor
    rows.append(["Cycles, the whole picture", f"{wall:.2f}", "", f"{processor:.2f}", ""])
    return rows
