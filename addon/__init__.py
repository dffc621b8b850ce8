"""Candela: real-time global illumination as a render engine of Blender."""


def register():
    """Called by Blender when the extension is enabled."""
    from . import cli, engine
    from .ui import compare_editor, jobs, panels, pass_operators, pass_run, pass_tree, properties, quality, tuning

    pass_tree.register()
    properties.register()
    engine.register()
    pass_run.register()
    jobs.register()
    quality.register()
    panels.register()
    tuning.register()
    pass_operators.register()
    compare_editor.register()
    cli.register()


def unregister():
    """Called by Blender when the extension is disabled; frees everything on the GPU."""
    from . import cli, engine
    from .ui import compare_editor, jobs, panels, pass_operators, pass_run, pass_tree, properties, quality, tuning

    cli.unregister()
    compare_editor.unregister()
    pass_operators.unregister()
    tuning.unregister()
    panels.unregister()
    quality.unregister()
    jobs.unregister()
    pass_run.unregister()
    engine.unregister()
    properties.unregister()
    pass_tree.unregister()
