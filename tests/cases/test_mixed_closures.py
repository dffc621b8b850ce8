"""Two closures on one even surface: of eight samples, little more noise than of one closure."""

import numpy as np
import pytest

from addon.compare.reference import render_passes
from bench.cases import CLEAR, DIFFUSE, EMISSION, GLOSSY, OTHER_GLOSSY, mixed

SIZE = 24


@pytest.fixture
def noise(stage):
    """A function: standard deviation of a plane's pixels over their mean from Cycles' of many samples, own and Cycles'
    of eight."""

    def measure(*closures, behind=0.0):
        stage.clear()
        stage.scene.render.filter_size = 1.5
        stage.camera_above(span=0.5)
        stage.world((1, 1, 1), 0.2)
        stage.light("AREA", (0.0, 0.0, 4.0), size=1.0)
        stage.floor(material=mixed(stage, closures))
        if behind:
            stage.floor(z=-0.5, material=stage.material("ShaderNodeEmission", Strength=behind))
        own, cycles, even = (
            render_passes(stage.scene, engine, samples, 1, size=(SIZE, SIZE), bounces=0).images["combined"][..., 1]
            for engine, samples in (("CANDELA", 8), ("CYCLES", 8), ("CYCLES", 512))
        )
        assert np.isclose(own.mean(), even.mean(), rtol=0.02)
        return [(one / one.mean() - even / even.mean()).std() for one in (own, cycles)]

    return measure


def test_emission_seen_through_half_of_another_is_even(noise):
    own, _ = noise(CLEAR, EMISSION, behind=0.5)
    assert own < 1e-3


def test_half_of_a_diffuse_layer_is_no_noisier_than_in_cycles(noise):
    own, cycles = noise(CLEAR, DIFFUSE, behind=0.5)
    assert own <= 1.1 * cycles


def test_two_lobes_are_hardly_noisier_than_the_sharper_one(noise):
    """Each has the light of half of the samples."""
    one, _ = noise(GLOSSY)
    two, _ = noise(GLOSSY, OTHER_GLOSSY)
    assert two <= 1.5 * one
