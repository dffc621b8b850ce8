"""Convolution soft shadow maps: the series, penumbrae of one map against clipped areas, no leaks, samples."""

import numpy as np
import pytest

from addon.kernels import convolution
from tests.techniques.test_shadows import EVERYWHERE, HEIGHT, LIGHTS, irradiance, receivers
from tests.techniques.test_vssm import EDGE, expected_visibility, floor, rms, visibility  # noqa: F401 - a fixture

# RMS of the visibility over a 4 m wide strip; see test_vssm.py for what one map cannot show. The series adds its own.
PENUMBRA_RMS = {"square": 0.02, "disc": 0.025, "sphere": 0.02, "sun": 0.0125}


@pytest.fixture
def strip(floor):  # noqa: F811
    floor.scene.candela.slot_shadow = "cssm"
    return floor


@pytest.mark.parametrize(("order", "scale", "offset"), [(4, 1.1214, 0.0642), (8, 1.1109, 0.0326), (16, 1.1084, 0.0164)])
def test_the_series_is_exact_from_its_offset_on(order, scale, offset):
    assert convolution.series(order) == pytest.approx((scale, offset), abs=2e-4)
    c = (2 * np.arange(order) + 1) * np.pi
    beyond = np.linspace(offset + 1e-4, 0.93, 500)
    lit = 0.5 + 2 * (np.sin(np.outer(beyond, c)) / c).sum(axis=1)
    assert (0.5 + scale * (lit - 0.5) > 0.9995).all()


@pytest.mark.slow
@pytest.mark.parametrize("name", list(PENUMBRA_RMS))
@pytest.mark.parametrize("prefilter", ["PYRAMID", "TABLE"])
def test_one_map_shows_the_penumbra_of_an_edge(strip, name, prefilter):
    kind, settings, source = LIGHTS[name]
    strip.scene.candela.cssm_prefilter = prefilter
    strip.light(kind, (0, 0, HEIGHT), **settings)
    strip.blocker(*EDGE)
    expected = expected_visibility(source, [EDGE])
    found = visibility(strip, source)
    assert rms(found, expected) < PENUMBRA_RMS[name]
    assert found[expected == 0].max() < 0.02


@pytest.mark.slow
@pytest.mark.parametrize("name", ["square", "sphere"])
def test_blockers_at_two_heights_that_close_the_light_together_leak_nothing(strip, name):
    kind, settings, source = LIGHTS[name]
    strip.light(kind, (0, 0, HEIGHT), **settings)
    plates = [((-EVERYWHERE, -EVERYWHERE), (0.0, EVERYWHERE), 1.2), ((0.0, -EVERYWHERE), (EVERYWHERE, EVERYWHERE), 0.6)]
    for plate in plates:
        strip.blocker(*plate)
    closed = expected_visibility(source, plates) == 0
    assert visibility(strip, source)[closed].max() <= 0.02


def test_without_blockers_nothing_is_darkened(strip):
    kind, settings, source = LIGHTS["square"]
    strip.light(kind, (0, 0, HEIGHT), **settings)
    strip.blocker((30, 30), (31, 31), 0.5)
    assert visibility(strip, source) == pytest.approx(1.0, abs=2e-4)


def test_a_closed_roof_lets_no_light_pass_whatever_its_distance(strip):
    kind, settings, _ = LIGHTS["square"]
    strip.light(kind, (0, 0, HEIGHT), **settings)
    for z in (0.01, 0.5, 1.4):
        roof = strip.blocker((-EVERYWHERE, -EVERYWHERE), (EVERYWHERE, EVERYWHERE), z)
        assert not irradiance(strip, 1, (24, 24)).any()
        strip.remove(roof)


@pytest.mark.slow
def test_the_error_falls_with_the_order(strip):
    """A plate close to the floor, while a bar close to the light stretches the range of depths."""
    kind, settings, source = LIGHTS["square"]
    strip.scene.candela.cssm_texels_per_pixel = 4.0
    strip.scene.candela.cssm_prefilter = "TABLE"
    strip.scene.candela.cssm_contacts = False  # rays would see most of the plate
    strip.light(kind, (0, 0, HEIGHT), **settings)
    blockers = [((-EVERYWHERE, -EVERYWHERE), (0.0, EVERYWHERE), 0.2), ((0.9, -0.1), (0.95, 0.1), 1.5)]
    for blocker in blockers:
        strip.blocker(*blocker)
    expected = expected_visibility(source, blockers)
    near = abs(receivers((64, 4))[:, 0]) < 0.4
    errors = []
    for order in ("4", "16"):
        strip.scene.candela.cssm_order = order
        errors.append(rms(visibility(strip, source)[near], expected[near]))
    assert errors[1] < 0.9 * errors[0]


@pytest.mark.slow
def test_the_error_falls_with_the_samples(strip):
    kind, settings, source = LIGHTS["disc"]
    strip.light(kind, (0, 0, HEIGHT), **settings)
    strip.blocker(*EDGE)
    expected = expected_visibility(source, [EDGE])
    one, many = (
        np.mean([rms(visibility(strip, source, samples, seed=k), expected) for k in range(8)]) for samples in (1, 16)
    )
    assert many < 0.6 * one
