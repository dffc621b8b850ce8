"""Clustered visibility: closed forms, maps that are kept, pictures that repeat."""

from types import SimpleNamespace

import numpy as np
import pytest

from addon.compare.passes import light_paths
from addon.compare.reference import render_passes
from addon.frame import ledger
from addon.frame.schedule import DRAFT, FINAL
from addon.frame.settings import Settings
from addon.snapshot.scene import Film
from addon.techniques.clustered_visibility import ClusteredVisibility
from tests.techniques.test_instant_radiosity import corner, sphere

NAME = "clustered_visibility"


def diffuse_indirect(scene, bounces, samples, size, technique=NAME, seed=0, **params):
    """The pass, with the technique's parameters by name."""
    scene.candela.slot_indirect = technique
    for name, value in params.items():
        setattr(scene.candela, f"{technique}_{name}", value)
    images = render_passes(scene, "CANDELA", samples, seed, size=size, bounces=bounces).images
    assert ledger.latest().bad_pixels == 0
    return light_paths(images)["diffuse_indirect"]


@pytest.fixture
def render(stage):
    def render(bounces, samples=8, size=(24, 24), **params):
        return diffuse_indirect(stage.scene, bounces, samples, size, **{"virtual_lights": 256, **params})

    return render


def counters():
    return next(row.counters for row in ledger.latest().rows if row.name == NAME)


@pytest.mark.slow
@pytest.mark.parametrize(("bounces", "shadows"), [(1, "TEXELS"), (3, "CONVOLUTION")])
def test_a_sphere_lit_from_its_centre_follows_the_series_of_reflections(stage, render, bounces, shadows):
    """Nothing stands inside, so that no cluster may lose any of its light, in one sample or many."""
    sphere(stage, stage.diffuse(0.5))
    stage.light("POINT", (0, 0, 0), energy=4 * np.pi**2, shadow_soft_size=0.0)
    light = render(bounces, samples=4, shadows=shadows)
    assert light.mean() == pytest.approx(0.5 * (1 - 0.5**bounces), rel=0.02)
    assert light.mean(axis=2).std() < 0.06 * light.mean()


@pytest.mark.slow
def test_a_sphere_that_shines_itself_keeps_all_its_energy(stage, render):
    """Radiance 1 and albedo 1/2: 1 / (1 - 1/2) in all, half of the first reflection is direct light."""
    shining = stage.principled(Base_Color=(0.5, 0.5, 0.5, 1), IOR=1.0, Emission_Strength=1.0)
    shining.node_tree.nodes["Principled BSDF"].inputs["Emission Color"].default_value = (1, 1, 1, 1)
    sphere(stage, shining, rings=12)
    assert render(12, samples=4).mean() == pytest.approx(0.5, rel=0.03)


@pytest.mark.slow
@pytest.mark.parametrize("shadows", ["TEXELS", "CONVOLUTION"])
def test_a_floor_in_the_sun_lights_the_wall_beside_it_by_their_form_factor(stage, render, shadows):
    """Nothing hides the unit squares from each other: clusters may not darken what their members bring."""
    stage.rectangle((0, 0), (1, 1), material=stage.diffuse(0.8))
    corners = [(0, 0, 0), (0, 1, 0), (0, 1, 1), (0, 0, 1)]
    stage.mesh(corners, [(0, 1, 2, 3)], material=stage.diffuse(1.0))
    stage.light("SUN", energy=10.0, angle=0.0)
    camera = stage.camera((3, 0.5, 0.5), (np.pi / 2, 0, np.pi / 2))
    camera.data.type, camera.data.ortho_scale = "ORTHO", 1.0
    light = render(1, shadows=shadows)
    assert light.mean() * np.pi == pytest.approx(8 * 0.200044, rel=0.03)
    stage.scene.candela.multires_radiosity_virtual_lights = 256
    unshadowed = diffuse_indirect(stage.scene, 1, 8, (24, 24), "multires_radiosity", rays=0)
    np.testing.assert_allclose(light, unshadowed, rtol=1e-3, atol=1e-5)


@pytest.mark.slow
def test_shadows_take_light_away_and_never_add_any(stage, render):
    corner(stage)
    stage.rectangle((-0.3, -0.3), (0.3, 0.3), z=0.6, material=stage.diffuse(0.2))
    stage.scene.candela.denoise_strength = 0.0  # each pixel's own light is compared
    clustered = render(2, samples=2, virtual_lights=128, rays=0)
    stage.scene.candela.multires_radiosity_virtual_lights = 128
    unshadowed = diffuse_indirect(stage.scene, 2, 2, (24, 24), "multires_radiosity", rays=0)
    assert clustered.mean() < 0.99 * unshadowed.mean()
    assert (clustered <= unshadowed * (1 + 1e-4) + 1e-6).mean() > 0.99


@pytest.mark.slow
@pytest.mark.parametrize("refine", [True, False])
def test_pictures_repeat_to_the_last_bit(stage, render, refine):
    corner(stage)
    first = render(2, samples=3, refine=refine)
    render(2, samples=1, virtual_lights=64)
    np.testing.assert_array_equal(render(2, samples=3, refine=refine), first)


