"""Isolated bright pixels are counted where one stands alone, and not where light is bright over several."""

import numpy as np

from bench.bright import around, came_by, isolated, wrong


def test_a_pixel_alone_counts_and_a_spot_does_not():
    light = np.full((8, 8), 0.1)
    light[2, 2] = 0.6
    light[5:7, 5:7] = 0.6
    light[0, 7] = 0.6
    assert np.argwhere(isolated(light)).tolist() == [[0, 7], [2, 2]]
    assert np.allclose(around(np.ones((3, 4)), whole=True), 1.0)


def test_a_small_lamp_that_the_truth_has_is_not_wrong():
    light = np.full((8, 8), 0.1)
    light[2, 2] = light[5, 5] = 5.0
    truth = np.full((8, 8), 0.1)
    truth[2, 2] = 4.0
    assert np.argwhere(wrong(light, truth)).tolist() == [[5, 5]]


def test_a_bright_pixel_is_of_the_path_that_its_surroundings_lack():
    images = {f"{lobe}_color": np.ones((4, 4, 3)) for lobe in ("diffuse", "glossy")}
    images |= {"diffuse_direct": np.full((4, 4, 3), 0.5), "glossy_indirect": np.full((4, 4, 3), 0.1)}
    images["glossy_indirect"][1, 2] = 5.0
    found = np.zeros((4, 4), bool)
    found[1, 2] = True
    assert came_by(images, found) == {"glossy indirect": 1}
