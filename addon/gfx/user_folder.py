"""Folder for data that can be made again: the extension's own, or the user's cache folder."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import bpy


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
