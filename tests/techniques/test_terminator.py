"""Smooth-shaded surfaces of few triangles are lit up to where a curved one would be, as by Cycles."""

import numpy as np
import pytest

from addon.compare.reference import render_passes
from tests.techniques.test_shadows import irradiance

SIZE = (96, 96)
LOW_SUN = (0, 1.2, 0)
OUTLINE = 8  # pixels of an outline whose centres one finds on the ball and the other does not


def ball(stage, segments=8, rings=6, smooth=True, **placement):
    """A sphere of one metre and few faces."""
    turns = np.arange(segments) * 2 * np.pi / segments
    heights = np.pi * np.arange(1, rings) / rings
    places = [(np.sin(h) * np.cos(t), np.sin(h) * np.sin(t), np.cos(h)) for h in heights for t in turns]
    top, bottom = len(places), len(places) + 1
    faces = []
    for k in range(segments):
        after = (k + 1) % segments
        faces += [(top, k, after), (bottom, top - segments + after, top - segments + k)]
        faces += [
            (r * segments + k, r * segments + segments + k, r * segments + segments + after, r * segments + after)
            for r in range(rings - 2)
        ]
    made = stage.mesh([*places, (0, 0, 1), (0, 0, -1)], faces, material=stage.diffuse(0.8), **placement)
    made.data.shade_smooth() if smooth else made.data.shade_flat()
    return made


@pytest.fixture
def lit(stage):
    stage.camera_above(span=2.4)
    stage.light("SUN", turn=LOW_SUN, angle=0.0)
    return stage


def by_cycles(stage):
    return render_passes(stage.scene, "CYCLES", 16, 1, True, SIZE).images["diffuse_direct"][..., 0] * np.pi


def off(found, expected):
    """Pixels that differ by more than a hundredth of the brightest."""
    return int((abs(found - expected) > 0.01 * expected.max()).sum())


@pytest.mark.parametrize("scale", [1, -1, 1e-3, 1e4])
def test_light_ends_where_it_does_by_cycles(lit, scale):
    made = ball(lit, scale=(scale, abs(scale), abs(scale)))
    camera = lit.scene.camera
    camera.data.ortho_scale, camera.location.z = 2.4 * abs(scale), 10 * abs(scale)
    camera.data.clip_start, camera.data.clip_end = 0.1 * abs(scale), 100 * abs(scale)
    expected = by_cycles(lit)
    assert off(irradiance(lit, 1, SIZE), expected) < OUTLINE
    made.shadow_terminator_geometry_offset = 0.0
    assert off(by_cycles(lit), expected) > 10 * OUTLINE
    assert off(irradiance(lit, 1, SIZE), by_cycles(lit)) < OUTLINE


@pytest.mark.parametrize("kind", ["POINT", "SPOT", "AREA"])
@pytest.mark.parametrize("technique", ["AUTO", "accumulated_maps", "vssm", "cssm"])
def test_so_it_does_by_any_technique_and_lamp(stage, kind, technique):
    stage.camera_above(span=2.4)
    stage.light(kind, (6, 0, 2.4), turn=LOW_SUN)
    stage.scene.candela.slot_shadow = technique
    made = ball(stage)
    expected = by_cycles(stage)
    with_offset = off(irradiance(stage, 16, SIZE), expected)
    made.shadow_terminator_geometry_offset = 0.0
    without = off(irradiance(stage, 16, SIZE), expected)
    assert with_offset < OUTLINE
    assert without > 10 * OUTLINE


@pytest.mark.parametrize("fine", [False, True])
def test_flat_faces_are_as_without_and_fine_ones_nearly(lit, fine):
    made = ball(lit, 128, 96) if fine else ball(lit, smooth=False)
    found = irradiance(lit, 1, SIZE)
    made.shadow_terminator_geometry_offset = 0.0
    assert off(found, irradiance(lit, 1, SIZE)) <= (2 if fine else 0)


def test_other_things_still_cast_their_shadow_there(lit):
    """The ray begins beside the surface, not beyond what stands next to it."""
    ball(lit)
    open_light = irradiance(lit, 1, SIZE)
    lit.blocker((-5, -5), (5, 0.0), 1.6)
    found = irradiance(lit, 1, SIZE)
    shaded = np.zeros(SIZE, bool)
    shaded[:40] = True
    assert found[shaded & (open_light > 0)].max() < 1e-3 * open_light.max()
