"""Wide light on what lies under a single sheet of water: radiance passes its faces unscaled, as in Cycles."""

import bmesh
import numpy as np
import pytest
from mathutils import Matrix

from addon.compare.passes import light_paths
from addon.gfx.library import resolve
from addon.materials.energy import pane_passing
from tests.techniques.test_image_space_subsurface import scattering, slab


def pool(stage, index=1.33, albedo=0.5, turn=(0, 0, 0), roughness=0.0):
    """A wide ground below a sheet, under an even world of radiance 1, seen from above."""
    stage.rectangle((-20, -20), (20, 20), z=-0.3, material=stage.diffuse(albedo))
    glass = stage.material("ShaderNodeBsdfGlass", Color=(1, 1, 1, 1), Roughness=roughness, IOR=index)
    stage.rectangle((-20, -20), (20, 20), material=glass, turn=turn)
    stage.world()
    stage.camera_above(1.0, 2.0)


def seen(stage, samples, engine="CANDELA"):
    """Light of the ground through the sheet."""
    return light_paths(stage.render(samples, (16, 16), engine=engine, bounces=24))["transmission_indirect"].mean()


@pytest.mark.parametrize("index", [1.33, 1.5])
def test_a_ground_below_water_has_the_light_that_faces_leave_and_mirror_back(stage, index):
    """A ray from the ground passes with the chance t = (1 - F) / n2, F the reflectance of even light from outside, and
    is mirrored back otherwise: B = t / (1 - (1 - t) albedo); total reflection has most of what is mirrored."""
    pool(stage, index)
    passing = pane_passing(index)[1] / index**2
    radiance = 0.5 * passing / (1 - (1 - passing) * 0.5)
    straight = 1 - ((index - 1) / (index + 1)) ** 2
    assert seen(stage, 32) == pytest.approx(straight * radiance, rel=0.03)


@pytest.mark.parametrize("method", ["BURLEY", "RANDOM_WALK_SKIN"])
def test_wax_below_water_has_the_light_of_a_ground_there(stage, method):
    """As above: of a body that stands out of it t was taken once more, as for what enters wax in clear glass."""
    pool(stage)
    color = np.array([0.8, 0.5, 0.2])
    wax = scattering(stage, method, 0.02, color=color)
    body = slab(stage, wax)
    body.location.z = -0.2
    work = bmesh.new()
    work.from_mesh(body.data)
    bmesh.ops.create_cube(work, size=0.5, matrix=Matrix.Translation((8, 8, 0.2)))
    work.to_mesh(body.data)
    work.free()
    passing = pane_passing(1.33)[1] / 1.33**2
    expected = (1 - (0.33 / 2.33) ** 2) * color * passing / (1 - (1 - passing) * color)
    light = light_paths(stage.render(24, (8, 8), bounces=24))["transmission_indirect"].mean(axis=(0, 1))
    print(f"{method}: {light.round(4)}, closed form {expected.round(4)}")
    assert light == pytest.approx(expected, rel=0.06)


def test_frosted_water_mirrors_back_as_much_as_clear_water(stage):
    """Of light on the ground alone: what it has of a sheet of any roughness is that of the faces' mean."""
    stage.scene.view_layers[0].use_pass_diffuse_indirect = True
    found = []
    for roughness in (0.0, 0.4):
        stage.clear()
        pool(stage, roughness=roughness)
        stage.scene.camera.location.z = -0.05  # below the sheet
        found.append(light_paths(stage.render(16, (16, 16), bounces=24))["diffuse_indirect"].mean())
    assert found[1] == pytest.approx(found[0], rel=0.05)


def test_a_ground_that_the_camera_sees_below_water_has_the_light_that_leaves_it(stage):
    """Of the world's light on the ground itself: t = (1 - F) / n2, as above."""
    pool(stage)
    stage.scene.camera.location.z = -0.05
    light = light_paths(stage.render(8, (16, 16), bounces=0))["diffuse_direct"].mean()
    assert light == pytest.approx(0.5 * pane_passing(1.33)[1] / 1.33**2, rel=0.03)


def test_a_window_elsewhere_leaves_a_pond_as_it_is(stage):
    """A pane of two open faces, larger than the pond, is judged by itself."""
    pool(stage)
    glass = stage.material("ShaderNodeBsdfGlass", Color=(1, 1, 1, 1), Roughness=0.0, IOR=1.33)
    for side in (1, -1):
        place = {"location": (60 + 0.05 * side, 0, 31), "turn": (0, side * np.pi / 2, 0)}
        stage.rectangle((-30, -30), (30, 30), material=glass, **place)
    stage.scene.camera.location.z = -0.05
    light = light_paths(stage.render(8, (16, 16), bounces=0))["diffuse_direct"].mean()
    assert light == pytest.approx(0.5 * pane_passing(1.33)[1] / 1.33**2, rel=0.03)


def test_the_middle_of_a_round_pool_has_the_sky_that_comes_in_beside_it(stage):
    """At depth h in a pool of radius R without walls even light comes in below the rim, from heights up to atan(h / R),
    and mirrored by the sheet, where all is reflected, up to atan(2 h / R): of a cosine's light the squares of their
    sines. What passes the sheet is t, as above, and what the ground sends up comes back with 1 - t. Rays of the world
    pass straight, so that .02 of it crosses the sheet's plane beside it (.85 without what the sheet mirrors)."""
    depth, radius, albedo = 0.3, 1.5, 0.05
    turns = np.arange(64) * 2 * np.pi / 64
    rim = np.stack([radius * np.cos(turns), radius * np.sin(turns), 0 * turns], axis=-1)
    glass = stage.material("ShaderNodeBsdfGlass", Color=(1, 1, 1, 1), Roughness=0.0, IOR=1.33)
    stage.mesh(rim, [range(64)], material=glass)
    stage.mesh(rim - (0, 0, depth), [range(64)], material=stage.diffuse(albedo))
    stage.world()
    stage.camera_above(0.2, -0.05)
    beside = np.sin(np.arctan(2 * depth / radius)) ** 2
    passing = pane_passing(1.33)[1] / 1.33**2
    expected = albedo * (beside + passing) / (1 - (1 - passing) * albedo)
    paths = light_paths(stage.render(32, (8, 8), bounces=8))
    light = sum(paths[name].mean() for name in ("diffuse_direct", "diffuse_indirect"))
    print(f"{light:.4f}, closed form {expected:.4f}")
    assert light == pytest.approx(expected, rel=0.06)


@pytest.mark.parametrize(
    ("file", "finds"),
    [("indirect/near", True), ("indirect/candidates", True), ("hits/bounced", True), ("ssdo/bounce", False)],
)
def test_points_of_the_world_are_left_out_at_sheets_where_rays_find_it_alone(file, finds):
    """Screen-space bounces send no rays that a sheet mirrors: they lost the world seen from below it."""
    text, _ = resolve(f"{file}.frag.glsl", {})
    defined, asked = text.find("#define SHEETS_FIND_SKY"), text.find("defined(SHEETS_FIND_SKY)")
    assert asked > 0 and (0 <= defined < asked) == finds
    assert (text.count("mirrored_lights(") > 1) == finds  # beside its definition
