"""Volume caustics against light tracing: the specification's scenes W1 to W4 (bench/shafts.py)."""

import numpy as np
import pytest

from bench import shafts


@pytest.mark.slow
@pytest.mark.parametrize("name", shafts.TRUTHS)
def test_the_profile_of_a_shaft_is_within_a_tenth_of_its_peak(registered, monkeypatch, name):
    monkeypatch.setattr(shafts, "TRACED", 4000)
    seen, truth, shown, _ = shafts.profiles(name, rays=64, samples=2, size=48)
    error, energy = shafts.figures(seen, truth)
    assert np.isfinite(shown).all() and (shown >= 0).all()
    assert error < 0.10
    assert energy == pytest.approx(1.0, abs=0.05)
