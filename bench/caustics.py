"""Caustics beside light tracing, Cycles and EEVEE, on six scenes: `python -m bench caustics`.

The truth is light tracing with Mitsuba 3 (caustic_truth.py), kept in results/caustics_truth.npz and made anew by
`--truth PYTHON`, an interpreter that has the packages of the dependency group `truth`. It holds the caustic's own
light: irradiance that lamps bring over specular surfaces, by pixel of an orthographic view from above.

Error is relMSE of that light, after both were blurred by a Gaussian of 2 pixels; `energy` the ratio of the sums.
Cycles' figure is its diffuse indirect light with one diffuse bounce, which is the same light. EEVEE has none of it, and
what light it lets through glass stands in its direct light; so a second error is that of all light of the floor, with
Cycles' direct light as the rest of the truth. Times are processor seconds of all threads of
whole renders, which other work on the machine does not change; of Candela the second one, since the first may compile.
From both follows the error of Cycles with its denoiser in the time of photons (bench/equal_time.py).

With `--motion` ball and lamp move 2 cm a frame over so many frames of 64 x 64 pixels, one sample each, instead. Beside
the mean square of a frame's error stands what is new in it, as `python -m bench indirect --temporal` has it: half the
mean square of the error's change from one frame to the next, which is the error's variance where frames err by chance.
With `--growth`, milliseconds of a picture of one sample with twice and four times the photons, casters and triangles.
"""

from __future__ import annotations

import argparse
import subprocess
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from . import caustic_scenes, equal_time, markdown
from .caustic_scenes import ALBEDO, SCENES
from .moving import new_in_it, of_frame, shifted

ROOT = Path(__file__).resolve().parent.parent
TRUTH = ROOT / "bench" / "results" / "caustics_truth.npz"
PAGE = ROOT / "docs" / "caustics.md"
COMMAND = "python -m bench caustics --page"
MOTION = "python -m bench caustics --motion 24 --page"
GROWTH = "python -m bench caustics --growth --page"
SIZE = 128
PHOTONS = 6_000_000
BLUR = 2.0  # pixels


@dataclass(frozen=True)
class Entrant:
    label: str
    engine: str
    samples: int
    technique: str = ""
    denoised: bool = False
    values: tuple[tuple[str, object], ...] = ()


ENTRANTS = (
    *(Entrant(f"photons, {n}", "CANDELA", n, "screen_space_photons") for n in (1, 16, 64)),
    *(Entrant(f"mapping, {n}", "CANDELA", n, "caustics_mapping") for n in (1, 16, 64)),
    Entrant("mapping by rays, 16", "CANDELA", 16, "caustics_mapping", values=(("by", "RAYS"),)),
    Entrant("off, 16", "CANDELA", 16, "OFF"),
    *(Entrant(f"Cycles, {n}", "CYCLES", n) for n in (4, 16, 64)),
    *(Entrant(f"Cycles denoised, {n}", "CYCLES", n, denoised=True) for n in (4, 16, 64)),
    Entrant("EEVEE, 16", "BLENDER_EEVEE", 16),
)


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--scenes", nargs="*", default=list(SCENES), choices=list(SCENES))
    parser.add_argument("--truth", metavar="PYTHON", help="make the truth anew with this interpreter's Mitsuba")
    parser.add_argument("--photons", type=int, default=PHOTONS, help="per lamp, for the truth")
    parser.add_argument("--entrants", nargs="*", help="labels to run (default: all)")
    parser.add_argument("--page", action="store_true", help="write the tables into docs/caustics.md")
    parser.add_argument("--pictures", type=Path, metavar="FOLDER", help="write what each entrant showed as PNG")
    parser.add_argument("--motion", type=int, default=0, metavar="FRAMES", help="frames of a moving ball instead")
    parser.add_argument("--growth", action="store_true", help="times by photons, casters and triangles instead")


