"""Panoramic cameras beside Cycles: what they see, with depth, through a lens, and by the eyes of a pair."""

import bpy
import numpy as np
import pytest

SIZE = (32, 24)
CAMERAS = {
    "EQUIRECTANGULAR": {}, "EQUIANGULAR_CUBEMAP_FACE": {}, "MIRRORBALL": {},
    "FISHEYE_EQUIDISTANT": {"fisheye_fov": 4.0},
    "FISHEYE_EQUISOLID": {"fisheye_lens": 8.0}, "FISHEYE_LENS_POLYNOMIAL": {},
    "CENTRAL_CYLINDRICAL": {"central_cylindrical_range_v_max": 1.5},
}  # fmt: skip


def surrounded(stage, kind, **settings):
    """A camera among shining walls whose colour is the place, in a world whose colour is the direction."""
    stage.camera((0.3, -0.2, 0.1), (1.3, 0.1, 0.5))
    lens = stage.scene.camera.data
    lens.type, lens.panorama_type = "PANO", kind
    for name, value in settings.items():
        setattr(lens, name, value)
    shining = stage.material("ShaderNodeEmission")
    tree = shining.node_tree
    place = tree.nodes.new("ShaderNodeNewGeometry")
    absolute = tree.nodes.new("ShaderNodeVectorMath")
    absolute.operation = "ABSOLUTE"
    tree.links.new(place.outputs["Position"], absolute.inputs[0])
    emission = next(node for node in tree.nodes if node.type == "EMISSION")
    tree.links.new(absolute.outputs[0], emission.inputs["Color"])
    for turn in ((0, 0, 0), (1.5708, 0, 0.3), (1.5708, 0, 1.9), (1.5708, 0, 3.3)):
        wall = stage.rectangle((-0.6, -0.6), (0.6, 0.6), -1.5, material=shining)
        wall.rotation_euler = turn
    world = bpy.data.worlds.new("Ways")
    stage.scene.world = world
    stage.use_nodes(world)
    tree = world.node_tree
    way = tree.nodes.new("ShaderNodeTexCoord")
    absolute = tree.nodes.new("ShaderNodeVectorMath")
    absolute.operation = "ABSOLUTE"
    tree.links.new(way.outputs["Generated"], absolute.inputs[0])
    background = next(node for node in tree.nodes if node.type == "BACKGROUND")
    tree.links.new(absolute.outputs[0], background.inputs["Color"])
    return lens


def off(stage, samples=16, truth=64):
    own = stage.render(samples, SIZE)["combined"]
    cycles = stage.render(truth, SIZE, engine="CYCLES")["combined"]
    squares = (own[..., :3].astype(float) - cycles[..., :3]) ** 2
    return squares / (cycles[..., :3] ** 2 + 0.01 * np.mean(cycles[..., :3] ** 2)), own, cycles


@pytest.mark.slow
@pytest.mark.parametrize("kind", CAMERAS)
def test_it_sees_what_that_of_cycles_sees(stage, kind):
    surrounded(stage, kind, **CAMERAS[kind])
    error, own, cycles = off(stage)
    assert error.mean() < 0.01
    assert own[..., 3] == pytest.approx(cycles[..., 3], abs=1e-3)


@pytest.mark.slow
def test_a_lens_blurs_as_that_of_cycles(stage):
    lens = surrounded(stage, "EQUIRECTANGULAR")
    sharp = stage.render(16, SIZE)["combined"]
    lens.lens, lens.dof.use_dof, lens.dof.focus_distance, lens.dof.aperture_fstop = 50.0, True, 0.7, 0.1
    error, own, _ = off(stage)
    assert error.mean() < 0.01
    assert np.abs(own - sharp).max() > 0.1


def test_inside_an_evenly_lit_ball_all_directions_are_alike(stage):
    """A lamp of intensity I in the middle of a ball of radius r lights each place with I / r^2, of which albedo / pi is
    seen: nothing else where the tiles meet by which surfaces are drawn."""
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=5, radius=2.0)
    ball = bpy.context.object
    ball.data.flip_normals()
    ball.data.shade_smooth()
    ball.data.materials.append(stage.diffuse(0.5))
    stage.light("POINT", location=(0, 0, 0), shadow_soft_size=0.0, energy=100.0)
    stage.camera((0, 0, 0), (np.pi / 2, 0, 0.3))
    lens = stage.scene.camera.data
    lens.type, lens.panorama_type = "PANO", "EQUIRECTANGULAR"
    seen = stage.render(1, (48, 24))["combined"][..., :3]
    np.testing.assert_allclose(seen, 0.5 / np.pi * 100.0 / (4 * np.pi) / 2.0**2, rtol=0.005)