def test_clusters_and_maps_of_the_first_sample_stand_where_samples_do_not_refine(stage, render):
    corner(stage)
    render(2, samples=4, clusters=16, refine=True)
    assert counters()["maps"] == counters()["clusters"] > 4 * 8
    render(2, samples=4, clusters=16, refine=False)
    assert 8 < counters()["maps"] == counters()["clusters"] <= 16
    assert counters()["maps kept"] == 3 * counters()["maps"]


def test_a_change_of_shadows_and_back_changes_nothing(stage, render):
    """Kept maps are filtered anew when they were not, though no map is traced."""
    corner(stage)
    stage.rectangle((-0.3, -0.3), (0.3, 0.3), z=0.6, material=stage.diffuse(0.2))
    fresh = render(1, samples=1, shadows="CONVOLUTION")
    lamp = stage.scene.objects["POINT"]
    place = lamp.location.x
    lamp.location.x = place + 0.1
    render(1, samples=1, shadows="CONVOLUTION")
    lamp.location.x = place
    render(1, samples=1, shadows="TEXELS")
    again = render(1, samples=1, shadows="CONVOLUTION")
    assert counters()["maps kept"] > 0 and "maps" not in counters()
    np.testing.assert_array_equal(again, fresh)


def test_maps_are_kept_while_nothing_in_them_changes(stage, render):
    """A lamp of another strength leaves virtual lights where they are."""
    corner(stage)
    render(1, samples=1)
    drawn = counters()["maps"]
    stage.scene.objects["POINT"].data.energy = 120.0
    render(1, samples=1)
    assert counters()["maps kept"] == drawn and "maps" not in counters()
    stage.rectangle((-0.3, -0.3), (0.3, 0.3), z=0.6, material=stage.diffuse(0.2))
    render(1, samples=1)
    assert counters()["maps"] > 0 and "maps kept" not in counters()


@pytest.mark.parametrize(
    ("size", "samples", "draft", "taken"),
    [
        ((320, 240), 1, False, True),
        ((320, 240), 2, False, False),
        ((320, 240), 1, True, False),
        ((96, 72), 1, False, False),
    ],
)
def test_auto_takes_it_for_single_samples_of_many_pixels(size, samples, draft, taken):
    film = Film(*size, (0, 0, *size))
    claimed = ClusteredVisibility().claims(
        SimpleNamespace(film=film), Settings(samples=samples, schedule=DRAFT if draft else FINAL)
    )
    assert claimed == taken


@pytest.mark.parametrize(
    "params",
    [
        {"virtual_lights": 1},
        {"clusters": 1},
        {"map_size": 8, "clusters": 256},
        {"map_size": 33, "shadows": "CONVOLUTION"},
    ],
)
def test_every_number_of_lights_and_clusters_works(stage, render, params):
    corner(stage)
    assert render(2, samples=2, size=(7, 5), **params).mean() > 0


@pytest.mark.slow
@pytest.mark.parametrize("scale", [1e-3, 1e4])
def test_light_does_not_depend_on_the_scale_of_the_scene(stage, render, scale):
    corner(stage)
    unit = render(2, samples=16)
    stage.clear()
    corner(stage, energy=60.0 * scale**2)
    stage.enlarge(scale)
    assert render(2, samples=16).mean() == pytest.approx(unit.mean(), rel=0.02)


@pytest.mark.parametrize("shadows", ["TEXELS", "CONVOLUTION"])
@pytest.mark.parametrize("aside", [0.0, 2.5])
def test_a_single_cluster_casts_the_penumbra_of_its_area(stage, render, aside, shadows):
    """A card of 1 m, 4 m above a floor, lit from below, half-way a half plane: its penumbra is a ramp of 1 m, straight
    below the card and `aside` metres beside it, where the card is seen from 32 degrees. Some 80 of the virtual lights
    lie on the card, so the middle of one picture's cluster is off by centimetres: it is the mean of several seeds."""
    stage.floor(6.0, material=stage.diffuse(0.5))
    card = stage.blocker((-0.5, -0.5), (0.5, 0.5), 4.0, material=stage.diffuse(0.8))
    card.visible_shadow = False
    stage.blocker((aside / 2, -8.0), (12.0, 8.0), 2.0, material=stage.diffuse(0.0))
    stage.light("SPOT", (0, 0, 2.1), (np.pi, 0, 0), spot_size=0.8, spot_blend=0.0, shadow_soft_size=0.0)
    stage.camera_above(4.0).location.x = aside
    size, shared = (48, 48), {"virtual_lights": 2048, "levels": 0}
    params = {"clusters": 1, "rays": 0, "refine": False, "map_size": 128}
    found = []
    for seed in range(6):
        clustered = render(1, 2, size, seed=seed, shadows=shadows, **params, **shared)
        unshadowed = diffuse_indirect(stage.scene, 1, 2, size, "multires_radiosity", seed, rays=0, **shared)
        found.append((clustered / unshadowed).mean(axis=(0, 2)))
    visible = np.mean(found, axis=0)
    place = (np.arange(48) - 23.5) / 12
    assert np.abs(visible - np.clip(0.5 - place, 0, 1)).mean() < 0.02
    width = np.subtract(*np.interp([-0.1, -0.9], -visible, place)) / 0.8
    assert width == pytest.approx(1.0, abs=0.2)
