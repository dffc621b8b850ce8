"""Depth of field: the blur of a point is the aperture's image (thin lens), and Cycles' own pictures."""

import numpy as np
import pytest

SIZE = (48, 48)
ANGLE = 0.6
FOCUS = 5.0


def camera(stage, fstop=0.5, **dof):
    placed = stage.camera((0, 0, 10), (0, 0, 0), angle=ANGLE)
    placed.data.dof.use_dof = True
    placed.data.dof.focus_distance = FOCUS
    placed.data.dof.aperture_fstop = fstop
    for name, value in dof.items():
        setattr(placed.data.dof, name, value)
    return placed.data


def lamp(stage, half, z):
    material = stage.material("ShaderNodeEmission", Strength=1.0)
    return stage.rectangle((-half, -half), (half, half), z, material=material)


def moments(picture):
    """Sum, mean place and variance per axis of a picture's brightness, in pixels."""
    weight = picture[..., 0].astype(np.float64)
    y, x = np.mgrid[0 : SIZE[1], 0 : SIZE[0]]
    total = weight.sum()
    mean = np.array([(weight * x).sum(), (weight * y).sum()]) / total
    spread = np.array([(weight * (x - mean[0]) ** 2).sum(), (weight * (y - mean[1]) ** 2).sum()]) / total
    return total, mean, spread


@pytest.mark.slow
@pytest.mark.parametrize("z", [2.0, 7.0], ids=["behind the focus", "before it"])
@pytest.mark.parametrize(("blades", "ratio"), [(0, 1.0), (0, 2.0), (4, 1.0)])
def test_a_blurred_lamp_spreads_as_the_aperture_does(stage, z, blades, ratio):
    """A disc of radius R adds R^2/4 to the variance on each axis, a square with corners at R adds R^2/6."""
    half = 0.25
    lens = camera(stage, fstop=0.1, aperture_blades=blades, aperture_ratio=ratio)
    lamp(stage, half, z)
    # Without a filter the lamp's sides fall between pixels: its sum settles at up to 1.6 % less.
    total, mean, spread = moments(stage.render(1024, SIZE)["emission"])
    distance = 10.0 - z
    per_tangent = SIZE[0] / (2.0 * np.tan(0.5 * ANGLE))
    radius = 0.001 * lens.lens / (2 * lens.dof.aperture_fstop) * abs(1 / distance - 1 / FOCUS) * per_tangent
    side = 2 * half / distance * per_tangent
    width = radius**2 / (4.0 if blades == 0 else 6.0)
    np.testing.assert_allclose(total, side**2, rtol=0.02)
    np.testing.assert_allclose(mean, 23.5, atol=0.05)
    np.testing.assert_allclose(spread, np.array([width / ratio**2, width]) + side**2 / 12, rtol=0.03, atol=0.05)


def test_the_plane_in_focus_stays_sharp(stage):
    lens = camera(stage, fstop=0.1)
    lamp(stage, 0.7, 10.0 - FOCUS)
    blurred = stage.render(16, SIZE)["emission"]
    lens.dof.use_dof = False
    np.testing.assert_allclose(blurred, stage.render(16, SIZE)["emission"], atol=1e-5)


def test_an_orthographic_camera_blurs_as_by_cycles(stage):
    for k in range(5):
        lamp(stage, 0.4, 2.0 * k).location.x = 1.5 * k - 3
    placed = stage.camera_above(8.0)
    placed.rotation_euler.y = 0.2
    placed.data.dof.use_dof, placed.data.dof.focus_distance, placed.data.dof.aperture_fstop = True, FOCUS, 1.0
    expected = stage.render(1024, SIZE, engine="CYCLES")["emission"]
    found = stage.render(256, SIZE)["emission"]
    placed.data.dof.use_dof = False
    assert np.abs(stage.render(256, SIZE)["emission"] - expected).max() > 0.3
    assert np.sqrt(np.mean((found - expected) ** 2)) < 0.01


def test_the_focus_object_wins_over_the_distance(stage):
    lens = camera(stage, fstop=0.1, focus_object=stage.link("Target", None, (3, 1, 10 - FOCUS)))
    lens.dof.focus_distance = 1.0
    lamp(stage, 0.7, 10.0 - FOCUS)
    blurred = stage.render(8, SIZE)["emission"]
    lens.dof.use_dof = False
    np.testing.assert_allclose(blurred, stage.render(8, SIZE)["emission"], atol=1e-5)


@pytest.mark.slow
def test_blades_turn_and_stretch_as_in_cycles(stage):
    camera(stage, fstop=0.03, aperture_blades=3, aperture_rotation=0.4, aperture_ratio=1.5)
    lamp(stage, 0.1, 7.0)
    ours, theirs = (stage.render(n, SIZE, engine=e)["emission"] for n, e in ((256, "CANDELA"), (2048, "CYCLES")))
    assert np.abs(ours - theirs).sum() < 0.1 * theirs.sum()


@pytest.mark.slow
def test_direct_light_out_of_focus_is_cycles(stage):
    """Poles before and behind the focus over a floor, their shadows cast by a sun and a lamp."""
    placed = camera(stage, fstop=0.2)
    placed.dof.focus_distance = 9.0
    stage.scene.candela.accumulated_maps_texels_per_pixel = 8.0  # pixels here have no filter that hides a texel
    stage.floor()
    for x, height in ((-1.5, 5.0), (0.0, 1.0), (1.5, 3.0)):
        stage.rectangle((x - 0.3, -0.8), (x + 0.3, 0.8), height, material=stage.diffuse(0.5))
    stage.light("SUN", turn=(0.5, 0.3, 0), angle=0.05)
    stage.light("POINT", location=(2, -2, 4), shadow_soft_size=0.3)
    ours = stage.render(64, SIZE)["diffuse_direct"]
    theirs = stage.render(512, SIZE, engine="CYCLES")["diffuse_direct"]
    assert ours.mean() == pytest.approx(theirs.mean(), rel=0.01)
    error = np.mean((ours - theirs) ** 2 / (theirs**2 + 1e-2 * theirs.mean() ** 2))
    assert error < 0.005
