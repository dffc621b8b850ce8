"""Passes of a final picture: light that estimates by differences left below 0."""

import numpy as np

from addon.final import COMBINED, _without_negative


def test_no_light_is_below_zero_and_the_picture_stays_its_sum():
    chance = np.random.default_rng(3)
    direct, bounced = (chance.uniform(-0.1, 1.0, (6, 8, 4)).astype(np.float32) for _ in range(2))
    arrays = {"radiance.diffuse_direct": direct, "radiance.diffuse_indirect": bounced}
    arrays[COMBINED] = 2.0 * (direct + bounced)
    alpha = arrays[COMBINED][..., 3].copy()
    _without_negative(arrays, exposure=2.0)
    assert all((array[..., :3] >= 0).all() for array in arrays.values())
    np.testing.assert_allclose(arrays[COMBINED][..., :3], 2.0 * (direct + bounced)[..., :3], atol=1e-6)
    assert (arrays[COMBINED][..., 3] == alpha).all()
