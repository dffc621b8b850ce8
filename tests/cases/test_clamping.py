"""Clamp Direct and Clamp Indirect hold for single samples, as Cycles' settings of these names do."""

import numpy as np
import pytest

from addon.compare.reference import render_passes

from .conftest import agree


@pytest.fixture
def clamped(stage):
    """A function that renders the stage with both engines and both limits: (Candela's passes, Cycles' passes)."""

    def render(direct, indirect, samples=16, reference=64):
        scene = stage.scene
        scene.candela.film_clamp_direct, scene.candela.film_clamp_indirect = direct, indirect
        extra = [(scene.cycles, "sample_clamp_direct", direct), (scene.cycles, "sample_clamp_indirect", indirect)]
        size = {"size": (32, 32)}
        own = render_passes(scene, "CANDELA", samples, 1, **size).images
        return own, render_passes(scene, "CYCLES", reference, 1, extra=extra, **size).images

    return render


@pytest.mark.slow
def test_what_is_seen_keeps_its_colour(stage, clamped):
    """Emission and the world, above the limit and below it."""
    stage.camera_above()
    stage.world((0.3, 2.5, 0.2))
    for left, color in ((-1.5, (8.0, 2.0, 0.1, 1.0)), (0.5, (0.2, 0.3, 0.1, 1.0))):
        stage.rectangle((left, -1), (left + 1, 1), material=stage.material("ShaderNodeEmission", Color=color))
    own, cycles = clamped(0.5, 0.0, samples=4, reference=4)
    for name in ("emission", "environment"):
        assert np.allclose(own[name][..., :3], cycles[name][..., :3], rtol=1e-3, atol=1e-3)
    assert own["combined"][..., :3].sum(-1).max() == pytest.approx(1.5, rel=1e-3)
    assert clamped(0.0, 0.1, samples=4, reference=4)[0]["emission"].max() == pytest.approx(8.0)


def means(passes, name):
    return passes[name][..., :3].reshape(4, 8, 4, 8, 3).mean((1, 3))


@pytest.mark.slow
def test_light_on_surfaces(stage, clamped):
    """A lamp close above a floor, which lights a wall: one limit leaves the other light as it was. Bounced light comes
    from many points at once and varies less than Cycles' does, so that less of it is taken away."""
    stage.floor(material=stage.diffuse(0.8))
    stage.rectangle((-2, 0), (2, 2), material=stage.diffuse(0.8), location=(0, 1, 0), turn=(1.3, 0, 0))
    stage.light("POINT", (0, 0, 0.8), energy=40.0, shadow_soft_size=0.05)
    stage.camera_above()
    free, _ = clamped(0.0, 0.0, reference=1)
    own, cycles = clamped(0.4, 0.0)
    agree(means(own, "diffuse_direct"), means(cycles, "diffuse_direct"))
    assert means(own, "diffuse_direct").max() < 0.7 * means(free, "diffuse_direct").max()
    assert np.allclose(own["diffuse_indirect"], free["diffuse_indirect"])
    limit = 0.03  # the passes are without the surfaces' colour
    own, cycles = clamped(0.0, limit)
    agree(means(own, "diffuse_direct"), means(cycles, "diffuse_direct"))
    assert free["diffuse_indirect"][..., :3].sum(-1).max() > 3.3 * limit / 0.8
    assert own["diffuse_indirect"][..., :3].sum(-1).max() <= 3.001 * limit / 0.8
