"""Figures of light below surfaces: processor seconds for equal error, bias and noise."""

import numpy as np
import pytest

from bench import markdown, subsurface, subsurface_split


def row(label, error, seconds):
    return "leaf", "BURLEY", label, error, "1 1 1", seconds, "0.0010"


def test_denoised_cycles_is_asked_for_the_least_that_errs_no_more():
    rows = [
        row("Candela 1", "0.0150", "0.10"), row("Candela 16", "0.0010", "0.90"),
        row("Cycles denoised 4", "0.0200", "0.05"),
        row("Cycles denoised 16", "0.0070", "0.11"), row("Cycles denoised 64", "0.0030", "0.33"),
    ]  # fmt: skip
    one, sixteen = subsurface.equal(rows)
    assert one[2:] == ("1", "0.0150", "0.10", "16 samples, 0.0070", "0.11")
    assert sixteen[2:] == ("16", "0.0010", "0.90", "none of these", "–")


def test_noise_and_bias_are_told_apart_whatever_the_noise_of_the_references():
    random = np.random.default_rng(1)
    right = np.full((64, 64, 3), 2.0)
    pictures = np.stack([right * 1.1 + random.normal(0.0, 0.5, right.shape) for _ in range(8)])
    references = np.stack([right + random.normal(0.0, 0.3, right.shape) for _ in range(4)])
    noise, bias = subsurface_split.parts_of_error(pictures, references)
    scale = 2.0**2 + 0.2**2
    assert abs(noise * scale / 0.5**2 - 1.0) < 0.05
    assert abs(bias * scale / 0.2**2 - 1.0) < 0.1
    ratio, of_pictures, of_references = subsurface_split.means_of(pictures, references)
    assert [float(one) for one in ratio.split()] == pytest.approx([1.1] * 3, abs=0.01)
    assert float(of_pictures.split()[0]) < 1.0 and float(of_references.split()[0]) < 1.0


def test_a_run_of_one_scene_leaves_the_rows_of_others(tmp_path):
    """Which keep the commit at which they were made."""

    def rows(scene, error, commit="0123456789"):
        cells = ("1.000 1.000 1.000", "0.10", "0.0010", commit)
        return [(scene, "BURLEY", f"Candela {n}", error, *cells) for n in (1, 16)]

    file = tmp_path / "page.md"
    file.write_text(f"{markdown.begin(subsurface.COMMAND)}\n{markdown.END}\n")
    size, reference = (32, 24), 256
    before = [*rows("ears", "0.5000"), *rows("grapes", "0.0400")]
    markdown.put_between(file, subsurface.COMMAND, subsurface.page_through(before, size, reference))
    page, again = file.read_text(), rows("ears", "0.2000", "abcdef0123")
    assert subsurface.with_others(page, again, size, reference) == [*again, *before[2:]]
    assert subsurface.with_others(page, again, (64, 48), reference) == again
