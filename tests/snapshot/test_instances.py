"""Instances are placed, never copied, and carry what their object and its instancer say."""

from dataclasses import asdict

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from addon.snapshot import SnapshotCache


def names(snapshot):
    return [one.object_name for one in snapshot.instances]


def collection_of(stage, *objects):
    made = bpy.data.collections.new("Collection")
    for one in objects:
        made.objects.link(one)
    empty = stage.link("Empty")
    empty.instance_type, empty.instance_collection = "COLLECTION", made
    return empty


def cube_on_points(group_name="Scatter", instanced="GeometryNodeMeshCube"):
    """A geometry node group that shows the mesh it gets, and a cube on each of its points."""
    group = bpy.data.node_groups.new(group_name, "GeometryNodeTree")
    group.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    group.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    new, link = group.nodes.new, group.links.new
    entry, leave, cube = new("NodeGroupInput"), new("NodeGroupOutput"), new(instanced)
    place, join = new("GeometryNodeInstanceOnPoints"), new("GeometryNodeJoinGeometry")
    link(entry.outputs[0], place.inputs["Points"])
    link(cube.outputs[0], place.inputs["Instance"])
    link(entry.outputs[0], join.inputs[0])
    link(place.outputs[0], join.inputs[0])
    link(join.outputs[0], leave.inputs[0])
    return group


def test_objects_that_share_a_mesh_share_one_mesh(stage):
    data = stage.mesh()
    for x in range(3):
        stage.link(f"O{x}", data, Matrix.Translation((x, 0, 0)))
    snapshot = stage.take()
    assert len(snapshot.meshes) == 1
    assert [one.matrix[0, 3] for one in snapshot.instances] == [0, 1, 2]


@pytest.mark.parametrize("names_of_both", [("a cube", "b lamp"), ("b cube", "a lamp")])
def test_lamps_and_meshes_of_a_collection_on_points_stay_what_they_are(stage, names_of_both):
    """Copies come point by point, in either order of kinds."""
    cube = stage.link(names_of_both[0], stage.mesh())
    lamp = stage.link(names_of_both[1], bpy.data.lights.new("lamp", "POINT"))
    placed = collection_of(stage, cube, lamp)
    made = placed.instance_collection
    for one in (cube, lamp, placed):
        stage.scene.collection.objects.unlink(one)
    group = cube_on_points("On points", "GeometryNodeCollectionInfo")
    info = next(node for node in group.nodes if node.bl_idname == "GeometryNodeCollectionInfo")
    info.inputs["Collection"].default_value = made
    stage.link("points", stage.mesh()).modifiers.new("Scatter", "NODES").node_group = group
    snapshot = stage.take()
    points = len(stage.scene.objects["points"].data.vertices)
    assert names(snapshot).count(names_of_both[0]) == points == len(snapshot.lights)


def test_a_modifier_parts_an_object_from_the_shared_mesh(stage):
    data = stage.mesh()
    stage.link("plain", data)
    stage.link("mirrored", data).modifiers.new("Mirror", "MIRROR")
    snapshot = stage.take()
    counts = {one.object_name: snapshot.meshes[one.mesh].triangle_count for one in snapshot.instances}
    assert counts == {"plain": 1, "mirrored": 2}


def test_a_collection_instance_is_placed_by_both_matrices(stage):
    inner = bpy.data.objects.new("Inner", stage.mesh())
    inner.matrix_world = Matrix.Translation((0, 1, 0))
    empty = collection_of(stage, inner)
    empty.matrix_world = Matrix.Scale(2, 4) @ Matrix.Translation((5, 0, 0))
    snapshot = stage.take()
    (one,) = snapshot.instances
    assert one.object_name == "Inner"
    assert one.matrix.tolist() == [[2, 0, 0, 10], [0, 2, 0, 2], [0, 0, 2, 0], [0, 0, 0, 1]]


def test_nested_collections_keep_one_mesh_and_distinct_keys(stage):
    inner = collection_of(stage, bpy.data.objects.new("Leaf", stage.mesh()))
    stage.scene.collection.objects.unlink(inner)
    for _ in range(2):
        collection_of(stage, inner)
    snapshot = stage.take()
    assert names(snapshot) == ["Leaf", "Leaf"]
    assert len(snapshot.meshes) == 1
    assert len({one.key for one in snapshot.instances}) == 2


