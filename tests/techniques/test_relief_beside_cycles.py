"""Scenes of `python -m bench relief`, smaller: relief and displaced meshes beside Cycles' displaced meshes."""

import pytest

from bench import relief as figures


@pytest.mark.slow
@pytest.mark.parametrize("name", ["stones", "box", "cylinder"])
def test_relief_is_what_cycles_displaces(registered, name, monkeypatch):
    """Away from edges, at outlines, and where a box stands in it; and so are the moved vertices of a fine mesh."""
    monkeypatch.setattr(figures, "SIZE", (64, 48))
    monkeypatch.setattr(figures, "OWN_SAMPLES", {"SUN": 16})
    monkeypatch.setattr(figures, "REFERENCE_SAMPLES", {"SUN": 16})
    found = dict(figures.errors(name, "SUN"))
    for label, one in found.items():
        assert one.away <= 0.03, label
        assert one.outline <= 1.0, label
        if name == "box":
            assert one.intersection <= 1.0, label
    assert found["mesh"].away < 1e-3
