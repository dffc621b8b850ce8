"""Candela: real-time global illumination as a render engine of Blender."""


def register():
    """Called by Blender when the extension is enabled."""
    from . import cli, engine
    from .ui import panels, properties

    properties.register()
    engine.register()
    panels.register()
    cli.register()


def unregister():
    """Called by Blender when the extension is disabled; frees everything on the GPU."""
    from . import cli, engine
    from .ui import panels, properties

    cli.unregister()
    panels.unregister()
    engine.unregister()
    properties.unregister()
