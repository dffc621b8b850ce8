"""Shadow maps by light: which kind each light gets and why, and that kinds in one picture add up."""

from dataclasses import replace

import numpy as np
import pytest

from addon.gfx import device
from addon.lighting import edge_costs, shadow_costs
from addon.lighting.light_rates import LightRates
from addon.lighting.maps_or_rays import Compared
from addon.sources.rates import Rate
from addon.techniques import shadows_by_light as by_light
from tests.techniques.test_depth_complexity import in_two_colours
from tests.techniques.test_shadows import HEIGHT, irradiance
from tests.techniques.test_vssm import EDGE, floor  # noqa: F401 - a fixture

NAME = "shadows_by_light"
SOFT = ("AREA", {"size": 1.0})
KINDS = {
    "a point": ("POINT", {"shadow_soft_size": 0.0}, by_light.PLAIN),
    "a sun of a hundredth of a degree": ("SUN", {"angle": 2e-4}, by_light.PLAIN),
    "a sphere at arm's length": ("POINT", {"shadow_soft_size": 0.8}, by_light.PLAIN),
    "a small sphere": ("POINT", {"shadow_soft_size": 0.3}, by_light.VARIANCE),
    "a spot whose size blurs its cone": ("SPOT", {"shadow_soft_size": 0.2, "spot_blend": 0.1}, by_light.PLAIN),
    "a wide blend": ("SPOT", {"shadow_soft_size": 0.1, "spot_size": 1.2, "spot_blend": 1.0}, by_light.VARIANCE),
    "a square": (*SOFT, by_light.VARIANCE),
    "a hazy sun": ("SUN", {"angle": 0.1}, by_light.VARIANCE),
}  # fmt: skip


@pytest.fixture
def plate(floor):  # noqa: F811
    floor.scene.candela.slot_shadow = "AUTO"
    floor.scene.candela.shadows_by_light_few_edges = False
    floor.scene.candela.shadows_by_light_few_points = False
    floor.blocker(*EDGE)
    return floor


LARGE = replace(device.MADE_UP["software"], render_pass=1e3)  # small pictures cost what large ones do, by pixel


@pytest.fixture
def few_edges(plate):
    plate.scene.candela.shadows_by_light_few_edges = True
    device.use(LARGE)
    yield plate
    device.use(None)


def counters(stage, technique=NAME):
    return stage.ledger.row(technique).counters


@pytest.mark.parametrize("light", KINDS)
def test_a_light_gets_the_maps_that_its_penumbra_asks_for(plate, light):
    plate.scene.candela.slot_shadow = NAME
    kind, settings, expected = KINDS[light]
    plate.light(kind, (0, 0, HEIGHT), **settings)
    irradiance(plate, 1, (32, 32))
    assert counters(plate) == {expected: 1}


@pytest.mark.slow
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


@pytest.mark.slow
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


def test_few_edges_are_taken_where_they_cost_less_on_this_device(few_edges):
    """Of two devices that differ in what an edge costs; the ledger says why, and the picture is that of the choice."""
    lamp = few_edges.light(SOFT[0], (0, 0, HEIGHT), **SOFT[1])
    said, found = {}, {}
    for name, edge in (("cheap", 1.0), ("dear", 1e4)):
        device.use(replace(LARGE, edge=edge))
        found[name] = irradiance(few_edges, 1, (32, 32), seed=len(said))
        (said[name],) = few_edges.ledger.row(NAME).choices
        kind = by_light.EDGES if name == "cheap" else by_light.VARIANCE
        assert counters(few_edges) == {"edges": 8, kind: 1}
    assert said["cheap"].startswith(f"{lamp.name}: edges, because ") and said["cheap"].endswith(" same error here")
    assert said["dear"].startswith(f"{lamp.name}: soft maps, because edges would take ")
    few_edges.scene.candela.shadows_by_light_few_edges = False
    assert np.array_equal(irradiance(few_edges, 1, (32, 32), seed=1), found["dear"])
    few_edges.scene.candela.slot_shadow = "depth_complexity"
    assert np.array_equal(irradiance(few_edges, 1, (32, 32), seed=0), found["cheap"])


