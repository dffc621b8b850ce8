"""What moves in a picture that should hold still: `python -m bench flicker`.

The camera moves slowly, about 1.3 pixels a frame, over ten frames with one seed. Each frame is compared with Cycles' of
many samples, in levels of eight bits (sRGB, one exposure for all frames of a scene):

    grain     standard deviation over the frames of a pixel's error
    boiling   the same after a blur of 5x5 pixels: what is seen as a picture that breathes
    jitter    peak to peak of the mean error of whole frames

Errors that stand still count for nothing here: they are what other benchmarks measure. What the reference's own noise,
known from its two renders, adds to grain and boiling is taken off. Denoised Cycles and EEVEE stand beside. References
are kept by content. `--film`: the frames as an animation, engines side by side; `--page` keeps rows of other scenes.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from bench.cells import ROOT
from bench.markdown import END, begin, put_between, table

COMMAND = "python -m bench flicker"
PAGE = ROOT / "docs" / "flicker.md"
SIZE, FRAMES, STEP_PIXELS, BLUR = (160, 120), 10, 1.3, 5
REFERENCE_SAMPLES = 256  # of each of the two renders
HEAD = ("scene", "engine", "samples", "frames", "grain", "boiling", "jitter")
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
        scenes = {row[0] for row in rows}
        kept = [row for row in rows_of(PAGE.read_text(encoding="utf-8"), COMMAND, HEAD) if row[0] not in scenes]
        put_between(PAGE, COMMAND, table([HEAD, *kept, *rows]))
    return 0


def rows_of(page: str, command: str, head: tuple[str, ...]) -> list[list[str]]:
    """Rows of a page's table that a command wrote, without its head."""
    written = page.partition(begin(command))[2].partition(END)[0]
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in written.splitlines() if line[:2] == "| "]
    return [row for row in cells if len(row) == len(head) and row[0] != head[0]]


def measured(name: str, options: argparse.Namespace):
    """Rows of a scene: Candela by number of samples, then its peers."""
    import bpy

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
        errors = []
        for number in moved(scene, start, options.frames, size):
            shown = render_passes(scene, engine, samples, 1, size=size, extra=settings).images["combined"][..., :3]
            errors.append(levels(shown, exposure) - levels(truths[number], exposure))
            film.setdefault((engine, samples), []).append(shown)
        grain, boiling, jitter = figures(np.array(errors))
        grain, boiling = (float(np.sqrt(max(a * a - b * b, 0.0))) for a, b in zip((grain, boiling), noise))
        yield [
            shown_as, label, str(samples), str(options.frames), f"{grain:.1f}", f"{boiling:.2f}", f"{jitter:.2f}"
        ]  # fmt: skip
    if options.film:
        chosen = [film[key] for key in (("CANDELA", options.samples[0]), ("CYCLES", 4)) if key in film]
        write_film(options.film, [*chosen, truths], exposure)


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
