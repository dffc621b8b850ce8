import bpy

candela = bpy.context.scene.candela

candela.samples = 64
candela.viewport_samples = 32
candela.accumulated_maps_texels_per_pixel = 2.0
candela.instant_radiosity_virtual_lights = 384
candela.instant_radiosity_rays = 8
