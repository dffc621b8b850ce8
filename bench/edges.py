"""Soft shadows by edges beside rays and maps: `python -m bench edges`.

| part | what is measured |
|---|---|
| families | visibility on the six families of bench/soft_scenes.py, against many rays of each pixel |
| costs | processor time of the shadows alone, by points, patterns and modes |
| fence | the same fence as a card of two triangles with a mask, and as a mesh of wires |
| union | what wedges add up at the receivers themselves, without film and smoothing, against all triangles |
| equal | casters by light size: time of rays and of maps with as many samples as leave the error of edges at one |
| cycles | direct light of the scenes of bench/edge_scenes.py against Cycles |
| growth | time, edges and bytes by casters, lights and pixels |

Only pixels that show the same surface in one sample as in many are compared, as everything else is the film's. Times
are processor time of whole renders on a software GPU less that of the same render without shadows, the least of some.
With `--page` each table becomes a part of docs/edge_shadows.md; with `--pictures` visibilities are written.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable

import numpy as np

from . import edge_scenes, markdown, soft, soft_scenes
from .quick import table
from .shading import node_of, tree_of
from .study import PICTURES, Study, number, size, some_of

DCS, PWB = "depth_complexity", "penumbra_wedges"
BY_EDGES = "soft lights with few edges: depth complexity"  # techniques/shadows_by_light.py
RAYS_OF_TRUTH = 1024


def dcs(points: int, **values) -> tuple[tuple[str, object], ...]:
    return (("points", str(points)), *(values | {"mode": values.get("mode", "SHARE")}).items())


ENTRANTS = (
    soft.Entrant("DCS, 64 points, one by one", DCS, dcs(64, mode="POINTS")),
    soft.Entrant("DCS, 64 points, share, not smooth", DCS, dcs(64, smooth=False)),
    soft.Entrant("DCS, 64 points, share", DCS, dcs(64)),
    soft.Entrant("DCS, 16 points, share", DCS, dcs(16)),
    soft.Entrant("DCS, 64 points, standard edges", DCS, dcs(64, accurate=False)),
    soft.Entrant("DCS, 64 points, share, 4 samples", DCS, dcs(64), samples=4),
    soft.Entrant("PWB, boxes", PWB, (("union", "BOXES"),)),
    soft.Entrant("PWB, product", PWB, (("union", "PRODUCT"),)),
    soft.Entrant("PWB, plain sum", PWB, (("union", "SUM"),)),
    soft.Entrant("VSSM", soft.VSSM),
    soft.Entrant("maps, 1 sample", soft.POINTS, soft.BY_MAPS),
    soft.Entrant("maps, 16 samples", soft.POINTS, soft.BY_MAPS, 16),
    soft.Entrant("rays, 1 sample", soft.POINTS, soft.BY_RAYS),
    soft.Entrant("rays, 16 samples", soft.POINTS, soft.BY_RAYS, 16),
    soft.Entrant("rays, 64 samples", soft.POINTS, soft.BY_RAYS, 64),
)

SHOWN = (
    soft.Entrant("DCS, 64 points", DCS, dcs(64)),
    soft.Entrant("DCS, 16 points", DCS, dcs(16)),
    soft.Entrant("VSSM", soft.VSSM),
    soft.Entrant("one ray", soft.POINTS, soft.BY_RAYS),
    soft.Entrant("rays", soft.POINTS, soft.BY_RAYS, 256),
)  # of the page's picture, from top to bottom


class Truth:
    """Visibility of a scene by many rays, and which pixels show one surface throughout."""

    def __init__(self, scene, size, samples: int = RAYS_OF_TRUTH):
        many = soft.Entrant("truth", soft.POINTS, soft.BY_RAYS, samples)
        blocked, free = soft.direct(scene, many, size, 7)[0], soft.direct(scene, many, size, 7, shadows=False)[0]
        self.visibility = np.divide(blocked, free, out=np.ones_like(free), where=soft.lit(free))
        whole = soft.Entrant("free", DCS, dcs(64))
        once = soft.direct(scene, whole, size, shadows=False)[0]
        self.kept = soft.lit(free) & (np.abs(once - free) < 0.01 * free)

    def error(self, found: np.ndarray) -> tuple[float, float]:
        """RMS and mean."""
        off = (found - self.visibility)[self.kept]
        return float(np.sqrt((off**2).mean())), float(off.mean())


def seconds(scene, entrant: soft.Entrant, size, runs: int, base: list[float] | None = None) -> float:
    """Of the shadows."""
    shadowed = min(soft.direct(scene, entrant, size, 20 + k)[1] for k in range(runs))
    free = min(soft.direct(scene, entrant, size, 40 + k, shadows=False)[1] for k in range(runs))
    return max(shadowed - free, 1e-4)


def counters(name: str) -> dict[str, int]:
    """Of a technique in the last picture."""
    from addon.frame import ledger

    return next((row.counters for row in ledger.latest().rows if row.name == name), {})


def kept_bytes(scene, name: str = DCS) -> int:
    """That the front end holds."""
    from addon import engine

    techniques = engine.session(scene, "final").renderer.techniques
    return next(one.tiles.bytes for one in techniques if one.name == name)


def families(options) -> str:
    rms, bias, rows = {}, {}, []
    for family in options.families:
        scene = soft_scenes.build(family)
        truth = Truth(scene, options.size)
        for entrant in ENTRANTS:
            found = soft.visibility(scene, entrant, options.size)
            error, mean = truth.error(found)
            rms.setdefault(entrant.label, []).append(error)
            bias.setdefault(entrant.label, []).append(mean)
            if options.pictures:
                path = options.pictures / f"{family}, {entrant.label}.png".replace(" ", "_").replace(",", "")
                soft.save(path, found, truth.visibility)
        print(f"{family} done", flush=True)
    rows = [("RMS (mean error)", *options.families, "mean RMS")]
    for label, errors in rms.items():
        cells = [f"{error:.4f} ({mean:+.4f})" for error, mean in zip(errors, bias[label])]
        rows.append((label, *cells, f"{np.mean(errors):.4f}"))
    return "### Visibility against 1,024 rays of each pixel\n\n" + show(rows)


def costs(options) -> str:
    variants = (
        ("16 points, share", dcs(16, smooth=False, interleaved=False)),
        ("64 points, share", dcs(64, smooth=False, interleaved=False)),
        ("64 points, interleaved", dcs(64, smooth=False)),
        ("64 points, interleaved and smooth", dcs(64)),
        ("64 points, standard edges", dcs(64, smooth=False, interleaved=False, accurate=False)),
        ("64 points, one by one", dcs(64, mode="POINTS")),
        ("16 points, one by one", dcs(16, mode="POINTS")),
    )
    rows = [("variant", *options.families, "ratio to 16 points")]
    found: dict[str, list[float]] = {label: [] for label, _ in variants}
    for family in options.families:
        scene = soft_scenes.build(family)
        for label, values in variants:
            found[label].append(seconds(scene, soft.Entrant(label, DCS, values), options.size, options.runs))
    first = np.array(found[variants[0][0]])
    for label, times in found.items():
        ratio = float(np.sum(times) / np.sum(first))
        rows.append((label, *(f"{1000 * time:.0f}" for time in times), f"{ratio:.2f}"))
    return "### Milliseconds of the shadows of one sample, by variant\n\n" + show(rows)


def fence(options) -> str:
    rows = [("fence", "triangles", "silhouette edges", "ms of its shadows", "RMS of the visibility")]
    times = {}
    for label, build in (("card with a mask", _card), ("mesh of wires", _wires)):
        scene = soft_scenes.build("stacked blockers")
        build(scene)
        entrant = soft.Entrant(label, DCS, dcs(64, most_edges=1_000_000))
        found = soft.visibility(scene, entrant, options.size)
        soft.direct(scene, entrant, options.size)
        row = counters(DCS)
        times[label] = seconds(scene, entrant, options.size, options.runs)
        many = soft.visibility(scene, soft.Entrant("many", soft.POINTS, soft.BY_RAYS, 256), options.size)
        error = float(np.sqrt(((found - many) ** 2).mean()))
        triangles = sum(
            len(thing.data.loop_triangles) or _count(thing) for thing in scene.objects if thing.name == "Blockers"
        )
        rows.append((label, f"{triangles:,}", f"{row.get('edges', 0):,}", f"{1000 * times[label]:.0f}", f"{error:.4f}"))
        if options.pictures:
            soft.save(options.pictures / f"fence_{label}.png".replace(" ", "_"), found, many)
    ratio = times["mesh of wires"] / times["card with a mask"]
    text = f"The card costs 1 / {ratio:.0f} of the mesh."
    return "### A fence as a card and as a mesh\n\n" + show(rows) + f"\n\n{text}"


def _count(thing) -> int:
    thing.data.calc_loop_triangles()
    return len(thing.data.loop_triangles)


UNION_FAMILIES = ("grid", "far background", "stacked blockers")
RECEIVERS, PLACES = 1500, 1024


def union(options) -> str:
    """RMS of the share of the lamp's area that some receivers see."""
    from addon import engine
    from addon.gfx import images
    from addon.sampling import sequence

    rows = [("union", *UNION_FAMILIES)]
    errors: dict[str, list[float]] = {}
    for family in UNION_FAMILIES:
        scene, expected = soft_scenes.build(family), None
        free = soft.direct(scene, soft.Entrant("free", PWB), options.size, shadows=False)[0]
        reached = soft.lit(free).reshape(-1)  # what turns away from the lamp has a share of nothing
        for mode in ("BOXES", "PRODUCT", "SUM"):
            soft.direct(scene, soft.Entrant(mode, PWB, (("union", mode),)), options.size)
            renderer = engine.session(scene, "final").renderer
            own = next(one for one in renderer.techniques if one.name == PWB)
            receivers = images.read(own.tiles._kept["receivers"]).reshape(-1, 4)
            found = images.read(own.tiles._kept["seen_share"]).reshape(-1)
            emitter = renderer.frame.emitters[0]
            valid = np.flatnonzero((receivers[:, 3] != 0) & reached)
            chosen = valid[np.linspace(0, len(valid) - 1, RECEIVERS).astype(int)]
            if expected is None:
                places = 2.0 * sequence.points(0, PLACES, "union", 1) - 1.0
                lamp = emitter.centre + places[:, :1] * emitter.u[:3] + places[:, 1:] * emitter.v[:3]
                expected = np.array([_seen(own._casters.corners, p, lamp) for p in receivers[chosen, :3].astype(float)])
            errors.setdefault(mode, []).append(float(np.sqrt(((found[chosen] - expected) ** 2).mean())))
    names = {"BOXES": "boxes", "PRODUCT": "product", "SUM": "plain sum"}
    rows += [(names[mode], *(f"{error:.4f}" for error in found)) for mode, found in errors.items()]
    ratios = [boxes / max(product, 1e-9) for boxes, product in zip(errors["BOXES"], errors["PRODUCT"])]
    rows.append(("boxes : product", *(f"{ratio:.2f}" for ratio in ratios)))
    title = f"### Unions at {RECEIVERS} receivers, against all triangles at {PLACES} places of the lamp"
    return f"{title}\n\n{show(rows)}"


