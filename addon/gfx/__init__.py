"""The one wall around Blender's gpu module: context, shaders, images, passes, readback, timing.

Nothing else in Candela imports `gpu`. What drivers and Blender versions do differently is met in here.
"""
