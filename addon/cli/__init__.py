"""`blender --command candela render | compare | plan | tune | merge | farm | grass …`, and as `python -m addon …`.

What a person may get wrong ends in one sentence on standard error: exit code 2 when the command line cannot be meant
as it stands, 1 when the file, the scene or the output will not do. Results are written beside their final place and
renamed, so that nothing half-written is ever seen. The opened file is changed in memory only.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import re
import signal
import sys
from dataclasses import replace
from pathlib import Path

import bpy

from ..compare.cache import LIMIT_BYTES
from ..compare.reference import cache_folder
from ..frame.settings import SAMPLES
from ..snapshot.scene import one_line
from ..techniques import REGISTRY
from . import farm, farm_operator, grass, merging, tuning, verbs
from .refused import FAILURE, USAGE, Refused
from .terminal import STDOUT

COMMAND = "candela"
OK = 0
SIZES = range(4, 65537)  # pixels; Blender's own limits of a resolution
FRAMES = range(-1048574, 1048575)  # Blender's own limits of a frame number


# ----------------------------------------------------------------------------------------------------------- the call


def main(arguments: list[str], program: str = f"blender --command {COMMAND}") -> int:
    """Do what the command line says and return the exit code. The add-on is registered."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")  # a terminal without × shows a question mark
    with contextlib.suppress(ValueError):  # not the main thread
        signal.signal(signal.SIGTERM, _interrupt)  # a farm that takes a task back: as Ctrl+C
    try:
        options = _parser(program).parse_args(arguments)
        options.verb(verbs.open_job(options) if options.opens else options)
        sys.stdout.flush()
    except Refused as refusal:
        return _end(str(refusal), refusal.code)
    except KeyboardInterrupt:
        return _end("Interrupted; what was unfinished was not written, and what was finished before stays.", FAILURE)
    except BrokenPipeError:  # `… | head`: who reads has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), STDOUT)
        return FAILURE
    except OSError as error:  # a full disk, a temporary folder that is not there
        return _end(f"{error.filename or 'A file'} could not be used: {error.strerror or error}.", FAILURE)
    except SystemExit as end:  # --help
        return int(end.code or OK)
    return OK


def _interrupt(*_) -> None:
    raise KeyboardInterrupt


def _end(sentence: str, code: int) -> int:
    sys.stdout.flush()
    print(one_line(sentence), file=sys.stderr, flush=True)
    return code


class _Parser(argparse.ArgumentParser):
    def error(self, message: str):
        hint = (
            "; a value that begins with a dash is written --option=-value" if "expected one argument" in message else ""
        )
        raise Refused(f"{message[:1].upper()}{message[1:].rstrip('.')}{hint} (see --help).", USAGE)


