"""Temporal glare: error against numpy, times and a strip of frames: `python -m bench glare`, for docs/glare.md.

The pictures that are scattered are Cycles' frames of four scenes (bench/glare_scenes.py), so that nothing but the eye
is compared: Candela's passes on the GPU against the reference in numpy (addon/eye/optics.py), from the same aperture.
Times are the least of some runs, the GPU waited for before and after; on a software GPU they are processor time, and
say how much work a pass is, not how long it takes on a real one.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np

from bench import markdown

ROOT = Path(__file__).resolve().parent.parent
PAGE, PICTURES = ROOT / "docs" / "glare.md", ROOT / "docs" / "images"
COMMAND = "python -m bench glare"
SIZE, SAMPLES = (320, 180), 32
LUMINANCE, SECONDS = 10.0, 1.0
SIDES = (256, 512, 1024)
AUTHOR = {256: (5.2, 2.7, 1.1), 512: (11.8, 4.8, 1.8), 1024: (36.5, 13.8, 4.8)}  # ms: aperture, diffraction, display
WHITE, MOST = 1.0, 1e6
HOW = {"white": WHITE, "strength": 1.0}
STEP, FRAMES = 0.1, 8  # seconds between the strip's frames


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--runs", type=int, default=3, help="runs of which the least time counts")
    parser.add_argument("--profile", action="store_true", help="only the tail beside the CIE's disability glare")
    parser.add_argument("--pictures", action="store_true", help="only the pictures of docs/glare.md")
    parser.add_argument("--page", action="store_true", help="write the tables into docs/glare.md, and the pictures")


def command(options: argparse.Namespace) -> int:
    import addon
    from addon.gfx import context

    if options.profile:
        text = profile()
        print(text)
        if options.page:
            markdown.put_between(PAGE, f"{COMMAND} --profile", text)
        return 0
    addon.register()
    context.ensure()
    if options.pictures:
        errors(True), stability(True), eyes()
        return 0
    parts = [machine(), errors(options.page), transforms(options.runs), times(options.runs), stability(options.page)]
    text = "\n\n".join(parts)
    print(text)
    if options.page:
        eyes()
        markdown.put_between(PAGE, COMMAND, text)
    return 0


ANGLES = (0.3, 0.5, 1.0, 2.0, 3.0, 4.0, 5.5)  # degrees
AGES = (25.0, 70.0)
MAGNIFICATION, PROFILE_SIDE, PROFILE_PUPIL = 10.0, 1024, 4.0


def disability_glare(degrees, age: float, pigment: float = 0.5):
    """Veiling luminance over illuminance, 1/sr, by the CIE's equation with age (Vos 2003; CIE 146:2002)."""
    older = 1.0 + (age / 62.5) ** 4
    return 10.0 / degrees**3 + (5.0 / degrees**2 + 0.1 * pigment / degrees) * older + 0.0025 * pigment


def profile() -> str:
    """The tail of the point spread (numpy, 575 nm, mean of three persons) beside the CIE's, at the default size."""
    from addon.eye import optics
    from addon.eye.aperture import Eye, aperture_at

    y, x = np.mgrid[0:PROFILE_SIDE, 0:PROFILE_SIDE] - PROFILE_SIDE // 2
    away = MAGNIFICATION * optics.degrees_per_texel() * np.hypot(x, y)
    texel = np.radians(MAGNIFICATION * optics.degrees_per_texel()) ** 2
    rows = [["eye", *(f"{angle:g}°" for angle in ANGLES), "ratio"]]
    for age in AGES:
        found = np.zeros(len(ANGLES))
        for seed in range(3):
            aperture = aperture_at(Eye(seed=seed, age=age, pupil=PROFILE_PUPIL, restlessness=0.0), 0.0, 1.0)
            light = optics.intensity(optics.field(optics.transmittance(aperture, PROFILE_SIDE), 0.25))
            light /= light.sum() * texel
            found += [light[np.abs(away / angle - 1.0) < 0.1].mean() / 3 for angle in ANGLES]
        cie = disability_glare(np.array(ANGLES), age)
        rows.append([f"{age:g} years, 1/sr", *(f"{one:.2g}" for one in found), ""])
        rows.append(["CIE", *(f"{one:.2g}" for one in cie), f"{(found / cie).min():.2f} to {(found / cie).max():.2f}"])
    return markdown.table(rows)


def machine() -> str:
    from addon.gfx import context

    clock = "processor time" if context.rasterises_in_software() else "time"
    return f"Measured on {context.describe()}; {clock}, the least of some runs."


# -------------------------------------------------------------------------------------------------------------- errors