def test_edges_err_less_at_one_sample(few_edges):
    few_edges.light(SOFT[0], (0, 0, HEIGHT), **SOFT[1])
    for height in (1.2, 2.0):
        few_edges.blocker((0.1, -0.2), (0.5, 0.1), height).visible_camera = False
    few_edges.camera_above(3.0)
    by_edges = irradiance(few_edges, 1, (32, 32))
    few_edges.scene.candela.shadows_by_light_few_edges = False
    by_maps = irradiance(few_edges, 1, (32, 32))
    few_edges.scene.candela.accumulated_maps_by = "RAYS"
    few_edges.scene.candela.slot_shadow = "accumulated_maps"
    expected = irradiance(few_edges, 256, (32, 32))
    beside = slice(18, None)  # of the plate, whose outline is the film's
    errors = [float(np.sqrt(((one - expected)[:, beside] ** 2).mean())) for one in (by_edges, by_maps)]
    assert errors[0] < 0.5 * errors[1]


@pytest.mark.parametrize("why", ("triangles", "cards", "texture"))
def test_edges_that_would_be_many_or_say_too_little_are_left(few_edges, why, monkeypatch):
    lamp = few_edges.light(SOFT[0], (0, 0, HEIGHT), **SOFT[1])
    if why == "triangles":
        monkeypatch.setattr(edge_costs, "MOST_TRIANGLES", 3)
    elif why == "cards":
        for k in range(160):
            card = few_edges.blocker((-0.4, 0.004 * k), (0.4, 0.004 * k + 0.01), 1.5)
            card.data.materials.clear()
            card.data.materials.append(few_edges.see_through(0.5))
    else:
        in_two_colours(lamp.data)
    irradiance(few_edges, 1, (32, 32))
    assert by_light.EDGES not in counters(few_edges)


def test_points_are_taken_where_soft_maps_are_not_worth_their_time(plate):
    """The picture is that of points in the slot, and the ledger says what was weighed."""
    plate.scene.candela.shadows_by_light_few_points = True
    plate.scene.candela.light_probes_maps = 8.0
    lamp = plate.light(SOFT[0], (0, 0, HEIGHT), size=0.05)
    found = irradiance(plate, 1, (32, 32))
    assert counters(plate) == {by_light.PLAIN: 1}
    (said,) = plate.ledger.row(NAME).choices
    assert (
        said.startswith(f"{lamp.name}: points, because error and time of the picture are ") and "of soft maps" in said
    )
    plate.scene.candela.slot_shadow = "accumulated_maps"
    assert np.array_equal(irradiance(plate, 1, (32, 32)), found)
    plate.scene.candela.slot_shadow = "AUTO"
    veil = plate.blocker((-0.4, -0.4), (0.4, 0.4), 1.5)  # whose points are noisier than probes tell
    veil.data.materials.clear()
    veil.data.materials.append(plate.see_through(0.5))
    irradiance(plate, 1, (32, 32))
    assert by_light.PLAIN not in counters(plate)


@pytest.mark.parametrize(("side", "variance", "best"), [(64, 0.02, "points"), (64, 4.0, "maps"), (1024, 0.02, "maps")])
def test_error_times_time_decides(side, variance, best):
    """Little variance is not worth a map, much is; what a small picture's outlines hide, a large one shows."""
    device.use(device.MADE_UP["software"])
    rates = LightRates(variance={"lamp": variance}, of_points={"lamp": Rate(0)})
    weighed = shadow_costs.Weighed((side, side), rates)
    each = Compared(rays=1e3 * side, maps=1e6)
    found = {"points": weighed.points("lamp", each), "maps": weighed.maps("lamp", each, 2.0**18)}
    assert min(found, key=lambda name: found[name].product) == best
    assert weighed.edges("lamp", 0.0, 0).error < found["maps"].error < found["points"].error
    device.use(None)


def test_edges_before_a_pixel_are_counted_by_wedges():
    """Two wedges around every other receiver of a row, and one around all."""
    from addon.scene.receivers import Receivers

    low = np.stack([np.arange(100.0), np.zeros(100), np.zeros(100)], axis=1)
    receivers = Receivers(low, low + 0.5, np.ones(100))
    half = np.tile([1.0, 0.0, 0.0, -49.75], (4, 1))  # x up to 49.75
    wedges = np.stack([half, half, np.zeros((4, 4))]).astype(np.float32)
    assert edge_costs.edges_before(receivers, wedges) == pytest.approx(2.0)
    assert edge_costs.edges_before(receivers, wedges[:0]) == 0.0


def test_what_is_foreseen_of_edges():
    device.use(device.MADE_UP["software"])
    others = Compared(rays=1e6, maps=2e6)
    assert edge_costs.foreseen(10_000, 100, others).startswith("edges, if at most ")
    assert edge_costs.foreseen(10_000, 10**6, others) == "soft maps, because 1000000 triangles have too many edges"
    device.use(replace(device.MADE_UP["software"], edge=1e4))
    assert edge_costs.foreseen(10_000, 100, others).startswith("soft maps, because edges cost more here")
    device.use(None)
