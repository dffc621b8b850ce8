"""16 samples with coarser shadow maps and fewer virtual lights: pictures to talk about, long animations."""

import bpy

candela = bpy.context.scene.candela

candela.samples = 16
candela.viewport_samples = 8
candela.accumulated_maps_texels_per_pixel = 1.0
candela.instant_radiosity_virtual_lights = 128
candela.instant_radiosity_rays = 1
candela.light_probes_maps = 5.0
candela.multires_radiosity_virtual_lights = 128
candela.multires_radiosity_rays = 4
candela.multires_radiosity_near_bounces = False
candela.clustered_visibility_virtual_lights = 256
candela.clustered_visibility_near_bounces = False
candela.environment_light_texels_per_pixel = 1.0
candela.shadows_by_light_soft_maps = False
