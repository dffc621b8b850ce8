"""Whether whole renders got slower: `python -m bench beside CHECKOUT`, this version and another one by turns.

CHECKOUT is a working tree of an older commit (`git worktree add`). Both render the sample scenes as bench-quick asks
Candela to, each in a process of its own, by turns: whatever else the machine does falls on both. What counts is the
least processor time of all threads, of which a software driver is most; it depends on the machine's load far less than
seconds do, which stand beside it. Seeds change from run to run, because a finished picture is kept. Drafts of a
viewport of 96x64 pixels that turns, and for which time stands still, are measured the same way.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from pathlib import Path

from bench.markdown import table

ROOT = Path(__file__).resolve().parents[1]
SCENES = ROOT / "sample_blends"
MOST = 1.05  # times the other's processor time
STEPS = 20  # of a viewport that turns
TURN = "turn"  # asked for in place of a seed
ANSWER = "took "  # begins the lines that are meant for us: Blender writes others
# Runs in the other tree, too: it asks nothing but what bench-quick there has.
SERVED = f"""
import sys, time
sys.path.insert(0, ".")
import addon, bpy
from addon.compare import reference
from addon.gfx import images
from bench import quick
from tests.viewport.region import Region
addon.register()

def turned():
    region = Region(samples=1)
    for step in range(4 + {STEPS}):
        if step == 4:
            images.finish()
            start = time.process_time(), time.perf_counter()
        region.camera = region.moved(1e-3)
        region.draw()
    images.finish()
    spent = [(now - then) / {STEPS} for now, then in zip((time.process_time(), time.perf_counter()), start)]
    region.viewport.release()
    return spent

for line in sys.stdin:
    path, seed, width, height = line.rstrip("\\n").split("\\t")
    if bpy.data.filepath != path:
        bpy.ops.wm.open_mainfile(filepath=path)
    scene = bpy.context.scene
    if seed == "{TURN}":
        spent = turned()
    else:
        size = int(width), int(height)
        made = quick.render(scene, reference.active_view_layer(scene), quick.CANDELA, int(seed), size)
        spent = made.cpu, made.seconds
    print("{ANSWER}%r %r" % tuple(spent), flush=True)
"""


class Version:
    """A process that renders with the add-on of one tree."""

    def __init__(self, tree: Path):
        self._process = subprocess.Popen(
            [sys.executable, "-c", SERVED], cwd=tree, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )

    def asked(self, scene: Path, seed: int | str, size: tuple[int, int]) -> tuple[float, float]:
        """Seconds of all threads' processor time, and of the clock, of a render with this seed or of a step of a TURN.
        EOFError if the process has ended."""
        self._process.stdin.write(f"{scene}\t{seed}\t{size[0]}\t{size[1]}\n")
        self._process.stdin.flush()
        for line in self._process.stdout:
            if line.startswith(ANSWER):
                cpu, seconds = map(float, line[len(ANSWER) :].split())
                return cpu, seconds
        raise EOFError(f"The process that renders {scene.stem} has ended.")

    def end(self) -> None:
        self._process.kill()  # its own exit handlers may wait for ever


# ------------------------------------------------------------------------------------------------------------- command


def add_options(parser: argparse.ArgumentParser) -> None:
    names = sorted(path.stem for path in SCENES.glob("*.blend"))
    parser.add_argument("checkout", type=Path, metavar="CHECKOUT", help="a working tree of another commit")
    parser.add_argument("--scenes", nargs="+", choices=names, default=names, metavar="NAME", help=", ".join(names))
    parser.add_argument("--runs", default=3, type=int, metavar="N", help="of each version on each scene (default 3)")
    parser.add_argument("--size", nargs=2, default=(128, 96), type=int, metavar=("W", "H"))


def command(options: argparse.Namespace) -> int:
    if not (options.checkout / "addon").is_dir():
        print(f"{options.checkout} is no working tree of Candela: make one by `git worktree add`.", file=sys.stderr)
        return 2
    versions = Version(options.checkout.resolve()), Version(ROOT)
    rows = [("scene", "other, s of processor", "this, s", "ratio", "ratio of seconds",
             "other, ms a draft", "this, ms", "ratio")]  # fmt: skip
    slower = []
    for name in options.scenes:
        scene = SCENES / f"{name}.blend"
        row = [name]
        for what, unit in ((1000, 1), (TURN, 1000)):
            for version in versions:
                version.asked(scene, what, options.size)  # compiles
            taken = [
                [version.asked(scene, what if what == TURN else run, options.size) for version in versions]
                for run in range(options.runs)
            ]
            (other, other_s), (this, this_s) = (tuple(map(min, zip(*runs))) for runs in zip(*taken))
            row += [f"{unit * other:.3g}", f"{unit * this:.3g}", f"{this / other:.2f}"]
            if what != TURN:
                row.append(f"{this_s / other_s:.2f}")
                slower += [name] * (this > MOST * other)
        rows.append(tuple(row))
        print(*row, sep=", ", flush=True)
    for version in versions:
        version.end()
    print(table(rows))
    print(f"Slower by more than {100 * (MOST - 1):.0f} %: {', '.join(slower) or 'none'}.")
    return 0
