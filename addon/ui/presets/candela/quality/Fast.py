import bpy

candela = bpy.context.scene.candela

candela.samples = 16
candela.viewport_samples = 8
candela.accumulated_maps_texels_per_pixel = 1.0