def _seen(corners: np.ndarray, receiver: np.ndarray, places: np.ndarray) -> float:
    """Share of places (S, 3) that no triangle (T, 3, 3) hides from a receiver."""
    a, b, c = np.moveaxis(corners.astype(np.float64) - receiver, 1, 0)
    ways = (places - receiver).T
    sides = np.stack([np.cross(a, b) @ ways >= 0, np.cross(b, c) @ ways >= 0, np.cross(c, a) @ ways >= 0])
    inside = sides.all(axis=0) | ~sides.any(axis=0)
    normal = np.cross(b - a, c - a)
    at_start = -(normal * a).sum(axis=1, keepdims=True)
    crossed = inside & ((at_start >= 0) != (at_start + normal @ ways >= 0))
    return float(1.0 - crossed.any(axis=0).mean())


WIRES, SEGMENTS = 60, 162


def _wires(scene) -> None:
    """Two layers of round wires (6 sides), each cut into segments: 233,280 triangles with caps left out."""
    import bpy

    mesh = scene.objects["Blockers"].data
    mesh.clear_geometry()
    turn = 2 * np.pi * np.arange(6) / 6
    ring = 0.008 * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    vertices, faces = [], []
    for axis in range(2):
        for k in range(WIRES):
            place = -1.5 + 3.0 * (k + 0.5) / WIRES
            along = np.linspace(-1.5, 1.5, SEGMENTS + 1)
            first = len(vertices)
            for x in along:
                for u, v in ring:
                    point = [0.0, 0.0, 1.0 + v + 0.017 * axis]
                    point[axis], point[1 - axis] = x, place + u
                    vertices.append(point)
            for s in range(SEGMENTS):
                for c in range(6):
                    a, b = first + 6 * s + c, first + 6 * s + (c + 1) % 6
                    faces.append((a, b, b + 6, a + 6))
    mesh.from_pydata(vertices, [], faces)
    mesh.materials.clear()
    mesh.materials.append(bpy.data.materials["White"])
    mesh.update()