def cycles_frame(name: str) -> tuple[np.ndarray, float]:
    """(linear picture (h, w, 4), degrees per pixel) by Cycles."""
    from addon.compare.reference import render_passes
    from bench.glare_scenes import SCENES

    scene = SCENES[name]()
    picture = render_passes(scene, "CYCLES", SAMPLES, size=SIZE).images["combined"]
    tangent = np.tan(scene.camera.data.angle_x / 2)  # the sensor fits the wider side
    return picture.astype(np.float32), float(np.degrees(2 * tangent / SIZE[0]))


def errors(pictures: bool) -> str:
    from addon.eye import optics, point_spread, scatter
    from addon.eye.aperture import Eye, aperture_at
    from addon.gfx import images
    from addon.techniques.temporal_glare import needless

    rows = [("picture", "brightest", "scattered", "convolution", "billboards", "half size", "skipped")]
    shown = []
    for name in ("street", "candle", "car", "interior"):
        picture, degrees = cycles_frame(name)
        image = images.upload(picture)
        measured = scatter.measure(image, WHITE)
        aperture = aperture_at(Eye(), SECONDS, LUMINANCE)
        scale = optics.scale_of(512, degrees, 10.0, aperture.diameter, 0.25, max(SIZE))
        reason = needless(measured, aperture, scale, 1.0, WHITE, 1)
        if reason:
            rows.append((name, f"{measured.most:.1f}", "0", "–", "–", "–", reason))
            continue
        pattern = point_spread.make_pattern(aperture, 512, 0.25)
        kernel = point_spread.make_kernel(pattern.colours, scale)
        half = optics.scale_of(512, 2 * degrees, 10.0, aperture.diameter, 0.25, max(SIZE))
        coarse = point_spread.make_kernel(pattern.colours, half)
        open_part = images.read(pattern.aperture)[..., 0].astype(np.float64).reshape(512, 2, 512, 2).mean((1, 3))
        colours = optics.colours(optics.intensity(optics.field(open_part, 0.25)))
        weights = optics.tail(optics.over_pixels(colours, scale), scale)
        expected = optics.glare(picture.astype(np.float64), weights, 1.0, WHITE, MOST)
        target, engine = images.Target((images.create(*SIZE, "RGBA32F"),)), scatter.Scatter()
        found = {}
        for label, run, one, factor in (
            ("convolution", engine.convolve, kernel, 1), ("half size", engine.convolve, coarse, 2),
            ("billboards", engine.billboards, kernel, 0),
        ):  # fmt: skip
            run(image, one, target, white=WHITE, strength=1.0, **({"factor": factor} if factor else {}))
            found[label] = images.read(target.colors[0])[..., :3]
        error = {label: relative_error(one, expected) for label, one in found.items()}
        share = float(weights.sum((0, 1)).mean())
        rows.append(
            (name, f"{measured.most:.0f}", f"{share:.3f}", f"{error['convolution']:.1e}", f"{error['billboards']:.3f}",
             f"{error['half size']:.3f}", "no")
        )  # fmt: skip
        shown.append(np.concatenate([picture[..., :3], found["convolution"], found["billboards"]], axis=1))
    if pictures:
        save("glare_scenes.png", np.concatenate(shown[::-1], axis=0))
    return (
        "Root of the mean squared difference to numpy's double precision, over that of numpy's picture; Cycles' frames"
        f" of {SIZE[0]}x{SIZE[1]} pixels and {SAMPLES} samples, pattern 512 x 512, strength 1, white 1. Billboards and"
        " half size are approximations; what they differ by is their price.\n\n" + markdown.table(rows)
    )


def relative_error(found: np.ndarray, expected: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.abs(found - expected) ** 2) / np.mean(np.abs(expected) ** 2)))


def save(name: str, linear: np.ndarray) -> None:
    from addon.compare.png import png

    light = np.clip(linear, 0.0, 1.0)
    shown = np.where(light <= 0.0031308, 12.92 * light, 1.055 * np.maximum(light, 1e-9) ** (1 / 2.4) - 0.055)
    PICTURES.mkdir(parents=True, exist_ok=True)
    (PICTURES / name).write_bytes(png((shown * 255 + 0.5).astype(np.uint8)[::-1]))


# --------------------------------------------------------------------------------------------------------------- times


def least(run: Callable[[], object], runs: int) -> float:
    """Milliseconds: of a software GPU the processor's, which a busy machine changes little."""
    from addon.gfx import context, images

    clock = time.process_time if context.rasterises_in_software() else time.perf_counter
    best = np.inf
    for _ in range(runs + 1):  # the first one compiles
        images.finish()
        started = clock()
        run()
        images.finish()
        best = min(best, clock() - started)
    return 1000 * best


