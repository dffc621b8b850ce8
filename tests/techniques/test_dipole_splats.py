"""Dipole splats of scenes whose answer is known: views of several boxes, what stands in the light's way, no range."""

import numpy as np
import pytest

from tests.techniques.foggy_stage import box
from tests.techniques.test_image_space_subsurface import COLOR, WALK, scattering, shown, slab, sphere


@pytest.fixture
def splats(stage):
    stage.scene.candela.image_space_subsurface_form = "SPLATS"
    return stage


@pytest.mark.parametrize("scale", [0.0, 1.0])
def test_channels_without_range_are_the_local_limit(splats, scale):
    slab(splats, scattering(splats, "RANDOM_WALK", scale * WALK, (1, 0.2, 0)), half=9.0)
    splats.light("SUN", energy=np.pi, angle=0.0)
    splats.camera_above(2.0)
    found = shown(splats.render(2, size=(8, 8))).mean(axis=(0, 1))
    assert found[2] == pytest.approx(COLOR[2], rel=0.02)
    if scale == 0.0:
        assert found == pytest.approx(COLOR, rel=0.02)
    else:
        assert found == pytest.approx(COLOR, rel=0.15)


def lit(splats, *between, size=(8, 8), samples=2, bounces=0, lamp=None, image="combined"):
    """Mean of a block seen from above, with what `between` puts into the scene."""
    made = slab(splats, scattering(splats, "RANDOM_WALK", 0.3 * WALK), half=2.0)
    for put in between:
        put(made)
    (lamp or (lambda: splats.light("SUN", energy=np.pi, angle=0.0)))()
    splats.camera_above(1.0, 3.0)
    found = splats.render(samples, size=size, bounces=bounces)[image][..., :3].mean(axis=(0, 1))
    splats.clear()
    splats.scene.candela.image_space_subsurface_form = "SPLATS"
    return found


def test_light_takes_the_colour_of_transparent_surfaces(splats):
    def glass(_):
        made = splats.material("ShaderNodeBsdfTransparent", Color=(1, 0.1, 0.0, 1))
        splats.blocker((-9, -9), (9, 9), 1.0, material=made)

    assert lit(splats, glass) / lit(splats) == pytest.approx([1, 0.1, 0.0], abs=0.03)


def test_views_of_several_boxes_bring_light_once(splats):
    def wall(_):
        box(splats, scattering(splats, "RANDOM_WALK", 0.3 * WALK), (-2, -2, -9), (2, 2, -5))

    assert lit(splats, wall) == pytest.approx(lit(splats), rel=0.05)


def test_objects_without_shadows_are_lit(splats):
    def hidden(made):
        made.visible_shadow = False

    assert lit(splats, hidden, samples=4) == pytest.approx(lit(splats, samples=4), rel=0.15)


@pytest.mark.slow
@pytest.mark.parametrize("emissive", [False, True])
def test_what_photons_bring_through_glass_is_no_direct_light(splats, emissive):
    """Glass is then as opaque to splats as a black body is."""

    def ball(material):
        sphere(splats, material, 0.5, location=(0, 0, 0.8)).visible_camera = False

    def lamp():
        if emissive:
            shine = splats.material("ShaderNodeEmission", Strength=20.0)
            splats.rectangle((-0.2, -0.2), (0.2, 0.2), material=shine, location=(0, 0, 2)).visible_camera = False
        else:
            splats.light("POINT", (0, 0, 2), energy=100, shadow_soft_size=0.0)

    def shadow(material):
        return lit(splats, lambda _: ball(material), lamp=lamp, bounces=2, image="diffuse_direct")

    glass = shadow(splats.material("ShaderNodeBsdfGlass", IOR=1.5, Roughness=0.0))
    assert glass == pytest.approx(shadow(splats.diffuse(0.0)), rel=0.01)
