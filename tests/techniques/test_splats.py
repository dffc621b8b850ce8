"""Splats spread all of a record's value over its footprint, whatever its shape; views of lights fit their box."""

import numpy as np
import pytest

from addon.gfx import images
from addon.gfx.struct import Block
from addon.kernels import splats
from addon.lighting.light_views import groups, views_of
from addon.lighting.photons import widening
from addon.scene.view import VIEW
from addon.sources import lights
from addon.techniques.caustics_mapping import INTO_MAP

SIDE, SPAN = 64, 4.0
NO_WALL = (1, 0, 2)  # farther away than the footprint reaches


def view_from_above():
    sun = emitter(lights.SUN)
    low, high = np.array([-SPAN / 2, -SPAN / 2, 0.0]), np.array([SPAN / 2, SPAN / 2, 0.0])
    return views_of(sun, np.array([0.0, 0.0, 1.0]), low, high, SIDE, (0.5, 0.5), 1.0)[0]


def emitter(kind, centre=(0.0, 0.0, 3.0)):
    zero = np.zeros(3)
    down = np.array([0.0, 0.0, -1.0])
    return lights.Emitter(None, kind, 0, np.array(centre), 0.0, np.ones(3), 1.0, down, 0.0, zero, zero, zero)


def receivers(view):
    """Positions and normals of the plane z = 0 in the view's texels."""
    u, v = np.array(view.values["right"][:3]), np.array(view.values["up"][:3])
    left, right, bottom, top = view.values["frame"]
    x = left + (np.arange(SIDE) + 0.5) / SIDE * (right - left)
    y = bottom + (np.arange(SIDE) + 0.5) / SIDE * (top - bottom)
    place = x[None, :, None] * u + y[:, None, None] * v
    position = np.concatenate([place, np.ones((SIDE, SIDE, 1))], axis=2)
    position[..., 2] = 0.0
    normal = np.zeros((SIDE, SIDE, 4))
    return images.upload(position), images.upload(normal), ((right - left) / SIDE) ** 2


@pytest.mark.parametrize(
    "axes", [((0.5, 0, 0), (0, 0.5, 0)), ((0.9, 0.4, 0), (-0.1, 0.225, 0)), ((0.3, 0, 0), (0, 1.2, 0))]
)
@pytest.mark.parametrize("wall", [NO_WALL, (1, 0, 0), (0.6, -0.8, 0.3)])
def test_all_of_a_value_arrives(gpu_context, axes, wall):
    """Also where a wall, by direction and distance in half axes, ends the footprint (caustics/footprint.frag.glsl)."""
    view = view_from_above()
    position, normal, area = receivers(view)
    records = [np.zeros((1, 2, 4), np.float32) for _ in splats.RECORD]  # the second one is empty
    records[1][0, 0, :3], records[2][0, 0, :3] = axes
    records[3][0, 0, :3] = 2.0, 1.0, 0.5
    for record, share in zip(records[1:], wall):
        record[0, 0, 3] = share
    target = images.Target((images.pool.take(SIDE, SIDE, "RGBA32F"),))
    target.clear()
    places = 1 if wall == NO_WALL else 16  # so that it does not matter where in a texel the wall stands
    for k in range(places):
        records[0][0, 0] = 0.1 + k / places * area**0.5, -0.2 + 7 * k % places / places * area**0.5, 0.0, 1.0
        splats.draw(
            INTO_MAP, target, tuple(images.upload(record) for record in records),
            textures={"receiver_position": position, "receiver_normal": normal},
            blocks={"map_view": Block(VIEW, **view.values)},
        )  # fmt: skip
    drawn = images.read(target.colors[0]) / places
    images.pool.give(target.colors[0])
    assert drawn[..., :3].sum(axis=(0, 1)) * area == pytest.approx([2.0, 1.0, 0.5], rel=0.01)


@pytest.mark.parametrize("count", [1, 2, 3, 5])
def test_footprints_of_photons_on_an_even_grid_leave_little_of_its_pattern(count):
    """Biweight kernels one apart, in the measure of their half axes, about places between them."""
    places = (np.arange(16) + 0.5) / 16
    ways = (places[:, None] - np.arange(-3, 5)) ** 2
    inside = np.maximum(1.0 - (ways[:, None, :, None] + ways[None, :, None, :]) / widening(count) ** 2, 0.0)
    light = (inside**2).sum(axis=(2, 3))
    assert light.std() < 0.03 * light.mean()


def test_boxes_that_overlap_or_are_too_many_are_joined():
    low = np.array([[0, 0, 0], [0.5, 0, 0], [10, 0, 0], [20, 0, 0], [30, 0, 0], [30.5, 5, 0]], float)
    found_low, found_high = groups(low, low + 1.0)
    assert len(found_low) == 4
    for a, b in zip(low, low + 1.0):
        assert ((found_low <= a).all(axis=1) & (found_high >= b).all(axis=1)).sum() == 1


@pytest.mark.parametrize("centre", [(0, 0, 3), (1, 2, 0.5), (0.1, 0.1, 1.2), (0, 0, 0)])
def test_every_place_of_the_box_is_seen_by_one_view(centre):
    low, high = np.array([-0.5, -0.5, -0.5]), np.array([0.5, 0.5, 0.5])
    lamp = emitter(lights.POINT, centre)
    views = views_of(lamp, np.zeros(3), low, high, 32, (0.3, 0.8), 5.0)
    places = np.random.default_rng(0).uniform(-0.5, 0.5, (200, 3))
    homogeneous = np.concatenate([places, np.ones((200, 1))], axis=1)
    seen = np.zeros(200)
    for view in views:
        x, y, w, _ = (homogeneous @ row for row in view.rows)
        seen += (w > 0) & (np.abs(x) <= w) & (np.abs(y) <= w)
    assert (seen == 1).all()
