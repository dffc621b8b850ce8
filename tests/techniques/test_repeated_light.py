"""Direct light once more where a point of the film shows another surface: right where a guess is not, else the same."""

import numpy as np
import pytest

from addon.compare.passes import light_paths
from addon.frame.bands import samples_in_parts

SIZE = (24, 24)
POINTS = 64


@pytest.fixture
def light_of(stage):
    """Direct light of a path by samples, with or without repeated light; film points are shared among the samples."""

    def light_of(path, samples, edges, points=POINTS, **options):
        stage.scene.candela.film_points = points
        stage.scene.candela.film_edges = edges
        return light_paths(stage.render(samples, SIZE, **{"bounces": 1, **options}))[path][..., :3].astype(np.float64)

    stage.scene.render.filter_size = 1.5
    stage.camera_above(2.0)
    return light_of


def error(light, truth):
    return float(np.mean((light - truth) ** 2) / np.mean(truth) ** 2)


def wires(stage, height, material, width=0.03):
    """Thinner than a pixel, which is a twelfth wide."""
    for k in range(-8, 9):
        x = k / 8
        corners = [(x, -2, height), (x + width, -2, height), (x + width + 0.4, 2, height), (x + 0.4, 2, height)]
        stage.mesh(corners, [(0, 1, 2, 3)], material=material)


def half_in_shadow(stage):
    """Wires above a floor; something overhead shades one half of both, along a slanting edge."""
    stage.floor(material=stage.diffuse(0.2))
    wires(stage, 0.3, stage.diffuse(0.9))
    stage.light("SUN", energy=3.0)
    stage.mesh([(-3, -3, 5), (-0.3, -3, 5), (0.3, 3, 5), (-3, 3, 5)], [(0, 1, 2, 3)])
    stage.scene.objects[-1].visible_camera = False


@pytest.mark.slow
def test_wires_at_a_shadows_edge_have_their_own_light(stage, light_of):
    half_in_shadow(stage)
    truth = light_of("diffuse_direct", 256, True, points=1, bounces=0)
    guess, repeated = (error(light_of("diffuse_direct", 16, edges), truth) for edges in (False, True))
    assert repeated < 0.7 * guess


@pytest.mark.slow
@pytest.mark.parametrize("roughness", [0.1, 0.4])
def test_highlights_on_outlines_are_not_dimmed(stage, light_of, roughness):
    """Cylinders hardly thicker than a pixel: what mirrors the light is seen by few pixels' own points."""
    stage.floor(material=stage.diffuse(0.2))
    gloss = stage.material("ShaderNodeBsdfGlossy", Roughness=roughness)
    turns = np.linspace(0, 2 * np.pi, 13)[:-1]
    for k in range(-6, 7):
        ring = [(k / 6 + 0.045 * np.cos(t), y, 0.2 + 0.045 * np.sin(t)) for y in (-2, 2) for t in turns]
        stage.mesh(ring, [(i, (i + 1) % 12, 12 + (i + 1) % 12, 12 + i) for i in range(12)], material=gloss)
    stage.light("SUN", energy=3.0, angle=0.2, turn=(0.0, 0.9, 0.0))
    stage.world((1, 1, 1), 0.3)
    truth, guess, repeated = (
        light_of("glossy_direct", samples, edges, points)
        for samples, edges, points in ((192, True, 1), (48, False, 192), (48, True, 192))
    )
    assert repeated.mean() == pytest.approx(truth.mean(), rel=0.01)
    assert error(repeated, truth) < 0.1 * error(guess, truth)


def test_light_on_one_surface_is_not_repeated(stage, light_of):
    stage.floor()
    stage.blocker((-2, -2), (0.05, 2), 1.0)
    stage.light("SUN", energy=3.0)
    guess, repeated = (light_of("diffuse_direct", 16, edges) for edges in (False, True))
    np.testing.assert_array_equal(guess, repeated)


def test_pictures_of_few_samples_do_without(stage, light_of):
    half_in_shadow(stage)
    guess, repeated = (light_of("diffuse_direct", 2, edges) for edges in (False, True))
    np.testing.assert_array_equal(guess, repeated)


def test_a_point_for_each_sample_needs_none(stage, light_of):
    half_in_shadow(stage)
    passes = []
    for edges in (False, True):
        light_of("diffuse_direct", 16, edges, points=16)
        assert stage.ledger.row("film").counters["points"] == 16
        passes.append(stage.ledger.row("film").counters["passes"])
    assert passes[0] == passes[1]


@pytest.mark.parametrize("why", ["rounds", "occlusion"])
def test_light_that_cannot_be_repeated_is_guessed_whole(stage, light_of, monkeypatch, why):
    """Maps of a second round lie over those of the first; directional occlusion adds no passes that could run again."""
    half_in_shadow(stage)
    stage.light("SUN", energy=1.0, turn=(0.3, 0, 0))
    stage.world((1, 1, 1), 0.5)
    stage.scene.candela.accumulated_maps_by = "MAPS"
    if why == "rounds":
        monkeypatch.setattr("addon.techniques.accumulated_maps.AccumulatedMaps.atlas_texels", 1)
    else:
        stage.scene.candela.slot_environment = "directional_occlusion"
    guess, repeated = (light_of("diffuse_direct", 4, edges) for edges in (False, True))
    np.testing.assert_array_equal(guess, repeated)


def test_samples_that_are_drawn_in_parts_are_the_same(stage, light_of, monkeypatch):
    """As in a window, which answers between parts: after each map here."""
    half_in_shadow(stage)
    stage.light("SUN", energy=1.0, turn=(0.3, 0, 0))
    stage.world((1, 1, 1), 0.5)
    whole = light_of("diffuse_direct", 4, True)
    light_of("diffuse_direct", 4, False)  # else the picture is only shown again
    monkeypatch.setattr("addon.lighting.visibility.PART_TEXELS", 1)
    monkeypatch.setattr("addon.engine._whole_samples", samples_in_parts)
    np.testing.assert_array_equal(whole, light_of("diffuse_direct", 4, True))


def test_the_same_picture_twice(stage, light_of):
    half_in_shadow(stage)
    first = light_of("direct_light", 4, True)
    light_of("direct_light", 4, False)  # else the picture is only shown again
    np.testing.assert_array_equal(first, light_of("direct_light", 4, True))


@pytest.mark.slow
def test_layers_under_lamp_and_world_keep_their_mean(stage, light_of):
    """Cards with alpha over a floor, under lamp and world: what maps and random choices decide is decided again."""
    stage.floor(material=stage.diffuse(0.5))
    wires(stage, 0.3, stage.see_through(0.5), 0.06)
    stage.light("POINT", location=(0.5, 0.5, 2.0), energy=80.0)
    stage.world((0.4, 0.6, 1.0), 0.5)
    truth, repeated = (
        light_of("diffuse_direct", samples, True, points, bounces=bounces)
        for samples, points, bounces in ((256, 1, 0), (32, 128, 1))
    )
    np.testing.assert_allclose(repeated.mean(axis=(0, 1)), truth.mean(axis=(0, 1)), rtol=0.02)
