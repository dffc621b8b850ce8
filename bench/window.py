"""What a viewport in a real window costs before anything is compiled: `python -m bench window --only cornell_box`.

Each scene is opened in a Blender with a window ($REAL_BLENDER, as for `make test-window`), with empty caches of driver
and Blender, and with the newest zip of build/ as the extension. Rendered is chosen; when the picture rests, a lamp, a
material of glass, and a border are added, one after the other. Of each: seconds until the view shows anything, until it
shows the scene's light (at first its direct light alone), all of it, and until it rests, and the longest time in which
Blender did not answer: seconds of the clock, and, in brackets, of all threads of the window's process, which say more
where other work shares the processors. `--after`: seconds between the choice of this engine, when the second process
begins to compile, and that of Rendered. With `--motion` instead: steps in a second and pixels, while a view turns and
while an animation is played, beside EEVEE in the same window.
"""

from __future__ import annotations

import argparse
import json
import os
import shlex
import subprocess
import tempfile
from pathlib import Path

from bench import markdown
from bench.beside import ROOT, scenes_of

SCENES = ("cornell_box", "window_interior", "hdri_product", "soft_shadow_garden")
STEPS = ("rendered", "lamp", "material", "border")
HEAD = (
    "scene",
    "backend",
    "step",
    "first picture, s",
    "its light, s",
    "with indirect light, s",
    "at rest, s",
    "longest block, s",
    "its draw, s",
    "dearest block, s of processor",
    "at",
    "its programs",
)
COLD, MOTION = (ROOT / "tests" / "window" / f"{name}.py" for name in ("cold", "motion"))
MOVING = ("scene", "backend", "engine", "turning, steps/s", "pixels", "playing, frames/s", "pixels")
TIMEOUT_S = 1500


def blender(environment: dict[str, str], log: Path, *arguments: object) -> None:
    """Run the real Blender; RuntimeError with the end of what it printed if it fails."""
    command = [*shlex.split(os.environ.get("REAL_BLENDER") or "blender"), *map(str, arguments)]
    with log.open("w") as file:
        done = subprocess.run(
            command, check=False, cwd=ROOT, env={**os.environ, **environment}, stdin=subprocess.DEVNULL, stdout=file,
            stderr=subprocess.STDOUT, timeout=TIMEOUT_S,
        )  # fmt: skip
    if done.returncode:
        raise RuntimeError(f"Blender ended with {done.returncode}: {log.read_text(errors='replace')[-2000:]}")


def measured(scene: Path, backend: str, steps: list[str], package: Path, folder: Path, script: Path = COLD) -> dict:
    """What the script noted, by step."""
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder) as caches:
        empty = {
            "MESA_SHADER_CACHE_DIR": f"{caches}/driver", "XDG_CACHE_HOME": f"{caches}/user",
            "BLENDER_USER_RESOURCES": f"{caches}/blender",
        }  # fmt: skip
        for path in empty.values():
            Path(path).mkdir()
        install = ("--command", "extension", "install-file", "--repo", "user_default", "--enable", package)
        blender(empty, folder / "install.log", *install)
        shown = ("--gpu-backend", backend, "--window-geometry", "0", "0", "1280", "800", scene)
        blender(empty, folder / "blender.log", *shown, "--python", script, "--", *steps, folder)
        if not any(Path(empty["BLENDER_USER_RESOURCES"]).iterdir()):
            raise RuntimeError(
                "The caches were not empty: $REAL_BLENDER starts a Blender that sees nothing of the environment. "
                f"Let that command pass on {', '.join(empty)}."
            )
    return json.loads((folder / "result.json").read_text())


def rows_of(scene: str, backend: str, found: dict) -> list[tuple[str, ...]]:
    def told(one: dict, what: str) -> str:
        if one.get(f"{what}_s") is None:
            return "-"
        worked = f" ({one[f'{what}_work_s']:.1f})" if f"{what}_work_s" in one else ""
        return f"{one[f'{what}_s']:.1f}{worked}"

    return [
        (
            scene, backend, step, told(one, "first") if step == "rendered" else "", told(one, "lit"),
            told(one, "whole"), told(one, "rest"), f"{one['longest_s']:.2f}", f"{one['longest_draw_s']:.2f}",
            f"{one.get('dearest_s', 0.0):.2f}", one["longest_at"], ", ".join(one.get("longest_programs", ())),
        )
        for step, one in found.items()
        if step in STEPS
    ]  # fmt: skip


def rows_of_motion(scene: str, backend: str, found: dict) -> list[tuple[str, ...]]:
    def pixels(one: dict) -> str:
        return ", ".join("1" if scale == 1 else f"1/{scale}" for scale in one["scales"])

    return [
        (
            scene, backend, engine, f"{one['orbit']['steps_per_s']:.1f}", pixels(one["orbit"]),
            f"{one['playback']['frames_per_s']:.1f}", pixels(one["playback"]),
        )
        for engine, one in found.items()
        if engine in ("candela", "eevee") and "orbit" in one
    ]  # fmt: skip


# ------------------------------------------------------------------------------------------------------------- command


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--only", nargs="+", default=SCENES, metavar="NAME", help="scenes, as of `bench beside`")
    parser.add_argument("--backend", nargs="+", default=["opengl"], choices=("opengl", "vulkan"))
    parser.add_argument("--steps", nargs="+", default=list(STEPS), choices=STEPS)
    parser.add_argument("--until-light", action="store_true", help="do not wait until the picture rests")
    parser.add_argument("--after", type=float, default=1.0, metavar="SECONDS", help="from engine to Rendered (1)")
    parser.add_argument("--motion", action="store_true", help="a turning view and playback, beside EEVEE, instead")
    parser.add_argument("--package", type=Path, help="the extension's zip; by default the newest of build/")
    parser.add_argument("--output", type=Path, default=ROOT / "build" / "cold", help="for logs and pictures")


def command(options: argparse.Namespace) -> int:
    import addon
    from addon.cli.terminal import quiet

    addon.register()
    package = options.package or max(ROOT.glob("build/candela-*.zip"), key=lambda path: path.stat().st_mtime)
    rows, until = [], [f"after={options.after}", *(["until_light"] if options.until_light else [])]
    with quiet() as terminal:
        for backend in options.backend:
            for scene in scenes_of(list(options.only)):
                folder = options.output / f"{scene.stem}-{backend}"
                steps, script = ([], MOTION) if options.motion else ([*options.steps, *until], COLD)
                found = measured(scene, backend, steps, package, folder, script)
                if "error" in found:
                    print(scene.stem, backend, found["error"], file=terminal, flush=True)
                for row in (rows_of_motion if options.motion else rows_of)(scene.stem, backend, found):
                    rows.append(row)
                    print(*row, sep=" | ", file=terminal, flush=True)
    print(markdown.table([MOVING if options.motion else HEAD, *rows]))
    return 0
