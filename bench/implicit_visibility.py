"""Implicit visibility beside the other techniques of its slot and Cycles: `python -m bench implicit_visibility`.

Diffuse indirect light in six rooms at 1, 16 and 64 samples: relMSE with the reference's noise taken off, bias, and
seconds of the whole render. Then what the author tabulates: 3,400 surfels with one bounce at as many bins as cube
maps of 8, 12 and 16, step by step. `--page` writes the tables into docs/implicit_visibility.md. What is redone when
something moves: points_motion.py.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator

from bench import indirect, markdown
from bench.study import Study, number, opened, size

NAME = "implicit_visibility"
OTHERS = ("instant_radiosity", "imperfect_shadow_maps", "clustered_visibility", "ssdo")
SAMPLES, MOST_SAMPLES = (1, 16), 64  # the last for this one and for instant radiosity
SIZE = (96, 64)
SURFELS, BINS = 3400, {14: "6 x 8²", 21: "6 x 12²", 28: "6 x 16²"}
AUTHOR = {14: 112, 21: 148, 28: 218}  # ms on a GeForce 8800, one bounce of light of the environment
STEPS = {  # programs by what they are for
    "links": ("links of surfels",),
    "shading": ("rays to surfels", "trace hits", "materials met", "hits", "reflectance of surfels"),
    "direct light": ("direct light, rays",),
    "bounce": ("direct light that surfels send", "light of groups of surfels", "bounce between surfels"),
    "pixels": ("light of surfels at pixels",),
}


def errors_of_all(options: argparse.Namespace) -> Iterator[str]:
    """Rooms so far."""
    done: list[str] = []
    for name in options.scenes:
        done.append(f"**{name}**\n\n{errors(name, options)}")
        yield "\n\n".join(done)


def errors(name: str, options: argparse.Namespace) -> str:
    """Technique, samples, relMSE, bias, seconds of the whole render, from Blender's call to the pixels."""
    scene = opened(name)
    truth = indirect.reference(scene, options.reference, options.size)
    rows = [("technique", "samples", "relMSE", "bias", "seconds")]
    for technique in (NAME, *OTHERS):
        indirect.measured(scene, technique, 1, options.size, truth)  # compiles
        for samples in options.samples:
            if samples == MOST_SAMPLES and technique not in (NAME, OTHERS[0]):
                continue
            if technique != NAME or samples != MOST_SAMPLES:
                anew()
            started = time.perf_counter()
            found = indirect.measured(scene, technique, samples, options.size, truth)
            rows.append((*found[:4], f"{time.perf_counter() - started:.2f}"))
            print(name, *rows[-1], flush=True)
    return markdown.table(rows)


def anew() -> None:
    """Drop surfels, links and light, so that a time is that of a picture by itself."""
    from addon import engine

    engine.free_sessions()


def times(options: argparse.Namespace) -> str:
    """Milliseconds of each step of one picture of one sample, the GPU waited for after each program."""
    from addon.compare.reference import render_passes
    from addon.frame import ledger
    from addon.scene import surfels

    scene = opened("cornell_box")
    scene.candela.slot_indirect = NAME
    scene.candela.implicit_visibility_surfels = SURFELS
    rows = [("bins", "as fine as", *("surfels (CPU)",), *STEPS, "GPU", "whole", "author")]
    for bins, cube in BINS.items():
        scene.candela.implicit_visibility_bins = bins
        render_passes(scene, "CANDELA", 1, 1, size=SIZE, bounces=1)  # compiles
        anew()
        with timed() as spent, timed_call(surfels.Surfels, "update") as made:
            render_passes(scene, "CANDELA", 1, 1, size=SIZE, bounces=1)
        count = ledger.latest().row(NAME).counters["light made"]
        step = [sum(ms for name, ms in spent.items() if name.startswith(names)) for names in STEPS.values()]
        rows.append((
            f"{bins}² on {count} sides", cube, f"{made[0]:.0f}", *(f"{ms:.1f}" for ms in step), f"{sum(step):.0f}",
            f"{sum(step) + made[0]:.0f}", str(AUTHOR[bins]),
        ))  # fmt: skip
    return markdown.table(rows)


class timed:
    """Milliseconds by program while it is open."""

    def __enter__(self) -> dict[str, float]:
        from addon.gfx import images, passes

        self.spent: dict[str, float] = {}
        self._kept = {name: getattr(passes, name) for name in ("fullscreen", "compute")}
        for name, run in self._kept.items():
            setattr(passes, name, self._measuring(run, images.finish))
        return self.spent

    def _measuring(self, run: Callable, finish: Callable) -> Callable:
        def measured(program, *arguments, **keywords):
            finish()
            started = time.perf_counter()
            run(program, *arguments, **keywords)
            finish()
            self.spent[program.name] = self.spent.get(program.name, 0.0) + 1000 * (time.perf_counter() - started)

        return measured

    def __exit__(self, *_) -> None:
        from addon.gfx import passes

        for name, run in self._kept.items():
            setattr(passes, name, run)


class timed_call:
    """Milliseconds of all calls of a method while it is open."""

    def __init__(self, owner, name: str):
        self.owner, self.name = owner, name

    def __enter__(self) -> list[float]:
        self.kept, self.spent = getattr(self.owner, self.name), [0.0]

        def measured(*arguments, **keywords):
            started = time.perf_counter()
            found = self.kept(*arguments, **keywords)
            self.spent[0] += 1000 * (time.perf_counter() - started)
            return found

        setattr(self.owner, self.name, measured)
        return self.spent

    def __exit__(self, *_) -> None:
        setattr(self.owner, self.name, self.kept)


STUDY = Study(
    NAME,
    {"error": errors_of_all, "time": times},
    {
        "--scenes": {"nargs": "+", "default": indirect.ROOMS, "metavar": "NAME", "help": "rooms to measure"},
        "--samples": {"nargs": "+", "type": int, "default": (*SAMPLES, MOST_SAMPLES), "metavar": "N"},
        "--size": size("96x64"),
        "--reference": number(128, "samples of each of two references"),
    },
)
add_options, command = STUDY.add_options, STUDY.command
