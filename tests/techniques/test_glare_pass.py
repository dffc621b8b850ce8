"""The pass Glare: in a file as large as the picture, with its light, whatever the render border; no stars by noise."""

import numpy as np
import pytest

from addon.eye import optics
from addon.techniques.temporal_glare import LEAST_CONTRAST


@pytest.mark.slow
@pytest.mark.parametrize("border", [False, True])
def test_the_pass_has_the_size_and_the_light_of_the_picture(written, border):
    written.camera_above(2.0)
    lamp = written.material("ShaderNodeEmission", Strength=2000.0)
    written.rectangle((-0.02, -0.02), (0.02, 0.02), material=lamp)
    written.world((0.02, 0.02, 0.02))
    written.scene.camera.data.candela.glare_mode = "CONVOLUTION"
    options = (
        [(written.scene.render, "use_border", True), (written.scene.render, "border_min_x", 0.25)] if border else []
    )
    images = written.written("CANDELA", 2, size=(64, 48), extra=options, bounces=0)
    glare, picture = images["Glare"], images["Combined"]
    assert glare.shape == picture.shape == (48, 64, 4)
    assert glare[..., :3].max() < picture[..., :3].max()
    assert glare[..., :3].sum() == pytest.approx(picture[..., :3].sum(), rel=0.05)


@pytest.mark.slow
def test_fireflies_of_four_samples_are_no_stars(stage):
    """A glowing ball beside polished metal, a block of glass and a matt floor: where a picture of many samples has no
    light that dazzles near by, one of four has hardly any, and nothing of the contrast from which glare is seen."""
    stage.floor(material=stage.principled(Base_Color=(0.3, 0.3, 0.3, 1), Roughness=0.4))
    glow = stage.material("ShaderNodeEmission", Color=(1.0, 0.9, 0.7, 1), Strength=60.0)
    metal = stage.material("ShaderNodeBsdfGlossy", Roughness=0.2)
    glass = stage.material("ShaderNodeBsdfGlass", Roughness=0.0, IOR=1.5)
    ball(stage, 0.2, (-0.6, 0.5, 0.7), glow)
    ball(stage, 0.5, (0.7, 0.4, 0.5), metal)
    ball(stage, 0.4, (-0.5, -0.7, 0.4), glass)
    stage.world((0.02, 0.02, 0.02))
    stage.camera((0.0, -4.0, 2.4), (np.radians(62.0), 0.0, 0.0))
    truth = stage.render(96, (64, 48), seed=9, bounces=4)["combined"].astype(np.float64)
    beside = grown(optics.excess(truth, 1.0, 1e6).max(axis=-1)) == 0.0
    for seed in (1, 2):
        picture = stage.render(4, (64, 48), seed=seed, bounces=4)["combined"].astype(np.float64)
        dazzles = optics.excess(picture, 1.0, 1e6).max(axis=-1)
        assert dazzles[beside].sum() < 0.01 * dazzles.sum()
        assert dazzles[beside].max() < LEAST_CONTRAST  # of white


def grown(light):
    """(H, W) the brightest of 3x3 pixels."""
    padded = np.pad(light, 1)
    height, width = light.shape
    return np.max([padded[j : j + height, i : i + width] for j in range(3) for i in range(3)], axis=0)


def ball(stage, radius, place, material):
    turn, rise = np.linspace(0, 2 * np.pi, 25)[:-1], np.linspace(0.05, np.pi - 0.05, 13)
    corners = [(np.cos(t) * np.sin(h), np.sin(t) * np.sin(h), np.cos(h)) for h in rise for t in turn]
    faces = [
        (24 * k + j, 24 * (k + 1) + j, 24 * (k + 1) + (j + 1) % 24, 24 * k + (j + 1) % 24)
        for k in range(12)
        for j in range(24)
    ]
    stage.mesh(corners, faces, material=material, location=place, scale=(radius,) * 3).data.shade_smooth()
