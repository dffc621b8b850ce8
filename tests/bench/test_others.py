"""Files of other people: what is said of a file, and of one that ends its process."""

import argparse
import subprocess
from pathlib import Path

import numpy as np
import pytest

from bench import others

ROOT = Path(__file__).resolve().parents[2]
SAMPLE = ROOT / "sample_blends" / "hdri_product.blend"
OPTIONS = argparse.Namespace(samples=2, reference_samples=8, size=(16, 12), tolerance=0.5, limit=600.0)
REPOSITORY = {"name": "someone/something"}


@pytest.mark.slow
def test_a_file_is_compared_in_a_process_of_its_own():
    row = others.row_of(REPOSITORY, ROOT, SAMPLE, OPTIONS)
    assert row.state == "alike", row
    assert 0.8 < row.mean < 1.25 and row.seconds > 0  # of 2 samples beside 8


@pytest.mark.slow
def test_a_process_that_ends_or_hangs_is_a_row(monkeypatch, tmp_path):
    broken = tmp_path / "broken.blend"
    broken.write_bytes(b"BLENDER")
    row = others.row_of(REPOSITORY, tmp_path, broken, OPTIONS)
    assert row.state.startswith("Blender cannot open it") and row.path == "broken.blend"
    ended = subprocess.CompletedProcess([], -11, "", "")
    monkeypatch.setattr(others.subprocess, "run", lambda *_, **__: ended)
    assert others.row_of(REPOSITORY, tmp_path, broken, OPTIONS).state == "ended without an answer (exit code -11)"

    def slow(*_, **__):
        raise subprocess.TimeoutExpired("", 5)

    monkeypatch.setattr(others.subprocess, "run", slow)
    assert others.row_of(REPOSITORY, tmp_path, broken, OPTIONS).state == "not done in 600 s"


def test_the_page_counts_and_names_every_file():
    name = others.repositories()[0]["name"]
    rows = [
        others.Row(name, "a.blend", "alike", 0.001, 1.0),
        others.Row(name, "b.blend", "off", 0.3, 1.2, ["diffuse_indirect +20.0%"], ["left out"]),
        others.Row(name, "c.blend", "ended without an answer (exit code -11)"),
    ]
    text = others.page(rows, OPTIONS)
    assert "3 files" in text and "2 could be compared; 1 have" in text and "1 ended Blender" in text
    assert text.index("b.blend") < text.index("a.blend") < text.index("c.blend")


def test_every_repository_is_named_by_a_whole_commit():
    for one in others.repositories():
        assert len(one["commit"]) == 40 and int(one["commit"], 16) and one["about"]


def test_a_light_path_that_is_off_is_named_though_the_pictures_error_is_small():
    def images(combined, glossy):
        return {"combined": np.full((4, 6, 4), combined), "glossy_direct": np.full((4, 6, 3), glossy)}

    first, second = images(1.0, 0.10), images(1.0, 0.10)
    assert others.paths_that_differ(images(1.0, 0.15), first, second) == ["glossy_direct +5.0%"]
    assert others.paths_that_differ(images(1.0, 0.11), first, second) == []  # a hundredth of the light
    noisy = images(1.0, 0.14)  # the references differ by 4 %: nothing within 8 % more can be told
    assert others.paths_that_differ(images(1.0, 0.19), first, noisy) == []
