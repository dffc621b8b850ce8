"""Comparisons in the interface say what the viewport shows otherwise than a render."""

import bpy
import pytest

from addon.ui.shown_otherwise import objects_shown_otherwise


@pytest.fixture
def cube(empty_scene):
    bpy.ops.mesh.primitive_cube_add()
    return bpy.context.object


def differing():
    bpy.context.view_layer.update()
    return objects_shown_otherwise(bpy.context.view_layer)


def test_what_is_hidden_in_one_of_them(cube):
    assert differing() == []
    cube.hide_render = True
    assert differing() == [cube.name]
    cube.hide_viewport = True
    assert differing() == []
    cube.hide_render = False
    assert differing() == [cube.name]


def test_what_a_collection_hides_in_one_of_them(cube):
    outer, inner = (bpy.data.collections.new(name) for name in ("Outer", "Inner"))
    bpy.context.scene.collection.children.link(outer)
    outer.children.link(inner)
    inner.objects.link(cube)
    bpy.context.scene.collection.objects.unlink(cube)
    outer.hide_render = True
    assert differing() == [cube.name]
    outer.hide_viewport = True
    assert differing() == []


def test_modifiers_with_other_levels_or_in_one_of_them(cube):
    smooth = cube.modifiers.new("Smooth", "SUBSURF")
    smooth.levels = smooth.render_levels = 2
    assert differing() == []
    smooth.render_levels = 3
    assert differing() == [cube.name]
    smooth.render_levels, smooth.show_viewport = 2, False
    assert differing() == [cube.name]


def test_the_comparison_names_them(lit_floor, capfd):
    hidden = next(thing for thing in bpy.context.scene.objects if thing.type == "MESH")
    hidden.modifiers.new("Smooth", "SUBSURF").render_levels = 3
    options = bpy.context.window_manager.candela_comparison
    options.samples, options.reference_samples, options.percentage = 1, 1, 20
    assert bpy.ops.candela.compare() == {"FINISHED"}
    assert f"The viewport shows '{hidden.name}' otherwise than a render" in capfd.readouterr().out
