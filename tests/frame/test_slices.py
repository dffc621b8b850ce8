"""Slices of a picture's samples, and what they are put together to."""

from dataclasses import replace

import numpy as np
import pytest

from addon.cli.slices import bounds
from addon.compare.exr_write import read_about, write_exr
from addon.frame.settings import Settings
from addon.frame.slices import Slice, merged
from addon.snapshot.exr import ExrError, read_exr

TOTAL = 10


def piece(first, count, size=(3, 2), **more):
    """A slice whose light is the sum of its samples' numbers."""
    height, width = size
    light = np.full((height, width, 4), sum(range(first, first + count)), np.float32)
    half = sum(range(first, min(first + count, TOTAL // 2)))
    images = {
        "film.diffuse_direct": light,
        "denoise.diffuse_direct_half": np.full_like(light, half if first < TOTAL // 2 <= first + count else 77),
        "film.depth": np.full_like(light, 5),
        "surface.position": np.full_like(light, first),
    }
    return Slice(first, count, TOTAL, images | more)


@pytest.mark.parametrize("ends", [(10,), (5, 10), (3, 7, 10), (1, 2, 10), (4, 5, 6, 10)])
def test_sums_are_those_of_all_samples_and_of_the_first_half(ends):
    starts = (0, *ends[:-1])
    found = merged([piece(a, b - a) for a, b in zip(starts, ends)][::-1])
    assert (found["film.diffuse_direct"] == 45).all()
    assert (found["denoise.diffuse_direct_half"] == 10).all()
    assert (found["film.depth"] == 5).all()
    assert (found["surface.position"] == starts[-1]).all()


@pytest.mark.parametrize(
    ("slices", "words"),
    [
        ([piece(0, 4), piece(6, 4)], "Samples 4 to 5 of 10 are missing"),
        ([piece(2, 8)], "Samples 0 to 1 of 10 are missing"),
        ([piece(0, 4)], "Samples 4 to 9 of 10 are missing"),
        ([piece(0, 6), piece(4, 6)], "Samples 4 to 5 are in more than one slice"),
        ([piece(0, 5), piece(0, 5), piece(5, 5)], "Samples 0 to 4 are in more than one slice"),
        ([piece(0, 5), piece(5, 5, size=(4, 4))], "different sizes: 2 × 3 and 4 × 4"),
        ([piece(0, 5), replace(piece(5, 5), total=12)], "pictures of 10 and of 12 samples"),
        ([piece(0, 5), piece(5, 5, extra=np.zeros((3, 2, 4), np.float32))], "extra are not in all"),
    ],
)
def test_what_is_no_whole_picture_is_refused(slices, words):
    with pytest.raises(ValueError, match=words):
        merged(slices)


@pytest.mark.parametrize(("total", "parts"), [(16, 4), (10, 3), (7, 7), (65, 8)])
def test_parts_are_all_samples_once_and_about_equal(total, parts):
    found = [bounds(f"{k}/{parts}", total) for k in range(1, parts + 1)]
    assert [n for first, count in found for n in range(first, first + count)] == list(range(total))
    counts = [count for _, count in found]
    assert max(counts) - min(counts) <= 1


@pytest.mark.parametrize("text", ["0/4", "5/4", "4", "a/b", "1/0", "-1/4"])
def test_what_is_no_part_is_refused(text):
    with pytest.raises(ValueError, match="no slice"):
        bounds(text, 16)


@pytest.mark.parametrize(
    ("offset", "count", "drawn", "is_slice"),
    [(0, 0, 16, False), (0, 16, 16, False), (4, 0, 12, True), (12, 8, 4, True), (16, 0, 0, True), (3, 5, 5, True)],
)
def test_samples_that_are_drawn(offset, count, drawn, is_slice):
    settings = Settings(samples=16, sample_offset=offset, sample_count=count)
    assert (settings.samples_to_draw, settings.is_slice) == (drawn, is_slice)


@pytest.mark.parametrize("size", [(1, 1), (37, 21), (16, 8)])
def test_a_written_file_is_read_back_exactly(tmp_path, size):
    height, width = size
    numbers = np.random.default_rng(3)
    layers = {
        "View.Layer.sum film.diffuse_direct": numbers.normal(size=(height, width, 4)).astype(np.float32),
        "A name that is much longer than thirty-one bytes.sum x": np.full((height, width, 4), np.inf, np.float32),
        "L.Depth": numbers.uniform(0, 1e10, (height, width, 1)).astype(np.float32),
    }
    about = {"candela": '{"text": "ü × 3"}'}
    write_exr(tmp_path / "a.exr", layers, about)
    found = read_exr(tmp_path / "a.exr")
    assert found.keys() == layers.keys()
    for name, pixels in layers.items():
        np.testing.assert_array_equal(found[name], pixels)
    assert read_about(tmp_path / "a.exr") == about
    openexr = pytest.importorskip("OpenEXR")
    with openexr.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
        other = file.channels()["L.Depth.R"].pixels
    np.testing.assert_array_equal(other[::-1], layers["L.Depth"][..., 0])


def test_a_file_that_is_no_exr_says_so(tmp_path):
    (tmp_path / "a.exr").write_bytes(b"nothing of the kind")
    with pytest.raises(ExrError, match="not an OpenEXR"):
        read_about(tmp_path / "a.exr")