def transforms(runs: int) -> str:
    from addon.gfx import images
    from addon.kernels import fft

    rows = [("side", "passes", "fetches per texel", "GPU", "numpy.fft", "relative error")]
    for side in (256, 512, 1024):
        pixels = np.random.default_rng(1).normal(size=(side, side, 4)).astype(np.float32)
        field, spare = (images.Target((images.upload(pixels),)) for _ in range(2))
        found = images.read(fft.transform(field, spare)[0].colors[0])
        given = [pixels[..., k] + 1j * pixels[..., k + 1] for k in (0, 2)]
        expected = [np.fft.fft2(one) for one in given]
        by_numpy = least(lambda g=given: [np.fft.fft2(one) for one in g], runs)
        error = relative_error(found[..., 0] + 1j * found[..., 1], expected[0])
        fetches = 2 * sum(fft.factors(side))
        rows.append(
            (f"{side}", f"{fft.pass_count(side, side)}", f"{fetches}",
             f"{least(lambda f=field, s=spare: fft.transform(f, s), runs):.0f} ms", f"{by_numpy:.0f} ms",
             f"{error:.0e}")
        )  # fmt: skip
    return (
        "Transform of four real channels as two complex images, RGBA32F (`numpy.fft.fft2` of two complex images, one"
        " thread):\n\n" + markdown.table(rows)
    )


def times(runs: int) -> str:
    from addon.eye import optics, point_spread, scatter
    from addon.eye.aperture import Eye, aperture_at
    from addon.gfx import images
    from addon.kernels import fft

    random = np.random.default_rng(2)
    picture = np.full((1024, 1024, 4), 0.2, np.float32)
    for y, x in random.integers(0, 1024, (60, 2)):
        picture[y, x, :3] = 1000.0
    image = images.upload(picture)
    target, engine = images.Target((images.create(1024, 1024, "RGBA32F"),)), scatter.Scatter()
    rows = [("step", *(f"{side}²" for side in SIDES))]
    found: dict[str, list[str]] = {}

    def add(label: str, text: str) -> None:
        found.setdefault(label, []).append(text)

    for side in SIDES:
        eye = Eye()
        aperture = aperture_at(eye, SECONDS, LUMINANCE)
        numbers = iter(range(10**6))
        state = least(lambda e=eye, n=numbers: aperture_at(e, 0.01 * next(n), LUMINANCE), runs)
        open_part = images.Target((images.create(2 * side, 2 * side, "R16F"),))
        pattern = images.Target((images.create(side, side, "R32F"),))
        colours = images.Target((images.create(side, side, "RGBA32F"),))
        drawn = least(lambda a=aperture, o=open_part: point_spread.draw_aperture(a, o), runs)
        diffracted = least(lambda o=open_part, p=pattern: point_spread.diffract(o.colors[0], 0.25, p), runs)
        coloured = [
            least(lambda p=pattern, c=colours, m=most: point_spread.colour(p.colors[0], c, 32, m), runs)
            for most in (32, optics.MOST_WAVELENGTHS)
        ]
        author = AUTHOR[side]
        scale = optics.scale_of(side, 0.04, 10.0, aperture.diameter, 0.25, 1024)
        make = lambda c=colours, s=scale: point_spread.make_kernel(c.colors[0], s)  # noqa: E731
        kernel = make()
        add("state of the eye (Python)", f"{state:.1f} ms")
        add("aperture", f"{drawn:.1f} ms ({author[0]})")
        add("diffraction", f"{diffracted:.1f} ms ({author[1]})")
        add("colours, 32 wavelengths", f"{coloured[0]:.1f} ms ({author[2]})")
        add("colours without gaps", f"{coloured[1]:.1f} ms")
        add("together, as the author", f"{drawn + diffracted + coloured[0]:.1f} ms ({sum(author):.1f})")
        add("kernel over pixels, its sums", f"{least(lambda m=make: m().release(), runs):.1f} ms")
        for factor, label in ((1, "convolution of 1024²"), (2, "the same at half size")):
            of = kernel if factor == 1 else point_spread.make_kernel(
                colours.colors[0], optics.scale_of(side, 0.04 * factor, 10.0, aperture.diameter, 0.25, 1024)
            )  # fmt: skip
            add(
                label,
                f"{least(lambda k=of, f=factor: engine.convolve(image, k, target, factor=f, **HOW), runs):.0f} ms",
            )
        add("billboards, 60 lamps",
            f"{least(lambda k=kernel: engine.billboards(image, k, target, **HOW), runs):.0f} ms")  # fmt: skip
        padded = fft.fitting_side(1024 + scale.reach)
        add("reach, padded side", f"{scale.reach}, {padded}")
        add(
            "passes: pattern, convolution", f"{point_spread.pass_count(side)}, {3 + 2 * fft.pass_count(padded, padded)}"
        )
    add_measure = least(lambda: scatter.measure(image, WHITE), runs)
    rows += [(label, *texts) for label, texts in found.items()]
    return (
        "The author's figures (GeForce 8800 GTX, 32 wavelengths, 2 x 2 supersampling) in brackets. The convolution"
        " keeps the kernel's transform; where each frame has a new kernel it takes half as long again. Measuring a"
        f" picture of 1024² for the skip takes {add_measure:.1f} ms.\n\n" + markdown.table(rows)
    )


