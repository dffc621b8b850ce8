"""What reflections and their edits cost: `python -m bench reflection_costs`.

Four tables for docs/reflections.md (--page writes them), all on the machine that runs this: a mirror before 1 to 64
cubes of a material each (of programs of their own, of one program with other values, and behind the mirror, where no
ray meets them); two facing mirrors with 1 to 16 shaded bounces, both beside mean colours; the solve of 1, 4 and 32
constraints over a million pixels; distances along 500,000 triangles.

Seconds are medians of renders after one that compiled. Passes are counted by the ledger and hold on every machine.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

from . import markdown
from .reflections import PAGE
from .shading import even_world

COMMAND = "python -m bench reflection_costs --page"
SAMPLES, REPEATS = 4, 3
SIZE = (96, 64)
MATERIALS = (1, 4, 16, 64)
BOUNCES = (1, 2, 4, 8, 16)
CONSTRAINTS = (1, 4, 32)
ROUNDS = 4  # solves between two readbacks
SOLVED = (1024, 1024)  # pixels of the solve that is timed
PROGRAMS, VALUES, UNMET = "programs of their own", "one program, other values", "met by no ray"


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--page", action="store_true", help="write the tables into docs/reflections.md, too")


def command(options: argparse.Namespace) -> int:
    import addon

    addon.register()
    parts = [
        f"**Materials that rays meet**: {SAMPLES} samples, 96x64 pixels.\n\n{materials()}",
        f"**Bounces**: two facing mirrors, {SAMPLES} samples.\n\n{bounces()}",
        f"**The solve of edits**: {SOLVED[0]}x{SOLVED[1]} places on the unit square.\n\n{solve()}",
        f"**Distances along a surface**: a closed mesh of 500,000 triangles, numpy on one core.\n\n{distances()}",
    ]
    print("\n\n".join(parts))
    if options.page:
        markdown.put_between(PAGE, COMMAND, "\n\n".join(parts))
    return 0


def _timed(scene, **settings) -> tuple[float, dict]:
    """Median seconds and the ledger's counters of shaded reflections."""
    from addon.compare.reference import render_passes
    from addon.frame import ledger

    for name, value in settings.items():
        setattr(scene.candela, name, value)
    seconds = []
    for k in range(REPEATS + 1):
        start = time.perf_counter()
        render_passes(scene, "CANDELA", SAMPLES, k, size=SIZE)
        seconds.append(time.perf_counter() - start)
    rows = [row for row in ledger.latest().rows if row.name == "shaded_reflections"]
    return float(np.median(seconds[1:])), dict(rows[0].counters) if rows else {}


