"""Build the extension's zip with Blender's own builder, and validate it.

    python tools/package.py [--output FOLDER]

Runs `blender --command extension` of the Blender that the environment variable REAL_BLENDER names, or of one on PATH;
where there is none, the same command-line program as it stands inside the bpy wheel. The zip is written into FOLDER
(build/ unless told otherwise) and its path printed last.
"""

import argparse
import importlib.util
import os
import re
import shlex
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def main() -> int:
    parser = argparse.ArgumentParser(description="Build and validate the extension's zip.")
    parser.add_argument("--output", type=Path, default=ROOT / "build", help="folder for the zip (default: build)")
    path = build(parser.parse_args().output)
    print(path)
    return 0


def build(folder: Path) -> Path:
    """Build the zip into `folder` and return its path; SystemExit with a sentence when Blender refuses it."""
    manifest = tomllib.loads((ROOT / "blender_manifest.toml").read_text(encoding="utf-8"))
    path = folder.resolve() / f"{manifest['id']}-{manifest['version']}.zip"
    folder.mkdir(parents=True, exist_ok=True)
    command, tags = extension_command()
    run([*command, "build", "--source-dir", str(ROOT), "--output-filepath", str(path), *tags])
    run([*command, "validate", *tags, str(path)])
    return path


def extension_command() -> tuple[list[str], list[str]]:
    """The start of the command line of Blender's extension tool, and the option that tells it the platform's tags."""
    for blender in (os.environ.get("REAL_BLENDER"), shutil.which("blender")):
        if blender and has_extensions(shlex.split(blender)):
            return [*shlex.split(blender), "--command", "extension"], []
    specification = importlib.util.find_spec("bpy")
    if specification is None or not specification.submodule_search_locations:
        raise SystemExit("There is neither a Blender (REAL_BLENDER, or blender on PATH) nor the bpy package.")
    wheel = Path(specification.submodule_search_locations[0])
    (program,) = wheel.glob("*/scripts/addons_core/bl_pkg/cli/blender_ext.py")
    (tags,) = wheel.glob("*/scripts/modules/_bpy_internal/extensions/tags.py")
    return [sys.executable, str(program)], ["--valid-tags", str(tags)]


def has_extensions(command: list[str]) -> bool:
    """Whether this Blender runs and is no older than 4.5, the first that Candela supports."""
    try:
        done = subprocess.run(
            [*command, "--version"], check=False, stdin=subprocess.DEVNULL, capture_output=True, text=True
        )
    except OSError:
        return False
    version = re.search(r"Blender (\d+)\.(\d+)", done.stdout)
    return bool(version) and (int(version[1]), int(version[2])) >= (4, 5)


def run(command: list[str]) -> None:
    done = subprocess.run(
        command, check=False, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    if done.returncode != 0:
        raise SystemExit(f"{done.stdout.strip()}\nBlender refused the extension; its own words stand above.")


if __name__ == "__main__":
    sys.exit(main())
