"""All measurements and the page, one after the other: `python -m bench all`, which `make bench` calls.

Profile and growth of cost come first, each within a part of the budget; time against error gets what is left. Pictures
are 256x192, or as large as a budget allows for what a page needs. Each step is a process of its own.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time

from bench import run
from bench.cells import ROOT, sample_scenes

SIZES = ((256, 192), (192, 144), (128, 96), (64, 48))
PROFILE, GROWTH, ERROR = 0.07, 0.06, 0.83  # parts of a budget; what is left is for the page
PROFILE_SIZE = "128x96"  # within a budget


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--budget", type=float, metavar="MINUTES", help="for everything; default: all cells")
    parser.add_argument("--size", type=run.size_of, metavar="WxH", help="default: the largest that fits, to 256x192")
    parser.add_argument("--scenes", nargs="+", metavar="NAME", help="default: all of sample_blends")


def command(options: argparse.Namespace) -> int:
    started = time.monotonic()
    scenes = ["--scenes", *options.scenes] if options.scenes else []
    width, height = options.size or largest(options.budget, len(options.scenes or sample_scenes()))
    size = ["--size", f"{width}x{height}"]
    if options.budget:
        profile = ["--size", PROFILE_SIZE, *minutes(PROFILE * options.budget)]
        growth = ["--runs", "0", *minutes(GROWTH * options.budget)]
    else:
        profile, growth = size, []
    failed = [step("profile", *scenes, *profile), step("growth", *growth)]
    left = []
    if options.budget:
        spent = (time.monotonic() - started) / 60
        left = minutes(options.budget * (PROFILE + GROWTH + ERROR) - spent)
    failed += [step("run", *scenes, *size, *left), step("page")]
    print(f"{(time.monotonic() - started) / 60:.1f} minutes")
    return max(failed)


def largest(budget: float | None, scenes: int) -> tuple[int, int]:
    """The largest size at which so many scenes have what a page needs within a budget of minutes, with references
    that are there already."""
    for size in SIZES:
        if budget is None or run.needed_seconds(scenes, size) <= 60 * ERROR * budget:
            return size
    return SIZES[-1]


def minutes(value: float) -> list[str]:
    return ["--budget", f"{value:.2f}"]


def step(*arguments: str) -> int:
    """One verb in a process of its own; its exit code."""
    print(f"== python -m bench {' '.join(arguments)}", flush=True)
    return subprocess.run([sys.executable, "-m", "bench", *arguments], cwd=ROOT, check=False).returncode
