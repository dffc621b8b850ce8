"""Write the sample scenes beside this script: `python sample_blends/make.py [--out FOLDER] [NAME …]`.

Each scene is made from nothing but numbers in `scenes/`; textures are generated and packed, so every file stands
alone. The same Blender version writes the same scene each time.

The committed files come from Blender 4.5, because a newer Blender opens them but not the other way round. Run under
the 4.5 wheel to renew them; a newer Blender asks for `--out`, so that nobody replaces them by accident.
"""

from __future__ import annotations

import argparse
import os
import sys
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from scenes import SCENES
from scenes.construct import begin, finish

import addon

HERE = Path(__file__).resolve().parent
OLDEST_READER = (4, 5)  # files must open in this Blender


def make(name: str, folder: Path) -> Path:
    """Build the scene `name` in an empty Blender and save it, compressed, into `folder`."""
    title, build = SCENES[name]
    begin(title)
    build()
    finish()
    bpy.context.scene.render.engine = "CANDELA"  # whoever opens the file wants to see it rendered by Candela
    path = folder / f"{name}.blend"
    bpy.context.preferences.filepaths.save_version = 0  # no .blend1 beside it
    bpy.context.preferences.filepaths.file_preview_type = "NONE"
    bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=True, relative_remap=False)
    return path


def main() -> int:
    parser = argparse.ArgumentParser(description="Write Candela's sample scenes.")
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"one or more of: {', '.join(SCENES)} (default: all)")
    parser.add_argument("--out", type=Path, metavar="FOLDER", help="where to write (default: beside this script)")
    arguments = parser.parse_args()
    for name in arguments.names:
        if name not in SCENES:
            parser.error(f"there is no scene '{name}'; there are {', '.join(SCENES)}")
    if arguments.out is None and bpy.app.version[:2] != OLDEST_READER:
        parser.error(
            f"Blender {bpy.app.version_string} would write files that 4.5 cannot open: "
            "run under 4.5 (`make samples BLENDER=4.5`) or give another folder by --out"
        )

    addon.register()  # Blender keeps the name of an engine only while it knows it
    folder = arguments.out or HERE
    folder.mkdir(parents=True, exist_ok=True)
    for name in arguments.names or SCENES:
        path = make(name, folder)
        print(f"{path}  {path.stat().st_size / 1024:.0f} KiB")
    return 0


if __name__ == "__main__":
    code = main()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)  # Blender 4.5 as a module waits forever in its exit handlers once an extension was loaded
