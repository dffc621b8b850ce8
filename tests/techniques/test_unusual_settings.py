"""Settings that files of many authors contain and sample scenes do not, each against Cycles' picture."""

import bpy
import numpy as np
import pytest

SIZE = (16, 16)


def means(images, names):
    return {name: images[name].reshape(-1, images[name].shape[-1])[:, :3].mean(axis=0) for name in names}


def agree(stage, names, bounces=0, samples=64, rel=0.01, size=SIZE):
    ours = means(stage.render(samples, size, bounces=bounces), names)
    theirs = means(stage.render(4 * samples, size, engine="CYCLES", bounces=bounces), names)
    for name in names:
        assert ours[name] == pytest.approx(theirs[name], rel=rel, abs=1e-6), name


def test_a_surface_without_material_is_cycles_default(stage):
    stage.rectangle((-9, -9), (9, 9))
    stage.light("POINT", (1, 1, 3))
    stage.camera_above()
    agree(stage, ("combined", "diffuse_color", "glossy_color", "diffuse_direct"))


def test_a_volume_alone_has_no_surface(stage):
    stage.floor(material=stage.diffuse(0.5))
    fog = stage.material("ShaderNodeVolumeScatter", Density=0.0)
    tree = fog.node_tree
    output = next(node for node in tree.nodes if node.type == "OUTPUT_MATERIAL")
    scatter = next(node for node in tree.nodes if node.type == "VOLUME_SCATTER")
    tree.links.remove(tree.links[0])
    tree.links.new(scatter.outputs[0], output.inputs["Volume"])
    stage.rectangle((-9, -9), (9, 9), 1.0, material=fog)
    stage.light("POINT", (0, 0, 3))
    stage.camera_above()
    agree(stage, ("combined", "diffuse_direct"))


@pytest.mark.slow
@pytest.mark.parametrize("limit", [0, 1024])
def test_a_light_may_be_kept_from_bouncing(stage, limit):
    stage.floor(material=stage.diffuse(0.8))
    stage.rectangle((-2, -2), (2, 2), 0.0, location=(-1.5, 0, 2), turn=(0, 1.5708, 0), material=stage.diffuse(0.8))
    stage.light("POINT", (0.5, 0, 2)).data.cycles.max_bounces = limit
    stage.camera_above()
    agree(stage, ("diffuse_direct", "combined"), bounces=4, rel=0.03)


@pytest.mark.slow
def test_hair_and_points_look_as_in_cycles(stage):
    """A tuft and a few points beside those that Cycles traces exactly: colour and light, over the picture's mean.

    Facets that turn away from the lamp shadow a rim that round strands would light: up to 2 % of the light is lost.
    """
    rng = np.random.default_rng(1)
    roots = rng.uniform(-1, 1, (150, 2))
    bend = rng.uniform(-0.4, 0.4, (150, 2))
    heights = np.linspace(0, 1, 5)
    keys = np.stack([np.append(root + b * h**2, h) for root, b in zip(roots, bend) for h in heights])
    strands = bpy.data.hair_curves.new("Hair")
    strands.add_curves([5] * 150)
    strands.attributes["position"].data.foreach_set("vector", keys.astype(np.float32).ravel())
    (strands.attributes.get("radius") or strands.attributes.new("radius", "FLOAT", "POINT")).data.foreach_set(
        "value", np.full(750, 0.03, np.float32)
    )
    strands.materials.append(stage.diffuse(0.6))
    cloud = bpy.data.pointclouds.new("Cloud")
    if not hasattr(cloud, "resize"):
        pytest.skip("points cannot be made by a script before Blender 5.0")
    cloud.resize(12)
    places = rng.uniform((-1.5, -1.5, 1.2), (1.5, 1.5, 1.6), (12, 3)).astype(np.float32)
    cloud.attributes["position"].data.foreach_set("vector", places.ravel())
    (cloud.attributes.get("radius") or cloud.attributes.new("radius", "FLOAT", "POINT")).data.foreach_set(
        "value", np.full(12, 0.15, np.float32)
    )
    cloud.materials.append(stage.diffuse(0.3))
    stage.link("Hair", strands)
    stage.link("Cloud", cloud)
    stage.floor(material=stage.diffuse(0.8))
    stage.light("POINT", (2, -2, 4), shadow_soft_size=0.3)
    stage.camera((3, -3, 3), (0.95, 0, 0.785), angle=0.7)
    stage.scene.cycles_curves.shape = "THICK"
    agree(stage, ("combined", "diffuse_color"), size=(48, 48), rel=0.02)


@pytest.mark.slow
def test_hair_of_particles_looks_as_in_cycles(stage):
    ground = stage.floor(half=1.5, material=stage.diffuse(0.8))
    ground.data.materials.append(stage.diffuse(0.4))
    ground.modifiers.new("Particles", "PARTICLE_SYSTEM")
    hair = ground.particle_systems[0].settings
    hair.type, hair.count, hair.hair_length, hair.material = "HAIR", 60, 1.0, 2
    hair.child_type, hair.rendered_child_count, hair.child_radius = "SIMPLE", 6, 0.3
    hair.root_radius, hair.tip_radius, hair.radius_scale, hair.shape = 1.0, 0.2, 0.08, 0.3
    stage.light("POINT", (2, -2, 4), shadow_soft_size=0.3)
    stage.camera((3, -3, 3), (0.95, 0, 0.785), angle=0.7)
    stage.scene.cycles_curves.shape = "THICK"
    agree(stage, ("combined", "diffuse_color"), size=(48, 48), rel=0.02)
