"""What the table of biases shows of pictures whose light is known, and which rows it takes."""

import argparse

import numpy as np
import pytest

from bench.bias import HEAD, SIZE, command, lights, rows_of_scene, seeds_of


def test_light_is_the_mean_luminance_of_each_path():
    grey, none = np.full((3, 4, 3), 0.5), np.zeros((3, 4, 4))
    found = lights(grey, {"diffuse_direct": none, "direct_light": grey})
    assert found == pytest.approx({"combined": 0.5, "diffuse_direct": 0.0})


def test_rows_leave_out_paths_without_light_and_say_standard_errors():
    truth = {"combined": 2.0, "diffuse_direct": 1.0, "glossy_direct": 0.01}
    found = {1: [{"combined": 2.0, "diffuse_direct": x} for x in (0.98, 1.0, 1.02)]}
    rows = list(rows_of_scene("a room", found, truth, {"combined": -0.02}))
    assert rows == [
        ["a room", "combined", "1.00", "0.010", "1.000 ± 0.000", "", "", ""],
        ["a room", "diffuse direct", "0.50", "0.000", "1.000 ± 0.012", "", "", ""],
    ]


def test_rows_have_a_cell_for_each_column_but_the_commit():
    (row,) = rows_of_scene("a room", {}, {"combined": 1.0}, {})
    assert len([*row, "commit"]) == len(HEAD)


@pytest.mark.parametrize(("samples", "size"), [([1], SIZE), ([1, 2, 4, 16], (64, 48))])
def test_a_page_takes_no_rows_with_blank_columns_or_of_another_size(samples, size):
    with pytest.raises(ValueError, match="leave --page out"):
        command(argparse.Namespace(page=True, samples=samples, size=size))


def test_pictures_of_many_samples_have_fewer_seeds():
    assert [seeds_of(samples, 8) for samples in (1, 2, 4, 16)] == [8, 8, 8, 3]
