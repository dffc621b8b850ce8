"""Isolated bright pixels are counted where one stands alone, and not where light is bright over several."""

import numpy as np

from bench.bright import around, isolated


def test_a_pixel_alone_counts_and_a_spot_does_not():
    light = np.full((8, 8), 0.1)
    light[2, 2] = 0.6
    light[5:7, 5:7] = 0.6
    light[0, 7] = 0.6
    assert np.argwhere(isolated(light)).tolist() == [[0, 7], [2, 2]]
    assert np.allclose(around(np.ones((3, 4)), whole=True), 1.0)
