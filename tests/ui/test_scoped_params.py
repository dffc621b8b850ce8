"""Parameters of lamps, materials, objects, cameras and worlds, and lists of them: from declaration to snapshot."""

from argparse import Namespace

import bpy
import pytest

from addon.cli import verbs
from addon.frame.technique import CAMERA, DIRECTION, OBJECT, POINT, Param, Technique, identifier, own_value
from addon.snapshot.own_settings import own_settings
from addon.ui import properties, scoped_panels


class Bent(Technique):
    name, label = "bent", "Bent"
    params = (
        Param("share", "Share", 0.5, "A number of each object", 0.0, 1.0, scope=OBJECT),
        Param(
            "edits", "Edits", (), "A list of each object", scope=OBJECT,
            many=(
                Param("place", "Place", (0.0, 0.0, 0.0), "A point of the object", handle=POINT),
                Param("towards", "Towards", (0.0, 0.0, 1.0), "A direction of the object", handle=DIRECTION),
                Param("radius", "Radius", 1.0, "How far it reaches", 0.0),
            ),
        ),
        Param("pupil", "Pupil", 3.0, "Of each camera", 1.0, 9.0, scope=CAMERA),
    )  # fmt: skip


@pytest.fixture
def declared(monkeypatch, registered):
    """The properties of `Bent`, on a pointer of their own, as the extension would make them."""
    bpy.ops.wm.read_factory_settings()
    monkeypatch.setattr(properties, "REGISTRY", (Bent,))
    monkeypatch.setattr(scoped_panels, "REGISTRY", (Bent,))
    entry = properties.entry_group(Bent.params[1])
    groups = {
        kind: properties._group(f"CandelaTest{scope.title()}", properties._declared(scope), "A test.")
        for kind, scope in ((bpy.types.Object, OBJECT), (bpy.types.Camera, CAMERA))
    }
    bpy.utils.register_class(entry)
    for kind, group in groups.items():
        bpy.utils.register_class(group)
        kind.candela = bpy.props.PointerProperty(type=group)
    yield bpy.context.scene
    for kind, group in groups.items():
        del kind.candela
        bpy.utils.unregister_class(group)
    bpy.utils.unregister_class(entry)
    for kind, (_, group) in ((row[0], row) for row in properties.GROUPS.values()):
        if kind in groups:
            kind.candela = bpy.props.PointerProperty(type=group)


def test_what_is_set_on_an_object_reaches_the_snapshot_and_what_is_not_has_its_default(declared):
    cube = bpy.context.object
    assert own_settings(cube) == ()
    assert own_value((), Bent, "share") == 0.5
    cube.candela.bent_share = 0.25
    assert own_value(own_settings(cube), Bent, "share") == 0.25
    with pytest.raises(KeyError, match="declares no parameter 'size'"):
        own_value((), Bent, "size")


def test_a_list_is_a_tuple_of_entries_with_all_their_values(declared):
    cube = bpy.context.object
    entry = cube.candela.bent_edits.add()
    entry.name, entry.place = "first", (1.0, 2.0, 3.0)
    (found,) = own_value(own_settings(cube), Bent, "edits")
    assert found == {"place": (1.0, 2.0, 3.0), "towards": (0.0, 0.0, 1.0), "radius": 1.0}
    assert hash(own_settings(cube)) is not None


def test_lists_are_edited_by_their_buttons(declared):
    cube = bpy.context.object
    group, name = cube.candela, identifier("bent", "edits")

    def press(action):
        return bpy.ops.candela.edit_list(scope=OBJECT, name=name, action=action)

    assert press("REMOVE") == {"CANCELLED"}
    for _ in range(3):
        assert press("ADD") == {"FINISHED"}
    assert [entry.name for entry in group.bent_edits] == ["1", "2", "3"] and group.bent_edits_active == 2
    press("UP")
    assert [entry.name for entry in group.bent_edits] == ["1", "3", "2"] and group.bent_edits_active == 1
    press("DOWN")
    assert press("DOWN") == {"CANCELLED"}
    press("REMOVE")
    assert [entry.name for entry in group.bent_edits] == ["1", "2"] and group.bent_edits_active == 1
    with pytest.raises(RuntimeError, match="no list 'bent_nothing'"):
        bpy.ops.candela.edit_list(scope=OBJECT, name="bent_nothing", action="ADD")


def test_points_and_directions_of_the_active_entry_have_handles(declared):
    cube = bpy.context.object
    assert scoped_panels._handles(cube) == []
    cube.candela.bent_edits.add()
    assert [place.name for place in scoped_panels._handles(cube)] == ["place", "towards"]


def test_a_setting_of_the_command_line_reaches_every_camera_of_the_picture(lit_floor):
    other = bpy.data.objects.new("Other", bpy.data.cameras.new("Other"))
    lit_floor.timeline_markers.new("cut", frame=9).camera = other
    options = Namespace(assignments=["eye.age=80", "film.points=16"], samples=None)
    verbs._apply_settings(lit_floor, options)
    assert lit_floor.camera.data.candela.eye_age == other.data.candela.eye_age == 80.0
    values = properties.settings_of(lit_floor, viewport=False).values
    assert values["eye", "age"] == 80.0 and values["film", "points"] == 16


def test_a_setting_of_a_camera_that_is_none_is_refused_with_a_sentence(lit_floor):
    lit_floor.camera = None
    with pytest.raises(ValueError, match=r"'eye\.age' is a setting of the camera, and the scene has none"):
        verbs._apply_settings(lit_floor, Namespace(assignments=["eye.age=80"], samples=None))


def test_what_the_command_line_does_not_name_stays(lit_floor):
    lit_floor.candela.use_denoise = False
    strength = lit_floor.candela.denoise_strength
    verbs._apply_settings(lit_floor, Namespace(assignments=["seed=3"], samples="5"))
    assert (lit_floor.candela.seed, lit_floor.candela.samples) == (3, 5)
    assert lit_floor.candela.denoise_strength == strength > 0.0


def test_a_cameras_parameter_is_a_setting_of_the_picture(declared):
    scene = declared
    values = properties._values(scene, None)
    assert values["bent", "pupil"] == 3.0 and ("bent", "share") not in values
    scene.camera.data.candela.bent_pupil = 5.0
    assert properties._values(scene, None)["bent", "pupil"] == 5.0
    evaluated = bpy.context.evaluated_depsgraph_get()
    assert properties._values(scene, evaluated)["bent", "pupil"] == 5.0
    scene.camera = None
    assert properties._values(scene, None) == {}