def test_geometry_nodes_instances_share_one_mesh_beside_the_objects_own(stage):
    placed = stage.link("Scatter", stage.grid(3))
    placed.modifiers.new("Nodes", "NODES").node_group = cube_on_points()
    snapshot = stage.take()
    assert len(snapshot.meshes) == 2
    triangles = [snapshot.meshes[one.mesh].triangle_count for one in snapshot.instances]
    assert sorted(triangles) == [12] * 16 + [18]


def test_keys_of_geometry_nodes_meshes_outlast_a_new_evaluation(stage):
    placed = stage.link("Scatter", stage.grid(2))
    placed.modifiers.new("Nodes", "NODES").node_group = cube_on_points()
    cache = SnapshotCache()
    first = stage.take(cache)
    placed.data.update_tag()
    second = stage.take(cache)
    assert second.sync_stats["meshes_read"] == 0
    assert list(first.meshes) == list(second.meshes)
    assert [one.key for one in first.instances] == [one.key for one in second.instances]


def test_vertex_instancing_hides_its_instancer_when_told(stage):
    leaf, tree = stage.link("Leaf", stage.mesh()), stage.link("Tree", stage.grid(1))
    leaf.parent = tree
    tree.instance_type = "VERTS"
    tree.show_instancer_for_viewport = False
    # Four instances, and the child itself, which Blender shows too.
    assert sorted(names(stage.take())) == ["Leaf"] * 5
    tree.show_instancer_for_viewport = True
    assert sorted(names(stage.take())) == ["Leaf"] * 5 + ["Tree"]


def test_particles_that_show_an_object_are_instances(stage):
    leaf = stage.link("Leaf", stage.mesh(), Matrix.Translation((0, 0, 9)))
    ground = stage.link("Ground", stage.grid(2))
    ground.modifiers.new("Particles", "PARTICLE_SYSTEM")
    settings = ground.particle_systems[0].settings
    settings.type, settings.count = "HAIR", 7
    settings.render_type, settings.instance_object = "OBJECT", leaf
    snapshot = stage.take()
    assert sorted(names(snapshot)) == ["Ground"] + ["Leaf"] * 8
    assert len(snapshot.meshes) == 2


def test_slots_linked_to_the_object_give_each_instance_its_materials(stage):
    data = stage.mesh()
    ours, theirs = bpy.data.materials.new("ours"), bpy.data.materials.new("theirs")
    data.materials.append(ours)
    stage.link("A", data)
    other = stage.link("B", data)
    other.material_slots[0].link, other.material_slots[0].material = "OBJECT", theirs
    stage.link("C", data)
    snapshot = stage.take()
    assert len(snapshot.meshes) == 1
    shown = [(one.object_name, snapshot.materials[one.materials[0]].name) for one in snapshot.instances]
    # Same mesh and materials stand together, in the scene's order.
    assert shown == [("A", "ours"), ("C", "ours"), ("B", "theirs")]


def test_an_empty_slot_of_the_object_hides_the_material_of_the_mesh(stage):
    data = stage.mesh()
    data.materials.append(bpy.data.materials.new("ours"))
    stage.link("A", data)
    other = stage.link("B", data)
    other.material_slots[0].link, other.material_slots[0].material = "OBJECT", None
    assert {one.object_name: one.materials[0] == 0 for one in stage.take().instances} == {"A": False, "B": True}


def test_an_empty_slot_shows_the_default_material(stage):
    data = stage.mesh()
    data.materials.append(None)
    stage.link("O", data)
    assert stage.take().instances[0].materials == (0,)


def test_materials_set_by_geometry_nodes_reach_the_instances(stage):
    group = cube_on_points()
    material = bpy.data.materials.new("painted")
    setter = group.nodes.new("GeometryNodeSetMaterial")
    setter.inputs["Material"].default_value = material
    cube = next(node for node in group.nodes if node.bl_idname == "GeometryNodeMeshCube")
    place = next(node for node in group.nodes if node.bl_idname == "GeometryNodeInstanceOnPoints")
    group.links.new(cube.outputs[0], setter.inputs[0])
    group.links.new(setter.outputs[0], place.inputs["Instance"])
    stage.link("O", stage.mesh()).modifiers.new("Nodes", "NODES").node_group = group
    snapshot = stage.take()
    cubes = [one for one in snapshot.instances if snapshot.meshes[one.mesh].triangle_count == 12]
    assert len(cubes) == 3
    for one in cubes:
        mesh = snapshot.meshes[one.mesh]
        assert {snapshot.materials[one.materials[slot]].name for slot in mesh.triangle_slots} == {"painted"}


