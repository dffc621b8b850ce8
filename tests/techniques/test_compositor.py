"""Blender's compositor reads the passes: mattes picked by name, values, shares of light."""

import bpy
import numpy as np
import pytest

SIZE = (48, 40)


@pytest.fixture
def composed(written, tmp_path):
    """The stage; `written.compose(join)` renders with a node tree that `join(tree, layers)` ends at a socket."""
    stage = written

    def compose(join):
        scene = stage.scene
        scene.render.engine = "CANDELA"
        stage.layer.update_render_passes()  # which make the sockets
        if bpy.app.version >= (5, 0):
            tree = scene.compositing_node_group = bpy.data.node_groups.new("Compositing", "CompositorNodeTree")
            tree.interface.new_socket("Image", in_out="OUTPUT", socket_type="NodeSocketColor")
            end = tree.nodes.new("NodeGroupOutput")
        else:
            scene.use_nodes = True
            tree = scene.node_tree
            tree.nodes.clear()
            end = tree.nodes.new("CompositorNodeComposite")
        layers = tree.nodes.new("CompositorNodeRLayers")
        tree.links.new(join(tree, layers), end.inputs[0])
        return stage.written("CANDELA", 8, size=SIZE, extra=[(scene.render, "use_compositing", True)])

    stage.compose = compose
    yield stage
    if bpy.app.version >= (5, 0):
        stage.scene.compositing_node_group = None
    else:
        stage.scene.use_nodes = False


def shown(passes):
    """What the compositor made: the file's picture."""
    return passes["composed"][..., 0]


def scene(stage):
    stage.camera_above(4.0)
    stage.floor(material=stage.diffuse(0.5)).name = "Floor"
    stage.rectangle((-1.1, -0.7), (0.6, 0.9), 0.5, material=stage.diffuse(0.2)).name = "Box"
    stage.light("POINT", (0, 0, 2)).lightgroup = "Key"


def test_a_matte_is_picked_by_name(composed):
    stage = composed
    scene(stage)
    stage.layer.use_pass_cryptomatte_object = True

    def join(tree, layers):
        matte = tree.nodes.new("CompositorNodeCryptomatteV2")
        matte.source, matte.scene, matte.layer_name = "RENDER", stage.scene, f"{stage.layer.name}.CryptoObject"
        matte.matte_id = "Box"
        return matte.outputs["Matte"]

    passes = stage.compose(join)
    np.testing.assert_allclose(shown(passes), stage.coverage(passes, "Object", "Box"), atol=1e-3)
    assert 0.1 < shown(passes).mean() < 0.5


def test_values_and_shares_of_light_are_sockets(composed):
    stage = composed
    scene(stage)
    stage.layer.use_pass_uv = True
    stage.layer.lightgroups.add(name="Key")
    passes = stage.compose(lambda tree, layers: layers.outputs["Combined_Key"])
    np.testing.assert_allclose(shown(passes), passes["Combined_Key"][..., 0], atol=1e-3)
