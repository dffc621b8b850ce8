import bpy

candela = bpy.context.scene.candela

candela.samples = 512
candela.viewport_samples = 128
candela.accumulated_maps_texels_per_pixel = 4.0
candela.instant_radiosity_virtual_lights = 512
candela.instant_radiosity_rays = 16
