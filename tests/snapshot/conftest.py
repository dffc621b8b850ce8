"""Small scenes for the snapshot's tests."""

import contextlib
import warnings

import bpy
import numpy as np
import pytest


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
        if bpy.app.version < (5, 0) or block.node_tree is None:  # lights without nodes exist until Blender 5.1
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