def _parser(program: str) -> argparse.ArgumentParser:
    shared = _Parser(add_help=False)
    shared.add_argument("file", metavar="FILE.blend", type=Path)
    shared.add_argument("--samples", metavar="N", help="samples per pixel (default: the file's)")
    shared.add_argument("--size", metavar="WxH", type=_size, help="pixels (default: the file's resolution)")
    shared.add_argument("--frame", metavar="N", type=_frame, help="frame of the animation (default: the file's)")
    shared.add_argument("--scene", metavar="NAME", help="default: the scene that was active when the file was saved")
    shared.add_argument("--view-layer", metavar="NAME", help="default: all that are rendered; compare: the active one")
    shared.add_argument(
        "--set", metavar="NAME=VALUE", action="append", default=[], dest="assignments",
        help=f"a setting of Candela, such as {_example()}; may be repeated; a wrong name prints the list",
    )  # fmt: skip
    shared.add_argument(
        "--run-scripts", action="store_true",
        help="run the file's scripts and drivers in Python; only for files that you trust",
    )  # fmt: skip
    shared.add_argument("--verbose", action="store_true", help="show what Blender itself prints")

    parser = _Parser(prog=program, description="Candela, a render engine for Blender.", allow_abbrev=False)
    commands = parser.add_subparsers(metavar="render|compare|plan|tune|merge|farm|grass", required=True)
    add = {"parents": [shared], "allow_abbrev": False}
    render = commands.add_parser("render", help="render a picture", **add)
    render.add_argument("--output", metavar="PATH", type=Path, help=".png, or .exr with all passes of the file")
    render.add_argument(
        "--compositing", action="store_true",
        help="run the file's compositor; File Output nodes that point outside the output's folder are muted",
    )  # fmt: skip
    render.add_argument(
        "--frames", metavar="A-B", type=_frames,
        help="several frames, such as 1-10, 1-100:5 or 1,3,7; the name of the output has #### for their number",
    )  # fmt: skip
    render.add_argument("--skip-existing", action="store_true", help="leave pictures that are there as they are")
    render.add_argument("--show", metavar="IMAGE", help="write this intermediate image in place of the picture")
    render.add_argument("--slice", metavar="K/N", help="the Kth of N parts of the samples, as .exr; see merge")
    _add_farming(render)
    render.set_defaults(verb=verbs.render, opens=True)
    merge = commands.add_parser("merge", help="make a picture of its slices", allow_abbrev=False)
    merge.add_argument("slices", metavar="SLICE.exr", type=Path, nargs="+", help="all slices of one picture")
    merge.add_argument("--file", metavar="FILE.blend", type=Path, help="the file that was rendered (needed)")
    merge.add_argument("--output", metavar="PATH", type=Path, required=True, help=".png, or .exr with all passes")
    merge.add_argument("--frames", metavar="A-B", type=_frames, help="several pictures; names have #### for the frame")
    merge.add_argument("--run-scripts", action="store_true", help="as for render")
    merge.add_argument("--compositing", action="store_true", help="as for render")
    merge.add_argument("--verbose", action="store_true", help="show what Blender itself prints")
    _add_farming(merge)
    merge.set_defaults(verb=merging.merge, opens=False)
    job = commands.add_parser("farm", help="write a job for a render farm", **add)
    job.add_argument("--frames", metavar="A-B", type=_frames, help="default: the file's range")
    job.add_argument("--chunk", metavar="N", type=_count, default=1, help="frames per task (default 1)")
    job.add_argument(
        "--split-samples", metavar="N", type=_count, default=1, help="slices per picture, a task each (default 1)"
    )
    job.add_argument("--output", metavar="FOLDER", type=Path, required=True, help="for the job's description")
    job.add_argument("--results", metavar="FOLDER", type=Path, help="for the pictures (default: in the job's folder)")
    job.add_argument("--format", choices=("png", "exr"), default="exr", help="of the pictures (default exr)")
    job.add_argument("--extensions", metavar="FOLDER", help="shared folder of extensions that nodes find Candela in")
    job.add_argument(
        "--skip-existing", action="store_true", help="tasks leave pictures and slices that are there, older ones too"
    )
    job.add_argument("--gpu", action="store_true", help="ask for nodes with a GPU")
    job.set_defaults(verb=farm.write_job, opens=True)
    against = commands.add_parser("compare", help="render by Candela and by Cycles, and compare", **add)
    against.add_argument("--output", metavar="FOLDER", type=Path, help="for index.html and the pictures")
    against.add_argument(
        "--reference-samples",
        metavar="N",
        type=_count,
        default=256,
        help="samples of each of the two Cycles renders (default 256)",
    )
    against.add_argument(
        "--direct-only", action=argparse.BooleanOptionalAction, default=False,
        help="both engines without bounces",
    )  # fmt: skip
    against.add_argument(
        "--first-row", action="store_true",
        help="begin the page with 1, 4 and 16 samples of Candela, and denoised Cycles in the time of the 16",
    )  # fmt: skip
    against.add_argument("--progress", action="store_true", help="print lines of progress, as render does for farms")
    against.add_argument("--no-cache", action="store_true", help="render the reference anew and do not keep it")
    _add_cache(against)
    against.set_defaults(verb=verbs.compare, opens=True)
    plan = commands.add_parser("plan", help="print what would run and why the rest is skipped", **add)
    plan.set_defaults(verb=verbs.plan, opens=True)
    tune = commands.add_parser("tune", help="find the settings with the least error within a time", **add)
    tune.add_argument(
        "--milliseconds",
        metavar="N",
        type=_positive,
        required=True,
        help="render time allowed per picture, on this machine",
    )
    tune.add_argument(
        "--budget",
        metavar="SECONDS",
        type=_positive,
        default=120.0,
        help="time for measuring, beside the reference (default 120)",
    )
    tune.add_argument(
        "--reference-samples",
        metavar="N",
        type=_count,
        default=128,
        help="samples of each of two Cycles renders (default 128)",
    )
    tune.add_argument("--apply", action="store_true", help="write what was found into the file, or into --output")
    tune.add_argument("--output", metavar="PATH.blend", type=Path, help="with --apply: leave FILE as it is")
    _add_cache(tune)
    tune.set_defaults(verb=tuning.tune_scene, opens=True)
    meadow = commands.add_parser("grass", help="render a patch of grass for materials to show", allow_abbrev=False)
    grass.add_arguments(meadow, _count)
    meadow.set_defaults(verb=grass.make_patch, opens=False)
    return parser


