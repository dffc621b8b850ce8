"""One sample with the lowest settings: to find light and composition."""

import bpy

candela = bpy.context.scene.candela

candela.samples = 1
candela.viewport_samples = 4
candela.accumulated_maps_texels_per_pixel = 1.0
candela.instant_radiosity_virtual_lights = 64
candela.instant_radiosity_rays = 1
candela.light_probes_maps = 3.0
candela.multires_radiosity_virtual_lights = 64
candela.multires_radiosity_rays = 2
candela.multires_radiosity_near_bounces = False
candela.clustered_visibility_virtual_lights = 128
candela.clustered_visibility_near_bounces = False
candela.environment_light_texels_per_pixel = 1.0
candela.shadows_by_light_soft_maps = False
