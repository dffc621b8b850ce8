"""Shadow maps by light: which kind each light gets and why, and that kinds in one picture add up."""

import numpy as np
import pytest

from addon.techniques import shadows_by_light as by_light
from tests.techniques.test_shadows import HEIGHT, irradiance
from tests.techniques.test_vssm import EDGE, floor  # noqa: F401 - a fixture

NAME = "shadows_by_light"
SOFT = ("AREA", {"size": 1.0})
KINDS = {
    "a point": ("POINT", {"shadow_soft_size": 0.0}, by_light.PLAIN),
    "a sun of a hundredth of a degree": ("SUN", {"angle": 2e-4}, by_light.PLAIN),
    "a sphere at arm's length": ("POINT", {"shadow_soft_size": 0.8}, by_light.VARIANCE),
    "a square": (*SOFT, by_light.VARIANCE),
    "a hazy sun": ("SUN", {"angle": 0.1}, by_light.VARIANCE),
}  # fmt: skip


@pytest.fixture
def plate(floor):  # noqa: F811
    floor.scene.candela.slot_shadow = "AUTO"
    floor.blocker(*EDGE)
    return floor


def counters(stage, technique=NAME):
    return stage.ledger.row(technique).counters


@pytest.mark.parametrize("light", KINDS)
def test_a_light_gets_the_maps_that_its_penumbra_asks_for(plate, light):
    plate.scene.candela.slot_shadow = NAME
    kind, settings, expected = KINDS[light]
    plate.light(kind, (0, 0, HEIGHT), **settings)
    irradiance(plate, 1, (32, 32))
    assert counters(plate) == {expected: 1}


def test_of_many_lights_the_strongest_have_variance_maps(plate):
    plate.scene.candela.shadows_by_light_important = 2
    for k in range(5):
        plate.light(SOFT[0], (0.1 * k, 0, HEIGHT), energy=100.0 - k, **SOFT[1])
    irradiance(plate, 1, (32, 32))
    assert counters(plate) == {by_light.VARIANCE: 2, by_light.CONVOLUTION: 3}


def test_auto_takes_it_for_one_sample_of_soft_lights_alone(plate):
    lamp = plate.light(SOFT[0], (0, 0, HEIGHT), **SOFT[1])
    irradiance(plate, 1, (16, 16))
    assert plate.ledger.row(NAME).state == "ran"
    assert plate.ledger.row("accumulated_maps").reason == "the shadow slot is filled by Shadow maps by light"
    irradiance(plate, 2, (16, 16))
    assert plate.ledger.row(NAME).reason == "the shadow slot is filled by Accumulated shadow maps"
    lamp.hide_render = True
    plate.light("POINT", (0, 0, HEIGHT), shadow_soft_size=0.0)
    irradiance(plate, 1, (16, 16))
    assert plate.ledger.row(NAME).state == "skipped"


def test_lights_of_all_kinds_add_up_to_what_each_brings_alone(plate):
    plate.scene.candela.shadows_by_light_important = 1
    plate.scene.candela.slot_shadow = NAME
    for kind in ("vssm", "cssm"):  # as fine as maps by light are at least
        setattr(plate.scene.candela, f"{kind}_texels_per_pixel", 16.0)
        setattr(plate.scene.candela, f"{kind}_contacts", False)
    lamps = [
        plate.light("POINT", (0.3, 0, HEIGHT), shadow_soft_size=0.0),
        plate.light("AREA", (0, 0, HEIGHT), size=1.0, energy=200.0),
        plate.light("AREA", (-0.5, 0, HEIGHT), size=0.7),
    ]
    together = irradiance(plate, 1, (32, 32))
    alone = np.zeros_like(together)
    for lamp, technique in zip(lamps, ("accumulated_maps", "vssm", "cssm")):
        plate.scene.candela.slot_shadow = technique
        plate.scene.candela.cssm_cells = 2
        for other in lamps:
            other.hide_render = other is not lamp
        alone += irradiance(plate, 1, (32, 32))
    assert together == pytest.approx(alone, rel=1e-5, abs=1e-6)
