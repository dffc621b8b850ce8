"""What several tests of the interface stand on."""

import warnings

import bpy
import pytest

from addon import engine
from addon.ui import ENGINE


@pytest.fixture
def lit_floor(registered, gpu_context, empty_scene, tmp_path, monkeypatch):
    """A scene of 64x48 pixels with a floor under a lamp; references are kept in a folder of the test."""
    monkeypatch.setenv("CANDELA_CACHE", str(tmp_path))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        bpy.ops.mesh.primitive_plane_add(size=8)
        bpy.ops.object.light_add(type="AREA", location=(0, 0, 4))
        bpy.context.object.data.energy = 400
        bpy.ops.object.camera_add(location=(0, 0, 8))
    scene = empty_scene
    scene.camera, scene.render.engine = bpy.context.object, ENGINE
    scene.render.resolution_x, scene.render.resolution_y = 64, 48
    scene.candela.bounces = 0
    yield scene
    engine.free_sessions()
