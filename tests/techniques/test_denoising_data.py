"""Denoising data beside Cycles': albedo, normal in the camera's space, and distance of what is seen."""

import numpy as np
import pytest

ONE_STEP = 1.0 / 255.0


@pytest.fixture
def asked(written):
    written.layer.cycles.denoising_store_passes = True
    yield written
    written.layer.cycles.denoising_store_passes = False


def steps(stage):
    stage.camera((0, -3.5, 3.5), (0.75, 0, 0.1), angle=1.0)
    stage.floor(half=2.2, material=stage.diffuse(0.4))
    red = stage.material("ShaderNodeBsdfDiffuse", Color=(0.8, 0.2, 0.1, 1))
    stage.rectangle((-0.6, -0.6), (0.6, 0.6), material=red, location=(-0.6, 0, 0.4), turn=(0.3, -0.2, 0.4))
    plastic = stage.principled(Base_Color=(0.2, 0.5, 0.8, 1), Roughness=0.5)
    stage.rectangle((-0.5, -0.5), (0.5, 0.5), material=plastic, location=(0.7, 0.3, 0.4), turn=(0.2, 0.3, 0.1))
    return stage


def surfaces(cycles) -> np.ndarray:
    """Where Cycles sees a surface in all samples: a background is as far as the camera sees since Blender 5.3, 1e36
    away since 5.0, and before it 0, as in Candela."""
    depth = cycles["Denoising Depth"][..., 0]
    return (depth > 0.0) & (depth < 100.0)


def test_albedo_normal_and_depth_are_those_of_cycles(asked):
    stage = steps(asked)
    own, cycles = stage.both(16, 256, bounces=0)
    seen = surfaces(cycles)
    even = seen.copy()
    for axis in (0, 1):
        for step in (-1, 1):
            other = np.roll(cycles["Denoising Normal"], step, axis)
            even &= np.abs(other - cycles["Denoising Normal"]).max(axis=-1) < 0.01
    assert even.mean() > 0.5
    for name, most in (("Denoising Normal", ONE_STEP), ("Denoising Depth", 0.01), ("Denoising Albedo", ONE_STEP)):
        assert own[name].shape == cycles[name].shape
        difference = np.abs(own[name] - cycles[name])[even].max()
        print(f"{name}: {difference:.1e}")
        assert difference < most, name
    assert not seen.all() and (own["Denoising Depth"][~seen] < 1e9).all()


@pytest.mark.parametrize("kind", ["PERSP", "ORTHO"])
def test_depth_begins_where_the_camera_begins_to_see(asked, kind):
    stage = steps(asked)
    stage.scene.camera.data.type, stage.scene.camera.data.clip_start = kind, 1.5
    stage.scene.camera.data.ortho_scale = 3.0
    own, cycles = stage.both(4, 64, bounces=0)
    difference = np.abs(own["Denoising Depth"] - cycles["Denoising Depth"])[surfaces(cycles)]
    print(f"{kind}: {np.median(difference):.5f} in the median")
    assert np.median(difference) < 2e-3 and (difference < 0.03).mean() > 0.9


def test_the_noisy_image_is_the_picture_without_denoise(asked):
    stage = steps(asked)
    stage.light("AREA", (0, 0, 2), size=2.0, energy=100.0)
    filtered = stage.written("CANDELA", 4, size=(24, 20), bounces=1)
    stage.scene.candela.denoise_strength = 0.0
    plain = stage.written("CANDELA", 4, size=(24, 20), bounces=1)["Combined"]
    assert np.abs(filtered["Combined"] - plain).max() > 1e-3
    np.testing.assert_allclose(filtered["Noisy Image"], plain, atol=1e-5)


@pytest.mark.slow
def test_nothing_runs_where_it_is_not_asked_for(asked):
    stage = steps(asked)
    stage.light("POINT", (0, 0, 3))
    with_it = stage.written("CANDELA", 2)
    stage.layer.cycles.denoising_store_passes = False
    without = stage.written("CANDELA", 2)
    assert {name for name in with_it.keys() ^ without.keys() if name != "header"} == {
        "Denoising Albedo", "Denoising Normal", "Denoising Depth", "Noisy Image",
    }  # fmt: skip
    np.testing.assert_array_equal(with_it["Combined"], without["Combined"])
    assert stage.ledger.row("shader_aovs").state == "skipped"