def _card(scene) -> None:
    """The same wires as a mask of 1,024 texels a side on a square."""
    import bpy

    mesh = scene.objects["Blockers"].data
    mesh.clear_geometry()
    mesh.from_pydata([(-1.5, -1.5, 1), (1.5, -1.5, 1), (1.5, 1.5, 1), (-1.5, 1.5, 1)], [], [(0, 1, 2, 3)])
    layer = mesh.uv_layers.new(name="UVMap")
    for corner, place in enumerate([(0, 0), (1, 0), (1, 1), (0, 1)]):
        layer.uv[corner].vector = place
    side = 1024
    place = (np.arange(side) + 0.5) / side * WIRES % 1.0 - 0.5
    wire = np.abs(place) * 3.0 / WIRES < 0.008
    pixels = np.ones((side, side, 4), np.float32)
    pixels[..., 3] = wire[:, None] | wire[None]
    image = bpy.data.images.new("Wires", side, side, alpha=True)
    image.pixels.foreach_set(pixels.ravel())
    image.pack()
    material = bpy.data.materials.new("Wires")
    tree, shader = tree_of(material), node_of(material, "BSDF_PRINCIPLED")
    texture = tree.nodes.new("ShaderNodeTexImage")
    texture.image, texture.interpolation = image, "Closest"
    tree.links.new(texture.outputs["Alpha"], shader.inputs["Alpha"])
    mesh.materials.clear()
    mesh.materials.append(material)


