"""Features that meet: how pairs are judged, and some of them beside Cycles."""

import argparse
import random

import numpy as np
import pytest

from bench import pairs
from bench.pair_room import FEATURES

FEW = 8  # of the pairs, drawn anew where features are added
STILL_WRONG: set[tuple[str, str]] = set()  # see docs/pairs.md


def options(*words):
    parser = argparse.ArgumentParser()
    pairs.add_options(parser)
    return parser.parse_args(words)


@pytest.fixture
def truth():
    chance = np.random.default_rng(1)
    return chance.uniform(0.2, 0.8, (24, 32, 3))


@pytest.mark.parametrize(("factor", "samples", "good"), [
    (1.02, 16, True), (1.04, 16, False), (0.96, 16, False), (1.04, 1, True), (1.15, 1, False),
])  # fmt: skip
def test_the_ratio_of_means_is_bounded_by_samples(truth, factor, samples, good):
    found = pairs.judged(truth * factor, truth, np.zeros_like(truth), samples)
    assert found["good"] is good and found["ratio"] == pytest.approx(factor)
    assert found["blocks"] == pytest.approx((factor - 1) ** 2, rel=0.2)  # a relative error that is the same everywhere


def test_noise_of_single_pixels_counts_little_and_of_a_corner_much(truth):
    noise = np.random.default_rng(2).normal(0.0, 0.2, truth.shape)
    assert pairs.judged(truth + noise - noise.mean(), truth, np.zeros_like(truth), 16)["good"]
    dark = truth.copy()
    dark[:8, :8] = 0
    dark *= truth.mean() / dark.mean()
    assert not pairs.judged(dark, truth, np.zeros_like(truth), 16)["good"]


def test_noise_of_the_reference_is_allowed(truth):
    half = np.kron(np.random.default_rng(3).normal(0.0, 0.1, (6, 8, 1)), np.ones((4, 4, 3)))
    assert not pairs.judged(truth + half, truth, 0 * half, 16)["good"]
    assert pairs.judged(truth + half, truth, half, 16)["good"]


@pytest.mark.parametrize("wrong", [np.full((24, 32, 3), np.nan), np.ones((8, 8, 3))])
def test_pictures_that_cannot_be_compared_are_red(truth, wrong):
    found = pairs.judged(wrong, truth, 0 * truth, 1)
    assert "failed" in found and pairs.colour(found) == pairs.RED


def test_two_black_pictures_are_alike(truth):
    black = np.zeros_like(truth)
    assert pairs.judged(black, black, black, 16)["good"]
    assert not pairs.judged(truth, black, black, 16)["good"]


def test_a_short_reference_allows_nothing(truth):
    """Its own noise is in the error already: what is within bounds all the same needs no longer one."""
    half = np.kron(np.random.default_rng(3).normal(0.0, 0.1, (6, 8, 1)), np.ones((4, 4, 3)))
    assert not pairs.judged(truth + half, truth, half, 16, doubt=0)["good"]
    assert pairs.judged(truth * 1.01, truth, half, 16, doubt=0)["good"]


def test_fireflies_of_a_long_reference_are_no_error_of_the_mean(truth):
    """One block of each reference has a path that found a lamp; by chance both have as much in all."""
    half = np.zeros_like(truth)
    half[:4, :4], half[8:12, 8:12] = 1.0, -1.0
    found = truth + np.abs(half)
    assert not pairs.judged(truth, found, half, 16, doubt=1)["good"]
    assert pairs.judged(truth, found, half, 16, doubt=2)["good"]


def test_what_has_met_least_comes_first():
    every, known = pairs.chosen(options()), {"sun + glass": {}, "glass + mirror": {}}
    order = pairs.rarest_first(every, known)
    assert sorted(order) == sorted(every)
    assert not {"sun", "glass", "mirror"} & {name for names in order[:15] for name in names}
    assert {name for names in order[:80] for name in names} >= set(FEATURES) - set(pairs.DEAR)


def test_what_is_said_is_amber():
    told, silent = ({"good": False, "notes": notes} for notes in (["Object 'A': is left out."], []))
    assert (pairs.colour(told), pairs.colour(silent)) == (pairs.AMBER, pairs.RED)
    assert pairs.colour({"good": True, "notes": ["anything"]}) == pairs.GREEN


def test_what_is_chosen():
    count = len(FEATURES)
    every = pairs.chosen(options())
    assert len(every) == len(set(every)) == count * (count - 1) // 2
    assert len(pairs.chosen(options("--alone"))) == count
    assert pairs.chosen(options("--only", "glass", "sun")) == [("sun", "glass")]
    assert len(pairs.chosen(options("--only", "glass"))) == count - 1
    parts = [pairs.chosen(options("--sample", "20", "--part", f"{k}/3")) for k in (1, 2, 3)]
    assert sorted(one for part in parts for one in part) == sorted(pairs.chosen(options("--sample", "20")))
    assert len(set(pairs.chosen(options("--triples", "9", "--seed", "5"))[0])) == 3
    with pytest.raises(SystemExit, match="There is no feature fogg"):
        pairs.chosen(options("--only", "fogg"))


def test_the_worst_stand_first():
    near = {"16": {"ratio": 1.04, "blocks": 0.01, "good": False, "notes": []}}
    far = {"1": {"ratio": 2.0, "blocks": 0.9, "good": False, "notes": ["said"]}}
    known = {"a + b": near, "a + c": far, "b + c": {"1": {"failed": "no picture"}}}
    assert [row[0] for row in pairs.worst(known)[1:]] == ["b + c", "a + c", "a + b"]
    assert pairs.summary(known)[1:] == [["1", "2", "0", "1", "1"], ["16", "1", "0", "0", "1"]]


SOUND = [one for one in pairs.chosen(options()) if one not in STILL_WRONG]


@pytest.fixture(scope="module")
def stage(registered):
    return pairs._stage()


@pytest.mark.slow
@pytest.mark.parametrize("names", random.Random(61).sample(SOUND, FEW), ids=pairs.key)
def test_pairs_beside_cycles(stage, names, monkeypatch):
    monkeypatch.setattr(pairs, "REFERENCE_SAMPLES", (16, 128))
    found = pairs.measure(stage, names, [1, 16])
    print(pairs.line(names, found))
    assert all(pairs.colour(one) != pairs.RED for one in found.values())


@pytest.mark.slow
def test_a_picture_of_one_wall_has_the_light_of_its_corners(stage):
    """Probes stand on what is seen, here one wall, and see nothing of what it sends to the floor: .984 without
    some of them on the floor."""
    assert pairs.measure(stage, ("orthographic",), [16])["16"]["ratio"] == pytest.approx(1.0, abs=0.01)


def test_blocks_that_show_glass_are_left_out_beside_traced_light():
    image = np.arange(8 * 12 * 3, dtype=float).reshape(8, 12, 3)
    glass = np.zeros_like(image)
    glass[5, 6] = 1.0
    kept = pairs._clear(image, glass)
    assert kept.shape == (4, 20, 3)
    np.testing.assert_array_equal(kept[:, 4:8], image[:4, 4:8])
    np.testing.assert_array_equal(kept[:, 16:], image[4:, 8:])


def test_traced_rooms_are_of_the_page_and_finite():
    from bench import pair_truth

    for names, halves in pair_truth.known().items():
        assert set(names.split(" + ")) <= set(FEATURES)
        assert halves.shape == (2, pairs.SIZE[1], pairs.SIZE[0], 3) and np.isfinite(halves).all() and halves.min() >= 0
