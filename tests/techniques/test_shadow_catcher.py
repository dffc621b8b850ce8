"""Shadow catchers, beside Cycles."""

import numpy as np
import pytest

from addon import engine
from addon.compare.metrics import relative_squared_error
from addon.frame import ledger, slices

SIZE = (64, 48)


@pytest.fixture
def caught(stage):
    render = stage.scene.render
    render.filter_size, render.film_transparent = 1.5, True
    stage.ground = stage.floor(6.0, material=stage.diffuse(0.6))
    stage.ground.is_shadow_catcher = True
    corners = [(a, b, c) for a in (-0.5, 0.5) for b in (-0.5, 0.5) for c in (0.0, 1.2)]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (1, 5, 7, 3), (0, 2, 6, 4)]
    stage.box = stage.mesh(corners, faces, material=stage.diffuse(0.7))
    stage.light("AREA", (-2.0, -1.0, 3.0), turn=(0.3, -0.6, 0), size=0.8, energy=200)
    stage.world(strength=0.3)
    stage.camera((0, -6, 4), (0.97, 0, 0))
    return stage


def with_pass(stage, engine_name, samples):
    layer = stage.scene.view_layers[0]
    layer.cycles.use_pass_shadow_catcher = True
    try:
        return stage.render(samples, SIZE, engine=engine_name, bounces=2)
    finally:
        layer.cycles.use_pass_shadow_catcher = False


def differences(own, truth):
    """Of Combined: relMSE of its colours beside the largest, where nothing is often all there is, and mean of alpha."""
    off = own["combined"][..., :3] - truth["combined"][..., :3]
    rgb = (off**2).mean() / (truth["combined"][..., :3] ** 2).mean()
    return rgb, np.abs(own["combined"][..., 3] - truth["combined"][..., 3]).mean()


@pytest.mark.slow
@pytest.mark.parametrize("transparent", [True, False])
def test_the_pass_beside_cycles(caught, transparent):
    caught.scene.render.film_transparent = transparent
    own, truth = with_pass(caught, "CANDELA", 64), with_pass(caught, "CYCLES", 512)
    error = relative_squared_error(own["shadow_catcher"], truth["shadow_catcher"]).mean()
    rgb, alpha = differences(own, truth)
    print(f"relMSE of Shadow Catcher {error:.5f}, of Combined {rgb:.5f}; alpha {alpha:.4f}")
    assert error <= 0.01 and rgb <= 0.01 and alpha <= 0.01


@pytest.mark.slow
@pytest.mark.parametrize("transparent", [True, False])
def test_combined_beside_cycles(caught, transparent):
    caught.scene.render.film_transparent = transparent
    own = caught.render(64, SIZE, bounces=2)
    truth = caught.render(512, SIZE, engine="CYCLES", bounces=2)
    rgb, alpha = differences(own, truth)
    print(f"relMSE of Combined {rgb:.5f}; alpha {alpha:.4f}")
    assert rgb <= 0.01 and alpha <= 0.01


@pytest.mark.slow
def test_catchers_alone_are_as_if_they_were_not_there(caught):
    caught.remove(caught.box)
    found = with_pass(caught, "CANDELA", 8)
    np.testing.assert_allclose(found["shadow_catcher"], 1.0, atol=1e-3)
    np.testing.assert_allclose(found["combined"], 0.0, atol=1e-3)


def test_scenes_without_catchers_make_one_picture(caught, monkeypatch):
    caught.ground.is_shadow_catcher = False
    begun = []
    renderer = engine.session(caught.scene, "final").renderer
    monkeypatch.setattr(renderer, "beginning", lambda *a, own=renderer.beginning: begun.append(1) or own(*a))
    found = with_pass(caught, "CANDELA", 2)
    assert len(begun) == 1
    np.testing.assert_array_equal(found["shadow_catcher"], 1.0)


def test_all_pictures_have_as_many_samples_where_they_end_early(caught):
    caught.scene.candela.noise_threshold = 0.1
    found = with_pass(caught, "CANDELA", 256)
    taken = ledger.latest().samples
    assert 8 <= taken < 256
    caught.scene.candela.noise_threshold = 0.0
    whole = with_pass(caught, "CANDELA", taken)
    for name in ("combined", "shadow_catcher"):
        assert np.abs(found[name] - whole[name]).mean() < 0.02


@pytest.mark.parametrize("transparent", [True, False])
def test_slices_make_the_picture_of_all_samples(caught, monkeypatch, transparent):
    caught.scene.render.film_transparent = transparent
    whole, taken = with_pass(caught, "CANDELA", 4), []
    own = caught.scene.candela
    try:
        for own.sample_offset, own.sample_count in ((0, 1), (1, 3)):
            monkeypatch.setattr(engine, "taken", {})
            with_pass(caught, "CANDELA", 4)
            taken.append(*engine.taken.values())
    finally:
        own.sample_offset = own.sample_count = 0
    monkeypatch.setattr(engine, "taken", None)
    monkeypatch.setattr(engine, "given", {caught.scene.view_layers[0].name: slices.merged(taken)})
    found = with_pass(caught, "CANDELA", 4)
    for name in ("combined", "shadow_catcher", "diffuse_direct"):
        np.testing.assert_allclose(found[name], whole[name], atol=1e-4 * np.abs(whole[name]).max(), err_msg=name)
