"""Painted translucency: new maps, what they are read as, and what they change."""

import bpy
import numpy as np
import pytest

from addon.materials import translucency
from addon.materials.graph import Graph, Input, Node
from addon.snapshot.scene import Image
from addon.ui.translucency import _overlaps, overlapping, property_of


def _plane(name="Plane"):
    bpy.ops.mesh.primitive_plane_add(size=2)
    made = bpy.context.object
    made.data.materials.append(bpy.data.materials.new(name))
    return made


def test_new_maps_change_nothing_and_belong_to_the_material(registered):
    plane = _plane()
    assert bpy.ops.candela.new_translucency_maps(size=16) == {"FINISHED"}
    for name, value in zip(translucency.MAPS, (0.5, 1.0, 1.0)):  # half the blur is that of the material
        image = getattr(plane.active_material.candela, property_of(name))
        pixels = np.array(image.pixels[:]).reshape(-1, 4)
        assert pixels[:, :3] == pytest.approx(np.full((256, 3), value), abs=1e-6)
    before = {image.name for image in bpy.data.images}
    bpy.ops.candela.new_translucency_maps(size=16)
    assert {image.name for image in bpy.data.images} == before


def test_what_is_painted_is_saved_with_the_file(registered, tmp_path):
    """Blender alone would save the images as they were made."""
    plane = _plane("Saved")
    bpy.ops.candela.new_translucency_maps(size=16)
    path, name = str(tmp_path / "painted.blend"), property_of(translucency.MAPS[0])
    for value in (0.25, 0.75):  # a second time, too, when it is packed already
        painted = getattr(plane.active_material.candela, name)
        painted.pixels[:] = [value] * (16 * 16 * 4)
        painted.update()
        bpy.ops.wm.save_as_mainfile(filepath=path)
        bpy.ops.wm.open_mainfile(filepath=path)
        plane = bpy.context.view_layer.objects.active
        assert getattr(plane.active_material.candela, name).pixels[0] == pytest.approx(value, abs=0.01)
    bpy.ops.wm.read_factory_settings(use_empty=True)


def test_a_mesh_without_uv_is_told_so(registered):
    plane = _plane()
    plane.data.uv_layers.remove(plane.data.uv_layers[0])
    with pytest.raises(RuntimeError, match="has no UV map"):
        bpy.ops.candela.new_translucency_maps(size=16)


def test_faces_over_one_another_are_found(registered):
    plane = _plane()
    assert not overlapping(plane.data)
    bpy.ops.mesh.primitive_cube_add()
    assert not overlapping(bpy.context.object.data)
    for k, corner in enumerate(bpy.context.object.data.uv_layers.active.uv):
        corner.vector = [(0.0, 0.0), (0.3, 0.0), (0.3, 0.3), (0.0, 0.3)][k % 4]
    assert overlapping(bpy.context.object.data)


def test_maps_are_made_in_edit_mode_too(registered):
    """Blender keeps a mesh's coordinates elsewhere then; of the copy that is looked at nothing is left."""
    plane, before = _plane("Edited"), len(bpy.data.meshes)
    bpy.ops.object.mode_set(mode="EDIT")
    assert not _overlaps(plane)
    assert bpy.ops.candela.new_translucency_maps(size=16) == {"FINISHED"}
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.mesh.duplicate()
    assert _overlaps(plane) and len(bpy.data.meshes) == before and plane.mode == "EDIT"
    bpy.ops.object.mode_set(mode="OBJECT")
    assert all(getattr(plane.active_material.candela, property_of(name)) for name in translucency.MAPS)


def test_a_disabled_object_is_not_painted_and_the_remedy_is_said(registered):
    plane = _plane("Disabled")
    bpy.ops.candela.new_translucency_maps(size=16)
    settings = bpy.context.scene.tool_settings.image_paint
    settings.canvas = None
    plane.hide_viewport = True
    bpy.context.view_layer.update()
    with pytest.raises(RuntimeError, match=r"^Error: 'Plane.*' cannot be painted: enable it in viewports"):
        bpy.ops.candela.paint_translucency_map(name=translucency.MAPS[0])
    assert settings.canvas is None and plane.mode == "OBJECT"


def test_maps_join_the_graph_beside_the_surface():
    node = Node("P", "P", "ShaderNodeBsdfPrincipled", {}, {"BSDF": "SHADER"})
    graph = Graph({"P": node}, surface=("P", "BSDF"))
    assert translucency.with_maps(graph, {}) is graph
    joined = translucency.with_maps(graph, {translucency.TINT: "image"})
    assert translucency.maps_of(joined) == {translucency.TINT: "image"}
    assert joined.nodes[joined.surface[0]].inputs["Shader"] == Input("SHADER", link=("P", "BSDF"))


def test_images_are_sampled_between_texels_and_sanitised():
    pixels = np.zeros((1, 2, 4), np.float32)
    pixels[0, 1, :3] = 1.0
    image = Image("key", 0, pixels)
    uv = np.array([[0.0, 0.5], [0.5, 0.5], [1.0, 0.5], [np.nan, 7.0]])
    assert translucency.sampled(image, uv)[:, 0] == pytest.approx([0.0, 0.5, 1.0, 0.0])
    pixels[0, 1, 0] = np.nan
    assert np.isfinite(translucency.sampled(image, uv)).all()
