"""Diffuse indirect light of the sample scenes against Cycles' own pass, at 64 samples and the same number of bounces.

The reference is noisy itself: the mean of its two renders is off by about half their difference, `floor`, which adds to
the squared error and is taken off. At 64x48 corners and contact are a larger part of the picture than at 256x192.
"""

from pathlib import Path

import bpy
import pytest

from addon.compare.metrics import compare_radiance
from addon.compare.passes import light_paths
from addon.compare.reference import render_passes

SCENES = Path(__file__).resolve().parents[2] / "sample_blends"
SIZE, SAMPLES, REFERENCE_SAMPLES, BOUNCES = (64, 48), 64, 128, 16
RELMSE, BIAS = 0.01, 0.03
MISSED = {  # measured at 96x72
    "colonnade_hall": "relMSE 0.0103 (multires: 0.006): grain of partly hidden virtual lights",
    "door_ajar": "relMSE 0.012 (multires: 0.008): few virtual lights beyond the gap",
    "window_interior": "relMSE 0.015 to 0.02 (multires: 0.009): few candidates meet the patch of sun",
}

pytestmark = pytest.mark.slow


@pytest.mark.parametrize("scene", ["cornell_box", "sky_courtyard", "emissive_lamp", *MISSED])
def test_diffuse_indirect_light_is_cycles_pass(scene, registered, request):
    if scene in MISSED:
        request.applymarker(pytest.mark.xfail(reason=MISSED[scene]))
    bpy.ops.wm.open_mainfile(filepath=str(SCENES / f"{scene}.blend"))
    candela, first, second = (
        light_paths(
            render_passes(bpy.context.scene, engine, samples, seed, size=SIZE, bounces=BOUNCES).images
        )["diffuse_indirect"]
        for engine, samples, seed in (
            ("CANDELA", SAMPLES, 1), ("CYCLES", REFERENCE_SAMPLES, 1), ("CYCLES", REFERENCE_SAMPLES, 2)
        )
    )  # fmt: skip
    error = compare_radiance(scene, candela, (first + second) / 2, (first - second) / 2)
    assert error.not_finite == error.negative == 0
    assert error.bias == pytest.approx(1.0, abs=BIAS + error.bias_floor), error
    assert error.relmse - error.floor <= RELMSE, error