def command(options: argparse.Namespace) -> int:
    from addon import register

    register()
    if options.motion or options.growth:
        text, mark = (motion(options.motion), MOTION) if options.motion else (growth(), GROWTH)
        print(text)
        if options.page:
            markdown.put_between(PAGE, mark, text)
        return 0
    if options.truth:
        make_truth(options.scenes, options.truth, options.photons)
    known = dict(np.load(TRUTH)) if TRUTH.exists() else {}
    entrants = [one for one in ENTRANTS if not options.entrants or one.label in options.entrants]
    rows = {one: [] for one in entrants}
    for name in options.scenes:
        if name not in known:
            print(f"{name}: no truth, run with --truth", flush=True)
            continue
        for one, figures in measure(name, known[name].astype(np.float64), entrants, options.pictures):
            rows[one].append(figures)
            print(f"{name:10} {one.label:22} " + "  ".join(cell(f) for f in figures), flush=True)
    shown = [name for name in options.scenes if name in known]
    parts = []
    titles = (
        "relMSE of the caustic's own light",
        "Its energy",
        "relMSE of all light on the floor",
        "Processor seconds of the render",
    )
    for number, title in enumerate(titles):
        table = [["", *(SCENES[name].label for name in shown)]]
        table += [[one.label, *(cell(figures[number]) for figures in found)] for one, found in rows.items() if found]
        parts.append(f"**{title}**\n\n{markdown.table(table)}")
    beside = [one for one in rows if rows[one] and (one.technique == "screen_space_photons" or one.denoised)]
    if {one.engine for one in beside} == {"CANDELA", "CYCLES"}:
        equal = [
            equal_time.row(SCENES[name].label, ((one.engine, rows[one][k][3], rows[one][k][2]) for one in beside))
            for k, name in enumerate(shown)
        ]
        parts.append(equal_time.table(equal, [one.samples for one in beside if one.engine == "CANDELA"]))
    text = "\n\n".join(parts)
    print(text)
    if options.page:
        markdown.put_between(PAGE, COMMAND, text)
    return 0


def cell(value: float) -> str:
    return "–" if value != value else f"{value:.4f}" if value < 0.1 else f"{value:.3f}"


def measure(name: str, truth: np.ndarray, entrants, pictures: Path | None):
    """For each entrant: relMSE of the caustic, its energy's ratio, relMSE of all light, seconds."""
    import bpy

    from addon.compare.reference import render_passes

    caustic_scenes.make(name)
    scene = bpy.context.scene
    size = (SIZE, SIZE)
    direct = render_passes(scene, "CYCLES", 64, 3, size=size, bounces=0).images["diffuse_direct"][..., :3] * np.pi
    direct = np.nan_to_num(direct)
    for one in entrants:
        configure(scene, one)
        bounces = 16 if one.engine == "CYCLES" else 1
        diffuse = 1 if one.engine == "CYCLES" else None
        seconds, images = [], None
        for seed in (1, 2) if one.engine == "CANDELA" and one.samples < 64 else (1,):  # the first may compile
            start = time.process_time()
            if one.denoised:
                images = denoised(scene, one, seed, size)
            else:
                done = render_passes(
                    scene, one.engine, one.samples, seed, size=size, bounces=bounces, diffuse_bounces=diffuse
                )
                images = done.images
            seconds.append(time.process_time() - start)
        whole = images["combined"][..., :3] * np.pi / ALBEDO
        own = images["diffuse_indirect"][..., :3] * np.pi if "diffuse_indirect" in images else None
        if one.engine == "BLENDER_EEVEE" or one.denoised or own is None:
            own = None
        error = relmse(own, truth) if own is not None else float("nan")
        energy = float(own.sum() / truth.sum()) if own is not None else float("nan")
        if pictures is not None:
            write_picture(pictures / f"{name} {one.label}.png", whole)
        yield one, (error, energy, relmse(whole, truth + direct), seconds[-1])
    if pictures is not None:
        write_picture(pictures / f"{name} truth.png", truth + direct)


def configure(scene, one: Entrant) -> None:
    settings = scene.candela
    for prop in settings.bl_rna.properties:
        if prop.identifier not in ("rna_type", "name"):
            settings.property_unset(prop.identifier)
    settings.denoise_strength = 0.0
    settings.slot_indirect = "OFF"
    if one.technique:
        settings.slot_caustics = one.technique
    for name, value in one.values:
        setattr(settings, f"{one.technique}_{name}", value)


def denoised(scene, one: Entrant, seed: int, size) -> dict[str, np.ndarray]:
    """Cycles with its own denoiser, which `render_passes` would turn off."""
    from addon.compare import reference

    plain = reference.cycles_settings

    def settings(scene, samples, seed, bounces):
        kept = [one for one in plain(scene, samples, seed, bounces) if one[1] != "use_denoising"]
        return [*kept, (scene.cycles, "use_denoising", True), (scene.cycles, "denoiser", "OPENIMAGEDENOISE")]

    reference.cycles_settings = settings
    try:
        return reference.render_passes(
            scene, "CYCLES", one.samples, seed, size=size, bounces=16, diffuse_bounces=1
        ).images
    finally:
        reference.cycles_settings = plain


