"""What did not change is not read again, and what did is never stale."""

import contextlib

import bpy
import numpy as np
import pytest

from addon.snapshot import SnapshotCache, instances


def counts(snapshot):
    return snapshot.sync_stats["meshes_read"], snapshot.sync_stats["meshes_reused"]


def only_mesh(snapshot):
    (mesh,) = snapshot.meshes.values()
    return mesh


def test_an_unchanged_mesh_is_the_same_object_again(stage):
    cache = SnapshotCache()
    stage.link("O", stage.mesh())
    first, second = stage.take(cache), stage.take(cache)
    assert counts(first) == (1, 0)
    assert counts(second) == (0, 1)
    assert only_mesh(second) is only_mesh(first)


def test_moving_an_object_reads_no_mesh(stage):
    cache = SnapshotCache()
    placed = stage.link("O", stage.mesh())
    stage.take(cache)
    placed.location.x = 3.0
    snapshot = stage.take(cache)
    assert counts(snapshot) == (0, 1)
    assert snapshot.instances[0].matrix[0, 3] == 3.0


def alter(change, placed, data):
    if change == "vertex":
        data.vertices[0].co.z = 1.0
    elif change == "uv":
        data.uv_layers["uv"].data[0].uv = (0.5, 0.25)
    elif change == "normals":
        data.polygons.foreach_set("use_smooth", np.ones(4, bool))
        data.vertices[4].co.z = 0.3
    elif change == "material index":
        data.polygons[3].material_index = 1
    elif change == "slot":
        data.materials.append(bpy.data.materials.new("c"))
    elif change == "modifier":
        placed.modifiers.new("Mirror", "MIRROR")
    elif change == "color":
        data.color_attributes["color"].data[0].color = (1, 0, 0, 1)


@pytest.mark.parametrize("informed", [False, True])
@pytest.mark.parametrize("change", ["vertex", "uv", "normals", "material index", "slot", "modifier", "color"])
def test_every_change_of_content_gives_a_new_version(stage, change, informed):
    cache = SnapshotCache()
    data = stage.grid(2)
    data.materials.append(bpy.data.materials.new("a"))
    data.materials.append(bpy.data.materials.new("b"))
    data.uv_layers.new(name="uv")
    data.color_attributes.new("color", "FLOAT_COLOR", "POINT")
    placed = stage.link("O", data)
    old = only_mesh(stage.take(cache))
    with stage.telling(cache) if informed else contextlib.nullcontext():
        alter(change, placed, data)
        data.update()
    assert cache.informed == informed
    new = only_mesh(stage.take(cache))
    assert new.version != old.version
    fresh = only_mesh(stage.take(SnapshotCache()))
    assert np.array_equal(new.positions, fresh.positions)
    assert np.array_equal(new.triangle_slots, fresh.triangle_slots)
    assert new.slots == fresh.slots


def test_a_new_evaluation_with_equal_content_keeps_the_version(stage):
    cache = SnapshotCache()
    data = stage.mesh()
    stage.link("O", data)
    old = only_mesh(stage.take(cache))
    data.update_tag()
    snapshot = stage.take(cache)
    assert counts(snapshot) == (0, 1)
    assert only_mesh(snapshot) is old


def test_another_depsgraph_of_the_same_scene_reuses_the_mesh(stage):
    """An F12 render evaluates everything anew, in a graph of its own."""
    cache = SnapshotCache()
    stage.link("O", stage.mesh())
    old = only_mesh(stage.take(cache))
    taken = []

    class Engine(bpy.types.RenderEngine):
        bl_idname = "SNAPSHOT_REUSE_TEST"
        bl_label = "Snapshot test"

        def render(self, depsgraph):
            from addon.snapshot import take

            taken.append(take(depsgraph, cache, 8, 8))

    bpy.utils.register_class(Engine)
    try:
        stage.scene.render.engine = Engine.bl_idname
        bpy.ops.render.render()
    finally:
        bpy.utils.unregister_class(Engine)
    assert counts(taken[0]) == (0, 1)
    assert only_mesh(taken[0]) is old