def cubes(count: int, kind: str):
    """A scene of a mirror and `count` cubes of a material each, beside the camera or behind the mirror."""
    import bpy

    from . import shapes
    from .reflection_scenes import MIRROR, TURNED
    from .shading import principled

    bpy.ops.wm.read_factory_settings(use_empty=True)
    even_world((0.5, 0.5, 0.55))
    mirror = principled("Mirror", (0.9, 0.9, 0.9, 1), **MIRROR)
    shapes.plane(mirror, (0, 3, 0), (TURNED, 0, 0), (3, 2, 1))
    side = int(np.ceil(np.sqrt(count)))
    for k in range(count):
        made = principled(f"Cube {k}", (0.2 + 0.6 * (k % 5) / 4, 0.5, 0.8 - 0.6 * (k % 7) / 6, 1))
        if kind != VALUES:
            _varied(made, k)
        x, z = 4 * ((k % side + 0.5) / side - 0.5), 3 * ((k // side + 0.5) / side - 0.5)
        shapes.cube(made, (x, 5 if kind == UNMET else -2.5, z), 2.0 / side)
    shapes.area((0, -1, 4), 150, 2)
    shapes.look((0, -1.2, 0), (0, 3, 0))
    return bpy.context.scene


def _varied(material, number: int) -> None:
    """Nodes before the colour that no other number has: each binary digit is an operation."""
    nodes, links = material.node_tree.nodes, material.node_tree.links
    shader = next(node for node in nodes if node.type == "BSDF_PRINCIPLED")
    place = nodes.new("ShaderNodeTexCoord")
    value = place.outputs["Object"]
    for digit in range(6):
        node = nodes.new("ShaderNodeVectorMath")
        node.operation = "SINE" if number >> digit & 1 else "ABSOLUTE"
        links.new(value, node.inputs[0])
        value = node.outputs[0]
    links.new(value, shader.inputs["Base Color"])


def materials() -> str:
    rows = [["", "materials", "seconds", "seconds, means", "passes", "programs", "materials met"]]
    for kind in (PROGRAMS, VALUES, UNMET):
        for count in MATERIALS:
            scene = cubes(count, kind)
            scene.candela.property_unset("shaded_reflections_bounces")
            seconds, counters = _timed(scene, shaded_reflections_bounces=8)
            means, _ = _timed(scene, shaded_reflections_bounces=0)
            met = counters.get("materials", "not asked")
            rows.append(
                [kind, str(count), f"{seconds:.2f}", f"{means:.2f}", str(counters.get("passes", 0)),
                 str(counters.get("programs", 0)), str(met)]
            )  # fmt: skip
            print(rows[-1], flush=True)
    return markdown.table(rows)


def bounces() -> str:
    from . import reflection_scenes

    scene = reflection_scenes.make("two mirrors")
    rows = [["shaded bounces", "seconds", "passes"]]
    for count in (0, *BOUNCES):
        seconds, counters = _timed(scene, shaded_reflections_bounces=count)
        rows.append([str(count) if count else "0 (means)", f"{seconds:.2f}", str(counters.get("passes", 0))])
        print(rows[-1], flush=True)
    return markdown.table(rows)


def solve() -> str:
    """Seconds of the solve alone, over all pixels of an image, by constraints."""
    from addon.gfx import context, images, passes
    from addon.surfaces import reflection_edits as edits

    rng = np.random.default_rng(1)
    width, height = SOLVED
    places = np.zeros((height, width, 4), np.float32)
    places[..., 0], places[..., 1] = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
    up = np.zeros((height, width, 4), np.float32)
    up[..., 2] = 1.0
    rows, first = [["constraints", "ms", "million pixels a second", "against 1 constraint", "author"]], None
    context.ensure()
    textures = {"places": images.upload(places), "directions": images.upload(up)}
    for count in CONSTRAINTS:
        pairs = [
            edits.Constraint(
                np.append(rng.uniform(size=2), 0.0), edits.unit(rng.normal(size=3)), edits.unit(rng.normal(size=3)),
                np.array([0.0, 0.0, 1.0]),
            )
            for _ in range(count)
        ]  # fmt: skip
        whole = edits.Region(edits.EUCLIDEAN, np.zeros(3), 1e6, 0.0)
        table = edits.edit_table(pairs, [whole], [(1 << count) - 1], 1.0)
        ms = _ms(passes, images, edits.SOLVE, textures, table)
        first = first or ms
        author = {1: "24.5", 32: "18.5"}.get(count, "")
        rows.append(
            [str(count), f"{ms:.1f}", f"{width * height / ms / 1e3:.2f}", f"{ms / first:.2f}",
             f"{author} million pixels a second" if author else ""]
        )  # fmt: skip
    return markdown.table(rows)


def _ms(passes, images, program, textures, table) -> float:
    """Of one solve: several are drawn before the image is read, and what reading takes is taken off."""
    taken: dict[int, list[float]] = {0: [], ROUNDS: []}
    with images.borrowed(*SOLVED, "RGBA32F") as target:
        for count in (ROUNDS, 0) * 5:
            start = time.perf_counter()
            for _ in range(count):
                passes.fullscreen(
                    program, target, textures=textures, blocks={"edits": table.block}, constants=table.constants
                )
            images.read(target.colors[0])
            taken[count].append((time.perf_counter() - start) * 1e3)
    return float(np.median(taken[ROUNDS][1:]) - np.median(taken[0][1:])) / ROUNDS


def torus(n: int) -> tuple[np.ndarray, np.ndarray]:
    """(V, 3) positions and (2 n n, 3) triangles of a closed, bumpy mesh."""
    angle = 2 * np.pi * np.arange(n) / n
    u, v = np.meshgrid(angle, angle, indexing="ij")
    thick = 0.4 + 0.03 * np.sin(9 * u) * np.sin(7 * v)
    positions = np.stack([(1 + thick * np.cos(v)) * np.cos(u), (1 + thick * np.cos(v)) * np.sin(u), thick * np.sin(v)])
    a = np.arange(n * n).reshape(n, n)
    b, d = np.roll(a, -1, axis=0), np.roll(a, -1, axis=1)
    c = np.roll(b, -1, axis=1)
    halves = [np.stack(corners, axis=-1).reshape(-1, 3) for corners in ((a, b, c), (a, c, d))]
    return positions.reshape(3, -1).T, np.concatenate(halves)


def distances() -> str:
    from addon.surfaces import geodesic

    surface = geodesic.Surface(*torus(500))
    vertices = len(surface.positions)
    rows = [["", "vertices in reach", "seconds"]]

    def timed(label: str, point, reach: float) -> None:
        start = time.perf_counter()
        found = surface.along(np.array(point), reach)
        seconds = time.perf_counter() - start
        rows.append([label, f"{(found <= reach).mean() * vertices:.0f} of {vertices}", f"{seconds:.3f}"])

    timed("first point, and what is next to what", (1.4, 0.0, 0.0), np.inf)
    timed("another point, whole mesh", (0.0, 1.4, 0.0), np.inf)
    for reach in (1.0, 0.3, 0.1):
        timed(f"a point that has moved, {reach} m of {surface.along(np.array((1.4, 0.0, 0.0)), np.inf).max():.1f} m",
              (1.4, 0.01 + 0.01 * reach, 0.0), reach)  # fmt: skip
    timed("a point that has not moved", (1.4, 0.0, 0.0), np.inf)
    return markdown.table(rows)
