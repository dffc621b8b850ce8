"""Small scenes for the snapshot's tests, and a stand-in for the node reader while it is not there."""

import contextlib
import importlib.util
import sys
import types
import warnings

import bpy
import numpy as np
import pytest

from addon.materials.graph import Graph, Input, Node

_KINDS = {"RGBA": "COLOR", "VALUE": "FLOAT", "VECTOR": "VECTOR", "SHADER": "SHADER"}


def _read_graph(block, image_key):
    """Flat trees only: no groups, reroutes or muted nodes."""
    nodes, surface = {}, None
    for node in block.node_tree.nodes:
        inputs = {}
        for socket in node.inputs:
            value = getattr(socket, "default_value", None)
            value = tuple(value) if hasattr(value, "__len__") and not isinstance(value, str) else value
            link = (socket.links[0].from_node.name, socket.links[0].from_socket.identifier) if socket.links else None
            inputs[socket.identifier] = Input(_KINDS.get(socket.type, "OTHER"), value, link)
        if node.bl_idname.startswith("ShaderNodeOutput"):
            surface = inputs["Surface"].link
            continue
        properties = {
            name: getattr(node, name)
            for name in ("space", "uv_map", "vector_type", "projection", "attribute_name", "attribute_type")
            if hasattr(node, name)
        }
        if node.bl_idname in ("ShaderNodeRGB", "ShaderNodeValue"):
            value = node.outputs[0].default_value
            properties["value"] = tuple(value) if hasattr(value, "__len__") else value
        image = getattr(node, "image", None)
        key = image_key(image, node.image_user) if image else ""
        outputs = {socket.identifier: _KINDS.get(socket.type, "OTHER") for socket in node.outputs}
        nodes[node.name] = Node(node.name, node.label or node.name, node.bl_idname, inputs, outputs, properties, key)
    return Graph(nodes, surface), ()


if importlib.util.find_spec("addon.materials.reader") is None:
    stand_in = types.ModuleType("addon.materials.reader")
    stand_in.read_graph = _read_graph
    sys.modules["addon.materials.reader"] = stand_in


class Stage:
    """An empty scene, and short words to put things into it."""

    def __init__(self):
        bpy.ops.wm.read_factory_settings(use_empty=True)
        self.scene = bpy.context.scene

    def link(self, name, data=None, matrix=None):
        placed = bpy.data.objects.new(name, data)
        self.scene.collection.objects.link(placed)
        if matrix is not None:
            placed.matrix_world = matrix
        return placed

    def mesh(self, name="mesh", vertices=((0, 0, 0), (1, 0, 0), (0, 1, 0)), faces=((0, 1, 2),), edges=()):
        made = bpy.data.meshes.new(name)
        made.from_pydata(vertices, edges, faces)
        return made

    def grid(self, count, name="grid"):
        """count x count quads over the unit square."""
        x, y = np.meshgrid(np.linspace(0, 1, count + 1), np.linspace(0, 1, count + 1))
        corner = (np.arange(count)[:, None] * (count + 1) + np.arange(count)).reshape(-1)
        faces = np.stack([corner, corner + 1, corner + count + 2, corner + count + 1], axis=1)
        made = bpy.data.meshes.new(name)
        made.vertices.add(x.size)
        made.loops.add(faces.size)
        made.polygons.add(len(faces))
        made.vertices.foreach_set("co", np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1).astype(np.float32))
        made.loops.foreach_set("vertex_index", faces.reshape(-1).astype(np.int32))
        made.polygons.foreach_set("loop_start", np.arange(0, faces.size, 4, dtype=np.int32))
        made.update(calc_edges=True)
        return made

    def camera(self, name="Camera"):
        placed = self.link(name, bpy.data.cameras.new(name))
        self.scene.camera = placed
        return placed

    def light(self, kind="POINT", **settings):
        data = bpy.data.lights.new(kind, kind)
        for name, value in settings.items():
            setattr(data, name, value)
        return self.link(kind, data)

    def world(self):
        made = bpy.data.worlds.new("World")
        self.scene.world = made
        self.use_nodes(made)
        return made

    def material(self, name="Material"):
        made = bpy.data.materials.new(name)
        self.use_nodes(made)
        return made

    def use_nodes(self, block):
        if bpy.app.version < (5, 0):
            block.use_nodes = True
        return block.node_tree

    @contextlib.contextmanager
    def telling(self, cache):
        """Hand Blender's updates on to the cache, as an engine does, and update at the end."""

        def tell(scene, depsgraph):
            cache.invalidate(depsgraph.updates)

        bpy.app.handlers.depsgraph_update_post.append(tell)
        try:
            yield
            bpy.context.view_layer.update()
        finally:
            bpy.app.handlers.depsgraph_update_post.remove(tell)

    def depsgraph(self):
        graph = bpy.context.evaluated_depsgraph_get()
        graph.update()
        return graph

    def take(self, cache=None, width=64, height=48, **options):
        from addon.snapshot import SnapshotCache, take

        if self.scene.camera is None and "view" not in options:
            self.camera()
        return take(self.depsgraph(), cache if cache is not None else SnapshotCache(), width, height, **options)


@pytest.fixture
def stage():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        yield Stage()
