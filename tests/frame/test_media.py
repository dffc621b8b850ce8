"""Media on the GPU: what changes of a scene their grids follow."""

from dataclasses import replace

import numpy as np
import pytest

from addon.gfx import images
from addon.materials.compiler import compile_material
from addon.materials.graph import Graph, Input, Node
from addon.materials.volume import medium_of
from addon.materials.volume_program import reads_camera
from addon.scene.media import Media
from addon.snapshot.scene import Material, Volume, VolumeInstance, World
from tests.frame.test_plan import room

GENERATED, CAMERA, DISTANCE = ("TexCoord", "Generated"), ("TexCoord", "Camera"), ("CameraData", "View Distance")


def tree(source=None, kind="VolumeScatter", **inputs):
    """A volume shader whose density is an output of another node."""
    sockets = {name.replace("_", " "): Input("COLOR", value) for name, value in inputs.items()}
    nodes = {}
    if source is not None:
        sockets["Density"] = Input("FLOAT", 1.0, ("source", source[1]))
        nodes["source"] = Node("source", "source", f"ShaderNode{source[0]}", {}, {source[1]: "VECTOR"})
    nodes["shader"] = Node("shader", "shader", f"ShaderNode{kind}", sockets, {"Volume": "SHADER"})
    return Graph(nodes, volume=("shader", "Volume"))


def looked_at_from(snapshot, place):
    matrix = np.eye(4)
    matrix[:3, 3] = place
    return replace(snapshot, camera=replace(snapshot.camera, matrix=matrix))


def update(media, snapshot):
    """Bring the media to a snapshot; whether that changed them."""
    before = media.textures.get("media_table")
    compiled = [compile_material(one.name, one.graph) for one in snapshot.materials]
    media.update(snapshot, compiled, np.zeros(3), 8)
    return media.textures["media_table"] is not before


def extinction(media):
    return images.read(media.textures["media_table"])[media.first_row, : media.cells, 0]


def test_voxels_follow_the_density_of_their_object(gpu_context):
    grid = Volume("cloud", 1, {"density": np.ones((2, 2, 2), np.float32)}, np.zeros(3), np.eye(3, 4))
    fog = Material("fog", "fog", tree(kind="VolumePrincipled", Color=(0.5, 0.5, 0.5, 1.0)))
    placed = VolumeInstance("Cloud", grid, np.eye(4), 1, density=1.0)
    snapshot = room(volumes=(placed,))
    snapshot = replace(snapshot, materials=(*snapshot.materials, fog))
    media = Media()
    assert update(media, snapshot)
    whole = extinction(media)
    assert whole.min() > 0.0
    assert not update(media, snapshot)
    assert update(media, replace(snapshot, volumes=(replace(placed, density=0.1),)))
    assert extinction(media) == pytest.approx(0.1 * whole)


def test_the_grid_of_the_world_holds_the_camera(gpu_context):
    uneven = tree(GENERATED)
    snapshot = room(world=World(np.zeros(3), medium=medium_of(uneven), volume=uneven))
    media = Media()
    assert update(media, looked_at_from(snapshot, (0, 0, 3)))
    assert update(media, looked_at_from(snapshot, (0, 0, 6)))
    box = media.found[0].to_world
    assert box[2, 3] < 0.0 and box[2, 3] + box[2, 2] > 6.0
    assert update(media, looked_at_from(snapshot, (0.5, 0.5, 0.5)))
    assert not update(media, looked_at_from(snapshot, (0.5, 0.25, 0.5)))


@pytest.mark.parametrize(("source", "follows"), [(GENERATED, False), (CAMERA, True), (DISTANCE, True)])
def test_a_volume_that_reads_the_camera_follows_it(gpu_context, source, follows):
    fog = tree(source)
    assert reads_camera(fog) is follows
    snapshot = room()
    snapshot = replace(
        snapshot, materials=(*snapshot.materials, Material("fog", "fog", fog)),
        instances=(replace(snapshot.instances[0], materials=(1,)),),
    )  # fmt: skip
    media = Media()
    assert update(media, looked_at_from(snapshot, (0.5, 0.5, 0.5)))
    assert update(media, looked_at_from(snapshot, (0.5, 0.25, 0.5))) is follows
