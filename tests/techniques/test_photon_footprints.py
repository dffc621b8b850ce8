"""Photons by themselves: how wide a footprint is that the lamp's own disc alone spreads, and where they come from."""

from types import SimpleNamespace

import numpy as np
import pytest

from addon.frame.schedule import AT_REST, DRAFT, FINAL
from addon.frame.settings import Settings
from addon.gfx import images, passes
from addon.gfx.struct import Block
from addon.lighting import caustic_casters, photons
from addon.lighting.photons import FOOTPRINTS, FOUND, Photons
from addon.scene.view import VIEW, View
from addon.snapshot.scene import Camera, Film
from addon.sources import lights


@pytest.mark.parametrize("disc", [0.3, 0.0])
def test_a_footprint_has_the_variance_of_the_disc_that_it_stands_for(gpu_context, disc):
    """The biweight kernel of radius h has the variance h^2 / 8 along an axis, an even disc of radius r r^2 / 4."""
    view = View(
        Camera(np.eye(4), "PERSPECTIVE", (-0.5, 0.5, -0.5, 0.5), 0.1, 100.0), Film(8, 8, (0, 0, 8, 8)), np.zeros(3)
    )
    photon = {name: np.zeros((1, 1, 4), np.float32) for name in FOUND}
    points, normals, fluxes = FOUND
    photon[points][:] = 0.0, 0.0, -2.0, 1.0
    photon[normals][:] = 0.0, 0.0, 1.0, disc
    photon[fluxes][:] = 1.0, 1.0, 1.0, 0.0
    target = images.Target(tuple(images.create(1, 1, "RGBA32F") for _ in range(4)))
    passes.fullscreen(
        FOOTPRINTS, target, textures={name: images.upload(pixels) for name, pixels in photon.items()},
        blocks={"film_view": Block(VIEW, **view.values(0, 0, (0.0, 0.0), 10.0))},
        constants={"widening": 1.0, "least_pixels": 0.0, "longest": 12.0},
    )  # fmt: skip
    first, second = (images.read(target.colors[k])[0, 0, :3] for k in (1, 2))
    radii = np.linalg.norm([first, second], axis=1)
    assert radii**2 / 8 == pytest.approx(disc**2 / 4, rel=1e-4, abs=1e-30)


@pytest.mark.parametrize("schedule", [FINAL, AT_REST, DRAFT], ids=["final", "growing", "draft"])
def test_each_photon_comes_from_a_point_of_the_lamp_of_its_own(monkeypatch, schedule):
    """Of a very wide lamp all samples have several points, while a view grows fewer and fewer; a draft has few."""
    lamp = SimpleNamespace(
        kind=lights.RECTANGLE, reach=0.9, is_flat=True, light=SimpleNamespace(key="lamp"), middle=lambda: np.zeros(3),
        position=np.asarray, sample=lambda *_: np.zeros(3),
    )  # fmt: skip
    casters = SimpleNamespace(spreads=False, dark=(), refracting={0}, wanted=lambda _: 3)
    monkeypatch.setattr(caustic_casters, "boxes_of", lambda *_: [(np.full(3, 0.9), np.full(3, 1.1))])
    monkeypatch.setattr(photons, "views_of", lambda *_: [None])
    monkeypatch.setattr(Photons, "_rounds", lambda *_: ([lamp], 1))
    samples = 4 if schedule.known_total else 40
    numbers = []
    for sample in range(1 if schedule.is_draft else samples):
        frame = SimpleNamespace(
            settings=Settings(samples, schedule=schedule), sample=sample, geometry=SimpleNamespace(size=9.0),
            shared=lambda kind: kind(), random_volume=lambda *_, **__: (0, 0, 0), random=lambda *_: (0, 0),
        )  # fmt: skip
        found = list(Photons().views(frame, casters, 64))
        numbers += [one.index for one in found]
        assert sum(one.weight for one in found) == pytest.approx(1.0)
        assert found[0].count == (32 if schedule.known_total else len(numbers))
    assert numbers == list(range(len(numbers)))
    assert len(numbers) == {FINAL: 32, DRAFT: 8}.get(schedule, 16 * 8 + 16 * 4 + 8 * 2)
