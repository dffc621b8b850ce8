"""Time of soft shadows by the number of lights, beside that of accumulated maps that leave the same error:
`python -m bench.soft_lights`.

Families of blockers (bench/soft_scenes.py) under one light of 1 m, the first of them also under 4, 16 and 64 on a ring,
at 640x360 with variance maps of 1024x1024. Times are processor time of whole renders on a software GPU less that of the
same render whose lights cast no shadow, the least of some that take turns, each after another of its kind, so that none
waits for memory that the one before had no use for: what is left are maps, tables and lookups. A further sample of
accumulated maps is the difference between some samples and one. The number of samples with the same error is read off
the errors under one light, of pictures of the same size, against 1,024 maps, between powers of four on logarithmic
scales. Those references take some minutes for each family when they are made for the first time.

`--levels` cuts every face of the blockers into four so many times, which changes no picture: what maps cost grows with
the casters, what lookups cost does not.
"""

from __future__ import annotations

import argparse
import os
import sys
import time

import bpy
import numpy as np

from . import markdown, soft, soft_scenes
from .quick import size_of, table

COMMAND = "python -m bench.soft_lights --page"
LIGHTS = (1, 4, 16, 64)
SAMPLES = (4, 16, 64)
MORE = 4  # samples between which the cost of one is taken
AFTER_ANOTHER = 1000  # between the seeds of a render and of the one before it, whose maps it must not take over
FAMILIES = ("foliage", *(name for name in soft_scenes.FAMILIES if name != "foliage"))
RING = 0.5  # metres, radius of the ring of lights
KINDS = (soft.Entrant("VSSM", soft.VSSM), soft.Entrant("CSSM", soft.CSSM))


def equal_samples(error: float, samples, errors) -> float:
    """Samples at which accumulated maps leave `error`; beyond what was measured, as the last two go on."""
    x, y = np.log(samples), np.log(errors)
    k = int(np.clip(np.searchsorted(-y, -np.log(error)), 1, len(x) - 1))
    slope = (x[k] - x[k - 1]) / (y[k] - y[k - 1])
    return float(np.exp(x[k - 1] + (np.log(error) - y[k - 1]) * slope))


def put_lights(scene, count: int) -> None:
    """`count` lights like the family's own, on a ring around its place; together they are as bright."""
    first = scene.objects["Light"]
    for thing in [thing for thing in scene.objects if thing.type == "LIGHT" and thing is not first]:
        bpy.data.objects.remove(thing)
    first.data.energy = 300.0 / count
    middle = np.array([0.3, 0.2, soft_scenes.LIGHT_HEIGHT])
    for k in range(count):
        light = first if k == 0 else bpy.data.objects.new(f"Light {k}", first.data)
        turn = 2 * np.pi * k / count
        light.location = middle + (RING * np.array([np.cos(turn), np.sin(turn), 0.0]) if count > 1 else 0.0)
        if k:
            scene.collection.objects.link(light)


def put_triangles(scene, level: int) -> int:
    """Cut the blockers' faces into four `level` times; the number of triangles then."""
    blockers = scene.objects["Blockers"]
    blockers.modifiers.clear()
    if level:
        cut = blockers.modifiers.new("Cut", "SUBSURF")
        cut.subdivision_type, cut.levels, cut.render_levels = "SIMPLE", level, level
    return 2 * len(blockers.data.polygons) * 4**level


def seconds(scene, entrant: soft.Entrant, samples: int, size: tuple[int, int], seed: int, shadows: bool) -> float:
    """Processor time of a render of direct light."""
    from addon.compare.reference import render_passes

    soft.configure(scene, entrant)
    scene.candela.direct_light_lights_per_sample = max(LIGHTS)
    for thing in scene.objects:
        thing.visible_shadow = True  # what was left by a picture without blockers
        if thing.type == "LIGHT":
            thing.data.use_shadow = shadows
    start = time.process_time()
    render_passes(scene, "CANDELA", samples, seed, direct_only=True, size=size)
    return time.process_time() - start


