"""Candela as Blender sees it: an extension is a package, and this one only hands over to `addon`."""


def register():
    from . import addon

    addon.register()


def unregister():
    from . import addon

    addon.unregister()
