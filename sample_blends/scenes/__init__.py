"""The sample scenes: file name -> (title, builder). Each module says what its scene is there to test."""

from . import (
    alpha_foliage,
    caustics,
    colonnade_hall,
    cornell_box,
    door_ajar,
    emissive_lamp,
    hdri_product,
    instances,
    meadow,
    sky_courtyard,
    soft_shadow_garden,
    window_interior,
)

SCENES = {
    "cornell_box": ("Cornell Box", cornell_box.build),
    "soft_shadow_garden": ("Soft Shadow Garden", soft_shadow_garden.build),
    "hdri_product": ("HDRI Product", hdri_product.build),
    "instances": ("Instances", instances.build),
    "window_interior": ("Window Interior", window_interior.build),
    "colonnade_hall": ("Colonnade Hall", colonnade_hall.build),
    "door_ajar": ("Door Ajar", door_ajar.build),
    "sky_courtyard": ("Sky Courtyard", sky_courtyard.build),
    "emissive_lamp": ("Emissive Lamp", emissive_lamp.build),
    "caustics_table": ("Caustics Table", caustics.build_table),
    "caustics_pool": ("Caustics Pool", caustics.build_pool),
    "caustics_rings": ("Caustics Rings", caustics.build_rings),
    "alpha_foliage": ("Alpha Foliage", alpha_foliage.build),
    "meadow": ("Meadow", meadow.build),
}
