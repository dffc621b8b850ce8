"""Data-blocks that are linked from another file: Blender would forget what operators set on them."""

import bpy
import pytest

from addon.frame.technique import OBJECT
from addon.ui import ENGINE, reflection_operators

REFUSED = r"' is linked from another file, and what is set here would not be saved: make it local first\."


@pytest.fixture
def linked(registered, empty_scene, tmp_path):
    """A mesh with a material and a camera, linked from another file; the mesh is active, the camera the scene's."""
    bpy.ops.mesh.primitive_plane_add()
    plane = bpy.context.object
    plane.data.materials.append(bpy.data.materials.new("Skin"))
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    bpy.data.libraries.write(str(tmp_path / "library.blend"), {plane, camera})
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    with bpy.data.libraries.load(str(tmp_path / "library.blend"), link=True) as (there, here):
        here.objects = there.objects
    for one in here.objects:
        scene.collection.objects.link(one)
    scene.render.engine, scene.camera = ENGINE, bpy.data.objects["Camera"]
    bpy.context.view_layer.objects.active = bpy.data.objects["Plane"]
    bpy.context.view_layer.update()
    yield bpy.data.objects["Plane"]
    bpy.ops.wm.read_factory_settings(use_empty=True)


CALLS = {
    "maps": lambda: bpy.ops.candela.new_translucency_maps(size=16),
    "place": lambda: bpy.ops.candela.place_reflection(location=(0, 0, 1), viewer=(0, 0, 5)),
    "list": lambda: bpy.ops.candela.edit_list(scope=OBJECT, name=reflection_operators.REGIONS, action="ADD"),
    "observer": lambda: bpy.ops.candela.eye_preset(preset="OLD"),
}


@pytest.mark.parametrize("name", CALLS)
def test_operators_refuse_and_set_nothing(linked, name):
    images = len(bpy.data.images)
    with pytest.raises(RuntimeError, match=REFUSED):
        CALLS[name]()
    assert len(bpy.data.images) == images
    assert not linked.candela.reflection_editing_constraints and not linked.candela.reflection_editing_regions


def test_a_click_refuses(linked):
    with pytest.raises(ValueError, match=f"^'Plane{REFUSED}"):
        reflection_operators.clicked(bpy.context.view_layer, linked)


@pytest.mark.parametrize("name", CALLS)
def test_what_is_made_local_is_changed(linked, name):
    bpy.ops.object.make_local(type="ALL")
    assert CALLS[name]() == {"FINISHED"}
