"""The benchmark of soft shadows: its scenes can be made, and what it measures tells techniques apart."""

import numpy as np
import pytest

from bench import markdown, soft, soft_lights

SIZE = (48, 36)


@pytest.mark.slow
@pytest.mark.parametrize("family", ["far background", "stacked blockers"])
def test_one_soft_map_leaves_less_error_than_four_points_of_the_light(registered, family):
    from bench import soft_scenes

    scene = soft_scenes.build(family)
    expected = soft.visibility(scene, soft.Entrant("truth", soft.POINTS, (("texels_per_pixel", 4.0),), 128), SIZE)
    assert 0.1 < (expected < 0.9).mean() < 0.9
    errors = {
        (technique, samples): soft.rms(
            soft.visibility(scene, soft.Entrant("", technique, (("texels_per_pixel", 4.0),), samples), SIZE), expected
        )
        for technique, samples in ((soft.VSSM, 1), (soft.CSSM, 1), (soft.POINTS, 4))
    }
    assert errors[soft.VSSM, 1] < errors[soft.POINTS, 4]
    assert errors[soft.CSSM, 1] < errors[soft.POINTS, 4]


@pytest.mark.slow
@pytest.mark.parametrize("technique", [soft.VSSM, soft.CSSM])
def test_short_rays_see_blockers_that_the_middle_of_the_light_does_not(registered, technique):
    """Wires of a fence, two layers close together: pixels that get hardly any light are what goes wrong."""
    from addon.compare.metrics import compare_radiance
    from bench import soft_scenes

    scene = soft_scenes.build("chain fence")
    expected, _ = soft.direct(scene, soft.Entrant("truth", soft.POINTS, samples=64), SIZE)
    error = {}
    for contacts in (True, False):
        found, _ = soft.direct(scene, soft.Entrant("", technique, (("contacts", contacts),)), SIZE)
        pictures = (np.repeat(one[..., None], 3, axis=-1) for one in (found, expected))
        error[contacts] = compare_radiance("direct", *pictures).relmse
    assert error[True] < 0.5 * error[False]


@pytest.mark.slow
@pytest.mark.parametrize(("family", "texels", "most"), [("far background", 4.0, 0.036), ("grid", 2.0, 0.055)])
def test_what_points_are_asked_for_is_told_finely_along_their_rows(registered, family, texels, most):
    """Texels where moments do not hold, and rays to contacts: of square grids the errors were .048 and .060."""
    from bench import soft_scenes

    scene = soft_scenes.build(family)
    expected = soft.visibility(scene, soft.Entrant("truth", soft.POINTS, soft.BY_MAPS, 128), (128, 96))
    found = soft.visibility(scene, soft.Entrant("", soft.VSSM, (("texels_per_pixel", texels),)), (128, 96))
    assert soft.rms(found, expected) < most


def test_the_table_has_a_row_per_technique():
    entrants = (soft.Entrant("one", soft.VSSM), soft.Entrant("map", soft.POINTS))
    results = [soft.Result(0.25, [3.0, 2.5], [0.5]), soft.Result(0.5, [1.5, 1.6], [0.5])]
    rows = soft.rows_of({"grid": results, "foliage": results}, entrants)
    assert rows[1] == ("one", "0.2500", "0.2500", "0.2500", "2.0")
    assert rows[2] == ("map", "0.5000", "0.5000", "0.5000", "1.0")


@pytest.mark.parametrize("command", [soft.COMMAND, soft_lights.COMMAND])
def test_the_page_has_marks_for_what_is_written(command):
    assert soft.PAGE.read_text(encoding="utf-8").count(markdown.begin(command)) == 1


def test_dark_pixels_count_as_lit():
    assert soft.lit(np.array([1.0, 0.04, 0.06])).tolist() == [True, False, True]
