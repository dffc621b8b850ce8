"""Samples that a technique takes part in (sampling/turns.py, sampling/interleaved.py), and how often it does
(frame/shares.py)."""

from itertools import pairwise

import numpy as np
import pytest

from addon.frame import shares
from addon.sampling.interleaved import FEWEST, interleaving
from addon.sampling.sequence import bits
from addon.sampling.turns import FEWEST as FEWEST_TURNS
from addon.sampling.turns import most_apart, turns


@pytest.mark.parametrize("samples", [8, 9, 16, 50, 64, 100])
@pytest.mark.parametrize("apart", [(1,), (2,), (4,), (1, 4), (2, 2, 8), (16,)])
def test_both_halves_keep_their_weight_and_the_first_sample_its_own(samples, apart):
    found = turns(samples, apart)
    half = samples // 2
    assert found[0] == 1.0
    assert sum(weight for sample, weight in found.items() if sample < half) == pytest.approx(half)
    assert sum(weight for sample, weight in found.items() if sample >= half) == pytest.approx(samples - half)


def test_a_part_has_turns_where_that_before_it_has_one():
    chain = [turns(64, apart) for apart in ((1,), (1, 2), (1, 2, 2), (1, 2, 2, 8))]
    for before, after in pairwise(chain):
        assert after.keys() <= before.keys()
    assert [len(one) for one in chain] == [64, 33, 33, 9]


def test_turns_are_spread_over_the_sequence():
    """Every fourth sample would lie in one quarter of the first dimension."""
    taken = np.array([sample for sample in turns(64, (4,)) if sample], np.uint64)
    for dimension in (0, 1, 5, 6):
        filled = np.bincount((bits(taken, dimension) >> np.uint64(30)).astype(int), minlength=4)
        assert filled.min() >= 2 and filled.max() <= 6


def test_the_smaller_a_share_the_fewer_samples():
    assert shares.apart_by(shares.WHOLE, 64) == 1 and shares.apart_by(np.inf, 64) == 1
    assert shares.apart_by(shares.WHOLE / 4, 64) == 2
    assert shares.apart_by(shares.WHOLE / 17, 64) == 4
    assert shares.apart_by(2e-5, 16) == most_apart(16) == 4 and most_apart(7, FEWEST_TURNS) == 1
    assert shares.apart_by(0.0, 16) == 8


def test_share_of_a_gloss_that_is_a_tenth_of_the_light():
    light = np.full(12, 2.0)
    assert shares.share_of((0.1 * light) ** 2, light) == pytest.approx(0.01 / 1.01)
    assert shares.share_of(np.zeros(12), np.zeros(12)) == 0.0
    assert shares.share_of(np.ones(12), np.zeros(12)) == np.inf


@pytest.mark.parametrize("samples", [16, 32, 64, 128])
@pytest.mark.parametrize("groups", [2, 3, 4, 7, 20])
def test_pixels_share_out_samples_evenly(samples, groups):
    """Each has as many in both halves, one in each block, and first numbers from all parts of the first dimension."""
    part = interleaving(groups, samples)
    assert part.count <= 2 * groups and samples // part.count >= FEWEST
    drawn: dict[tuple[int, int], list[int]] = {}
    for sample in range(samples):
        drawn.setdefault(part.place(sample), []).append(sample)
    assert sorted(drawn) == sorted((x, y) for x in range(part.columns) for y in range(part.rows))
    for taken in drawn.values():
        assert [part.visit(sample) for sample in taken] == list(range(samples // part.count))
        assert sum(sample < samples // 2 for sample in taken) == len(taken) / 2
        first = bits(np.array(taken, np.uint64), 0) >> np.uint64(30)
        assert np.ptp(np.bincount(first.astype(int), minlength=4)) == 0


@pytest.mark.parametrize("samples", [9, 50, 100, 250])
@pytest.mark.parametrize("groups", [2, 3, 7])
def test_what_is_no_whole_block_of_a_half_is_drawn_in_all_pixels(samples, groups):
    part = interleaving(groups, samples)
    half, weight = samples // 2, {place: [0, 0] for place in part.places}
    for sample in range(samples):
        for place in [part.place(sample)] if part.is_part(sample) else part.places:
            weight[place][sample >= half] += part.count if part.is_part(sample) else 1
    assert set(map(tuple, weight.values())) == {(half, samples - half)}
    assert sum(not part.is_part(sample) for sample in range(samples)) <= 2 * part.count - 1
    visits = [part.visit(sample) for sample in range(samples) if part.is_part(sample)]
    assert visits == [k for k in range(part.visits) for _ in range(part.count)]


def test_groups_begin_at_different_pixels():
    places = {interleaving(4, 16, first).place(5) for first in range(4)}
    assert len(places) == 4


@pytest.mark.parametrize(("groups", "samples"), [(1, 64), (4, 1), (4, 7), (2, 6), (2, 7)])
def test_few_samples_and_single_pictures_draw_every_pixel(groups, samples):
    assert interleaving(groups, samples) is None
