"""Grass on a hill beside blades that stand on it, by Cycles."""

import pytest

from bench import grass as figures


def test_the_outline_of_a_hill_is_that_of_blades(registered):
    found = {}
    for engine in ("CANDELA", "CYCLES"):
        figures.hill(engine == "CANDELA")
        found[engine] = figures.outline_of(engine, 16, 11.0, None)
    assert found["CANDELA"].mean() == pytest.approx(found["CYCLES"].mean(), rel=0.05)
    assert found["CANDELA"].std() > 0.5 * found["CYCLES"].std()  # figures of more places: docs/grass.md
