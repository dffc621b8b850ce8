"""Hashes of names against published values; pairs of ids and weights ranked and merged."""

import json

import numpy as np
import pytest

from addon.kernels.ranks import id_bits, ids_of, manifest, merged, murmur_hash, ranked


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("", 0),
        ("hello", 0x248BFA47),
        ("Hello, world!", 0xC0363E43),
        ("The quick brown fox jumps over the lazy dog", 0x2E4FF723),
    ],
)
def test_hashes_are_those_of_murmur3(text, value):
    assert murmur_hash(text) == value


def test_ids_are_ordinary_floats_and_the_manifest_tells_their_bits():
    names = [f"object {k}" for k in range(3000)]
    ids = ids_of(names)
    assert np.isfinite(ids).all() and (np.abs(ids) >= np.finfo(np.float32).tiny).all()
    told = json.loads(manifest(names))
    assert all(int(told[name], 16) == bits for name, bits in zip(names, ids.view(np.uint32)))
    assert any(id_bits(name) != murmur_hash(name) for name in names)


def pairs(*given):
    """One pixel's images of (id, weight) pairs, two in each."""
    flat = np.array(given, np.float32).reshape(1, 1, -1)
    return [flat[..., k : k + 4] for k in range(0, flat.shape[-1], 4)]


def test_weights_of_slices_are_added_by_id_and_not_by_rank():
    one = pairs((5.0, 3.0), (7.0, 2.0), (9.0, 1.0), (0.0, 0.0))
    other = pairs((7.0, 4.0), (11.0, 0.5), (5.0, 0.25), (0.0, 0.0))
    found = np.concatenate(merged([one, other]), axis=-1).reshape(-1, 2)
    np.testing.assert_allclose(found, [(7.0, 6.0), (5.0, 3.25), (9.0, 1.0), (11.0, 0.5)])


def test_the_lightest_have_no_room():
    one, other = pairs((5.0, 3.0), (7.0, 2.0)), pairs((9.0, 4.0), (7.0, 0.5))
    np.testing.assert_allclose(np.concatenate(merged([one, other]), -1).reshape(-1, 2), [(9.0, 4.0), (5.0, 3.0)])


def test_ranking_sorts_each_pixel():
    found = np.concatenate(ranked(pairs((5.0, 1.0), (0.0, 0.0), (6.0, 4.0), (7.0, 2.0))), -1).reshape(-1, 2)
    np.testing.assert_allclose(found, [(6.0, 4.0), (7.0, 2.0), (5.0, 1.0), (0.0, 0.0)])
