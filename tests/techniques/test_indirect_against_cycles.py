"""Diffuse indirect light of the sample scenes against Cycles' own pass, at 64 samples and the same number of bounces.

The reference is noisy itself: the mean of its two renders is off by about half their difference, `floor`, which adds to
the squared error and is taken off. That is not all of its part: errors are relative to its own pixels, and where few
paths find the light most of those are too dark. In the window sample at 96x72, 2048 samples instead of 256 in each
render take the same picture from relMSE 0.037 to 0.021. At 64x48 corners and contact are a larger part of the picture
than at 256x192.
"""

from pathlib import Path

import bpy
import numpy as np
import pytest

from addon.compare.metrics import compare_radiance
from addon.compare.passes import light_paths
from addon.compare.reference import render_passes
from addon.sampling import sequence

SCENES = Path(__file__).resolve().parents[2] / "sample_blends"
SIZE, SAMPLES, REFERENCE_SAMPLES, BOUNCES = (64, 48), 64, 128, 16
RELMSE, BIAS = 0.01, 0.03
MISSED = {  # net of the floor; at 96x72 unless said otherwise
    "colonnade_hall": "relMSE 0.011 against 2 x 256 samples, 0.025 here (512 virtual lights: 0.009)",
    "door_ajar": "relMSE 0.087 against 2 x 256 samples, 0.31 here beside a floor of 0.22; no longer reference yet",
    "window_interior": "relMSE 0.015 against 2 x 2048 samples (512 lights: 0.010), 0.085 here, floor 0.1",
}

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module", params=["cornell_box", "sky_courtyard", "emissive_lamp", *MISSED])
def error(request, registered):
    bpy.ops.wm.open_mainfile(filepath=str(SCENES / f"{request.param}.blend"))
    candela, first, second = (
        light_paths(
            render_passes(bpy.context.scene, engine, samples, seed, size=SIZE, bounces=BOUNCES).images
        )["diffuse_indirect"]
        for engine, samples, seed in (
            ("CANDELA", SAMPLES, 1), ("CYCLES", REFERENCE_SAMPLES, 1), ("CYCLES", REFERENCE_SAMPLES, 2)
        )
    )  # fmt: skip
    return compare_radiance(request.param, candela, (first + second) / 2, (first - second) / 2)


def test_diffuse_indirect_light_is_finite(error):
    assert error.not_finite == error.negative == 0


def test_diffuse_indirect_light_has_cycles_mean(error):
    assert error.bias == pytest.approx(1.0, abs=BIAS + error.bias_floor), error


def test_diffuse_indirect_light_is_cycles_pass(error, request):
    if error.name in MISSED:
        request.applymarker(pytest.mark.xfail(strict=True, reason=MISSED[error.name]))
    assert error.relmse - error.floor <= RELMSE, error


def test_walls_seen_edge_on_do_not_outshine_themselves(registered, monkeypatch):
    """Rays that graze a wall stand for areas larger than the town. What faces such a wall from nearby was lit by all of
    it: with these film points one pixel has four hundred thousand times the light of Cycles' brightest."""
    monkeypatch.setattr(sequence, "_FILM_DIRECTIONS", sequence._DIRECTIONS[3:5])
    sequence._block.cache_clear()
    bpy.ops.wm.open_mainfile(filepath=str(SCENES / "instances.blend"))
    images = render_passes(bpy.context.scene, "CANDELA", 8, 2, size=(128, 96), bounces=16).images
    sequence._block.cache_clear()
    light = light_paths(images)["diffuse_indirect"]
    assert light.max() < 100 * light.mean()


@pytest.mark.parametrize("roughness", [0.0, 1.0])
def test_light_goes_round_a_closed_room_as_in_cycles(stage, roughness):
    """Rough surfaces reflect less than their albedo to most directions, at every bounce."""
    corners = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (0, 2)]
    faces = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    stage.mesh(corners, faces, material=stage.diffuse(0.6, roughness))
    stage.light("AREA", (0, 0, 1.9), size=0.5, energy=20)
    stage.camera((0.9, 0.9, 1.0), (np.pi / 2, 0, 3 * np.pi / 4), angle=1.5)
    pictures = (stage.render(n, (32, 32), engine=e, bounces=4) for n, e in ((64, "CANDELA"), (512, "CYCLES")))
    ours, theirs = (picture["diffuse_indirect"].mean() for picture in pictures)
    assert ours == pytest.approx(theirs, rel=0.02)