def blurred(image: np.ndarray, sigma: float = BLUR) -> np.ndarray:
    """A Gaussian over the first two axes; what would lie outside repeats the rim."""
    reach = int(np.ceil(3 * sigma))
    weights = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma) ** 2)
    weights /= weights.sum()
    for axis in (0, 1):
        padded = np.pad(image, [(reach, reach) if k == axis else (0, 0) for k in range(image.ndim)], mode="edge")
        image = sum(
            weight * np.take(padded, np.arange(k, k + image.shape[axis]), axis=axis) for k, weight in enumerate(weights)
        )
    return image


def relmse(x: np.ndarray, truth: np.ndarray) -> float:
    from addon.compare.metrics import relative_squared_error

    return float(relative_squared_error(blurred(x.astype(np.float64)), blurred(truth)).mean())


def write_picture(path: Path, irradiance: np.ndarray) -> None:
    import bpy

    path.parent.mkdir(parents=True, exist_ok=True)
    level = np.clip(irradiance / 4.0, 0.0, 1.0)
    encoded = np.where(level < 0.0031308, 12.92 * level, 1.055 * np.maximum(level, 1e-9) ** (1 / 2.4) - 0.055)
    image = bpy.data.images.new("Picture", irradiance.shape[1], irradiance.shape[0])
    pixels = np.ones((*irradiance.shape[:2], 4), np.float32)
    pixels[..., :3] = encoded
    image.colorspace_settings.name = "Non-Color"
    image.pixels.foreach_set(pixels.ravel())
    image.filepath_raw, image.file_format = str(path), "PNG"
    image.save()
    bpy.data.images.remove(image)


def make_truth(names, python: str, photons: int) -> None:
    """Trace the scenes' light and put the results into TRUTH."""
    known = dict(np.load(TRUTH)) if TRUTH.exists() else {}
    for name in names:
        with tempfile.TemporaryDirectory() as folder:
            given, found = Path(folder) / "scene.npz", Path(folder) / "found.npz"
            np.savez(given, **exported(name))
            subprocess.run(
                [python, Path(__file__).with_name("caustic_truth.py"), given, found, str(photons)], check=True
            )
            result = np.load(found)
            known[name] = result["irradiance"].astype(np.float16)
            print(f"{name}: {photons} photons a lamp in {float(result['seconds']):.0f} s", flush=True)
    TRUTH.parent.mkdir(exist_ok=True)
    np.savez_compressed(TRUTH, **known)


def exported(name: str) -> dict[str, np.ndarray]:
    """The scene as arrays (caustic_truth.py)."""
    import bpy

    made = caustic_scenes.make(name)
    out: dict[str, np.ndarray] = {}
    kinds, iors, smooth, lamps = [], [], [], []
    graph = bpy.context.evaluated_depsgraph_get()
    for placed in bpy.context.scene.objects:
        if placed.type == "LIGHT":
            lamps.append(lamp_row(placed))
        if placed.type != "MESH":
            continue
        mesh = placed.evaluated_get(graph).to_mesh()
        mesh.calc_loop_triangles()
        matrix = np.array(placed.matrix_world)
        points = np.array([v.co for v in mesh.vertices]) @ matrix[:3, :3].T + matrix[:3, 3]
        normals = np.array([v.normal for v in mesh.vertices]) @ matrix[:3, :3].T
        number = len(kinds)
        out[f"vertices_{number}"] = points
        out[f"normals_{number}"] = normals
        out[f"faces_{number}"] = np.array([t.vertices for t in mesh.loop_triangles])
        shader = next(n for n in placed.data.materials[0].node_tree.nodes if n.type.startswith("BSDF"))
        kinds.append({"BSDF_DIFFUSE": 0, "BSDF_GLASS": 1}.get(shader.type, 2))
        iors.append(shader.inputs["IOR"].default_value if kinds[-1] == 1 else 1.5)
        smooth.append(any(polygon.use_smooth for polygon in placed.data.polygons))
    return out | {
        "kinds": np.array(kinds), "iors": np.array(iors), "smooth": np.array(smooth), "lamps": np.array(lamps),
        "centre": np.array(made.centre), "span": np.array(made.span), "size": np.array(SIZE),
    }  # fmt: skip