@pytest.mark.parametrize(
    ("setting", "flag"),
    [
        ("visible_camera", "camera"),
        ("visible_diffuse", "diffuse"),
        ("visible_glossy", "glossy"),
        ("visible_transmission", "transmission"),
        ("visible_volume_scatter", "volume"),
        ("visible_shadow", "shadow"),
    ],
)
def test_ray_visibility_is_the_objects_and_the_instancers(stage, setting, flag):
    setattr(stage.link("O", stage.mesh()), setting, False)
    inner = bpy.data.objects.new("Inner", stage.mesh())
    setattr(collection_of(stage, inner), setting, False)
    for one in stage.take().instances:
        flags = asdict(one.visibility)
        assert flags.pop(flag) is False
        assert all(flags.values())


def test_indirect_only_collections_hide_from_the_camera(stage):
    made = bpy.data.collections.new("Collection")
    stage.scene.collection.children.link(made)
    made.objects.link(bpy.data.objects.new("O", stage.mesh()))
    layer = bpy.context.view_layer.layer_collection.children[0]
    layer.indirect_only = True
    assert stage.take().instances[0].visibility.camera is False
    layer.indirect_only, layer.holdout = False, True
    (one,) = stage.take().instances
    assert one.visibility.camera is True
    assert one.holdout is True


def test_holdout_and_pass_index(stage):
    placed = stage.link("O", stage.mesh())
    placed.is_holdout, placed.pass_index = True, 7
    (one,) = stage.take().instances
    assert (one.holdout, one.pass_index) == (True, 7)


def in_layer(stage, name, *objects):
    """The layer collection of a new collection in the scene that holds these objects alone."""
    made = bpy.data.collections.new(name)
    stage.scene.collection.children.link(made)
    for one in objects:
        stage.scene.collection.objects.unlink(one)
        made.objects.link(one)
    return bpy.context.view_layer.layer_collection.children[name]


@pytest.mark.parametrize("decides", [False, True], ids=["instanced", "instancer"])
@pytest.mark.parametrize("how", ["object's holdout", "holdout", "indirect only", "both"])
def test_an_instance_is_cut_out_or_unseen_where_its_instancer_is(stage, how, decides):
    inner = stage.link("Inner", stage.mesh())
    empty = collection_of(stage, inner)
    layers = in_layer(stage, "Inner", inner), in_layer(stage, "Empty", empty)
    if how == "object's holdout":
        (inner, empty)[decides].is_holdout = True
    else:
        layers[decides].holdout = how != "indirect only"
        layers[decides].indirect_only = how != "holdout"
    (one,) = [one for one in stage.take().instances if "/" in one.key]
    assert one.holdout == (decides and how != "indirect only")
    assert one.visibility.camera == (not decides or how != "indirect only")


def test_a_holdout_in_a_collection_for_indirect_light_cuts_all_the_same(stage):
    placed = stage.link("O", stage.mesh())
    in_layer(stage, "Layer", placed).indirect_only = True
    placed.is_holdout = True
    (one,) = stage.take().instances
    assert (one.holdout, one.visibility.camera) == (True, True)


def test_the_predicate_hides_objects(stage):
    for name in "AB":
        stage.link(name, stage.mesh())
    assert names(stage.take(shown=lambda found: found.name == "B")) == ["B"]


def test_a_render_leaves_out_what_is_disabled_in_renders(stage):
    stage.link("seen", stage.mesh())
    stage.link("hidden", stage.mesh()).hide_render = True
    stage.link("viewport only", stage.mesh()).hide_viewport = True
    stage.camera()
    taken = []

    class Engine(bpy.types.RenderEngine):
        bl_idname = "SNAPSHOT_INSTANCES_TEST"
        bl_label = "Snapshot test"

        def render(self, depsgraph):
            from addon.snapshot import take

            taken.append(take(depsgraph, SnapshotCache(), 8, 8))

    bpy.utils.register_class(Engine)
    try:
        stage.scene.render.engine = Engine.bl_idname
        bpy.ops.render.render()
    finally:
        bpy.utils.unregister_class(Engine)
    assert names(taken[0]) == ["seen", "viewport only"]