def boxes(count: int, light_size: float):
    """Boxes over a floor, as many as asked, smaller the more they are."""
    scene = soft_scenes.build("stacked blockers")
    random = np.random.default_rng(count)
    blockers = soft_scenes.Faces()
    half = 0.25 * count ** (-1 / 3)
    for _ in range(count):
        centre = random.uniform((-1.4, -1.2, 0.3), (1.4, 1.2, 1.8))
        way = random.normal(size=3)
        way *= half / np.linalg.norm(way)
        blockers.rod(centre - way, centre + way, half)
    mesh = scene.objects["Blockers"].data
    mesh.clear_geometry()
    mesh.from_pydata([tuple(vertex) for vertex in blockers.vertices], [], blockers.faces)
    scene.objects["Light"].data.size = light_size
    return scene


SAMPLES = (1, 4, 16, 64)


def equal(options) -> str:
    rows = [
        (
            "casters",
            "light",
            "edges",
            "RMS",
            "ms by edges",
            "rays: samples, ms",
            "maps: samples, ms",
            "least",
            "Auto, 1 sample",
            "its RMS",
        )
    ]
    for count in (4, 32, 256, 2048):
        for light_size in (0.2, 1.0):
            scene = boxes(count, light_size)
            truth = Truth(scene, options.size, 512)
            own = soft.Entrant("edges", DCS, dcs(64))
            error = truth.error(soft.visibility(scene, own, options.size))[0]
            soft.direct(scene, own, options.size)
            edges = counters(DCS).get("edges", 0)
            times = {"edges": seconds(scene, own, options.size, options.runs)}
            cells = []
            for name, values in (("rays", soft.BY_RAYS), ("maps", soft.BY_MAPS)):
                entrants = [soft.Entrant(name, soft.POINTS, values, n) for n in SAMPLES]
                errors = [truth.error(soft.visibility(scene, one, options.size))[0] for one in entrants]
                needed = samples_for(error, errors)
                taken = entrants[-2]
                each = seconds(scene, taken, options.size, 1) / taken.samples
                times[name] = each * needed if np.isfinite(needed) else np.inf
                cells.append(f"{needed:.0f}, {1000 * times[name]:.0f}" if np.isfinite(needed) else "never")
            least = min(times, key=times.get)
            auto = soft.Entrant("auto", "AUTO")
            of_auto = truth.error(soft.visibility(scene, auto, options.size))[0]
            soft.direct(scene, auto, options.size)
            taken = "edges" if BY_EDGES in counters("shadows_by_light") else "soft maps"
            rows.append((
                f"{count}", f"{light_size} m", f"{edges:,}", f"{error:.4f}", f"{1000 * times['edges']:.0f}",
                *cells, least, taken, f"{of_auto:.4f}",
            ))  # fmt: skip
    return "### The same error by edges, rays and maps\n\n" + show(rows)


def samples_for(error: float, errors: list[float]) -> float:
    """Samples that leave `error`, read off between those of SAMPLES on logarithmic scales; inf where the error has
    stopped falling."""
    x, y = np.log(SAMPLES), np.log(np.maximum(errors, 1e-9))
    for k in range(1, len(x)):
        if np.log(error) >= y[k] or k == len(x) - 1:
            slope = (y[k] - y[k - 1]) / (x[k] - x[k - 1])
            if slope > -0.1:
                return np.inf if np.log(error) < y[k] else float(np.exp(x[k]))
            return float(max(np.exp(x[k - 1] + (np.log(error) - y[k - 1]) / slope), 1.0))
    return np.inf


