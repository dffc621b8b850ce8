"""Soft maps chosen by hand soften the shadows of every kind of light source."""

import pytest

from bench import soft, soft_sources

SIZE = (48, 36)


def test_a_hard_shadow_has_no_penumbra():
    import numpy as np

    assert soft_sources.between(np.array([[0.0, 1.0], [1.0, 0.0]])) == 0.0
    assert soft_sources.between(np.array([[0.0, 0.5], [1.0, 0.9]])) == 0.5


@pytest.mark.slow
@pytest.mark.parametrize("source", list(soft_sources.SOURCES))
def test_one_sample_of_soft_maps_is_nearer_to_the_truth_than_one_of_hard_maps(registered, source):
    entrants = (
        soft.Entrant("VSSM", soft.VSSM),
        soft.Entrant("CSSM", soft.CSSM),
        soft.Entrant("maps", soft.POINTS, soft.BY_MAPS),
    )
    (vssm, soft_share), (cssm, _), (hard, _), (_, share) = soft_sources.measure(source, entrants, SIZE, 64)
    assert vssm < hard and cssm < hard
    assert share > 0.1 and soft_share > 0.6 * share
