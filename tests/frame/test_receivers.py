"""Boxes around what the camera sees: tiles of large pictures are merged, and the boxes hold the same."""

import numpy as np
import pytest

from addon.scene.receivers import MOST, merged


@pytest.mark.parametrize("rows, columns, side", [(12, 16, 1), (32, 32, 1), (33, 32, 2), (68, 120, 3), (135, 240, 6)])
def test_tiles_are_merged_until_few_enough_are_left(rows, columns, side):
    random = np.random.default_rng(rows)
    low = random.normal(size=(rows, columns, 4))
    high = low + random.uniform(0.0, 1.0, low.shape)
    low[3, 5], high[3, 5] = 1e30, -1e30  # nothing is seen there
    found_low, found_high, found_side = merged(low, high)
    assert found_side == side
    assert found_low.shape[0] * found_low.shape[1] <= MOST
    assert found_low.min() == low.min() and found_high.max() == high.max()
    for row, column in ((0, 0), (3, 5), (rows - 1, columns - 1)):
        part = (
            slice(row // side * side, (row // side + 1) * side),
            slice(column // side * side, (column // side + 1) * side),
        )
        assert (found_low[row // side, column // side] == low[part].min(axis=(0, 1))).all()
        assert (found_high[row // side, column // side] == high[part].max(axis=(0, 1))).all()