def _add_farming(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--progress", action="store_true", help="print lines of progress that render farms read")
    parser.add_argument(
        "--expect", metavar="VERSION", help="exit with code 1 unless Blender's version begins so, such as 5.2"
    )


def _add_cache(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--cache", metavar="FOLDER", type=Path,
        help=f"keeps Cycles' references, up to {LIMIT_BYTES >> 30} GiB (default: {cache_folder()})".replace("%", "%%"),
    )  # fmt: skip


def _example() -> str:
    return next(f"{t.name}.{p.name}={p.default}" for t in REGISTRY for p in t.params)


def _size(text: str) -> tuple[int, int]:
    match = re.fullmatch(r"(\d+)[xX×](\d+)", text)
    size = (int(match[1]), int(match[2])) if match else (0, 0)
    if not all(edge in SIZES for edge in size):
        raise argparse.ArgumentTypeError(
            f"'{text}' is not a size: two whole numbers from {SIZES[0]} to {SIZES[-1]} are, such as 640x480"
        )
    return size


def _frame(text: str) -> int:
    try:
        if int(text) in FRAMES:
            return int(text)
    except ValueError:
        pass
    raise argparse.ArgumentTypeError(f"'{text}' is not a frame: whole numbers from {FRAMES[0]} to {FRAMES[-1]} are")


def _frames(text: str) -> list[int]:
    beyond = argparse.ArgumentTypeError(f"'{text}' holds no frame, or one beyond {FRAMES[0]} to {FRAMES[-1]}")
    found: dict[int, None] = {}
    for part in text.split(","):
        match = re.fullmatch(r"\s*(-?\d{1,12})(?:-(-?\d{1,12})(?::(\d{1,12}))?)?\s*", part)
        if match is None or int(match[3] or 1) < 1:
            raise argparse.ArgumentTypeError(f"'{text}' are no frames: 1-10, 1-100:5 or 1,3,7 are")
        first, last = int(match[1]), int(match[2] or match[1])
        if first not in FRAMES or last not in FRAMES:  # before they are listed, which could fill the memory
            raise beyond
        found |= dict.fromkeys(range(first, last + 1, int(match[3] or 1)))
    if not found:
        raise beyond
    return list(found)


def _positive(text: str) -> float:
    try:
        if 0 < float(text) < float("inf"):
            return float(text)
    except ValueError:
        pass
    raise argparse.ArgumentTypeError(f"'{text}' is not a time: a number above 0 is")


def _count(text: str) -> int:
    try:
        return replace(SAMPLES, name="number").check(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error).rstrip(".")) from None


# ------------------------------------------------------------------------------------------------------- registration

_handle: list = []  # of the registered command


def register() -> None:
    """Make `blender --command candela` known."""
    _handle.append(bpy.utils.register_cli_command(COMMAND, main))
    farm_operator.register()


def unregister() -> None:
    farm_operator.unregister()
    while _handle:
        bpy.utils.unregister_cli_command(_handle.pop())