def test_negative_and_zero_scale_are_kept(stage):
    stage.link("O", stage.mesh()).scale = (-1, 0, 2)
    (one,) = stage.take().instances
    assert np.diag(one.matrix).tolist() == [-1, 0, 2, 1]


@pytest.mark.parametrize("data", ["mesh", "light"])
def test_what_stands_at_no_finite_place_is_left_out_and_named(stage, data):
    placed = stage.link("Lost", stage.mesh() if data == "mesh" else bpy.data.lights.new("Lost", "POINT"))
    placed.parent = stage.link("Parent")
    placed.parent.scale, placed.location = (1e30,) * 3, (1e30,) * 3  # the product overflows
    snapshot = stage.take()
    assert snapshot.instances == snapshot.lights == ()
    assert snapshot.notes[0].subject == "Object 'Lost'"


def test_random_is_the_one_that_cycles_gives_the_object(stage):
    """Object Info > Random drawn as emission by Cycles, one pixel."""
    if not hasattr(stage.scene, "cycles"):
        pytest.skip("this Blender has no Cycles")
    material = stage.material()
    tree = material.node_tree
    tree.nodes.clear()
    info, emission = tree.nodes.new("ShaderNodeObjectInfo"), tree.nodes.new("ShaderNodeEmission")
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(info.outputs["Random"], emission.inputs["Strength"])
    tree.links.new(emission.outputs[0], output.inputs["Surface"])
    data = stage.grid(1)
    data.materials.append(material)
    stage.link("Some Object.001", data, Matrix.Translation((-0.5, -0.5, 0)))
    stage.camera().location.z = 1.0
    (one,) = stage.take().instances
    assert drawn_by_cycles(stage) == pytest.approx(one.random, abs=1e-3)


def drawn_by_cycles(stage):
    """Red of the one pixel that Cycles draws."""
    render = stage.scene.render
    render.engine = "CYCLES"
    render.resolution_x = render.resolution_y = 4
    stage.scene.cycles.samples = 1
    stage.scene.cycles.use_denoising = False
    render.image_settings.file_format = "OPEN_EXR"
    render.image_settings.color_depth = "32"
    render.filepath = bpy.app.tempdir + "random.exr"
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(render.filepath)
    image.colorspace_settings.name = "Non-Color"
    return image.pixels[0]


def test_what_is_not_drawn_is_named(stage):
    stage.link("Smoke", bpy.data.volumes.new("smoke"))
    snapshot = stage.take()
    assert snapshot.instances == ()
    said = {note.subject: note.text for note in snapshot.notes}
    assert set(said) == {"Object 'Smoke'"}
    assert all("is not drawn" in text for text in said.values())


def test_order_and_grouping_do_not_depend_on_names(stage):
    first, second = stage.mesh("zzz"), stage.mesh("aaa")
    for number, data in enumerate((first, second, first, second)):
        stage.link(f"{9 - number}", data)
    snapshot = stage.take()
    assert names(snapshot) == ["9", "7", "8", "6"]
    assert [one.mesh for one in snapshot.instances] == sorted(
        (one.mesh for one in snapshot.instances), key=list(snapshot.meshes).index
    )


@pytest.mark.timing
def test_three_thousand_instances_sync_in_time(stage):
    """Half of them objects of their own, half instances of a collection's."""
    data = stage.mesh()
    for number in range(1500):
        stage.link(f"O{number}", data)
    leaf = stage.link("Leaf", stage.mesh())
    tree = stage.link("Tree", stage.grid(38))  # 1521 vertices
    leaf.parent, tree.instance_type = tree, "VERTS"
    cache = SnapshotCache()
    stage.take(cache)
    seconds = min(stage.take(cache).sync_stats["seconds"] for _ in range(3))
    count = len(stage.take(cache).instances)
    print(f"\n{count} instances: {seconds * 1e3:.0f} ms")
    assert count > 3000
    assert seconds < 0.25  # 0.1 wanted; the rest is for a busy machine
