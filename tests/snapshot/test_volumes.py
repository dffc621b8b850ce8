"""Volume objects arrive as grids of voxels, with what their objects and modifiers make of them."""

import time
from types import SimpleNamespace

import bpy
import numpy as np
import pytest

from addon.snapshot import SnapshotCache, instances, smoke
from addon.snapshot.volumes import _grids, openvdb
from tests.snapshot.test_instances import collection_of, in_layer


@pytest.fixture
def cloud(stage, tmp_path):
    """An object of 4 voxels of half a metre on a side."""
    vdb = openvdb()
    grid = vdb.FloatGrid()
    grid.name = "density"
    grid.copyFromArray(np.ones((4, 4, 4), np.float32))
    grid.transform = vdb.createLinearTransform(voxelSize=0.5)
    vdb.write(str(tmp_path / "cloud.vdb"), [grid])
    data = bpy.data.volumes.new("cloud")
    data.filepath = str(tmp_path / "cloud.vdb")
    return stage.link("cloud", data)


def only_volume(snapshot):
    (one,) = snapshot.volumes
    return one.volume


def shift(placed, x):
    """Gives the object a modifier that moves its geometry; its node is returned."""
    group = bpy.data.node_groups.new("Shift", "GeometryNodeTree")
    for way in ("INPUT", "OUTPUT"):
        group.interface.new_socket("Geometry", in_out=way, socket_type="NodeSocketGeometry")
    entry, move, leave = (
        group.nodes.new(kind) for kind in ("NodeGroupInput", "GeometryNodeTransform", "NodeGroupOutput")
    )
    group.links.new(entry.outputs[0], move.inputs["Geometry"])
    group.links.new(move.outputs[0], leave.inputs[0])
    move.inputs["Translation"].default_value = (x, 0, 0)
    placed.modifiers.new("Shift", "NODES").node_group = group
    return move


def test_modifiers_of_a_volume_with_a_file_are_followed(stage, cloud):
    cache = SnapshotCache()
    plain = only_volume(stage.take(cache))
    node = shift(cloud, 5)
    first = only_volume(stage.take(cache))
    node.inputs["Translation"].default_value = (7, 0, 0)
    second = only_volume(stage.take(cache))
    assert [one.to_object[0, 3] - plain.to_object[0, 3] for one in (first, second)] == pytest.approx([5, 7])
    assert np.array_equal(second.grids["density"], plain.grids["density"])
    assert len({plain.version, first.version, second.version}) == 3


def test_a_file_that_a_modifier_lets_pass_is_read_anew(stage, cloud, tmp_path):
    """Whether the modifier is off, or does nothing."""
    for shown in (False, True):
        cache = SnapshotCache()
        modifier = cloud.modifiers.new("Displace", "VOLUME_DISPLACE")
        modifier.show_render = modifier.show_viewport = shown
        modifier.strength = 0.0
        first = only_volume(stage.take(cache))
        vdb = openvdb()
        grid = vdb.FloatGrid()
        grid.name = "density"
        grid.copyFromArray(np.full((4, 4, 4), 2.0 + shown, np.float32))
        vdb.write(str(tmp_path / f"{shown}.vdb"), [grid])
        cloud.data.filepath = str(tmp_path / f"{shown}.vdb")
        second = only_volume(stage.take(cache))
        assert second.grids["density"].max() == 2.0 + shown and second.version != first.version
        cloud.modifiers.remove(modifier)


def test_a_volume_that_modifiers_made_anew_alike_is_the_same(stage, cloud):
    cache = SnapshotCache()
    shift(cloud, 5)
    before = only_volume(stage.take(cache))
    cloud.data.update_tag()
    assert only_volume(stage.take(cache)) is before


def test_each_object_has_its_own_of_a_shared_volume_that_modifiers_change(stage, cloud):
    shift(stage.link("shifted", cloud.data), 5)
    plain, shifted = stage.take().volumes
    assert shifted.volume.to_object[0, 3] - plain.volume.to_object[0, 3] == pytest.approx(5)


def test_a_volume_that_a_mesh_turns_into_is_followed(stage):
    """The file has no volume data-block then."""
    placed, cache = stage.link("O", stage.mesh()), SnapshotCache()
    node = shift(placed, 5)
    tree = node.id_data
    made = tree.nodes.new("GeometryNodeVolumeCube")
    for axis in "XYZ":
        made.inputs[f"Resolution {axis}"].default_value = 4
    tree.links.new(made.outputs["Volume"], node.inputs["Geometry"])
    first = only_volume(stage.take(cache))
    node.inputs["Translation"].default_value = (7, 0, 0)
    second = only_volume(stage.take(cache))
    assert second.to_object[0, 3] - first.to_object[0, 3] == pytest.approx(2)
    assert second.key == first.key


def test_a_view_layer_without_volumes_has_none(stage, cloud):
    assert stage.take().volumes
    bpy.context.view_layer.use_volumes = False
    assert stage.take().volumes == ()


def test_the_view_layers_material_is_that_of_volumes_too(stage, cloud):
    cloud.data.materials.append(stage.material("Own"))
    bpy.context.view_layer.material_override = stage.material("Over")
    snapshot = stage.take()
    assert snapshot.materials[snapshot.volumes[0].material].name == "Over"


