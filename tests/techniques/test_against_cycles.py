"""Direct light of sample scenes against Cycles, path by path, at a quarter of the pixels of the project's target.

The target is a relMSE of 0.003 at 256x192 and 64 samples. Here the depth maps have as many texels as there, and the
bound is 0.004, since at half the resolution twice as large a share of the pixels lies on an edge.
"""

from pathlib import Path

import bpy
import numpy as np
import pytest

from addon.compare.metrics import compare_radiance
from addon.compare.passes import light_paths
from addon.compare.reference import render_passes
from addon.frame.technique import identifier
from addon.lighting.visibility import RESOLUTION
from addon.techniques import REGISTRY

SCENES = Path(__file__).resolve().parents[2] / "sample_blends"
SIZE = (128, 96)
PATHS = ("diffuse_direct", "glossy_direct", "emission", "environment")
RELMSE, BIAS = 0.004, 0.01
TEXELS_PER_PIXEL = 4.0  # 512 texels, as many as by default at 256x192

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module", params=["cornell_box", "soft_shadow_garden"])
def errors(request, registered):
    """Per light path, the error of Candela's 64 samples against 512 of Cycles; the noise floor by a second seed."""
    bpy.ops.wm.open_mainfile(filepath=str(SCENES / f"{request.param}.blend"))
    scene = bpy.context.scene
    for technique in REGISTRY:
        if RESOLUTION in technique.params:
            setattr(scene.candela, identifier(technique.name, RESOLUTION.name), TEXELS_PER_PIXEL)
    paths = [
        light_paths(render_passes(scene, engine, samples, seed, direct_only=True, size=SIZE).images)
        for engine, samples, seed in (("CANDELA", 64, 1), ("CYCLES", 512, 1), ("CYCLES", 512, 2))
    ]
    candela, first, second = paths
    return {
        path: compare_radiance(
            path, candela[path], (first[path] + second[path]) / 2, (first[path] - second[path]) / 2
        )
        for path in PATHS
    }  # fmt: skip


@pytest.mark.parametrize("path", PATHS)
def test_a_direct_path_is_cycles_path(errors, path, request):
    if path == "glossy_direct" and "garden" in request.node.name:
        request.applymarker(pytest.mark.xfail(strict=True, reason="relMSE 0.019: single pixels of narrow lobes"))
    error = errors[path]
    assert error.not_finite == error.negative == 0
    assert error.relmse <= max(RELMSE, error.floor), error
    assert error.bias == pytest.approx(1.0, abs=BIAS + error.bias_floor), error


def test_highlight_of_a_whole_lamp_in_one_sample(stage):
    """Rays and points share a highlight; the points of a lamp that is drawn whole count as they are drawn."""
    stage.floor(material=stage.material("ShaderNodeBsdfGlossy", Roughness=0.25))
    stage.rectangle((0.3, 0.3), (0.6, 0.6), 0.4, material=stage.diffuse())
    stage.light("POINT", (0.0, 0.0, 2.0), shadow_soft_size=0.3)
    stage.camera_above(3.0)
    truth = stage.render(256, (48, 48))["glossy_direct"].mean()
    one = np.mean([stage.render(1, (48, 48), seed=seed)["glossy_direct"].mean() for seed in range(4)])
    np.testing.assert_allclose(one, truth, rtol=0.1)
