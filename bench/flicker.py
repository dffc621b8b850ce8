"""What moves in a picture that should hold still: `python -m bench flicker`.

The camera moves slowly, about 1.3 pixels a frame, over ten frames with one seed. Each frame is compared with Cycles' of
many samples, in levels of eight bits (sRGB, one exposure for all frames of a scene):

    grain     standard deviation over the frames of a pixel's error
    boiling   the same after a blur of 5x5 pixels: what is seen as a picture that breathes
    jitter    peak to peak of the mean error of whole frames
    error     relMSE of the frames, mean, untrimmed
    bias      mean of the frames over that of the references; with several seeds its standard error

Errors that stand still count for nothing in the first three. What the reference's own noise, known from its two
renders, adds to grain, boiling and error is taken off. Candela's figures are means over `--seeds`, each with all frames
of its own; denoised Cycles and EEVEE stand beside with one seed. References are kept by content. `--film`: the frames
as an animation, engines side by side; `--page` keeps all other rows.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from bench.cells import ROOT
from bench.markdown import put_between, rows_of, table

COMMAND = "python -m bench flicker"
PAGE = ROOT / "docs" / "flicker.md"
SIZE, FRAMES, STEP_PIXELS, BLUR = (160, 120), 10, 1.3, 5
REFERENCE_SAMPLES = 256  # of each of the two renders
HEAD = ("scene", "engine", "samples", "seeds", "frames", "size", "grain", "boiling", "jitter", "error", "bias")
PEERS = (
    *(("Cycles, denoised", "CYCLES", samples, (("use_denoising", True),)) for samples in (1, 4, 16)),
    *(("EEVEE", "BLENDER_EEVEE", samples, ()) for samples in (1, 16)),
)
FILM_MS, GAP = 200, 4  # a frame of the animation stands so long; pixels between engines
SCENES = ("window_interior", "cornell_box", "sky_courtyard", "open_sky")


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--scenes", nargs="+", default=list(SCENES), help="samples, rooms of `bench media`, .blend files"
    )
    parser.add_argument("--samples", type=int, nargs="+", default=[1, 4, 16])
    parser.add_argument(
        "--reference", type=int, default=REFERENCE_SAMPLES, help="samples of each of two renders by Cycles"
    )
    parser.add_argument("--film", type=Path, help="write frames into this GIF: first samples, 4 of Cycles, reference")
    parser.add_argument("--frames", type=int, default=FRAMES)
    parser.add_argument("--seeds", type=int, default=1, help="of Candela: figures are means over so many animations")
    parser.add_argument("--size", default="x".join(map(str, SIZE)), help="pixels")
    parser.add_argument("--no-peers", action="store_true", help="Candela alone")
    parser.add_argument("--page", action="store_true", help=f"write the table into docs/{PAGE.name}")


def command(options: argparse.Namespace) -> int:
    import addon

    addon.register()
    rows = []
    for scene in options.scenes:
        for row in measured(scene, options):
            rows.append(row)
            print("  ".join(row), flush=True)
    print(table([HEAD, *rows]))
    if options.page:
        measured_now = {tuple(row[:3]) for row in rows}
        written = rows_of(PAGE.read_text(encoding="utf-8"), COMMAND, HEAD)
        kept = [row for row in written if tuple(row[:3]) not in measured_now]
        names = list(dict.fromkeys(row[0] for row in (*kept, *rows)))
        put_between(PAGE, COMMAND, table([HEAD, *sorted([*kept, *rows], key=lambda row: names.index(row[0]))]))
    return 0


def measured(name: str, options: argparse.Namespace):
    """Rows of a scene: Candela by number of samples, then its peers."""
    import bpy

    from addon.compare.metrics import compare_radiance
    from addon.compare.reference import reference, render_passes

    size = tuple(int(edge) for edge in options.size.split("x"))
    entrants = [("Candela", "CANDELA", n, ()) for n in options.samples]
    entrants += () if options.no_peers else PEERS
    shown_as = opened(name)
    scene = bpy.context.scene
    start = scene.camera.matrix_world.copy()
    found = [reference(scene, options.reference, size=size) for _ in moved(scene, start, options.frames, size)]
    truths = [one.images["combined"][..., :3] for one in found]
    exposure = 1.0 / max(float(np.percentile(truths[0], 95)), 1e-6)
    noise = [levels(one.images["combined"][..., :3] + one.half["combined"][..., :3], exposure) for one in found]
    noise = figures(np.array([one - levels(truth, exposure) for one, truth in zip(noise, truths)]))
    film = {}
    for label, engine, samples, extra in entrants:
        settings = [(scene.cycles, key, value) for key, value in extra]
        own, ratios = [], []
        seeds = range(1, 1 + (options.seeds if engine == "CANDELA" else 1))
        for seed in seeds:
            frames = [
                render_passes(scene, engine, samples, seed, size=size, extra=settings).images["combined"][..., :3]
                for _ in moved(scene, start, options.frames, size)
            ]
            film.setdefault((engine, samples), frames)
            errors = [levels(shown, exposure) - levels(truth, exposure) for shown, truth in zip(frames, truths)]
            compared = [
                compare_radiance(label, shown, one.images["combined"], one.half["combined"])
                for shown, one in zip(frames, found)
            ]
            own.append((*figures(np.array(errors)), np.mean([max(one.relmse - one.floor, 0.0) for one in compared])))
            ratios.append(np.mean(frames) / max(np.mean(truths), 1e-30))
        grain, boiling, jitter, error = np.mean(own, axis=0)
        grain, boiling = (float(np.sqrt(max(a * a - b * b, 0.0))) for a, b in zip((grain, boiling), noise))
        yield [
            shown_as, label, str(samples), str(len(seeds)), str(options.frames), options.size, f"{grain:.1f}",
            f"{boiling:.2f}", f"{jitter:.2f}", f"{error:.4f}", bias_of(ratios),
        ]  # fmt: skip
    if options.film:
        chosen = [film[key] for key in (("CANDELA", options.samples[0]), ("CYCLES", 4)) if key in film]
        write_film(options.film, [*chosen, truths], exposure)


def bias_of(ratios: list[float]) -> str:
    """The mean of ratios by seed as text; of several seeds with its standard error."""
    mean = f"{np.mean(ratios):.3f}"
    return f"{mean} ± {np.std(ratios, ddof=1) / np.sqrt(len(ratios)):.3f}" if len(ratios) > 1 else mean


def write_film(path: Path, engines: list[list[np.ndarray]], exposure: float) -> None:
    """An animation of the frames of several engines, side by side, forth and back."""
    from PIL import Image

    frames = []
    for shown in zip(*engines):
        parts = [np.pad(levels(one, exposure), ((0, 0), (0, GAP), (0, 0)), constant_values=255.0) for one in shown]
        pixels = np.clip(np.concatenate(parts, axis=1)[::-1, :-GAP] + 0.5, 0, 255).astype(np.uint8)
        frames.append(Image.fromarray(pixels))
    frames += frames[-2:0:-1]
    path.parent.mkdir(parents=True, exist_ok=True)
    frames[0].save(path, save_all=True, append_images=frames[1:], duration=FILM_MS, loop=0, optimize=True)


def opened(name: str) -> str:
    """Open a sample file, a path, `open_sky`, or a foggy room of media_scenes.py; what the page calls it."""
    import bpy

    from bench import media_scenes

    built = {"open_sky": open_sky, **{room: parts[0] for room, parts in media_scenes.ROOMS.items()}}
    if name in built:
        media_scenes.begin()
        built[name]()
        return name.replace("_", " ") if name == "open_sky" else name
    path = Path(name) if name.endswith(".blend") else ROOT / "sample_blends" / f"{name}.blend"
    bpy.ops.wm.open_mainfile(filepath=str(path))
    return path.stem.replace("_", " ")


def open_sky() -> None:
    """A box and a ball on a floor that nothing but an even sky lights."""
    from bench import beside_scenes as parts

    parts.camera("Camera", (0, -6, 1.7), (parts.SIDE_VIEW[0] - 0.08, 0, 0))
    parts.box((-8, -8, -0.2), (8, 8, 0), parts.diffuse(0.7, 0.7, 0.7))
    parts.box((-1.6, 0, 0), (-0.4, 1, 1.6), parts.diffuse(0.7, 0.3, 0.2))
    parts.ball(0.7, (1.1, 0.3, 0.7), parts.diffuse(0.3, 0.5, 0.7))
    parts.world(0.6, 0.8, 1.0)


def moved(scene, start, frames: int, size: tuple[int, int]):
    """Numbers of frames; the camera goes sideways, so that what is 5 m away moves by STEP_PIXELS a frame: to its right,
    or to its left where a wall stands so near that it would end in it."""
    import bpy
    import mathutils

    data = scene.camera.data
    wide = data.ortho_scale if data.type == "ORTHO" else 2.0 * 5.0 * np.tan(data.angle / 2)
    graph = bpy.context.evaluated_depsgraph_get()
    origin, right = start.translation, start.to_3x3() @ mathutils.Vector((1.0, 0.0, 0.0))
    far = 1.5 * frames * STEP_PIXELS * wide / size[0]
    wide *= -1.0 if scene.ray_cast(graph, origin, right, distance=far)[0] else 1.0
    for number in range(frames):
        way = mathutils.Matrix.Translation((number * STEP_PIXELS * wide / size[0], 0.0, 0.0))
        scene.camera.matrix_world = start @ way
        bpy.context.view_layer.update()
        yield number


def levels(linear: np.ndarray, exposure: float) -> np.ndarray:
    """Radiance as eight-bit levels, not rounded."""
    from addon.compare.metrics import display

    return 255.0 * display(linear * exposure).astype(np.float64)


def figures(errors: np.ndarray) -> tuple[float, float, float]:
    """Grain, boiling and jitter of errors (frames, H, W, 3), in their units."""
    blurred = np.stack([_blurred(error) for error in errors])
    jitter = float(np.ptp(errors.mean(axis=(1, 2, 3))))
    return float(errors.std(axis=0).mean()), float(blurred.std(axis=0).mean()), jitter


def _blurred(image: np.ndarray) -> np.ndarray:
    """Means of BLUR x BLUR pixels, without the rim."""
    sums = np.pad(image, ((1, 0), (1, 0), (0, 0))).cumsum(axis=0).cumsum(axis=1)
    k = BLUR
    return (sums[k:, k:] - sums[:-k, k:] - sums[k:, :-k] + sums[:-k, :-k]) / (k * k)
