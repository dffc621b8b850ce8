"""Candela: real-time global illumination as a render engine of Blender."""


def register():
    """Called by Blender when the extension is enabled."""
    for part in _parts():
        part.register()


def unregister():
    """Called by Blender when the extension is disabled; frees everything on the GPU."""
    for part in reversed(_parts()):
        part.unregister()


def _parts() -> tuple:
    """The modules that register something, in order: classes come after those that they refer to."""
    from . import cli, engine
    from .ui import (
        compare_editor,
        eye_panel,
        grass,
        jobs,
        panels,
        pass_nodes,
        pass_operators,
        pass_run,
        pass_tree,
        preferences,
        properties,
        quality,
        reflection_operators,
        scoped_panels,
        translucency,
        tuning,
        viewport_pass,
    )

    return (
        pass_tree, pass_nodes, properties, engine, pass_run, jobs, quality, panels, scoped_panels, eye_panel,
        reflection_operators, grass, translucency, tuning, pass_operators, compare_editor, viewport_pass,
        preferences, cli,
    )  # fmt: skip
