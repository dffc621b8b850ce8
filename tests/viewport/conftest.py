"""The scene that the viewport's tests look at, and a viewport on it."""

import warnings

import bpy
import pytest

from addon import engine
from addon.ui import ENGINE
from tests.viewport.region import Region


@pytest.fixture
def scene(registered, gpu_context, empty_scene):
    """A cube on a floor under a lamp, seen by a camera."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        bpy.ops.mesh.primitive_plane_add(size=8)
        bpy.ops.mesh.primitive_cube_add(size=1.5, location=(0, 0, 0.75))
        bpy.ops.object.light_add(type="POINT", location=(2, -2, 4))
        bpy.context.object.data.energy = 400
        bpy.context.object.data.shadow_soft_size = 0.3
        bpy.ops.object.camera_add(location=(4, -5, 4), rotation=(0.95, 0, 0.67))
        empty_scene.camera = bpy.context.object
        empty_scene.render.engine = ENGINE
        yield empty_scene
    engine.free_sessions()


@pytest.fixture
def region(scene):
    made = Region()
    yield made
    made.viewport.release()
