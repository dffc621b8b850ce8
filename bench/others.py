"""Files of other people beside Cycles: `python -m bench others`, which fetches and renders them.

bench/others.toml names the repositories and commits. Each is fetched from GitHub with git, that commit alone, into
`--folder`, and stays there for the next run. Every .blend file in it is opened as the command line opens files, with
scripts off, and rendered by Candela with all light and by Cycles twice, in a process of its own with a limit of time:
a crash or a hang is one row of the table. A scene without a camera gets one that sees all of it; one without any light
stays dark, and is compared dark.

A row says relMSE of the picture with half and with all samples, without the reference's noise and without the worst
hundredth of the pixels (edges in few samples), the mean beside Cycles', and the light paths whose mean differs by more
than SHARE of the picture's light beyond the references' noise; then how many sentences Candela itself says about what
it leaves out. A file is alike if neither the error nor any light path's mean is off. `--page` writes
docs/other_files.md, worst first.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import tomllib
from dataclasses import asdict, dataclass, field
from pathlib import Path

from bench import markdown
from bench.cells import ROOT
from bench.quick import size_of

LIST = ROOT / "bench" / "others.toml"
PAGE = ROOT / "docs" / "other_files.md"
COMMAND = "python -m bench others --page"
LIMIT = 240.0  # seconds for a file
MARGIN = 1.1  # of the sphere about everything, for a camera where a file has none
ENDED = "ended without an answer"
SHARE = 0.02  # of the picture's light


@dataclass
class Row:
    """What became of one file."""

    repository: str
    path: str
    state: str = "alike"  # or off, or a sentence that says why there is no picture
    error: float = 0.0
    mean: float = 1.0
    off: list[str] = field(default_factory=list)
    said: list[str] = field(default_factory=list)
    few: float = 0.0  # relMSE of half the samples
    seconds: float = 0.0  # processor seconds of a picture, without compiling
    cycles: float = 0.0  # the same of the reference


def repositories() -> list[dict]:
    return tomllib.loads(LIST.read_text(encoding="utf-8"))["repository"]


def fetch(repository: dict, folder: Path) -> Path:
    """The repository's files at its commit, below `folder`. CalledProcessError when git cannot bring them."""
    place = folder / repository["name"].replace("/", "+")
    if (place / "complete").exists():
        return place
    place.mkdir(parents=True, exist_ok=True)
    url = f"https://github.com/{repository['name']}"
    for arguments in (
        ["init", "--quiet"],
        ["fetch", "--quiet", "--depth", "1", url, repository["commit"]],
        ["checkout", "--quiet", "--force", "FETCH_HEAD"],
    ):
        subprocess.run(["git", "-C", str(place), *arguments], check=True)
    (place / "complete").touch()
    return place


# ------------------------------------------------------------------------------------------- one file, in its process