def test_the_cache_forgets_what_left_the_scene(stage):
    cache = SnapshotCache()
    placed = stage.link("O", stage.mesh())
    old = only_mesh(stage.take(cache))
    stage.scene.collection.objects.unlink(placed)
    assert stage.take(cache).meshes == {}
    assert cache.meshes == {}
    stage.scene.collection.objects.link(placed)
    assert only_mesh(stage.take(cache)).version > old.version


def test_versions_never_repeat_between_caches(stage):
    stage.link("O", stage.mesh())
    first, second = only_mesh(stage.take(SnapshotCache())), only_mesh(stage.take(SnapshotCache()))
    assert first.key == second.key
    assert first.version != second.version


@pytest.mark.parametrize("informed", [False, True])
def test_a_changed_node_value_is_seen(stage, informed):
    cache = SnapshotCache()
    data, material = stage.mesh(), stage.material()
    data.materials.append(material)
    stage.link("O", data)
    shader = next(node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED")
    shader.inputs["Roughness"].default_value = 0.25
    stage.take(cache)
    same = stage.take(cache).materials[1].graph
    with stage.telling(cache) if informed else contextlib.nullcontext():
        shader.inputs["Roughness"].default_value = 0.75
    assert cache.informed == informed
    changed = stage.take(cache).materials[1].graph
    (node,) = (node for node in changed.nodes.values() if node.type == "ShaderNodeBsdfPrincipled")
    assert node.inputs["Roughness"].value == 0.75
    assert changed is not same


def test_an_unchanged_graph_stays_the_same_object(stage):
    cache = SnapshotCache()
    data = stage.mesh()
    data.materials.append(stage.material())
    stage.link("O", data)
    assert stage.take(cache).materials[1].graph is stage.take(cache).materials[1].graph


def test_an_empty_list_of_updates_is_no_news(stage):
    cache = SnapshotCache()
    cache.invalidate([])
    assert not cache.informed


def test_a_sync_uses_up_the_news(stage):
    cache = SnapshotCache()
    placed = stage.link("O", stage.mesh())
    stage.take(cache)
    with stage.telling(cache):
        placed.location.x = 1.0
    assert cache.informed
    stage.take(cache)
    assert not cache.informed
    assert cache.changed == set()


def test_a_moved_object_leaves_the_graphs_unread(stage):
    cache = SnapshotCache()
    data = stage.mesh()
    data.materials.append(stage.material())
    placed = stage.link("O", data)
    stage.take(cache)
    entries = dict(cache.graphs)
    with stage.telling(cache):
        placed.location.x = 1.0
    stage.take(cache)
    assert all(cache.graphs[key] is entry for key, entry in entries.items())


# Objects


def told(snapshot):
    """All that a snapshot says of its instances, as plain data."""
    return {
        one.key: {name: value.tolist() if name == "matrix" else value for name, value in vars(one).items()}
        for one in snapshot.instances
    }


def layer_of(stage, name):
    return bpy.context.view_layer.layer_collection.children[name]


EDITS = {
    "nothing": lambda stage, a, b: None,
    "move": lambda stage, a, b: setattr(a, "location", (1, 2, 3)),
    "parent": lambda stage, a, b: setattr(a, "parent", b),
    "move the parent": lambda stage, a, b: setattr(stage.scene.objects["Parent"], "location", (0, 0, 4)),
    "name": lambda stage, a, b: setattr(a, "name", "Other"),
    "name of the topmost parent": lambda stage, a, b: setattr(stage.scene.objects["Parent"], "name", "Other"),
    "no topmost parent": lambda stage, a, b: setattr(stage.scene.objects["Child"], "parent", None),
    "color": lambda stage, a, b: setattr(a, "color", (1, 0, 0, 1)),
    "pass index": lambda stage, a, b: setattr(a, "pass_index", 7),
    "shadow": lambda stage, a, b: setattr(a, "visible_shadow", False),
    "holdout": lambda stage, a, b: setattr(a, "is_holdout", True),
    "hide": lambda stage, a, b: setattr(a, "hide_viewport", True),
    "hide in the layer": lambda stage, a, b: a.hide_set(True),
    "slot": lambda stage, a, b: a.data.materials.append(bpy.data.materials.new("New")),
    "modifier": lambda stage, a, b: a.modifiers.new("Mirror", "MIRROR"),
    "instances": lambda stage, a, b: setattr(stage.scene.objects["Parent"], "instance_type", "VERTS"),
    "indirect only": lambda stage, a, b: setattr(layer_of(stage, "Inner"), "indirect_only", True),
    "holdout of the layer": lambda stage, a, b: setattr(layer_of(stage, "Inner"), "holdout", True),
    "exclude": lambda stage, a, b: setattr(layer_of(stage, "Inner"), "exclude", True),
    "removal of the parent": lambda stage, a, b: bpy.data.objects.remove(stage.scene.objects["Parent"]),
    "removal": lambda stage, a, b: bpy.data.objects.remove(b),
    "override": lambda stage, a, b: setattr(
        bpy.context.view_layer, "material_override", bpy.data.materials.new("Over")
    ),
}


@pytest.mark.parametrize("informed", [False, True])
@pytest.mark.parametrize("edit", EDITS)
def test_what_is_taken_over_is_what_would_be_read(stage, edit, informed):
    cache = SnapshotCache()
    one, other, parent, child = (stage.link(name, stage.mesh()) for name in ("O", "P", "Parent", "Child"))
    child.parent = parent
    stage.link("Grandchild", stage.mesh()).parent = child
    inner = bpy.data.collections.new("Inner")
    stage.scene.collection.children.link(inner)
    inner.objects.link(stage.scene.objects["P"])
    stage.scene.collection.objects.unlink(other)
    stage.take(cache)
    for _ in range(2):  # the second time nothing happens any more
        with stage.telling(cache) if informed else contextlib.nullcontext():
            EDITS[edit](stage, one, other)
            edit = "nothing"
        assert told(stage.take(cache)) == told(stage.take(SnapshotCache()))


@pytest.mark.parametrize("informed", [False, True])
def test_instances_that_did_not_change_are_the_same_objects(stage, informed):
    cache = SnapshotCache()
    placed = [stage.link(f"O{k}", stage.mesh()) for k in range(4)]
    before = stage.take(cache).instances
    with stage.telling(cache) if informed else contextlib.nullcontext():
        placed[2].location.x = 1.0
    after = stage.take(cache).instances
    assert [a is b for a, b in zip(before, after)] == [True, True, False, True]
    assert stage.take(cache).instances is after


def test_what_a_viewport_hides_does_not_make_it_read_all_objects_again(stage, monkeypatch):
    """As with a closed eye of a collection: each object is asked whether it is shown, and one alone for all else."""
    cache, hidden, read = SnapshotCache(), {"O1"}, []
    placed = [stage.link(f"O{k}", stage.mesh()) for k in range(4)]

    def taken(cache):
        return stage.take(cache, shown=lambda one: one.name not in hidden)

    taken(cache)
    original = instances.own_settings
    monkeypatch.setattr(instances, "own_settings", lambda owner: read.append(owner.name) or original(owner))
    for now_hidden in ({"O1"}, {"O3"}):
        with stage.telling(cache):
            placed[2].location.x += 1.0
        hidden.clear()
        hidden.update(now_hidden)
        read.clear()
        found = taken(cache)
        assert read == ["O2"]
        assert told(found) == told(taken(SnapshotCache())) and len(found.instances) == 3
    assert len(stage.take(cache).instances) == 4  # no longer hidden
