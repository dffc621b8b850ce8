"""Clustered visibility beside traced visibility of the same virtual lights."""

from pathlib import Path

import bpy
import numpy as np
import pytest

from tests.techniques.test_clustered_visibility import diffuse_indirect

SCENES = Path(__file__).resolve().parents[2] / "sample_blends"

pytestmark = pytest.mark.slow


@pytest.fixture
def room(registered):
    """Renders a sample scene by one sample, and its measure: every virtual light traced from every pixel."""

    def room(name):
        bpy.ops.wm.open_mainfile(filepath=str(SCENES / f"{name}.blend"))
        scene = bpy.context.scene

        def render(technique="clustered_visibility", virtual_lights=512, levels=0, **params):
            return diffuse_indirect(
                scene, 16, 1, (64, 48), technique, virtual_lights=virtual_lights, levels=levels, **params
            )

        return render, render("multires_radiosity", rays=1024)

    return room


def rms(pixels, traced):
    return float(np.sqrt(((pixels - traced) ** 2).mean()) / traced.mean())


def test_more_clusters_are_nearer_to_traced_visibility(room):
    """Unshadowed, the same virtual lights are off by a quarter."""
    render, traced = room("cornell_box")
    assert rms(render("multires_radiosity", rays=0), traced) > 0.2
    errors = [rms(render(clusters=count, rays=0), traced) for count in (2, 8, 64, 256)]
    assert errors == sorted(errors, reverse=True)
    assert errors[2] < 0.08
    assert errors[3] < 0.06
    assert rms(render(rays=0, clusters=64, shadows="CONVOLUTION"), traced) < 0.10


def test_rays_take_back_what_few_clusters_leak_through_a_door(room):
    """The virtual lights stand beyond a door ajar: what one of a cluster sees the others do not."""
    render, traced = room("door_ajar")
    leaking, corrected = render(clusters=16, rays=0), render(clusters=16, rays=16)
    assert leaking.mean() > 1.1 * traced.mean()
    assert corrected.mean() == pytest.approx(traced.mean(), rel=0.03)
    assert rms(corrected, traced) < 0.8 * rms(leaking, traced)
