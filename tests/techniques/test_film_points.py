"""One sample of light shown at several points of the film: edges and textures smooth, and no light lost or moved."""

import numpy as np
import pytest

from addon.compare.passes import light_paths
from addon.film.point_costs import MOST, count_of

SIZE = (24, 24)


@pytest.fixture
def light_of(stage):
    """Light of a path by samples and film points."""

    def light_of(path, samples, points, **options):
        stage.scene.candela.light_probes_maps = 2.0  # shadows are not what is asked about here
        stage.scene.candela.film_points = points
        return light_paths(stage.render(samples, SIZE, **options))[path][..., :3].astype(np.float64)

    stage.scene.render.filter_size = 1.5
    stage.camera_above(2.0)
    return light_of


def stripes(stage, width, *materials, turn=0.2):
    """Slanting stripes of these materials, side by side, in one plane."""
    for k in range(-40, 40):
        x = k * width
        corners = [(x, -2, 0), (x + width, -2, 0), (x + width + 4 * turn, 2, 0), (x + 4 * turn, 2, 0)]
        stage.mesh(corners, [(0, 1, 2, 3)], material=materials[k % len(materials)])


def error(light, truth):
    return float(np.mean((light - truth) ** 2) / np.mean(truth) ** 2)


@pytest.mark.parametrize(
    ("points", "samples", "count"), [(64, 1, MOST), (64, 16, 4), (64, 40, 2), (64, 64, 1), (1, 1, 1)]
)
def test_samples_share_the_films_points(points, samples, count):
    assert count_of(points, samples) == count


@pytest.mark.slow
def test_edges_are_as_smooth_as_with_as_many_samples_as_points(stage, light_of):
    stripes(stage, 0.11, stage.diffuse(0.1), stage.diffuse(0.9))
    stage.light("SUN", energy=3.0)
    truth = light_of("diffuse_direct", 1024, 1, bounces=0)
    many = error(light_of("diffuse_direct", 64, 1, bounces=0), truth)
    few = error(light_of("diffuse_direct", 16, 1, bounces=0), truth)
    shared = error(light_of("diffuse_direct", 16, 64, bounces=1), truth)
    assert shared < 1.5 * many < 0.5 * few


@pytest.mark.slow
def test_a_sample_is_lit_once_however_many_points_it_shows(stage, light_of):
    stage.floor()
    stage.light("SUN", energy=3.0)
    light_of("diffuse_direct", 2, 16, bounces=0)
    assert stage.ledger.row("direct_light").counters["passes"] == 2
    assert stage.ledger.row("film").counters["points"] == 4
    light_of("diffuse_direct", 2, 16, bounces=1)
    assert stage.ledger.row("film").counters["points"] == 16


def test_nothing_is_drawn_twice_where_all_points_are_one(stage, light_of):
    stage.scene.render.filter_size = 0.01
    stage.floor()
    stage.light("SUN", energy=3.0)
    light_of("diffuse_direct", 2, 16, bounces=0)
    assert stage.ledger.row("film").counters["points"] == 2


@pytest.mark.slow
@pytest.mark.parametrize("samples", [1, 8])
def test_a_shadows_edge_on_one_colour_is_as_sharp_as_without(stage, light_of, samples):
    """No point of the film sees another surface, so light moves by the half pixel to the next one's point at most."""
    stage.floor()
    stage.blocker((-2, -2), (0.05, 2), 1.0)
    stage.light("SUN", energy=3.0)
    truth, own, shared = (
        light_of("diffuse_direct", count, points, bounces=1)
        for count, points in ((256, 1), (samples, 1), (samples, 64))
    )
    assert error(shared, truth) < 1.2 * error(own, truth)


@pytest.mark.slow
@pytest.mark.parametrize("colors", [((0, 0, 0, 1), (1, 1, 1, 1)), ((1, 0, 0, 1), (0, 1, 1, 1))], ids=["black", "red"])
def test_no_light_is_lost_beside_a_surface_that_shows_none(stage, light_of, colors):
    """What is black, or has no green, tells nothing of the light that arrives there."""
    stripes(stage, 0.11, *(stage.material("ShaderNodeBsdfDiffuse", Color=color) for color in colors))
    stage.light("SUN", energy=3.0)
    truth, shared = (light_of("diffuse_direct", samples, 128, bounces=1) for samples in (256, 32))
    np.testing.assert_allclose(shared.mean(axis=(0, 1)), truth.mean(axis=(0, 1)), rtol=0.01)
    assert error(shared, truth) < 1e-3


