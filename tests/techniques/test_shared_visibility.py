"""Soft shadows that are looked up at every fourth pixel: as without where nothing varies, alike in penumbrae."""

from types import SimpleNamespace

import numpy as np
import pytest

from addon.gfx import context, images, passes
from addon.gfx.struct import Block
from addon.lighting import shared_visibility
from addon.scene.view import VIEW
from tests.techniques.test_shadows import HEIGHT, irradiance
from tests.techniques.test_vssm import EDGE, floor  # noqa: F401 - a fixture

SIZE, WHOLE, SMALL = (402, 251), (401, 253), (200, 120)  # beyond whole cells along both axes, and one pixel beyond


@pytest.fixture
def large(floor):  # noqa: F811
    """A picture that is large enough, of an edge's shadow on a floor."""
    floor.blocker(*EDGE)
    return floor


def shared(stage):
    return stage.ledger.row("direct_light").counters.get("shared lookups", 0)


def both(stage, size=SIZE, samples=1, kind="vssm"):
    """The picture with and without sharing, and how many lights shared lookups with it."""
    found = irradiance(stage, samples, size)
    lights = shared(stage)
    setattr(stage.scene.candela, f"{kind}_sparse", False)
    expected = irradiance(stage, samples, size)
    assert shared(stage) == 0
    setattr(stage.scene.candela, f"{kind}_sparse", True)
    return found, expected, lights


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "size"), [("vssm", SIZE), ("cssm", SIZE), ("vssm", WHOLE)])
def test_penumbra_is_alike_and_all_else_the_same(large, kind, size):
    large.scene.candela.slot_shadow = kind
    large.light("AREA", (0, 0, HEIGHT), size=1.0)
    found, expected, lights = both(large, size, kind=kind)
    assert lights == 1
    most = expected.max()
    assert abs(found - expected).max() < 0.05 * most
    assert np.sqrt(((found - expected) ** 2).mean()) < 0.005 * most
    dark = expected < 1e-6 * most
    assert dark.mean() > 0.1
    assert found[dark].max() < 0.02 * most


@pytest.mark.slow
@pytest.mark.parametrize("most", [None, 600], ids=["", "small images"])
def test_five_lights_are_the_sum_of_each(large, most, monkeypatch):
    """Four share an image, the fifth has another; two where an image may not be as high."""
    if most:
        lower = SimpleNamespace(**{**vars(images), "most_side": lambda: most})  # for lookups alone: maps are larger
        monkeypatch.setattr(shared_visibility, "images", lower)
    large.scene.candela.vssm_refine = False
    for k in range(5):
        large.light("AREA", (0.3 * k - 0.6, 0.2 * k - 0.4, HEIGHT), size=0.6 + 0.2 * k)
    found, expected, lights = both(large)
    assert lights == 5
    assert np.sqrt(((found - expected) ** 2).mean()) < 0.005 * expected.max()
    assert found.mean() == pytest.approx(expected.mean(), rel=2e-3)


def test_between_lookups_visibility_is_bilinear(gpu_context):
    """Of four lights, one above the other, on a plane on which all cells lie and know all lights."""
    side, rate = 9, shared_visibility.RATE
    rng = np.random.default_rng(1)
    points = side // rate + 2
    seen = rng.random((points, points, 4))
    place = np.zeros((side, side, 4))
    place[..., 1], place[..., 0] = np.mgrid[:side, :side]
    place[..., 3] = 1.0
    view = Block(VIEW, **(dict.fromkeys(VIEW.fields, 0) | {
        "eye": (0.0, 0.0, 5.0, 1.0), "frame": (-1.0, 1.0, -1.0, 1.0), "film": (side, side, 0.1, 100.0),
    }))  # fmt: skip
    textures = {
        "surface_position": place, "surface_normal": np.zeros((side, side, 4)), "visibility": seen,
        "cells": np.broadcast_to((0.0, 0.0, 0.0, 255.0), (points - 1, points - 1, 4)),
    }  # fmt: skip
    with images.borrowed(side, 4 * side, "R32F") as target:
        passes.compute(
            shared_visibility.MARKING, (side, side), blocks={"film_view": view}, constants={"light_count": 4},
            textures={name: images.upload(pixels) for name, pixels in textures.items()},
            images={"pixel_visibility": target.colors[0]},
        )  # fmt: skip
        found = images.read(target.colors[0])[..., 0].reshape(4, side, side)
    cell, share = np.divmod(np.arange(side), rate)
    between = np.zeros((side, points))
    between[np.arange(side), cell], between[np.arange(side), cell + 1] = 1 - share / rate, share / rate
    expected = np.einsum("yj,xi,jik->kyx", between, between, seen)
    np.testing.assert_allclose(found, expected, atol=1e-5)


