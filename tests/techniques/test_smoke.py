"""Smoke domains, by stand-ins for their grids: Blender's own module simulates nothing in the Python package of 5.2."""

from types import SimpleNamespace

import numpy as np
import pytest

from addon.snapshot import instances, smoke
from tests.techniques.foggy_stage import box, glowing_floor, volume

SIZE = 4, 2, 6


def domain(density, size=SIZE, color=None, **grids):
    """Settings of a domain of these (X, Y, Z) values; color (X, Y, Z, 4), times density."""
    flat = density.transpose(2, 1, 0).ravel()
    empty = np.zeros(0, np.float32)
    given = {name: grids.get(name, np.zeros_like(density)).transpose(2, 1, 0).ravel() for name in smoke.GRIDS[1:]}
    return SimpleNamespace(
        domain_resolution=size, use_noise=False, noise_scale=2, density_grid=flat,
        color_grid=empty if color is None else color.transpose(2, 1, 0, 3).ravel(),
        **{f"{name}_grid": values for name, values in given.items()},
    )  # fmt: skip


@pytest.fixture
def stands_in(monkeypatch):
    """Makes objects whose name begins with "Domain" gas domains of given settings."""

    def put(settings):
        for module in (instances, smoke):
            monkeypatch.setattr(
                module, "domain_of", lambda owner: settings if owner.name.startswith("Domain") else None
            )

    return put


def test_grids_have_x_fastest_and_colours_without_density():
    density = np.random.default_rng(0).random(SIZE).astype(np.float32)
    density[1, 1, 2] = 0.0
    color = np.concatenate([density[..., None] * (0.8, 0.4, 0.2), density[..., None]], axis=-1).astype(np.float32)
    found = smoke.domain_grids(domain(density, color=color, flame=density / 2))
    np.testing.assert_array_equal(found["density"], density)
    np.testing.assert_array_equal(found["flame"], density / 2)
    assert found["color"][3, 1, 5] == pytest.approx((0.8, 0.4, 0.2), rel=1e-5)
    assert not found["color"][1, 1, 2].any()


def test_finer_cells_of_noise_are_read_where_they_stand():
    density = np.full((8, 4, 12), 0.3, np.float32)
    settings = domain(density)
    settings.use_noise = True
    assert smoke.domain_grids(settings)["density"].shape == (8, 4, 12)


def test_numbers_that_are_none_are_no_smoke():
    density = np.full(SIZE, np.nan, np.float32)
    density[0, 0, 0], density[1, 0, 0] = 0.5, np.inf
    found = smoke.domain_grids(domain(density))["density"]
    assert found.sum() == 0.5


def test_a_domain_absorbs_what_stands_in_its_cells(stage, stands_in):
    """Smoke of .4 per metre in the half to the right of a domain of two metres, lit from below."""
    density = np.zeros((8, 8, 8), np.float32)
    density[4:] = 0.4
    stands_in(domain(density, (8, 8, 8)))
    stage.camera_above()
    glowing_floor(stage)
    made = box(
        stage, volume(stage, "ShaderNodeVolumePrincipled", Density=1.0, Color=(0, 0, 0, 1)), (-1, -1, -1), (1, 1, 1)
    )
    made.name = "Domain"
    stage.scene.candela.slot_volume = "OFF"  # nothing in it scatters
    seen = stage.render(4, size=(16, 16))["combined"][8, :, 0]
    assert seen[10] == pytest.approx(2 * np.exp(-0.8), rel=0.02)
    assert seen[5] == pytest.approx(2.0, rel=0.01)
    assert seen[1] == pytest.approx(2.0, rel=1e-5)


def test_a_domain_that_was_not_simulated_says_so(stage, stands_in):
    stands_in(domain(np.zeros(SIZE, np.float32)))
    stage.camera_above()
    glowing_floor(stage)
    box(stage, volume(stage, "ShaderNodeVolumePrincipled"), (-1, -1, -1), (1, 1, 1)).name = "Domain"
    stage.scene.candela.slot_volume = "OFF"
    seen = stage.render(size=(8, 8))["combined"][4, 4, 0]
    assert seen == pytest.approx(2.0, rel=1e-5)
    assert any("baked for this frame" in note.text for note in stage.renderer.frame.snapshot.notes)
