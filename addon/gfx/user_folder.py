"""Folder for data that can be made again: the extension's own, or the user's cache folder; and files of JSON in it.

The folder may be one that the user names and keeps other things in, so that names of files there begin with `candela_`.
"""

from __future__ import annotations

import contextlib
import json
import os
import sys
from pathlib import Path

import bpy

from ..whole_files import replacing

MOST_BYTES = 1 << 20  # of a file of JSON


def user_folder(name: str) -> Path:
    """The folder `name`; below $CANDELA_CACHE if that is set, the extension's own one if Candela is one."""
    given = os.environ.get("CANDELA_CACHE")
    if given:
        return Path(given)
    parts = (__package__ or "").split(".")
    if parts[0] == "bl_ext":
        return Path(bpy.utils.extension_path_user(".".join(parts[:3]), path=name))
    return user_caches() / "candela" / name


def user_caches() -> Path:
    """The folder that the system has for caches of this user."""
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches"
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    given = Path(os.environ.get("XDG_CACHE_HOME", ""))
    return given if given.is_absolute() else Path.home() / ".cache"  # a relative one is to be ignored


def kept(path: Path) -> dict:
    """What a file of JSON holds by name; empty where there is none that can be read."""
    try:
        with path.open(encoding="utf-8") as file:
            found = json.loads(file.read(MOST_BYTES))
    except (OSError, ValueError, RecursionError):
        return {}
    return found if isinstance(found, dict) else {}


def keep(path: Path, content: dict) -> None:
    """Write such a file at once: whoever reads finds the old content or the new one. Where the folder cannot be written
    nothing is kept."""
    with contextlib.suppress(OSError), replacing(path) as file:
        file.write(json.dumps(content, indent=1).encode())
