"""The screen-space bounce against Cycles' own pass, one reflection in the Cornell box: the bias that it declares.

With rays it is what patches at edges leave. By the screen alone, the far sides of the blocks and all before the camera
send nothing.
"""

from pathlib import Path

import bpy
import pytest

from addon.compare.metrics import compare_radiance
from addon.compare.passes import light_paths
from addon.compare.reference import render_passes

CORNELL_BOX = Path(__file__).resolve().parents[2] / "sample_blends" / "cornell_box.blend"

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(("rays", "relmse", "bias"), [(True, 0.09, (0.93, 1.05)), (False, 0.25, (0.5, 0.8))])
def test_one_bounce_on_the_screen_leaves_the_bias_that_it_declares(rays, relmse, bias, registered):
    bpy.ops.wm.open_mainfile(filepath=str(CORNELL_BOX))
    settings = bpy.context.scene.candela
    settings.slot_indirect, settings.ssdo_rays = "ssdo", rays
    candela, first, second = (
        light_paths(render_passes(bpy.context.scene, engine, samples, seed, size=(64, 48), bounces=1).images)[
            "diffuse_indirect"
        ]
        for engine, samples, seed in (("CANDELA", 32, 1), ("CYCLES", 128, 1), ("CYCLES", 128, 2))
    )
    error = compare_radiance("cornell_box", candela, (first + second) / 2, (first - second) / 2)
    assert error.not_finite == error.negative == 0
    assert bias[0] < error.bias < bias[1], error
    assert error.relmse - error.floor <= relmse, error
