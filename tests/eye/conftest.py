"""The module `gpu` is part of Blender: Python finds it once bpy was imported."""

import bpy  # noqa: F401
