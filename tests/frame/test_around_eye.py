"""Which objects the eye may be in."""

import numpy as np
import pytest

from addon.scene.around_eye import _may_meet

LOW, HIGH = np.array([-1.0, -1.0, 0.0]), np.array([1.0, 1.0, 2.0])


@pytest.mark.parametrize(("origin", "meets"), [
    ((0.0, 0.0, -1.0), True), ((0.0, 0.0, 1.0), True), ((0.0, 0.0, 3.0), False), ((2.0, 0.0, 1.0), False),
    ((1.0, 0.0, 1.0), True), ((5.0, 5.0, 5.0), False),
])  # fmt: skip
def test_rays_along_an_axis_meet_boxes_without_a_warning(origin, meets):
    with np.errstate(all="raise"):
        assert _may_meet(np.array(origin), np.array([0.0, 0.0, 1.0]), LOW, HIGH) is meets
