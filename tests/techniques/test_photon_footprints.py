"""The footprint of a photon by itself: how wide it is, where nothing but the lamp's own disc spreads it."""

import numpy as np
import pytest

from addon.gfx import images, passes
from addon.gfx.struct import Block
from addon.lighting.photons import FOOTPRINTS, FOUND
from addon.scene.view import VIEW, View
from addon.snapshot.scene import Camera, Film


def test_a_footprint_has_the_variance_of_the_disc_that_it_stands_for(gpu_context):
    """The biweight kernel of radius h has the variance h^2 / 8 along an axis, an even disc of radius r r^2 / 4."""
    disc = 0.3
    view = View(
        Camera(np.eye(4), "PERSPECTIVE", (-0.5, 0.5, -0.5, 0.5), 0.1, 100.0), Film(8, 8, (0, 0, 8, 8)), np.zeros(3)
    )
    photon = {name: np.zeros((1, 1, 4), np.float32) for name in FOUND}
    points, normals, fluxes = FOUND
    photon[points][:] = 0.0, 0.0, -2.0, 1.0
    photon[normals][:] = 0.0, 0.0, 1.0, disc
    photon[fluxes][:] = 1.0, 1.0, 1.0, 0.0
    target = images.Target(tuple(images.create(1, 1, "RGBA32F") for _ in range(4)))
    passes.fullscreen(
        FOOTPRINTS, target, textures={name: images.upload(pixels) for name, pixels in photon.items()},
        blocks={"film_view": Block(VIEW, **view.values(0, 0, (0.0, 0.0), 10.0))},
        constants={"widening": 1.0, "least_pixels": 0.0, "longest": 12.0},
    )  # fmt: skip
    first, second = (images.read(target.colors[k])[0, 0, :3] for k in (1, 2))
    radii = np.linalg.norm([first, second], axis=1)
    assert radii**2 / 8 == pytest.approx(disc**2 / 4, rel=1e-4)