AGAINST_CYCLES = (
    soft.Entrant("DCS, 64 points one by one, 16 samples", DCS, dcs(64, mode="POINTS"), 16),
    soft.Entrant("DCS, 64 points share, 1 sample", DCS, dcs(64)),
    soft.Entrant("DCS, standard edges, 16 samples", DCS, dcs(64, mode="POINTS", accurate=False), 16),
    soft.Entrant("PWB, boxes", PWB, (("union", "BOXES"),)),
    soft.Entrant("PWB, plain sum", PWB, (("union", "SUM"),)),
    soft.Entrant("rays, 256 samples", soft.POINTS, soft.BY_RAYS, 256),
)
CYCLES_SAMPLES = 512


def against_cycles(options) -> str:
    """RMS of the direct light, by the 95th percentile of Cycles' own."""
    from addon.compare.reference import reference, render_passes

    def direct(images) -> np.ndarray:
        return sum(
            images[f"{kind}_direct"][..., 0].astype(np.float64) * images[f"{kind}_color"][..., 0]
            for kind in ("diffuse", "glossy")
        )

    rows = {entrant.label: [] for entrant in AGAINST_CYCLES} | {"noise of Cycles": []}
    for name in edge_scenes.SCENES:
        scene = edge_scenes.build(name)
        made = reference(scene, CYCLES_SAMPLES, True, options.size)
        expected = direct(made.images)
        scale = float(np.percentile(expected, 95))
        one_seed = direct({key: made.images[key] + made.half.get(key, 0.0) for key in made.images})
        for entrant in AGAINST_CYCLES:
            soft.configure(scene, entrant)
            images = render_passes(scene, "CANDELA", entrant.samples, 1, direct_only=True, size=options.size).images
            off = (direct(images) - expected) / scale
            kept = np.abs(off) < np.inf
            rows[entrant.label].append(f"{np.sqrt((off[kept] ** 2).mean()):.4f} ({off.mean():+.4f})")
            if options.pictures:
                path = options.pictures / f"cycles, {name}, {entrant.label}.png".replace(" ", "_").replace(",", "")
                soft.save(path, direct(images) / scale * 0.8, expected / scale * 0.8)
        rows["noise of Cycles"].append(f"{np.sqrt(((one_seed - expected) ** 2).mean()) / scale:.4f}")
        print(f"{name} done", flush=True)
    head = ("RMS (mean error)", *edge_scenes.SCENES)
    text = f"### Direct light against Cycles (2 x {CYCLES_SAMPLES} samples), by its 95th percentile"
    return f"{text}\n\n" + show([head, *((label, *cells) for label, cells in rows.items())])


def growth(options) -> str:
    rows = [("casters", "lights", "pixels", "edges", "words", "ms", "MiB kept")]
    own = soft.Entrant("edges", DCS, dcs(64))
    width, height = options.size
    cases = [(count, 1, options.size) for count in (16, 64, 256, 1024)]
    cases += [(64, lamps, options.size) for lamps in (2, 4)]
    cases += [(64, 1, (width * k, height * k)) for k in (2, 4)]
    for count, lamps, film in cases:
        scene = boxes(count, 1.0)
        from .soft_lights import put_lights

        put_lights(scene, lamps)
        soft.direct(scene, own, film)
        row, held = counters(DCS), kept_bytes(scene)
        time = seconds(scene, own, film, options.runs)
        pixels = f"{film[0]}x{film[1]}"
        mib = f"{held / 2**20:.1f}"
        rows.append(
            (f"{count}", f"{lamps}", pixels, f"{row['edges']:,}", f"{row['words']:,}", f"{1000 * time:.0f}", mib)
        )
    return "### Growth\n\n" + show(rows)


def show(rows) -> str:
    print(table(rows), flush=True)
    return markdown.table(rows)


PARTS = {
    "families": families, "union": union, "cycles": against_cycles, "costs": costs, "fence": fence, "equal": equal,
    "growth": growth,
}  # fmt: skip


def told(part: Callable[[argparse.Namespace], str]) -> Callable[[argparse.Namespace], str]:
    """The same, with what all figures of it are of."""
    return lambda options: f"{part(options)}\n\n{options.size[0]}x{options.size[1]} pixels, a software GPU."


STUDY = Study(
    "edges",
    {name: told(part) for name, part in PARTS.items()},
    {
        "--families": some_of(soft_scenes.FAMILIES),
        "--size": size("96x72"),
        "--runs": number(2, "for the times"),
        "--pictures": PICTURES,
    },
    page="edge_shadows",
)
add_options, command = STUDY.add_options, STUDY.command
