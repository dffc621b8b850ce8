"""What drafts of a moving view are compared with."""

from types import SimpleNamespace

import bpy  # noqa: F401 (gpu is its)
import numpy as np
import pytest

from addon.film.filter import taps
from bench.orbit import AFTER, through_film, too_few


def test_a_film_spreads_a_bright_pixel_by_its_weights():
    """At the rim, within two pixels of it, own points alone count along the axis that leads there."""
    picture = np.zeros((9, 12, 3))
    picture[4, 5] = picture[0, 5] = 1.0
    _, weights = taps(0.0, 1.5)
    seen = through_film(picture, 1.5)
    np.testing.assert_allclose(seen[3:6, 4:7, 0], np.outer(weights, weights), atol=1e-12)
    np.testing.assert_allclose(seen[0, 4:7, 0], weights, atol=1e-12)
    assert seen[1].max() == 0.0
    assert through_film(np.ones((9, 12, 3)), 1.5) == pytest.approx(1.0)


@pytest.mark.parametrize("steps", range(1, 9))
def test_steps_after_an_edit_are_all_drawn_or_refused(steps):
    edit = range(steps // 2, steps // 2 + AFTER)
    assert too_few(SimpleNamespace(ways=["edit"], steps=steps)) == (not {*edit} <= {*range(steps)})
    assert not too_few(SimpleNamespace(ways=["camera"], steps=steps))


def test_a_narrow_film_shows_the_middles_of_pixels():
    picture = np.random.default_rng(1).random((5, 7, 3))
    np.testing.assert_array_equal(through_film(picture, 0.4), picture)
