"""The page about indirect light: every technique beside EEVEE and Cycles, growth and motion, in one run.

`python -m bench indirect --page docs/indirect_light.md`. In each scene Candela with each technique of the slot, EEVEE
with ray tracing and denoised Cycles render the same picture in one process, one after the other; a time is that of a
whole render, from Blender's call to the finished picture. Combined is compared between the engines, the diffuse
indirect pass where an engine has one that means the same: EEVEE splits light otherwise, and denoising knows Combined
alone. Errors are relMSE with the reference's own noise taken off.

Growth is told by counters, which hold on every machine: one dial at a time, pictures of one sample.
"""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from bench import ages, markdown
from bench.cells import Scene, Series
from bench.markdown import write_whole

BOUNCES = 16
SAMPLES = (1, 16)
OF_AUTO = (*SAMPLES, 64)  # what it takes at 64 is told by that; others than that cost several times as much
MOVING_SCENE, FRAMES, MOVING_SIZE, MOVING_REFERENCE = "cornell_box", 24, (48, 36), 64
GROWTH_SIZE = (64, 48)
GROWN = ("multires_radiosity", "clustered_visibility", "imperfect_shadow_maps")
GATHER_SCENES, GATHER_SIZE, GATHER_LIGHTS = ("cornell_box", "colonnade_hall", "window_interior"), (640, 360), 256
GATHER_RAYS = (0, 64)
GATHER_HEAD = ("scene", "rays", "regions", "of pixels", "their ms", "every pixel's ms", "ratio", "RMS difference")
HEAD = ("technique", "samples", "seconds", "Combined", "bias", "diffuse indirect", "bias")
GROWTH_HEAD = ("technique", "dial", "value", "ms", "counters")
MOVING_HEAD = ("technique", "new error", "error of a frame")


def own(technique: str) -> Series:
    """Candela with a technique in the slot, all else as it comes."""
    label = "Auto" if technique == "AUTO" else technique
    return Series(label, "CANDELA", (), bounces=BOUNCES, slots=(("indirect", technique),))


PEERS = (
    (Series("EEVEE, ray traced", "BLENDER_EEVEE", (), ray_traced=True), 16),
    (Series("Cycles, denoised", "CYCLES", (), bounces=BOUNCES, denoised=True), 4),
    (Series("Cycles, denoised", "CYCLES", (), bounces=BOUNCES, denoised=True), 16),
)


def entrants(techniques: list[str]) -> list[tuple[Series, int]]:
    """Engines with settings and numbers of samples, in the order of the table."""
    found = [(own(name), samples) for name in techniques for samples in SAMPLES]
    return [*((own("AUTO"), samples) for samples in OF_AUTO), *found, *PEERS]


def cells(figures: dict) -> tuple[str, ...]:
    """Seconds and errors of one measurement by bench/worker.py."""
    times = sorted(figures["times"])
    shown = [f"{times[len(times) // 2]:.2f}"]
    for path in ("combined", "diffuse_indirect"):
        error = figures["errors"].get(path)
        if error is None or error["relmse"] is None:
            shown += ["–", "–"]
        else:
            shown += [f"{max(error['relmse'] - error['floor'], 0.0):.4f}", f"{error['bias']:.3f}"]
    return tuple(shown)


def taken(figures: dict, techniques: list[str]) -> str:
    """Which of the techniques has drawn a picture of these figures."""
    return next((row["name"] for row in figures["techniques"] if row["name"] in techniques), "none")


def measured(name: str, techniques: list[str], size: tuple[int, int], reference: int) -> list[tuple[str, ...]]:
    """The lines of one scene; what fails says so."""
    from bench import worker

    opened = worker.open_scene(Scene(name), size, reference)
    lines = []
    for series, samples in entrants(techniques):
        try:
            figures = worker.measure(opened, series, samples, size)
            found = cells(figures)
            label = f"Auto: {taken(figures, techniques)}" if series.label == "Auto" else series.label
        except Exception as error:  # one engine that does not render here leaves the rest of the table
            found, label = (f"failed: {type(error).__name__}", *("–",) * 4), series.label
        lines.append((label, str(samples), *found))
    return lines