MATERIALS = {
    "gloss": ("ShaderNodeBsdfGlossy", {"Roughness": 0.4}, "glossy_direct"),
    "glass": ("ShaderNodeBsdfGlass", {"Roughness": 0.3}, "transmission_direct"),
    "translucent": ("ShaderNodeBsdfTranslucent", {}, "diffuse_direct"),
    "sheen": ("ShaderNodeBsdfSheen", {"Roughness": 0.5}, "diffuse_direct"),
    "velvet": ("ShaderNodeBsdfSheen", {"distribution": "ASHIKHMIN"}, "glossy_direct"),
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", MATERIALS)
def test_every_lobe_keeps_its_light_at_edges(stage, light_of, kind):
    node, inputs, path = MATERIALS[kind]
    distribution = inputs.get("distribution")
    own = stage.material(node, Color=(0.9, 0.6, 0.3, 1), **{k: v for k, v in inputs.items() if k != "distribution"})
    if distribution:
        own.node_tree.nodes[0].distribution = distribution
    stripes(stage, 0.3, own, stage.diffuse(0.5))
    stage.world((1, 1, 1), 0.5)
    stage.light("SUN", turn=(0.5, 0.2, 0), energy=2.0)
    stage.light("SUN", turn=(3.0, 0.2, 0), energy=2.0)
    truth, shared = (light_of(path, 64, points, bounces=1) for points in (64, 512))
    assert truth.mean() > 1e-4
    assert shared.mean() == pytest.approx(truth.mean(), rel=0.02)


@pytest.mark.slow
def test_a_mix_of_lobes_keeps_its_light(stage, light_of):
    """Of several lobes a point draws one at random, another than the sample that was lit."""
    material = stage.principled(Base_Color=(0.8, 0.4, 0.2, 1), Roughness=0.5, Coat_Weight=0.8, Sheen_Weight=0.5)
    stripes(stage, 0.3, material, stage.diffuse(0.5))
    stage.light("SUN", turn=(0.3, 0.2, 0), energy=2.0)
    stage.world((1, 1, 1), 0.5)
    for path in ("glossy_direct", "diffuse_direct"):
        truth, shared = (light_of(path, 64, points, bounces=1) for points in (64, 512))
        assert shared.mean() == pytest.approx(truth.mean(), rel=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("inputs", [{"Coat_Weight": 0.25}, {"Coat_Weight": 1.0}, {"IOR": 1.2}], ids=str)
@pytest.mark.parametrize("metal", [0.5, 1.0])
def test_lobes_that_reflect_unlike_keep_their_light(stage, light_of, metal, inputs):
    """A coat hardly reflects, and is drawn at random seldom and with great weight; the metal below it nearly all."""
    stage.floor(material=stage.principled(Base_Color=(0.8, 0.6, 0.4, 1), Metallic=metal, Roughness=0.5, **inputs))
    stage.light("SUN", turn=(0.3, 0.2, 0), energy=2.0)
    stage.world((1, 1, 1), 0.5)
    truth, shared = (light_of("glossy_direct", samples, points, bounces=1) for samples, points in ((64, 64), (8, 64)))
    assert shared.mean() == pytest.approx(truth.mean(), rel=0.02)


def test_layers_are_drawn_stochastically_at_every_point(stage, light_of):
    """A half transparent card: coverage of one sample with eight points is that of eight samples."""
    stage.rectangle((-2, -2), (2, 2), material=stage.see_through(0.5))
    stage.scene.render.film_transparent = True
    coverage = []
    for points in (1, 16):
        stage.scene.candela.light_probes_maps = 2.0  # shadows are not what is asked about here
        stage.scene.candela.film_points = points
        coverage.append(stage.render(1, SIZE)["combined"][..., 3].std())
    assert coverage[0] > 0.4
    assert coverage[1] < 0.6 * coverage[0]


@pytest.mark.slow
def test_wires_that_no_pixels_own_point_meets_have_light(stage, light_of):
    for k in range(-8, 9):
        x = k / 8
        stage.mesh([(x, -2, 0), (x + 0.02, -2, 0), (x + 0.42, 2, 0), (x + 0.4, 2, 0)], [(0, 1, 2, 3)],
                   material=stage.diffuse(0.8))  # fmt: skip
    stage.light("SUN", energy=3.0)
    truth = light_of("diffuse_direct", 256, 1, bounces=0)
    assert light_of("diffuse_direct", 4, 16, bounces=1).mean() == pytest.approx(truth.mean(), rel=0.05)


@pytest.mark.parametrize("samples", [1, 3])
def test_the_same_picture_twice(stage, light_of, samples):
    stripes(stage, 0.11, stage.diffuse(0.1), stage.diffuse(0.9))
    stage.light("POINT", energy=50.0)
    first, second = (light_of("direct_light", samples, 64, bounces=2) for _ in range(2))
    np.testing.assert_array_equal(first, second)
