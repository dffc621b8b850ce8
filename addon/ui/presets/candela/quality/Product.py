"""For glass, metal and lacquer on a table: more surfaces behind each other, finer caustics, 128 samples."""

import bpy

candela = bpy.context.scene.candela

candela.samples = 128
candela.viewport_samples = 48
candela.emissive_light_points = 8
candela.environment_light_texels_per_pixel = 2.0
candela.traced_refraction_interfaces = 16
candela.shaded_reflections_bounces = 12
candela.screen_space_photons_grid = 256
candela.screen_space_photons_interfaces = 16
candela.caustics_mapping_grid = 256
