"""Tiles are rendered by Blender's Cycles."""

import bpy  # noqa: F401
