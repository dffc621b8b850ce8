"""Scenes as people make them, each beside Cycles: the stage of the technique tests, and how pictures are compared."""

import numpy as np
import pytest

from addon.compare.reference import render_passes
from tests.techniques.conftest import kept_stage, stage  # noqa: F401

REFERENCE_SAMPLES = 64


def agree(own, expected, relative=0.06, absolute=0.02):
    """Assert that values agree as the cases ask: within 6 % and 0.02."""
    own, expected = np.asarray(own, float), np.asarray(expected, float)
    assert own.shape == expected.shape
    off = np.abs(own - expected) - (relative * np.abs(expected) + absolute)
    assert (off <= 0).all(), f"{own.round(3).tolist()} is not {expected.round(3).tolist()}"


@pytest.fixture
def beside(stage):  # noqa: F811
    """A function that renders the stage with both engines: (Candela's passes, Cycles' passes)."""

    def render(samples=16, size=(32, 32), bounces=None, reference=REFERENCE_SAMPLES):
        own = render_passes(stage.scene, "CANDELA", samples, 1, size=size, bounces=bounces).images
        cycles = render_passes(stage.scene, "CYCLES", reference, 1, size=size, bounces=bounces).images
        assert all(np.isfinite(pixels).all() for pixels in own.values())
        return own, cycles

    return render
