"""Candela: real-time global illumination as a render engine of Blender."""


def register():
    """Called by Blender when the extension is enabled."""
    from . import cli, engine
    from .ui import compare_editor, panels, pass_operators, pass_run, pass_tree, properties, quality

    pass_tree.register()
    properties.register()
    engine.register()
    pass_run.register()
    quality.register()
    panels.register()
    pass_operators.register()
    compare_editor.register()
    cli.register()


def unregister():
    """Called by Blender when the extension is disabled; frees everything on the GPU."""
    from . import cli, engine
    from .ui import compare_editor, panels, pass_operators, pass_run, pass_tree, properties, quality

    cli.unregister()
    compare_editor.unregister()
    pass_operators.unregister()
    panels.unregister()
    quality.unregister()
    pass_run.unregister()
    engine.unregister()
    properties.unregister()
    pass_tree.unregister()
