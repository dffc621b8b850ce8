import bpy

candela = bpy.context.scene.candela

candela.samples = 512
candela.viewport_samples = 128
candela.accumulated_maps_texels_per_pixel = 4.0
