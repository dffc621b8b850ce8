"""For many small lamps and glowing signs in the dark: each of 128 samples asks 48 lamps and 12 points of what glows."""

import bpy

candela = bpy.context.scene.candela

candela.samples = 128
candela.viewport_samples = 32
candela.direct_light_lights_per_sample = 48
candela.emissive_light_points = 12
candela.instant_radiosity_virtual_lights = 768
candela.light_probes_maps = 12.0