# -------------------------------------------------------------------------------------------------------------- growth


@dataclass(frozen=True)
class Dial:
    """What is turned: name, values, the scene's family, and how a value is set."""

    name: str
    values: tuple[int, ...]
    family: str = ""
    size: Callable[[int], tuple[int, int]] = lambda value: GROWTH_SIZE
    parameter: str = ""


DIALS = (
    Dial("virtual lights", (128, 512, 2048), parameter="virtual_lights"),
    Dial("width", (64, 128, 256), size=lambda value: (value, value * 3 // 4)),
    Dial("triangles", (1_000, 10_000, 100_000), family="triangles"),
    Dial("lights", (1, 16, 256), family="lights"),
)


def growth(techniques=GROWN, dials=DIALS) -> Iterator[tuple[str, ...]]:
    """Counters of one sample by technique and dial."""
    from bench import worker

    for dial in dials:
        for value in dial.values:
            scene = Scene(dial.family, dial.family, value) if dial.family else Scene(MOVING_SCENE)
            size = dial.size(value)
            opened = worker.open_scene(scene, size, 0)
            for technique in techniques:
                values = ((f"{technique}_{dial.parameter}", value),) if dial.parameter else ()
                series = Series(technique, "CANDELA", (), slots=(("indirect", technique),), values=values)
                for seed in (0, 1):  # the first compiles
                    worker.render(opened, series, 1, seed, size)
                row = next((row for row in worker.of_ledger()["techniques"] if row["name"] == technique), None)
                if row:
                    counted = ", ".join(f"{count} {what}" for what, count in row["counters"].items())
                    yield technique, dial.name, f"{value}", f"{row['ms']:.0f}", counted


# ------------------------------------------------------------------------------------------------------------- gathers


@contextmanager
def timed_gathers() -> Iterator[list[float]]:
    """Milliseconds of every gather over regions while this lasts: bounds, list, gather, and what fills the others."""
    from addon.gfx import images
    from addon.gfx.timing import Profiler
    from addon.techniques.multires_radiosity import MultiresRadiosity

    spent: list[float] = []
    fence = Profiler(wait=True)
    original = MultiresRadiosity.irradiance

    def measured_call(*arguments):
        images.finish()
        with fence.step("gather"):
            found = yield from original(*arguments)
        spent.append(1000 * fence.seconds.pop("gather"))
        return found

    MultiresRadiosity.irradiance = measured_call
    try:
        yield spent
    finally:
        MultiresRadiosity.irradiance = original


def gathers(scenes=GATHER_SCENES, size=GATHER_SIZE, virtual_lights=GATHER_LIGHTS) -> Iterator[tuple[str, ...]]:
    """The gather of regions beside that of every pixel, of the same virtual lights; none traced, nothing is random."""
    import numpy as np

    from addon.compare.passes import light_paths
    from addon.techniques.multires_radiosity import LEVELS
    from bench import worker

    for name in scenes:
        opened = worker.open_scene(Scene(name), size, 0)
        for rays in GATHER_RAYS:
            found = {}
            for levels in (LEVELS.default, 0):
                values = (("virtual_lights", virtual_lights), ("rays", rays), ("levels", levels))
                series = Series(
                    "regions", "CANDELA", (), bounces=2, slots=(("indirect", "multires_radiosity"),),
                    values=tuple((f"multires_radiosity_{parameter}", value) for parameter, value in values),
                )  # fmt: skip
                worker.render(opened, series, 1, 0, size)  # compiles
                with timed_gathers() as spent:
                    made = worker.render(opened, series, 1, 1, size, passes=True)
                row = next(row for row in worker.of_ledger()["techniques"] if row["name"] == "multires_radiosity")
                shown = light_paths(made["images"], made["transparent"])["diffuse_indirect"]
                found[levels] = sum(spent), row["counters"]["regions"], shown
            (of_regions, count, coarse), (of_pixels, _, fine) = found.values()
            difference = np.sqrt(np.square(coarse - fine).mean()) / fine.mean()
            yield (
                name, str(rays), str(count), f"{100 * count / (size[0] * size[1]):.0f} %", f"{of_regions:.0f}",
                f"{of_pixels:.0f}", f"{of_regions / of_pixels:.2f}",
                "noise" if rays else f"{100 * difference:.1f} %",
            )  # fmt: skip


# ---------------------------------------------------------------------------------------------------------------- page


def page(about: dict, size, reference: int, by_scene: dict, gathered: list, grown: list, moved: list) -> str:
    """The whole page as Markdown."""
    made = f"{about['date']}, Blender {about['blender']}, {about['device']}, {about['cpu']}."
    intro = f"""Written by `python -m bench indirect --page PATH`; do not edit. {ages.now()} {made}

{size[0]} x {size[1]} pixels, {BOUNCES} bounces, against two renders of {reference} samples by Cycles, whose noise is
taken off the errors (relMSE); the passes of one sample are means of several seeds. Seconds are those of a whole
render. EEVEE splits light into other passes, and denoised
Cycles has none: of both Combined is compared."""
    parts = ["# Indirect light: error and time", intro]
    parts += [f"## {name}\n\n{markdown.table([HEAD, *rows])}" for name, rows in by_scene.items()]
    if gathered:
        parts.append(
            f"## Regions\n\nThe gather of {GATHER_LIGHTS} virtual lights, none or some of them traced, once for each"
            " region (all that finds regions\nand interpolates between them included) and once for each pixel, at"
            f" {GATHER_SIZE[0]} x {GATHER_SIZE[1]}; difference in irradiance,\nover its mean.\n\n"
            + markdown.table([GATHER_HEAD, *gathered])
        )
    if grown:
        parts.append(
            "## Growth\n\nOne sample; the dials of the picture and of virtual lights in the Cornell box, those of"
            f" triangles and lights\nin bench/families.py at {GROWTH_SIZE[0]} x {GROWTH_SIZE[1]}.\n\n"
            + markdown.table([GROWTH_HEAD, *grown])
        )
    if moved:
        parts.append(
            f"## Motion\n\n{FRAMES} frames of one sample of the Cornell box while camera and lamp move slowly, at"
            f" {MOVING_SIZE[0]} x {MOVING_SIZE[1]}.\nNew error is half the mean square of the error's change from one"
            " frame to the next: 0 where errors stand still,\ntheir variance where every frame draws its own.\n\n"
            + markdown.table([MOVING_HEAD, *moved])
        )
    return "\n\n".join(parts) + "\n"


def write(path: Path, scenes, techniques: list[str], size: tuple[int, int], reference: int) -> None:
    """Measure all and write the page; after each scene, so that what is measured stays when the run is ended."""
    import bpy

    from bench import indirect, worker
    from bench.quick import table

    about = worker.about() | {"date": dt.datetime.now(dt.UTC).strftime("%Y-%m-%d")}
    by_scene: dict[str, list] = {}
    gathered: list[tuple[str, ...]] = []
    grown: list[tuple[str, ...]] = []
    moved: list[tuple[str, ...]] = []

    def save(title: str, head, rows) -> None:
        print(f"\n{title}\n{table([head, *rows])}", flush=True)
        write_whole(path, page(about, size, reference, by_scene, gathered, grown, moved))

    for name in scenes:
        by_scene[name] = measured(name, techniques, size, reference)
        save(name, HEAD, by_scene[name])
    gathered += gathers()
    save("regions", GATHER_HEAD, gathered)
    grown += growth()
    save("growth", GROWTH_HEAD, grown)
    bpy.ops.wm.open_mainfile(filepath=str(indirect.SCENES / f"{MOVING_SCENE}.blend"))
    moved += indirect.moving(bpy.context.scene, techniques, FRAMES, MOVING_REFERENCE, MOVING_SIZE)
    save("motion", MOVING_HEAD, moved)