def fence(stage):
    """Posts, thinner than a cell, in front of the floor."""
    for k in range(12):
        x = 0.32 * k - 1.9
        stage.rectangle((x, -2.0), (x + 0.02, 2.0), 0.3)


def test_outlines_and_what_stands_on_the_floor_look_for_themselves(large):
    """Each post looks for its own light."""
    large.light("AREA", (0, 0, HEIGHT), size=1.0)
    fence(large)
    found, expected, lights = both(large)
    assert lights == 1
    assert np.sqrt(((found - expected) ** 2).mean()) < 0.01 * expected.max()
    assert np.percentile(abs(found - expected), 99) < 0.05 * expected.max()


@pytest.mark.slow
def test_where_shaders_cannot_count_the_same_pixels_look_for_themselves(large, monkeypatch):
    """Without lists each pixel is asked whether it does."""
    for k in range(3):
        large.light("AREA", (0.5 * k - 0.5, 0, HEIGHT), size=1.0)
    fence(large)
    listed, _, lights = both(large)
    assert lights == 3
    monkeypatch.setattr(context, "counts_in_images", lambda: False)
    marked, _, lights = both(large)
    assert lights == 3
    assert np.array_equal(listed, marked)


@pytest.mark.slow
@pytest.mark.parametrize(("size", "samples"), [(SMALL, 1), (SIZE, 16)])
def test_small_pictures_and_those_of_many_samples_ask_every_pixel(large, size, samples):
    large.light("AREA", (0, 0, HEIGHT), size=1.0)
    irradiance(large, samples, size)
    assert shared(large) == 0


@pytest.mark.slow
def test_layers_lit_from_both_sides_ask_every_pixel(large):
    large.light("AREA", (0, 0, HEIGHT), size=1.0)
    large.rectangle((1.0, 1.0), (1.5, 1.5), 0.5, material=large.material("ShaderNodeBsdfTranslucent"))
    irradiance(large, 1, SIZE)
    assert shared(large) == 0


@pytest.mark.slow
def test_the_mean_of_a_slanted_and_curved_scene_is_kept(large):
    """In perspective, with a ball: planes of cells are those of facets."""
    large.scene.camera.data.type = "PERSP"
    large.scene.camera.location, large.scene.camera.rotation_euler = (0, -4.0, 2.0), (1.1, 0, 0)
    turns, heights = np.linspace(0, 2 * np.pi, 25)[:-1], np.linspace(-1, 1, 13)[1:-1]
    ring = [(0.4 * np.sqrt(1 - h * h) * np.cos(t), 0.4 * np.sqrt(1 - h * h) * np.sin(t), 0.4 * h + 0.4)
            for h in heights for t in turns]  # fmt: skip
    faces = [(r * 24 + k, r * 24 + (k + 1) % 24, r * 24 + 24 + (k + 1) % 24, r * 24 + 24 + k)
             for r in range(len(heights) - 1) for k in range(24)]  # fmt: skip
    large.mesh(ring, faces, material=large.diffuse(0.8))
    large.light("AREA", (0, 0, HEIGHT), size=1.0)
    found, expected, lights = both(large)
    assert lights == 1
    assert found.mean() == pytest.approx(expected.mean(), rel=3e-3)
    assert np.sqrt(((found - expected) ** 2).mean()) < 0.01 * expected.max()
