"""Passes that hold no light: mist, position and indices, beside Cycles' own."""

import numpy as np
import pytest

from addon.compare.passes import OTHER_NAMES
from addon.compare.reference import render_passes
from addon.ui.passes import divide_by_color

SIZE = (48, 40)
SPAN = 4.0


@pytest.fixture
def asked(stage):
    """The stage with these passes switched on; `both(samples)` renders it by Candela and by Cycles."""
    layer = stage.scene.view_layers[0]
    switches = [row.switch for row in OTHER_NAMES if "." not in row.switch]  # others are of the Cycles add-on
    for switch in switches:
        setattr(layer, switch, True)
    stage.both = lambda samples: [
        render_passes(stage.scene, engine, samples, 1, direct_only=True, size=SIZE).images
        for engine in ("CANDELA", "CYCLES")
    ]
    yield stage
    for switch in switches:
        setattr(layer, switch, False)


def mist(stage, falloff="QUADRATIC", start=1.0, depth=6.0):
    stage.world((0.0, 0.0, 0.0))
    settings = stage.scene.world.mist_settings
    settings.falloff, settings.start, settings.depth = falloff, start, depth


def steps(stage):
    """Three walls across a wide view, at 2, 4 and 9 m, and nothing beside them."""
    stage.camera((0, 0, 10), (0, 0, 0), angle=1.6)
    for k, depth in enumerate((2.0, 4.0, 9.0)):
        wall = stage.rectangle((-2.0 + 1.2 * k, -9), (-0.9 + 1.2 * k, 9), 10.0 - depth, material=stage.diffuse())
        wall.pass_index, wall.data.materials[0].pass_index = 5 + k, 300 * k
    return stage


@pytest.mark.parametrize("falloff", ["QUADRATIC", "LINEAR", "INVERSE_QUADRATIC"])
def test_mist_is_that_of_cycles(asked, falloff):
    mist(steps(asked), falloff)
    own, cycles = asked.both(1)
    np.testing.assert_allclose(own["mist"], cycles["mist"], atol=1e-5)
    assert own["mist"].max() == 1.0 and own["mist"].min() < 0.5


def test_mist_without_depth_is_that_of_cycles(asked):
    mist(steps(asked), "LINEAR", depth=0.0)
    own, cycles = asked.both(1)
    np.testing.assert_allclose(own["mist"], cycles["mist"], atol=1e-5)


def test_mist_shows_what_transparent_layers_let_through(asked):
    mist(asked, "LINEAR")
    asked.camera_above(SPAN)
    asked.rectangle((-9, -9), (9, 9), 0.0)
    half = asked.material("ShaderNodeBsdfTransparent", Color=(0.25, 0.25, 0.25, 1.0))
    asked.rectangle((-9, -9), (0, 9), 5.0, material=half)
    own, cycles = asked.both(16)
    np.testing.assert_allclose(own["mist"].mean(), cycles["mist"].mean(), rtol=5e-3)
    np.testing.assert_allclose(own["mist"][:, 30:], cycles["mist"][:, 30:], atol=1e-5)


def test_position_is_in_world_space_far_from_the_origin_too(asked):
    asked.camera((1000, -2000, 10), (0, 0, 0), angle=1.6)
    asked.rectangle((995, -2100), (1001, -1900), 3.0)
    own, cycles = asked.both(1)
    seen = cycles["depth"][..., 0] < 1e9
    assert 0.2 < seen.mean() < 0.9
    assert (own["position"][~seen] == 0.0).all()
    np.testing.assert_allclose(
        own["position"][seen], cycles["position"][seen], atol=0.02 * 7
    )  # other places in a pixel
    middle = own["position"][seen]
    np.testing.assert_allclose(middle[:, 2], 3.0, atol=1e-3)


def test_indices_are_those_of_objects_and_materials(asked):
    steps(asked)
    own, cycles = asked.both(1)
    for name in ("object_index", "material_index"):
        np.testing.assert_array_equal(own[name], cycles[name])
    assert set(np.unique(own["object_index"])) == {0.0, 5.0, 6.0, 7.0}
    assert set(np.unique(own["material_index"])) == {0.0, 300.0, 600.0}


@pytest.mark.parametrize("threshold", [0.0, 0.5, 0.95])
def test_layers_show_by_the_alpha_threshold(asked, threshold):
    """As in Cycles: layers from that opacity on in full, thinner ones in as many of the pixels as they cover."""
    asked.scene.view_layers[0].pass_alpha_threshold = threshold
    asked.floor().pass_index = 5
    opacity_of = (0.2, 0.7)
    for k, opacity in enumerate(opacity_of):
        card = asked.rectangle((-2 + 2 * k, -9), (2 * k, 9), 1.0, material=asked.principled(Alpha=opacity))
        card.pass_index = 10 + k
    asked.camera_above(SPAN)
    try:
        own, cycles = asked.both(1)
    finally:
        asked.scene.view_layers[0].pass_alpha_threshold = 0.5
    for k, columns in enumerate((slice(2, 22), slice(26, 46))):
        for name, near, far in (("depth", 9.0, 10.0), ("object_index", 10 + k, 5)):
            shares = []
            for found in (own, cycles):
                values = found[name][:, columns, 0]
                assert np.all(np.isclose(values, near, atol=1e-3) | np.isclose(values, far, atol=1e-3))
                shares.append(np.isclose(values, near, atol=1e-3).mean())
            if opacity_of[k] < threshold:
                assert shares == pytest.approx([opacity_of[k]] * 2, abs=0.06)
            else:
                assert shares == [1.0, 1.0]


def test_indices_change_no_picture_and_are_drawn_only_where_asked_for(asked):
    steps(asked)
    with_them = asked.render(4)
    drawn = asked.ledger.row("film").counters["passes"]
    for row in OTHER_NAMES:
        if "." not in row.switch:
            setattr(asked.scene.view_layers[0], row.switch, False)
    without = asked.render(4)
    assert not {row.image for row in OTHER_NAMES} & without.keys()
    assert asked.ledger.row("film").counters["passes"] == drawn - 2
    for name in ("combined", "normal", "depth"):
        np.testing.assert_array_equal(with_them[name], without[name])


def test_light_over_colour_takes_the_mean_of_other_channels_where_there_is_none():
    traces = [1e-5, 1e-5, 1e-5], [1e-9, 2e-9, 0.0], [0.0, 0.0, 0.0]  # where a filter's edge meets glass
    light = np.array([[[0.2, 0.6, 0.5], [0.3, 0.0, 0.0], [0.1, 0.2, 0.3], traces[0]]], np.float32)
    color = np.array([[[0.4, 0.2, 0.0], [0.0, 0.0, 0.0], [1.0, 1.0, 1.0], traces[1]]], np.float32)
    expected = [[[0.5, 3.0, 1.75], [0.0, 0.0, 0.0], [0.1, 0.2, 0.3], traces[2]]]
    np.testing.assert_allclose(divide_by_color(light, color), expected, rtol=1e-6)
