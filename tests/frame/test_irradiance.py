"""Irradiance of the unoccluded world by normal, against sums over all texels."""

import numpy as np
import pytest

from addon.sources.irradiance import COLUMNS, ROWS, WorldCells

HEIGHT, WIDTH = 256, 512


def sphere(height=HEIGHT, width=WIDTH):
    """Directions (H, W, 3) of an equirectangular image's texels and their solid angles (H, W)."""
    edges = np.sin((np.arange(height + 1) / height - 0.5) * np.pi)
    latitude = np.arcsin((edges[1:] + edges[:-1]) / 2)[:, None]
    azimuth = (0.5 - (np.arange(width) + 0.5) / width) * 2 * np.pi
    x, y = np.cos(latitude) * np.cos(azimuth), np.cos(latitude) * np.sin(azimuth)
    solid_angle = np.broadcast_to(np.diff(edges)[:, None] * (2 * np.pi / width), (height, width))
    return np.stack([x, y, np.broadcast_to(np.sin(latitude), x.shape)], axis=-1), solid_angle


DIRECTIONS, SOLID_ANGLE = sphere()
SUN = np.array([0.3, -0.5, 0.8]) / np.linalg.norm([0.3, -0.5, 0.8])
SKIES = {
    "even": np.ones((HEIGHT, WIDTH)),
    "sky above a ground": np.where(DIRECTIONS[..., 2] > 0, 0.3 + DIRECTIONS[..., 2], 0.1),
    "sun": 0.2 + 5000.0 * (np.einsum("hwi,i->hw", DIRECTIONS, SUN) > np.cos(np.radians(0.9))),
    "window": 0.05 + 3.0 * ((np.abs(DIRECTIONS[..., 1]) < 0.3) & (np.abs(DIRECTIONS[..., 2]) < 0.4)),
    "night that takes light away": -0.5 - DIRECTIONS[..., 0] ** 2,
}


def normals(count=200):
    some = np.random.default_rng(1).normal(size=(count, 3))
    some /= np.linalg.norm(some, axis=1, keepdims=True)
    return np.concatenate([some, np.eye(3), -np.eye(3)])


def summed(light, towards):
    return np.array([(light * SOLID_ANGLE * np.maximum(DIRECTIONS @ normal, 0.0)).sum() for normal in towards])


@pytest.mark.parametrize("name", SKIES)
def test_irradiance_is_the_sum_over_texels(name):
    light = SKIES[name]
    colored = light[..., None] * np.array([1.0, 0.5, 0.0])
    found = WorldCells(colored).irradiance(np.eye(3)).at(normals())
    truth = summed(light, normals())
    # A sun that the horizon cuts counts as a point.
    assert np.abs(found[:, 0] - truth).max() <= (0.007 if name == "sun" else 0.003) * np.abs(truth).mean()
    np.testing.assert_allclose(found[:, 1], 0.5 * found[:, 0], rtol=1e-5)
    assert not found[:, 2].any()


@pytest.mark.parametrize("tilted", (False, True))
def test_irradiance_turns_with_the_world(tilted):
    angle = 0.7
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1.0]])
    turn = np.roll(turn, (1, 1), axis=(0, 1)) if tilted else turn
    cells = WorldCells(np.repeat(SKIES["window"][..., None], 3, axis=2))
    straight, turned = cells.irradiance(np.eye(3)), cells.irradiance(turn)
    some = normals()
    np.testing.assert_allclose(turned.at(some @ turn.T), straight.at(some), atol=0.005 * straight.table.mean())


def test_openness_counts_in_the_cell_of_a_direction():
    """Light of one direction counts by the openness of the cell that `of` finds for it."""
    row, column = 172, 77
    light = np.zeros((HEIGHT, WIDTH, 3))
    light[row, column] = 1.0
    cells = WorldCells(light)
    direction = DIRECTIONS[row, column]
    own = cells.of(direction)
    openness = np.zeros(ROWS * COLUMNS)
    openness[own] = 0.25
    facing = cells.irradiance(np.eye(3), openness).at(direction)
    np.testing.assert_allclose(facing, 0.25 * SOLID_ANGLE[row, column], rtol=1e-3)
    assert np.argmax(cells.centres() @ direction) == own


def test_a_world_without_light_gives_none():
    found = WorldCells(np.zeros((HEIGHT, WIDTH, 3))).irradiance(np.eye(3))
    assert not found.at(normals()).any() and not found.texels().any()
