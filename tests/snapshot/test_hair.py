"""Hair of particle systems: where strands lie, how wide they are, what they take from the mesh they grow on."""

import bpy
import numpy as np
import pytest

from addon.snapshot import SnapshotCache
from addon.snapshot.strands import MOST_TRIANGLES, tubes


def grow(stage, count=20, children=0, **settings):
    """A square of 1 m with hair 0.5 m long."""
    ground = stage.link("Ground", stage.grid(2))
    ground.data.uv_layers.new(name="Map")
    corners = np.array([ground.data.vertices[loop.vertex_index].co[:2] for loop in ground.data.loops], np.float32)
    ground.data.uv_layers[0].uv.foreach_set("vector", corners.ravel())
    ground.modifiers.new("Particles", "PARTICLE_SYSTEM")
    made = ground.particle_systems[0].settings
    made.type, made.count, made.hair_length = "HAIR", count, 0.5
    if children:
        made.child_type, made.rendered_child_count = "SIMPLE", children
        made.child_percent = children
    for name, value in settings.items():
        setattr(made, name, value)
    return ground


def hair_of(snapshot):
    (key,) = [key for key in snapshot.meshes if key.startswith("hair")]
    return snapshot.meshes[key]


def test_strands_grow_from_the_mesh_with_the_radius_of_their_settings(stage):
    grow(stage, root_radius=2.0, tip_radius=0.0, radius_scale=0.02, use_close_tip=False)
    snapshot = stage.take()
    assert len(snapshot.instances) == 2 and not snapshot.notes
    mesh = hair_of(snapshot)
    low, high = mesh.bounds_min, mesh.bounds_max
    assert low[2] == pytest.approx(0.0, abs=0.02) and high[2] == pytest.approx(0.5, abs=0.02)
    assert (low[:2] > -0.05).all() and (high[:2] < 1.05).all()
    # A tube of twelve sides is a little wider than the strand: pi / (12 sin(pi / 12)).
    roots = mesh.positions[mesh.positions[:, 2] < 1e-4]
    centres = roots.reshape(-1, 12, 3).mean(axis=1, keepdims=True)
    assert np.linalg.norm(roots.reshape(-1, 12, 3) - centres, axis=2) == pytest.approx(0.02 * 1.0115, rel=1e-3)


def test_children_hide_their_parents(stage):
    ground = grow(stage, count=10)
    alone = len(hair_of(stage.take()).triangle_corners)
    ground.particle_systems[0].settings.child_type = "SIMPLE"
    ground.particle_systems[0].settings.rendered_child_count = 7
    ground.particle_systems[0].settings.child_percent = 7  # the test's depsgraph is a viewport's
    stage.scene.view_layers[0].update()
    assert len(hair_of(stage.take()).triangle_corners) == 7 * alone


def test_a_hidden_emitter_keeps_its_hair(stage):
    ground = grow(stage)
    ground.show_instancer_for_viewport = ground.show_instancer_for_render = False
    (only,) = stage.take().meshes
    assert only.startswith("hair")


def test_strands_have_the_place_of_their_root_on_the_mesh(stage):
    grow(stage)
    mesh = hair_of(stage.take())
    uv = mesh.uv_maps["Map"]
    places = mesh.positions[mesh.corner_vertices]
    low = places[:, 2] < 1e-4
    np.testing.assert_allclose(uv[low], places[low, :2], atol=0.03)
    assert mesh.active_uv == "Map"


def test_hair_takes_its_material_slot_and_is_read_once(stage):
    ground = grow(stage, material=2)
    for name in ("Skin", "Hair"):
        ground.data.materials.append(stage.material(name))
    cache = SnapshotCache()
    snapshot = stage.take(cache)
    (hair,) = [one for one in snapshot.instances if one.mesh.startswith("hair")]
    assert snapshot.materials[hair.materials[0]].name == "Hair"
    again = stage.take(cache)
    assert hair_of(again).version == hair_of(snapshot).version and again.sync_stats["meshes_read"] == 0


def test_instances_of_an_object_carry_its_hair(stage):
    ground = grow(stage)
    group = bpy.data.collections.new("Group")
    group.objects.link(ground)
    stage.scene.collection.objects.unlink(ground)
    for number in range(3):
        empty = stage.link(f"Empty {number}")
        empty.instance_type, empty.instance_collection = "COLLECTION", group
        empty.location.x = 2.0 * number
    stage.scene.view_layers[0].update()
    snapshot = stage.take()
    placed = [one for one in snapshot.instances if one.mesh.startswith("hair")]
    assert sorted(one.matrix[0, 3] for one in placed) == pytest.approx([0.0, 2.0, 4.0])
    assert hair_of(snapshot).bounds_max[0] < 1.1


def test_many_strands_become_coarser_not_fewer():
    offsets = np.arange(0, 9 * 60_001, 9)
    rng = np.random.default_rng(1)
    points = (rng.uniform(0, 1, (60_000, 1, 3)) + np.linspace(0, 0.1, 9)[None, :, None]).reshape(-1, 3)
    _, _, triangles, source = tubes(points.astype(np.float32), np.full(len(points), 1e-3), offsets)
    assert len(triangles) <= MOST_TRIANGLES
    assert len(np.unique(np.searchsorted(offsets, source, side="right"))) == 60_000
    assert set(offsets[:-1]) <= set(source) and set(offsets[1:] - 1) <= set(source)
