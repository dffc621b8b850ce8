"""Tables of the world's directions by tile: chances, what a probe cannot judge by itself, and what rays would leave."""

import numpy as np
import pytest

from addon.sources import world_tiles

TILES, GRID = (6, 8), (16, 32)


def openings(width):
    """Tiles that each see another strip of the sky, `width` cells wide."""
    useful = np.zeros((*TILES, *GRID))
    for column in range(TILES[1]):
        useful[:, column, 8:12, column * 4 : column * 4 + width] = 1.0
    return useful


def moments(radiance, density=1 / (4 * np.pi)):
    return np.stack([radiance, radiance**2, radiance**2 / density])


def test_each_table_is_a_distribution_that_reaches_all_light():
    radiance = np.linspace(0.0, 2.0, GRID[0] * GRID[1]).reshape(GRID)
    chance = world_tiles.tables(world_tiles.arriving(openings(3), radiance), radiance)
    np.testing.assert_allclose(chance.sum(axis=(2, 3)), 1.0)
    assert (chance[..., radiance > 0] > 0).all()


def test_a_tile_draws_most_from_what_it_sees():
    radiance, useful = np.ones(GRID), openings(4)
    chance = world_tiles.tables(world_tiles.arriving(useful, radiance), radiance)
    assert chance[3, 4][useful[3, 4] > 0].mean() > 2 * chance[3, 4][useful[3, 0] > 0].mean()


@pytest.mark.parametrize("useful", [np.zeros((*TILES, *GRID)), np.ones((1, 1, *GRID))])
def test_no_light_and_a_single_tile_have_tables_too(useful):
    chance = world_tiles.tables(world_tiles.arriving(useful, np.ones(GRID)), np.ones(GRID))
    np.testing.assert_allclose(chance.sum(axis=(2, 3)), 1.0)


def test_what_only_its_own_probe_saw_is_not_in_the_table_that_judges_it():
    useful = np.zeros((*TILES, *GRID))
    useful[..., 2, 2] = 1.0
    useful[3, 4] = 0.0
    useful[3, 4, 12, 20] = 1.0
    light = world_tiles.arriving(useful, np.ones(GRID))
    assert world_tiles.tables(light, np.ones(GRID))[3, 4, 12, 20] > 0.02
    assert world_tiles.tables(light, np.ones(GRID), with_own=False)[3, 4, 12, 20] < 0.01


def test_edges_rise_from_zero():
    edges = world_tiles.lower_edges(world_tiles.tables(openings(2), np.ones(GRID)))
    assert edges.shape == (TILES[0] * TILES[1], GRID[0] * GRID[1])
    assert (edges[:, 0] == 0).all() and (np.diff(edges, axis=1) >= 0).all() and edges.max() <= 1


def test_rays_are_better_where_every_tile_sees_another_part_of_an_even_sky():
    by_rays, by_shared = world_tiles.variances(openings(4), moments(np.ones(GRID)))
    assert by_rays < 0.25 * by_shared


def test_shared_directions_are_better_where_a_sun_is_smaller_than_a_cell():
    sky = np.ones(GRID)
    square = sky.copy()
    square[9, :] = 1000.0  # the mean of a spot that is brighter than its cell
    found = world_tiles.variances(np.ones((*TILES, *GRID)), np.stack([sky, square, sky * 4 * np.pi]))
    assert found[0] > 10 * found[1]


def test_the_unit_of_radiance_does_not_matter():
    useful = openings(3)
    one, other = (world_tiles.variances(useful, moments(np.full(GRID, unit))) for unit in (1.0, 1e6))
    np.testing.assert_allclose(one, other)
