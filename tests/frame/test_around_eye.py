"""Which objects the eye may be in."""

import numpy as np
import pytest

from addon.scene.around_eye import _first_met, _may_meet

LOW, HIGH = np.array([-1.0, -1.0, 0.0]), np.array([1.0, 1.0, 2.0])


@pytest.mark.parametrize(("origin", "meets"), [
    ((0.0, 0.0, -1.0), True), ((0.0, 0.0, 1.0), True), ((0.0, 0.0, 3.0), False), ((2.0, 0.0, 1.0), False),
    ((1.0, 0.0, 1.0), True), ((5.0, 5.0, 5.0), False),
])  # fmt: skip
def test_rays_along_an_axis_meet_boxes_without_a_warning(origin, meets):
    with np.errstate(all="raise"):
        assert _may_meet(np.array(origin), np.array([0.0, 0.0, 1.0]), LOW, HIGH) is meets


def test_a_ray_meets_a_triangle_where_it_goes_through_it():
    """Two triangles above each other, wound in opposite ways: the nearer one, from the side that it shows."""
    one = np.array([(0, 0, 1), (1, 0, 1), (0, 1, 1)], float)
    both, rise = np.stack([one + (0, 0, 2), one[::-1]]), np.array([0.0, 0.0, 1.0])
    for x in (-0.2, 0.1, 0.3, 0.6, 0.9):
        for y in (-0.2, 0.05, 0.3, 0.6):
            inside = x > 0 and y > 0 and x + y < 1
            below, above = np.array([x, y, 0.0]), np.array([x, y, 4.0])
            assert _first_met(both, below, rise) == ((1, False) if inside else None)
            assert _first_met(both, above, -rise) == ((0, False) if inside else None)
            assert _first_met(both[:1], below, rise) == ((0, True) if inside else None)
    assert _first_met(both, np.array([0.2, 0.2, 5.0]), rise) is None