@pytest.mark.parametrize("slot", [False, True], ids=["no slot", "empty slot"])
def test_a_volume_without_a_material_is_a_principled_volume(stage, cloud, slot):
    if slot:
        cloud.data.materials.append(None)
    stage.link("another", cloud.data)
    snapshot = stage.take()
    (index,) = {one.material for one in snapshot.volumes}
    graph = snapshot.materials[index].graph
    assert graph.nodes[graph.volume[0]].type == "ShaderNodeVolumePrincipled"
    assert graph.surface is None


def test_volumes_are_seen_by_the_rays_of_the_object_and_of_its_instancer(stage, cloud):
    cloud.visible_shadow = False
    empty = collection_of(stage, cloud)
    empty.visible_glossy = False
    layer = in_layer(stage, "Empty", empty)
    plain, instance = sorted(stage.take().volumes, key=lambda one: "/" in one.key)
    assert (plain.visibility.shadow, plain.visibility.glossy) == (False, True)
    assert (instance.visibility.shadow, instance.visibility.glossy) == (False, False)
    layer.indirect_only = True
    plain, instance = sorted(stage.take().volumes, key=lambda one: "/" in one.key)
    assert (plain.visibility.camera, instance.visibility.camera) == (True, False)


@pytest.mark.parametrize("surfaces", [False, True])
def test_a_domain_of_smoke_counts_as_a_volume_of_the_view_layer(stage, monkeypatch, surfaces):
    for module in (instances, smoke):
        monkeypatch.setattr(module, "domain_of", lambda owner: owner if owner.name == "Domain" else None)
    monkeypatch.setattr(smoke, "domain_grids", lambda settings: {"density": np.ones((2, 2, 2), np.float32)})
    stage.link("Domain", stage.mesh())
    stage.link("O", stage.mesh())
    layer = bpy.context.view_layer
    layer.use_solid, layer.material_override = surfaces, stage.material("Over")
    snapshot = stage.take()
    assert [snapshot.materials[one.material].name for one in snapshot.volumes] == ["Over"]
    assert len(snapshot.instances) == surfaces
    layer.use_volumes = False
    snapshot = stage.take()
    assert snapshot.volumes == ()
    assert len(snapshot.instances) == surfaces


def test_two_voxels_far_apart_take_no_memory(stage, cloud, tmp_path):
    vdb = openvdb()
    grid = vdb.FloatGrid()
    grid.name = "density"
    for place in ((0, 0, 0), (100_000, 100_000, 100_000)):
        grid.fill(place, place, 1.0)
    vdb.write(str(tmp_path / "cloud.vdb"), [grid])
    snapshot = stage.take(SnapshotCache())
    assert not snapshot.volumes
    assert any("box of 100001 x 100001 x 100001" in note.text and "resample" in note.text for note in snapshot.notes)


def test_a_large_grid_read_in_layers_has_the_means_of_its_voxels(stage, cloud, tmp_path):
    """400 voxels along x, ten in each of the others: three become one."""
    values = np.random.default_rng(3).random((400, 10, 10)).astype(np.float32)
    vdb = openvdb()
    grid = vdb.FloatGrid()
    grid.name = "density"
    grid.copyFromArray(values)
    vdb.write(str(tmp_path / "cloud.vdb"), [grid])
    found = only_volume(stage.take(SnapshotCache())).grids["density"]
    padded = np.pad(values, ((0, 2), (0, 2), (0, 2))).reshape(134, 3, 4, 3, 4, 3)
    np.testing.assert_allclose(found, padded.mean(axis=(1, 3, 5)), atol=1e-6)


def test_a_text_longer_than_its_file_is_refused_before_memory_is_taken_for_it(cloud, tmp_path):
    """Blender has read the file's headers by then and waited for it; Candela does not wait again."""
    path = tmp_path / "cloud.vdb"
    whole, text = path.read_bytes(), b"\x04\x00\x00\x00name\x06\x00\x00\x00string"
    assert whole.count(text) == 1 and _grids(str(path)) is not None
    at = whole.index(text) + len(text)
    path.write_bytes(whole[:at] + b"\xf0\xff\xff\x7f" + whole[at + 4 :])
    started = time.process_time()
    with pytest.raises(ValueError, match="beyond its end"):
        _grids(str(path))
    assert time.process_time() - started < 0.5


@pytest.mark.parametrize("finer", [1, 2])
def test_smoke_with_noise_has_cells_that_many_times_finer(finer):
    """Grids of a domain of 2 x 3 x 4 cells, x running fastest; noise makes them finer along each axis."""
    size = np.array((2, 3, 4)) * finer
    count = int(size.prod())
    settings = SimpleNamespace(
        density_grid=np.arange(1.0, count + 1.0), flame_grid=[], temperature_grid=[], heat_grid=[], color_grid=[],
        domain_resolution=(2, 3, 4), use_noise=finer > 1, noise_scale=finer,
    )  # fmt: skip
    ((name, density),) = smoke.domain_grids(settings).items()
    assert name == "density" and density.shape == tuple(size)
    x, y, z = np.indices(size)
    np.testing.assert_array_equal(density, 1.0 + x + size[0] * (y + size[1] * z))