def render(path: Path, options: argparse.Namespace) -> dict:
    """What is to be said of one file: the fields of a `Row` that a picture gives."""
    import bpy
    import numpy as np

    import addon
    from addon.cli import untrusted
    from addon.cli.verbs import open_mainfile
    from addon.compare.passes import light_paths
    from addon.compare.reference import render_passes
    from addon.frame import ledger
    from bench.random_scenes import differences

    addon.register()
    why = open_mainfile(path)
    if why:
        return {"state": f"Blender cannot open it: {why}".replace(f"{ROOT}/", "")}
    untrusted.contain(compositing=False)
    scene = bpy.context.scene
    scene.render.use_sequencer = scene.render.use_multiview = scene.render.use_border = False
    if scene.camera is None and not add_camera(scene):
        return {"state": "nothing to see"}
    width, height = options.size
    shape = scene.render.resolution_x / max(scene.render.resolution_y, 1)
    size = (width, max(8, round(width / shape))) if shape > width / height else (max(8, round(height * shape)), height)

    def pictures(engine: str, samples: int, seed: int) -> dict:
        images = render_passes(scene, engine, samples, seed, size=size).images
        return {"combined": images["combined"], **light_paths(images)}

    def worked() -> float:
        used = resource.getrusage(resource.RUSAGE_SELF)
        return used.ru_utime + used.ru_stime

    few = pictures("CANDELA", max(options.samples // 2, 1), 3)  # compiles, too
    started = worked()
    own = pictures("CANDELA", options.samples, 3)
    seconds = worked() - started
    said = [str(note) for note in ledger.latest().notes]
    if not all(np.isfinite(picture).all() for picture in own.values()):
        return {"state": "not finite", "said": said, "seconds": seconds}
    started = worked()
    first, second = (pictures("CYCLES", options.reference_samples, seed) for seed in (1, 2))
    cycles = (worked() - started) / 2
    found, _ = differences(few, first, second, options.tolerance)
    before = {name: float(error) for name, error, _ in map(str.split, found)}.get("combined", 0.0)
    found, _ = differences(own, first, second, options.tolerance)
    values = {name: (float(error), float(mean)) for name, error, mean in map(str.split, found)}
    error, mean = values.get("combined", (0.0, 1.0))
    worse = paths_that_differ(own, first, second)
    state = "off" if error > options.tolerance or worse else "alike"
    return {"state": state, "error": error, "mean": mean,
            "off": worse, "said": said, "seconds": seconds, "few": before, "cycles": cycles}  # fmt: skip


def paths_that_differ(own: dict, first: dict, second: dict) -> list[str]:
    """Light paths, `combined` among them, whose mean differs from that of both references together by more than SHARE
    of the picture's light and twice what the references differ by. Images: (H, W, 3 or 4)."""
    means = {name: [float(of[name][..., :3].mean()) for of in (own, first, second)] for name in own}
    light = max(sum(means["combined"][1:]) / 2, 1e-30)
    found = []
    for name, (mine, one, other) in means.items():
        share = (mine - (one + other) / 2) / light
        if abs(share) > SHARE + 2 * abs(one - other) / light:
            found.append(f"{name} {share:+.1%}")
    return found


def add_camera(scene) -> bool:
    """A camera that sees everything in the scene; False where there is nothing."""
    import bpy
    import mathutils

    corners = [
        instance.matrix_world @ mathutils.Vector(corner)
        for instance in bpy.context.evaluated_depsgraph_get().object_instances
        if instance.object.type in ("MESH", "CURVE", "SURFACE", "META", "FONT", "CURVES", "POINTCLOUD", "VOLUME")
        for corner in instance.object.bound_box
    ]
    if not corners:
        return False
    centre = sum(corners, mathutils.Vector()) / len(corners)
    radius = max((corner - centre).length for corner in corners) or 1.0
    data = bpy.data.cameras.new("Camera")
    made = bpy.data.objects.new("Camera", data)
    scene.collection.objects.link(made)
    towards = mathutils.Vector((-0.55, 0.65, -0.5)).normalized()
    distance = MARGIN * radius / (data.sensor_width / 2 / data.lens)
    made.location = centre - towards * distance
    made.rotation_euler = towards.to_track_quat("-Z", "Y").to_euler()
    data.clip_start, data.clip_end = 1e-3 * radius, distance + 10 * radius
    scene.camera = made
    return True


# --------------------------------------------------------------------------------------------------------------- files


def row_of(repository: dict, place: Path, path: Path, options: argparse.Namespace) -> Row:
    """One file, in a process of its own."""
    named = Row(repository["name"], str(path.relative_to(place)))
    command = [sys.executable, "-m", "bench", "others", "--one", str(path), "--samples", str(options.samples),
               "--reference-samples", str(options.reference_samples), "--tolerance", str(options.tolerance),
               "--size", "x".join(map(str, options.size))]  # fmt: skip
    try:
        done = subprocess.run(
            command, check=False, cwd=ROOT, capture_output=True, text=True, errors="replace",
            timeout=options.limit,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        named.state = f"not done in {options.limit:g} s"
        return named
    try:
        answer = json.loads((done.stdout.strip().splitlines() or [""])[-1])
    except ValueError:
        named.state = f"{ENDED} (exit code {done.returncode})"
        print(done.stderr[-2000:], file=sys.stderr)
        return named
    return Row(named.repository, named.path, **answer)


def line_of(row: Row) -> str:
    if row.state not in ("alike", "off"):
        return f"{row.state}: {row.path}"
    found = f"{row.few:.4f} {row.error:.4f} {row.mean:.3f} {row.seconds:.2f}/{row.cycles:.2f} s"
    return f"{row.state} {found}: {row.path} {'; '.join(row.off)}"


def page(rows: list[Row], options: argparse.Namespace) -> str:
    """The table, worst first, and its counts."""
    drawn = [row for row in rows if row.state in ("alike", "off")]
    alike = sum(row.state == "alike" for row in drawn)
    ended = sum(row.state.startswith(ENDED) for row in rows)
    sources = [("repository", "commit", "licence", "what", "files")]
    for one in repositories():
        count = sum(row.repository == one["name"] for row in rows)
        if count:
            url = f"https://github.com/{one['name']}/tree/{one['commit']}"
            sources.append((f"[{one['name']}]({url})", one["commit"][:10], one["licence"], one["about"], str(count)))
    off = "light paths that differ, of the picture's light"
    table = [("file", f"relMSE {options.samples // 2}", str(options.samples), "time", "mean", off, "sentences")]
    rest = [("file", "why there is no comparison")]
    for row in sorted(rows, key=lambda row: -row.error):
        name = f"{row.repository.split('/')[1]}: {row.path}"
        if row in drawn:
            times = f"{row.seconds / max(row.cycles, 1e-3):.2f}"
            errors = f"{row.few:.4f}", f"{row.error:.4f}"
            table.append((name, *errors, times, f"{row.mean:.3f}", "; ".join(row.off), str(len(row.said))))
        else:
            rest.append((name, row.state))
    said = (
        f"{len(rows)} files, {options.samples} samples of Candela with all light beside two renders of "
        f"{options.reference_samples} samples of Cycles, {options.size[0]}x{options.size[1]} at most. "
        f"{len(drawn)} could be compared; {alike} have a relMSE of at most {options.tolerance:g} and "
        f"no light path off; "
        f"{ended} ended Blender. relMSE of half the samples and of all; time: processor seconds of all beside those of "
        f"a render of Cycles, without compiling."
    )
    parts = [said, markdown.table(sources), markdown.table(table)]
    return "\n\n".join(parts + ([markdown.table(rest)] if len(rest) > 1 else []))


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--folder", type=Path, default=ROOT / "out" / "others", help="of the repositories (out/others)")
    parser.add_argument("--repository", default="", metavar="TEXT", help="those whose owner/name has this in it")
    parser.add_argument("--only", default="", metavar="TEXT", help="files whose path has this in it")
    parser.add_argument("--every", type=int, default=1, metavar="N", help="each Nth file")
    parser.add_argument("--samples", type=int, default=16, metavar="N", help="default 16")
    parser.add_argument("--reference-samples", type=int, default=64, metavar="N", help="each of two (default 64)")
    parser.add_argument("--size", type=size_of, default=(96, 96), metavar="WxH", help="at most (default 96x96)")
    parser.add_argument("--tolerance", type=float, default=0.02, metavar="E", help="relMSE that is off (default 0.02)")
    parser.add_argument("--limit", type=float, default=LIMIT, metavar="SECONDS", help=f"for a file (default {LIMIT:g})")
    parser.add_argument("--page", action="store_true", help="write docs/other_files.md")
    parser.add_argument("--one", type=Path, metavar="FILE.blend", help="one file in this process, as JSON")


def command(options: argparse.Namespace) -> int:
    if options.one:
        print(json.dumps(render(options.one, options)))
        return 0
    if options.every < 1:
        print("--every takes a number of at least 1.", file=sys.stderr)
        return 2
    rows = []
    for repository in (one for one in repositories() if options.repository in one["name"]):
        try:
            place = fetch(repository, options.folder.resolve())
        except (OSError, subprocess.CalledProcessError) as error:
            print(f"{repository['name']} could not be fetched: {error}", file=sys.stderr)
            return 1
        files = sorted(path for path in place.rglob("*.blend") if options.only in str(path.relative_to(place)))
        for path in files[:: options.every]:
            rows.append(row_of(repository, place, path, options))
            print(line_of(rows[-1]), flush=True)
            _keep(options.folder, rows)
    if not rows:
        print(f"No file of the repositories has '{options.only}' in its path.", file=sys.stderr)
        return 2
    if options.page:
        markdown.put_between(PAGE, COMMAND, page(rows, options))
        print(PAGE)
    return int(any(row.state.startswith((ENDED, "not finite")) for row in rows))


def _keep(folder: Path, rows: list[Row]) -> None:
    markdown.write_whole(folder / "rows.json", json.dumps([asdict(row) for row in rows], indent=1))
