"""All measurements and the page, one after the other: `python -m bench all`, which `make bench` calls.

Profile and growth of cost come first, because they take the same time always; time against error gets what is left of
the budget. Each is a process of its own. The table that Auto reads is not written: that changes pictures, and is
decided by hand (`python -m bench costs`, and then the tests).
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time

from bench import run
from bench.cells import ROOT

LEAST = 2.0  # minutes that time against error gets at least
FIXED = 25.0  # seconds for the page


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--budget", type=float, metavar="MINUTES", help="for everything; default: all cells")
    parser.add_argument("--size", default="128x96", metavar="WxH", help="default 128x96")
    parser.add_argument("--scenes", nargs="+", metavar="NAME", help="default: all of sample_blends")


def command(options: argparse.Namespace) -> int:
    started = time.monotonic()
    run.size_of(options.size)
    scenes = ["--scenes", *options.scenes] if options.scenes else []
    size = ["--size", options.size]
    short = ["--runs", "0"] if options.budget else []
    failed = [step("profile", *scenes, *size), step("growth", *short)]
    budget = []
    if options.budget:
        left = options.budget - (time.monotonic() - started + FIXED) / 60
        budget = ["--budget", f"{max(left, LEAST):.2f}"]
    failed += [step("run", *scenes, *size, *budget), step("page")]
    print(f"{(time.monotonic() - started) / 60:.1f} minutes")
    return max(failed)


def step(*arguments: str) -> int:
    """One verb in a process of its own; its exit code."""
    print(f"== python -m bench {' '.join(arguments)}", flush=True)
    return subprocess.run([sys.executable, "-m", "bench", *arguments], cwd=ROOT, check=False).returncode
