"""512 samples with the finest shadow maps and most virtual lights: final pictures without visible noise."""

import bpy

candela = bpy.context.scene.candela

candela.samples = 512
candela.viewport_samples = 128
candela.accumulated_maps_texels_per_pixel = 4.0
candela.instant_radiosity_virtual_lights = 768
candela.instant_radiosity_rays = 4
candela.light_probes_maps = 16.0
candela.multires_radiosity_virtual_lights = 2048
candela.multires_radiosity_rays = 128
candela.multires_radiosity_near_bounces = True
candela.clustered_visibility_virtual_lights = 2048
candela.clustered_visibility_near_bounces = True
candela.environment_light_texels_per_pixel = 2.0
candela.shadows_by_light_soft_maps = True
