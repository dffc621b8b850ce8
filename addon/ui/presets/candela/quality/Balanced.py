"""What a new scene has: 64 samples."""

import bpy

candela = bpy.context.scene.candela

candela.samples = 64
candela.viewport_samples = 32
candela.accumulated_maps_texels_per_pixel = 2.0
candela.instant_radiosity_virtual_lights = 512
candela.instant_radiosity_rays = 2
candela.light_probes_maps = 8.0
candela.multires_radiosity_virtual_lights = 1024
candela.multires_radiosity_rays = 64
candela.multires_radiosity_near_bounces = True
candela.clustered_visibility_virtual_lights = 1024
candela.clustered_visibility_near_bounces = True
candela.environment_light_texels_per_pixel = 1.0
candela.shadows_by_light_soft_maps = True
