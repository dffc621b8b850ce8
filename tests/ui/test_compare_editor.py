"""The comparison in the Image Editor, run as an operator without a window."""

import bpy
import numpy as np
import pytest

from addon.compare import pictures
from addon.ui import compare_editor


@pytest.fixture
def compared(lit_floor):
    """The options of the comparison, after it was made."""
    options = bpy.context.window_manager.candela_comparison
    options.samples, options.reference_samples, options.percentage = 8, 16, 50
    options.row, options.view = 0, "CANDELA"
    assert bpy.ops.candela.compare() == {"FINISHED"}
    return options


def shown():
    image = bpy.data.images[compare_editor.IMAGE]
    return np.array(image.pixels[:]).reshape(image.size[1], image.size[0], 4)[..., :3]


def test_comparison_has_a_row_for_each_light_path_and_small_errors(compared):
    rows = {picture.row.label: picture for picture in compare_editor.latest()}
    assert {"Combined", "Diffuse direct", "Glossy direct", "Normal", "Depth"} <= set(rows)
    assert rows["Combined"].x.shape[:2] == (24, 32)
    assert rows["Combined"].error.relmse < 0.01
    assert rows["Combined"].error.bias == pytest.approx(1, abs=0.02)


def test_image_shows_what_is_chosen(compared):
    row = compare_editor.latest()[0]
    assert np.allclose(shown(), row.x[..., :3], atol=1e-6)
    assert bpy.ops.candela.compare_swap() == {"FINISHED"}
    assert np.allclose(shown(), row.reference[..., :3], atol=1e-6)
    compared.view = "ERROR"
    assert np.allclose(shown(), pictures.error_map(row.x, row.reference), atol=1e-6)
    compared.view = "DIFFERENCE"
    bpy.ops.candela.compare_show(row=1)
    row = compare_editor.latest()[1]
    difference = np.abs(row.x[..., :3] - row.reference[..., :3])
    assert np.allclose(shown(), compared.gain * difference, atol=1e-5)
    compared.gain = 1.0
    assert np.allclose(shown(), difference, atol=1e-6)


def test_the_panel_lists_each_light_once_and_cuts_nothing_off(compared):
    listed = [picture.row.label for _, picture in compare_editor.table_of(compare_editor.latest())]
    assert len({label.removesuffix(" pass") for label in listed}) == len(listed)
    assert max(map(len, listed)) <= 22


def test_every_row_can_be_shown_in_every_view(compared):
    for number in range(len(compare_editor.latest())):
        for view, *_ in compare_editor.VIEWS:
            compared.row, compared.view = number, view
            assert np.isfinite(shown()).all()


def test_scene_without_a_camera_is_refused_with_a_sentence(registered, gpu_context, empty_scene):
    with pytest.raises(RuntimeError, match="no camera"):
        bpy.ops.candela.compare()


def editors(*images):
    """A context of a window with an Image Editor for each of these images, the first of which is clicked."""
    made = []
    for image in images:
        space = type("Space", (), {"image": image})()
        area = type(
            "Area", (), {"type": "IMAGE_EDITOR", "as_pointer": lambda self: id(self), "tag_redraw": lambda _: 0}
        )()
        area.spaces = type("Spaces", (), {"active": space})()
        made.append(area)
    screen = type("Screen", (), {"areas": made})()
    return type("Context", (), {"area": made[0], "window": type("Window", (), {"screen": screen})()})()


def test_comparison_is_shown_where_it_was_asked_for_whatever_stands_there(compared):
    result = type("Image", (), {"name": "Render Result"})()
    mine = type("Image", (), {"name": "My Photograph"})()
    context = editors(result, mine, None)
    compare_editor._show(compared, context)
    seen = [area.spaces.active.image for area in context.window.screen.areas]
    assert seen[0] == seen[2] == bpy.data.images[compare_editor.IMAGE] and seen[1] is mine


def test_another_file_clears_the_comparison(compared):
    before = compare_editor.latest()
    compare_editor._another_file()
    assert before and compare_editor.latest() == ()
    compare_editor._rows = before