def shadow_seconds(scene, size: tuple[int, int], runs: int) -> dict[str, float]:
    """By label: one sample of each kind, and a further sample of accumulated maps."""
    maps = soft.Entrant("maps", soft.POINTS, soft.BY_MAPS)
    cases = [(kind, 1) for kind in KINDS] + [(maps, 1), (maps, 1 + MORE)]
    found: dict[tuple, list[float]] = {}
    for seed in range(1, 2 + runs):  # the first run compiles
        for entrant, samples in cases:
            for shadows in (True, False):
                seconds(scene, entrant, samples, size, seed + AFTER_ANOTHER, shadows)
                spent = seconds(scene, entrant, samples, size, seed, shadows)
                if seed > 1:
                    found.setdefault((entrant.label, samples, shadows), []).append(spent)
    least = {case: min(times) for case, times in found.items()}
    of = {(label, n): least[label, n, True] - least[label, n, False] for label, n, _ in least}
    return {kind.label: of[kind.label, 1] for kind in KINDS} | {"maps": (of["maps", 1 + MORE] - of["maps", 1]) / MORE}


def equal_errors(family: str, scene, size: tuple[int, int], maps: int) -> dict[str, float]:
    """By label of a kind: the samples at which accumulated maps leave its error, under the family's own light."""
    expected = soft.truth(family, scene, size, maps)

    def error(entrant):
        return soft.rms(soft.visibility(scene, entrant, size), expected)

    errors = [error(soft.Entrant("maps", soft.POINTS, soft.BY_MAPS, samples=n)) for n in SAMPLES]
    return {kind.label: equal_samples(error(kind), SAMPLES, errors) for kind in KINDS}


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(prog="python -m bench.soft_lights", description=__doc__.splitlines()[0])
    parser.add_argument(
        "--families", nargs="+", default=FAMILIES, choices=list(soft_scenes.FAMILIES), metavar="NAME",
        help="under the first number of lights; more lights and finer blockers of the first family alone",
    )  # fmt: skip
    parser.add_argument("--lights", nargs="+", type=int, default=LIGHTS, metavar="N")
    parser.add_argument(
        "--levels", nargs="*", type=int, default=[3, 5], metavar="N",
        help="of finer blockers, under the first number of lights (default 3 5)",
    )  # fmt: skip
    parser.add_argument("--size", default="640x360", type=size_of, metavar="WxH")
    parser.add_argument("--runs", default=3, type=int, metavar="N")
    parser.add_argument("--page", action="store_true", help="write the table into docs/soft_shadows.md")
    parser.add_argument("--maps", default=soft.REFERENCE_MAPS, type=int, metavar="N", help="of the reference")
    options = parser.parse_args(arguments)
    import addon
    from addon.cli.terminal import quiet
    from addon.gfx import context

    addon.register()
    rows = [("blockers", "lights", "triangles", "one map", *(f"{kind.label} / map" for kind in KINDS),
             *(f"{kind.label}: {word}" for kind in KINDS for word in ("samples", "faster")))]  # fmt: skip
    equal: dict[str, dict[str, float]] = {}
    first, *others = options.families
    cases = [(first, count, 0) for count in options.lights] + [(first, options.lights[0], n) for n in options.levels]
    for family, count, level in cases + [(family, options.lights[0], 0) for family in others]:
        with quiet():
            context.ensure()
            scene = soft_scenes.build(family)
            if family not in equal:
                equal[family] = equal_errors(family, scene, options.size, options.maps)
            put_lights(scene, count)
            triangles = put_triangles(scene, level)
            spent = shadow_seconds(scene, options.size, options.runs)
        ratios = {kind.label: spent[kind.label] / spent["maps"] for kind in KINDS}
        one_map = f"{1000 * spent['maps']:.0f} ms"
        row = [family, str(count), str(triangles), one_map, *(f"{ratio:.1f}" for ratio in ratios.values())]
        for label, ratio in ratios.items():
            row += [f"{equal[family][label]:.1f}", f"{equal[family][label] / ratio:.1f}"]
        rows.append(tuple(row))
        print(", ".join(f"{name} {value}" for name, value in zip(rows[0], row)), flush=True)
    print(table(rows))
    if options.page:
        about = f"{'x'.join(map(str, options.size))} pixels; maps of as many samples as leave the error."
        markdown.put_between(soft.PAGE, COMMAND, f"{about}\n\n{markdown.table(rows)}")
    print("samples: of accumulated maps that leave the same error; faster: than those")
    return 0


if __name__ == "__main__":
    code = main(sys.argv[1:])
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)  # Blender 4.5 as a module waits forever in its exit handlers once a GPU was used