# ----------------------------------------------------------------------------------------------------------- stability


def stability(pictures: bool) -> str:
    """What changes from frame to frame, and that it is the same again."""
    from addon.eye import optics, point_spread
    from addon.eye.aperture import Eye, aperture_at
    from addon.gfx import images

    def kernel_at(seconds: float, eye: Eye) -> np.ndarray:
        aperture = aperture_at(eye, seconds, LUMINANCE)
        pattern = point_spread.make_pattern(aperture, 512, 0.25)
        scale = optics.scale_of(512, 0.04, 10.0, 2.8, 0.25, 1024)
        kernel = point_spread.make_kernel(pattern.colours, scale)
        weights = images.read(kernel.weights)[..., :3].astype(np.float64)
        kernel.release()
        pattern.release()
        return weights

    rows = [("eye", "needles change in 0.1 s", "in 1/24 s", "scattered share", "its change in 0.1 s")]
    still = replace(Eye(), restlessness=0.0, tremor=0.0, movement=0.0)
    strip = []
    for label, eye in (("as measured", Eye()), ("lens and vitreous body alone", replace(Eye(), restlessness=0.0)),
                       ("still", still)):  # fmt: skip
        frames = [kernel_at(SECONDS + STEP * k, eye) for k in range(FRAMES)]
        fast = [kernel_at(SECONDS + k / 24, eye) for k in range(FRAMES)]
        change, change_fast = (
            np.mean([np.abs(b - a).sum() / a.sum() for a, b in pairwise(one)]) for one in (frames, fast)
        )
        shares = np.array([one.sum((0, 1)).mean() for one in frames])
        steps = np.abs(np.diff(shares)).mean() / shares.mean()
        rows.append((label, f"{change:.3f}", f"{change_fast:.3f}", f"{shares.mean():.4f}", f"{steps:.4f}"))
        if label == "as measured":
            strip = frames
    again = kernel_at(SECONDS + STEP * 5, Eye())
    same = "equal to the bit" if (again == strip[5]).all() else "NOT equal"
    if pictures:
        middle = len(strip[0]) // 2
        part = np.s_[middle - 90 : middle + 91, middle - 90 : middle + 91]
        save("glare_strip.png", np.concatenate([4000.0 * one[part] for one in strip], axis=1))
    return (
        "Kernels of 512 x 512 patterns; a change is the sum of absolute differences over the kernel's sum. Frame 5"
        f" computed alone is {same} to frame 5 after frames 0 to 4.\n\n" + markdown.table(rows)
    )


def eyes() -> None:
    """Pupils and glare of the presets, for the page."""
    from addon.eye import optics, point_spread
    from addon.eye.aperture import Eye, aperture_at
    from addon.eye.presets import PRESETS
    from addon.gfx import images

    columns = []
    for preset in PRESETS.values():
        values = {name: value for name, value in preset.values.items() if name != "defocus"}
        defocus = preset.values.get("defocus", 0.25)
        aperture = aperture_at(replace(Eye(), **values), SECONDS, 0.5)
        pattern = point_spread.make_pattern(aperture, 512, defocus)
        scale = optics.scale_of(512, 0.033, 10.0, aperture.diameter, defocus, 1024)
        kernel = point_spread.make_kernel(pattern.colours, scale, sharp=False)
        weights = images.read(kernel.weights)[..., :3]
        middle = len(weights) // 2
        part = weights[middle - 120 : middle + 120, middle - 120 : middle + 120]
        light = images.read(pattern.aperture)[..., 0].reshape(512, 2, 512, 2).mean((1, 3))[136:376, 136:376]
        columns.append(np.concatenate([6000.0 * part, np.repeat(light[..., None], 3, axis=2)], axis=0))
        kernel.release()
        pattern.release()
    save("glare_eyes.png", np.concatenate(columns, axis=1))
