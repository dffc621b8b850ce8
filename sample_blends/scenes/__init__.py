"""The sample scenes: file name -> (title, builder). Each module says what its scene is there to test."""

from . import alpha_foliage, cornell_box, hdri_product, instances, soft_shadow_garden, window_interior

SCENES = {
    "cornell_box": ("Cornell Box", cornell_box.build),
    "soft_shadow_garden": ("Soft Shadow Garden", soft_shadow_garden.build),
    "hdri_product": ("HDRI Product", hdri_product.build),
    "instances": ("Instances", instances.build),
    "window_interior": ("Window Interior", window_interior.build),
    "alpha_foliage": ("Alpha Foliage", alpha_foliage.build),
}
