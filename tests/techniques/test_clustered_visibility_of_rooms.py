"""Clustered visibility beside traced visibility of the same virtual lights."""

from pathlib import Path

import bpy
import numpy as np
import pytest

from tests.techniques.test_clustered_visibility import diffuse_indirect

CORNELL_BOX = Path(__file__).resolve().parents[2] / "sample_blends" / "cornell_box.blend"


@pytest.fixture
def cornell_box(registered):
    bpy.ops.wm.open_mainfile(filepath=str(CORNELL_BOX))
    return bpy.context.scene


@pytest.mark.slow
def test_more_clusters_are_nearer_to_traced_visibility(cornell_box):
    """The same virtual lights, all of them traced; unshadowed they differ by a quarter."""
    size, light = (64, 48), {"virtual_lights": 512, "levels": 0}
    traced = diffuse_indirect(cornell_box, 16, 1, size, "multires_radiosity", rays=1024, **light)
    unshadowed = diffuse_indirect(cornell_box, 16, 1, size, "multires_radiosity", rays=0, **light)

    def rms(pixels):
        return float(np.sqrt(((pixels - traced) ** 2).mean()) / traced.mean())

    errors = [rms(diffuse_indirect(cornell_box, 16, 1, size, clusters=count, **light)) for count in (2, 8, 64, 256)]
    assert rms(unshadowed) > 0.2
    assert errors == sorted(errors, reverse=True)
    assert errors[2] < 0.08
    assert errors[3] < 0.06
    by_means = diffuse_indirect(cornell_box, 16, 1, size, clusters=64, shadows="CONVOLUTION", **light)
    assert rms(by_means) < 0.10
