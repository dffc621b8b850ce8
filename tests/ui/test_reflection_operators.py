"""Operators and panel of edited reflections where an object has no surface to ask, or one that is not in the layer."""

from types import SimpleNamespace

import bpy
import pytest
from mathutils import Vector

from addon.ui import ENGINE, reflection_operators


@pytest.fixture
def mirror(registered, empty_scene):
    """A square in the plane z = 0, active, with a constraint that turns what is seen by 90 degrees."""
    empty_scene.render.engine = ENGINE
    mesh = bpy.data.meshes.new("Mirror")
    mesh.from_pydata([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], [], [(0, 1, 2, 3)])
    made = bpy.data.objects.new("Mirror", mesh)
    empty_scene.collection.objects.link(made)
    bpy.context.view_layer.objects.active = made
    entry = made.candela.reflection_editing_constraints.add()
    entry.point, entry.viewer, entry.target = (0, 0, 0), (0, 0, 2), (2, 0, 0)
    bpy.context.view_layer.update()
    return made


def disable(mirror):
    mirror.hide_viewport = True


def disable_collection(mirror):
    within = bpy.data.collections.new("Disabled")
    bpy.context.scene.collection.children.link(within)
    bpy.context.scene.collection.objects.unlink(mirror)
    within.objects.link(mirror)
    bpy.context.view_layer.objects.active = mirror
    within.hide_viewport = True


def edit(mirror):
    bpy.ops.object.mode_set(mode="EDIT")


def empty(mirror):
    mirror.data.clear_geometry()


CASES = (disable, disable_collection, edit, empty)


def place():
    return bpy.ops.candela.place_reflection(location=(0.5, 0.5, 0.1), viewer=(0, 0, 3))


def labels(mirror):
    """What is shown below the list of constraints."""
    shown = []
    row = SimpleNamespace(operator=lambda *_, **__: None)
    layout = SimpleNamespace(
        row=lambda **_: row, label=lambda text, **_: shown.append(text), prop=lambda *_, **__: None
    )
    reflection_operators._draw(SimpleNamespace(layout=layout), SimpleNamespace(object=mirror, scene=bpy.context.scene))
    return shown


def test_on_a_surface_a_constraint_is_placed_and_its_angle_shown(mirror):
    assert labels(mirror) == ["Turns reflections by 90°"]
    assert place() == {"FINISHED"}
    assert tuple(mirror.candela.reflection_editing_constraints[-1].point) == pytest.approx((0.5, 0.5, 0.0))
    assert labels(mirror) == ["Turns reflections by 0°"]


def test_a_new_constraint_on_a_coarse_smooth_mesh_turns_nothing(mirror):
    """Reflections follow the normals between those of corners, not those of faces, which differ by up to 15 degrees."""
    bpy.ops.mesh.primitive_uv_sphere_add(segments=12, ring_count=8, location=(1, 2, 0.3), rotation=(0.4, 0.2, 0.1))
    ball = bpy.context.object
    ball.data.shade_smooth()
    bpy.context.view_layer.update()
    for where in ((1.4, 1.2, 0.6), (0.8, 1.1, 0.2), (1.0, 1.3, 1.0)):
        assert bpy.ops.candela.place_reflection(location=where, viewer=(0, -4, 1)) == {"FINISHED"}
        entry = ball.candela.reflection_editing_constraints[-1]
        assert reflection_operators.angle_of(entry, ball) < 0.004


@pytest.mark.parametrize("change", CASES)
def test_without_a_surface_no_angle_is_shown(mirror, change):
    change(mirror)
    bpy.context.view_layer.update()
    assert labels(mirror) == []
    assert reflection_operators.angle_of(mirror.candela.reflection_editing_constraints[0], mirror) is None


@pytest.mark.parametrize("change", CASES)
def test_without_a_surface_the_remedy_is_said(mirror, change):
    change(mirror)
    bpy.context.view_layer.update()
    assert bpy.context.object == mirror
    with pytest.raises(RuntimeError, match=r"^Error: 'Mirror' has no surface .* enabled in viewports"):
        place()
    assert len(mirror.candela.reflection_editing_constraints) == 1


def test_a_click_on_an_instance_of_what_is_not_in_the_layer_is_a_sentence(mirror):
    """Such an object can neither be selected nor made active."""
    away = bpy.data.collections.new("Away")
    bpy.context.scene.collection.objects.unlink(mirror)
    away.objects.link(mirror)
    instance = bpy.data.objects.new("Instance", None)
    instance.instance_type, instance.instance_collection = "COLLECTION", away
    bpy.context.scene.collection.objects.link(instance)
    graph = bpy.context.evaluated_depsgraph_get()
    hit, *_, met, _ = bpy.context.scene.ray_cast(graph, Vector((0, 0, 3)), Vector((0, 0, -1)))
    assert hit and met.original == mirror
    with pytest.raises(RuntimeError):
        mirror.select_set(True)
    with pytest.raises(ValueError, match=r"'Mirror' is only shown as an instance here"):
        reflection_operators.clicked(bpy.context.view_layer, met)
    bpy.context.scene.collection.objects.link(mirror)
    bpy.context.view_layer.update()
    assert reflection_operators.clicked(bpy.context.view_layer, met) == mirror
    with pytest.raises(ValueError, match=r"'Instance' is no mesh"):
        reflection_operators.clicked(bpy.context.view_layer, instance)
    with pytest.raises(ValueError, match=r"no surface where you clicked"):
        reflection_operators.clicked(bpy.context.view_layer, None)
