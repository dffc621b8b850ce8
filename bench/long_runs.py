"""Thousands of random scenes by Candela alone: `python -m bench random --alone SECONDS`.

As many as fit in that time are rendered one after the other in one process, with bounces and 1 to 4 samples. Told are
pixels that are not finite, errors, what memory the process held meanwhile, and what of it is kept by name. With
`--same` the first scene is rendered again and again, which tells what stays of a picture. With `--keep` the run goes on
after the last scene of the runs before it that drew alike, so that their figures add up:
bench/results/random_BACKEND.json holds them, with the commit of each; one process at a time. A run whose process died
(Ctrl-C ends one as its time does) is told apart: the scene at which that was counts as wrong, and the next run begins
after it. `--alone 0 --keep` tells of what is kept alone.
"""

from __future__ import annotations

import argparse
import contextlib
import fcntl
import json
import resource
import time
from dataclasses import asdict, dataclass, field
from pathlib import Path

from bench import ages
from bench.cells import ROOT
from bench.markdown import write_whole

KEPT = ROOT / "bench" / "results"
MIB = 1 << 20


@dataclass
class Run:
    """What one process rendered: `count` scenes from `first` on."""

    commit: str
    size: tuple[int, int]
    alike: int
    first: int
    count: int = 0
    wrong: dict[str, str] = field(default_factory=dict)  # what is wrong, by the scene's number
    resident: list[tuple[int, int]] = field(default_factory=list)  # MiB after so many scenes
    seconds: float = 0.0  # of the processor
    ended: bool = False
    samples: int = 64

    @property
    def current(self) -> int:
        """The scene that is drawn; after the end of a process that died, the one at which that was."""
        return self.first + self.count

    @property
    def following(self) -> int:
        return self.current + (not self.ended)

    @property
    def kind(self) -> tuple:
        """What runs have in common whose figures add up."""
        return tuple(self.size), self.alike, self.samples


def alone(options: argparse.Namespace) -> int:
    """Render scenes for so many seconds; 1 if one of them failed or had pixels that are not finite, or if runs cannot
    be kept."""
    place = place_of(_backend())
    if not options.keep:
        return _alone(options, place)
    if options.same:
        print("--keep goes on with other scenes, --same with none: choose one of them.")
        return 1
    try:
        with only_here(place):
            return _alone(options, place)
    except BlockingIOError:
        print(f"Another process keeps its runs in {place}.")
        return 1


def _alone(options: argparse.Namespace, place: Path) -> int:
    before = read(place) if options.keep else []
    run = Run(ages.git("rev-parse", "--short=8", "HEAD") or "unknown", tuple(options.size), options.alike,
              options.first, samples=options.samples)  # fmt: skip
    run.first = max((one.following for one in before if one.kind == run.kind), default=run.first)
    until = time.monotonic() + options.alone
    with contextlib.suppress(KeyboardInterrupt):
        while time.monotonic() < until:
            if options.keep:  # as if it died here: what ends it may not let it say so
                write(place, [*before, run])
            _render(run, options)
            if run.count % options.every == 0:
                run.resident.append((run.count, _resident()))
                print(f"{run.count} scenes, {run.resident[-1][1]} MiB; {_held()}", flush=True)
    run.ended = True
    kept = [*before, *([run] if run.count else [])]
    if options.keep and place.exists():
        write(place, kept)
    print(f"{run.count} scenes, {len(run.wrong)} wrong: {[*run.wrong]}; {run.seconds:.0f} s of the processor")
    if len(run.resident) > 3:
        held = [mib for _, mib in run.resident]
        print(f"{held[len(held) // 4]} MiB after a quarter of them, {max(held)} at most, {held[-1]} at the end")
    if options.keep:
        for kind in dict.fromkeys(one.kind for one in kept):
            print(total(place.stem, [one for one in kept if one.kind == kind]))
    return int(bool(run.wrong))


def _render(run: Run, options: argparse.Namespace) -> None:
    """The next scene of a run."""
    from addon.compare.reference import render_passes
    from addon.frame import ledger
    from bench import random_scenes

    number = run.first if options.same else run.current
    scene, notes = random_scenes.build(number, options.alike)
    try:
        render_passes(scene, "CANDELA", 1 + number % min(options.samples, 4), number, size=options.size)
        bad = ledger.latest().bad_pixels
        wrong = f"{bad} pixels are not finite" if bad else ""
    except Exception as error:
        wrong = f"{type(error).__name__}: {error}"
    if wrong:
        run.wrong[str(number)] = wrong
        print(f"{number}: {wrong}\n    {notes}", flush=True)
    run.count += 1
    run.seconds = round(sum(resource.getrusage(resource.RUSAGE_SELF)[:2]), 1)


def _backend() -> str:
    import gpu

    from addon.gfx import context

    context.ensure()
    return gpu.platform.backend_type_get().lower()


def _resident() -> int:
    from bench.memory import resident_bytes

    return resident_bytes() // MIB


def _held() -> str:
    from bench.memory import kept

    return ", ".join(
        f"{value // MIB} MiB of {name}" if name in ("pool", "images") else f"{value} {name}"
        for name, value in kept().items()
    )


# ---------------------------------------------------------------------------------------------------------------- kept


def place_of(backend: str) -> Path:
    return KEPT / f"random_{backend}.json"


def read(place: Path) -> list[Run]:
    return [Run(**one) for one in json.loads(place.read_text("utf-8"))] if place.exists() else []


def write(place: Path, runs: list[Run]) -> None:
    place.parent.mkdir(exist_ok=True)
    write_whole(place, json.dumps([asdict(one) for one in runs], indent=1) + "\n")


@contextlib.contextmanager
def only_here(place: Path):
    """BlockingIOError if another process keeps runs there; the system lets go of what a dead one held."""
    place.parent.mkdir(exist_ok=True)
    with place.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield


def total(name: str, runs: list[Run]) -> str:
    """What all runs of a kind say together."""
    died = [one.current for one in runs if not one.ended]
    wrong = [*(int(number) for one in runs for number in one.wrong), *died]
    most = max((mib for one in runs for _, mib in one.resident), default=0)
    count, seconds = sum(one.count for one in runs) + len(died), sum(one.seconds for one in runs)
    (width, height), alike, samples = runs[0].kind
    return (
        f"{name}, {width}x{height}, {alike} alike, of {samples} samples: {count} scenes"
        f" in {len(runs)} runs, {len(wrong)} wrong: {wrong}; {most} MiB at most;"
        f" {len(died)} runs without an end, at {died}; {seconds:.0f} s of the processor"
    )
