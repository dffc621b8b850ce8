"""The list of instances on the GPU: what a move uploads, and that it says the same as a list that is uploaded anew."""

from dataclasses import replace
from types import SimpleNamespace

import bpy
import numpy as np
import pytest

from addon.gfx import geometry as gfx_geometry
from addon.gfx import images
from addon.materials.compiled import Attribute
from addon.scene import geometry
from addon.scene.corners import corner_attribute
from addon.scene.geometry import MOST_MOVED, SceneGeometry
from addon.scene.materials import MaterialSet
from addon.snapshot import SnapshotCache, take

COUNT = 300  # more than a row of the list holds


@pytest.fixture
def snapshot(gpu_context, empty_scene):
    """A field of cubes that share a mesh, and one that does not."""
    bpy.ops.object.camera_add(location=(0, -50, 10), rotation=(1.2, 0, 0))
    bpy.context.scene.camera = bpy.context.object
    bpy.ops.mesh.primitive_cube_add(size=0.5)
    mesh = bpy.context.object.data
    for k in range(COUNT):
        cube = bpy.data.objects.new(f"Cube {k}", mesh)
        cube.location = k % 20, k // 20, 0.0
        bpy.context.collection.objects.link(cube)
    bpy.ops.mesh.primitive_cube_add(size=1.0, location=(5, 5, 2))
    return take(bpy.context.evaluated_depsgraph_get(), SnapshotCache(), 64, 36)


def moved(snapshot, numbers, distance):
    """The snapshot with some of its instances elsewhere."""
    instances = list(snapshot.instances)
    for number in numbers:
        matrix = instances[number].matrix.copy()
        matrix[0, 3] += distance
        instances[number] = replace(instances[number], matrix=matrix)
    return replace(snapshot, instances=tuple(instances))


@pytest.fixture
def uploaded(monkeypatch):
    """Sizes of the lists that are uploaded from now on."""
    sizes = []
    upload = images.upload_list

    def counted(rows):
        sizes.append(len(rows))
        return upload(rows)

    monkeypatch.setattr(geometry.images, "upload_list", counted)
    return sizes


def content(made):
    return images.read(made.instances).reshape(-1, 4)[: made.instance_rows.shape[0] * geometry.TEXELS_PER_INSTANCE]


def updated(made, snapshot):
    materials = MaterialSet()
    materials.update(snapshot)
    return made.update(snapshot, materials.compiled)


@pytest.mark.parametrize("count", [1, 5, MOST_MOVED])
def test_moved_instances_are_drawn_into_the_list(snapshot, uploaded, count):
    made = SceneGeometry()
    assert updated(made, snapshot)
    uploaded.clear()
    uploads = made.uploads
    assert updated(made, moved(snapshot, range(290 - count, 290), 3.0))
    assert uploaded == [] and made.uploads == uploads
    np.testing.assert_array_equal(content(made), made.instance_rows.reshape(-1, 4))


def test_list_of_many_moved_instances_is_uploaded(snapshot, uploaded):
    made = SceneGeometry()
    updated(made, snapshot)
    uploaded.clear()
    assert updated(made, moved(snapshot, range(COUNT), 3.0))
    assert len(uploaded) == 1
    np.testing.assert_array_equal(content(made), made.instance_rows.reshape(-1, 4))


def test_instances_at_rest_upload_nothing(snapshot, uploaded):
    made = SceneGeometry()
    updated(made, snapshot)
    uploaded.clear()
    assert not updated(made, snapshot)
    assert uploaded == []


def test_many_small_moves_end_in_the_same_list_as_one(snapshot):
    """Instances keep their order over single moves; each still stands where it should."""
    made, anew = SceneGeometry(), SceneGeometry()
    updated(made, snapshot)
    for number in range(0, 100, 7):
        snapshot = moved(snapshot, [number], 0.5 * number)
        updated(made, snapshot)
    updated(anew, snapshot)

    def sorted_rows(one):
        rows = content(one).reshape(-1, geometry.TEXELS_PER_INSTANCE * 4)
        return rows[np.lexsort(rows.T)]

    np.testing.assert_array_equal(sorted_rows(made), sorted_rows(anew))


def test_order_does_not_depend_on_the_numbers_in_names_of_meshes(snapshot):
    """Names hold numbers of the session; what is drawn at random depends on the order."""
    orders = []
    for start in (8, 99):  # 8, 9 and 99, 100: as text the larger one comes first
        names = dict(zip(snapshot.meshes, (f"mesh {start}", f"mesh {start + 1}")))
        named = replace(
            snapshot,
            meshes={names[key]: mesh for key, mesh in snapshot.meshes.items()},
            instances=tuple(replace(one, mesh=names[one.mesh]) for one in snapshot.instances),
        )
        made = SceneGeometry()
        updated(made, named)
        orders.append(made.instance_rows)
    np.testing.assert_array_equal(*orders)


def test_no_batch_has_the_number_of_another(gpu_context):
    vertices = gfx_geometry.vertex_buffer(position=np.eye(3, dtype=np.float32))
    numbers = [gfx_geometry.triangle_batch(vertices, np.array([[0, 1, 2]])).number for _ in range(8)]
    assert len(set(numbers)) == 8


def test_what_is_named_may_be_colours_or_a_map():
    """Colours read as a map have its three numbers, a map read as colours is opaque; what is not there is 0."""
    corners = np.arange(3)
    paint, around = np.arange(12.0).reshape(3, 4), np.arange(6.0).reshape(3, 2) + 20
    mesh = SimpleNamespace(
        corner_vertices=corners, uv_maps={"Around": around}, colors={"Paint": paint}, active_uv="Around",
        active_color="Paint", motion=None,
    )  # fmt: skip
    zero, one = np.zeros((3, 1)), np.ones((3, 1))
    for kind, name, expected in (
        ("UV", "Paint", [paint[:, :3], zero]),
        ("UV", "", [around, zero, zero]),
        ("COLOR", "", [paint]),
        ("COLOR", "Around", [around, zero, one]),
        ("UV_PASS", "", [around, one, zero]),
        ("NAMED", "None", [zero, zero, zero, one]),
        ("UV", "None", [zero] * 4),
    ):
        found = corner_attribute(mesh, Attribute(kind, name))
        np.testing.assert_array_equal(found, np.concatenate(expected, axis=1), err_msg=f"{kind} {name}")