def lamp_row(placed) -> np.ndarray:
    data = placed.data
    matrix = np.array(placed.matrix_world)
    sun = data.type == "SUN"
    strength = np.array(data.color[:]) * data.energy / (1.0 if sun else 4 * np.pi)
    extent = data.angle / 2 if sun else data.shadow_soft_size
    cone = -1.0 if sun else np.cos(data.spot_size / 2)
    return np.array([0.0 if sun else 1.0, *matrix[:3, 3], *-matrix[:3, 2], *strength, extent, cone])


TECHNIQUES = ("screen_space_photons", "caustics_mapping")
STEP = 0.02  # metres a frame
TRUTH_SAMPLES = 64


def motion(count: int) -> str:
    """The table of a ball and a lamp that move: error of a frame, and what is new in it."""
    import bpy

    from addon.compare.reference import render_passes

    rows = [["", "of a frame", "new in it", "of a frame, blurred", "new in it, blurred", "light of a frame, deviation"]]
    for technique in TECHNIQUES:
        caustic_scenes.make("sphere")
        scene = bpy.context.scene
        moving = [one for one in scene.objects if one.type == "LIGHT" or one.name.startswith("Ball")]
        one = Entrant("", "CANDELA", 1, technique)
        configure(scene, one)
        errors, sums = [], []
        for _ in shifted(moving, count, STEP):
            seen = [
                render_passes(scene, "CANDELA", samples, 1, size=(64, 64), bounces=1).images["diffuse_indirect"][
                    ..., :3
                ]
                * np.pi
                for samples in (1, TRUTH_SAMPLES)
            ]
            errors.append((seen[0] - seen[1]).astype(np.float64))
            sums.append(seen[0].sum() / seen[1].sum())
        row = [technique]
        for found in (np.array(errors), np.array([blurred(error) for error in errors])):
            row += [f"{of_frame(found):.4f}", f"{new_in_it(found):.4f}"]
        rows.append([*row, f"{100 * np.std(sums):.2f} %"])
    return (
        f"Square of irradiance, (W/m²)²; {count} frames, against {TRUTH_SAMPLES} samples of each; blurred by {BLUR:g}"
        f" pixels.\n\n{markdown.table(rows)}"
    )


def growth() -> str:
    """The table of times with more photons, casters and triangles."""
    import bpy

    from addon.compare.reference import render_passes
    from addon.frame import ledger

    rows = [["", *(f"{technique}, ms" for technique in TECHNIQUES)]]
    dials = [(f"{side}² photons", {"side": side}) for side in (64, 128, 256, 512)]
    dials += [(f"{balls} balls", {"balls": balls}) for balls in (1, 4, 16)]
    dials += [(f"{triangles:,} triangles of a ball", {"triangles": triangles}) for triangles in (2304, 9216, 36864)]
    for label, dial in dials:
        row = [label]
        for technique in TECHNIQUES:
            caustic_scenes.clear()
            caustic_scenes.floor()
            side = int(np.sqrt(dial.get("balls", 1)))
            segments = int(np.sqrt(dial.get("triangles", 9216)))
            for x in range(side):
                for y in range(side):
                    place = ((x + 0.5) / side * 2 - 1, (y + 0.5) / side * 2 - 1, 0.75)
                    caustic_scenes.ball(0.5 / side, place, caustic_scenes.glass(), segments)
            caustic_scenes.spot((0.9, 0.3, 3.2), (0, 0, 0.75), 10.0, 50.0)
            caustic_scenes.camera(4.0)
            scene = bpy.context.scene
            configure(scene, Entrant("", "CANDELA", 1, technique, values=(("grid", dial.get("side", 128)),)))
            times = []
            for seed in range(4):  # the first compiles
                render_passes(scene, "CANDELA", 4, seed, size=(128, 128), bounces=1)
                times.append(ledger.latest().row(technique).milliseconds / 4)
            row.append(f"{np.median(times[1:]):.1f}")
        rows.append(row)
    return (
        "Of one sample, a glass ball above a floor, 128 x 128 pixels, the median of three; one dial at a time, others"
        f" 128² photons, one ball of 9,216 triangles.\n\n{markdown.table(rows)}"
    )
