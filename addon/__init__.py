"""Candela: real-time global illumination as a render engine of Blender."""


def register():
    """Called by Blender when the extension is enabled."""
    import bpy

    from . import cli, engine
    from .ui import properties

    properties.register()
    bpy.utils.register_class(engine.CandelaEngine)
    cli.register()


def unregister():
    """Called by Blender when the extension is disabled; frees everything on the GPU."""
    import bpy

    from . import cli, engine
    from .ui import properties

    cli.unregister()
    bpy.utils.unregister_class(engine.CandelaEngine)
    engine.free_sessions()
    properties.unregister()
