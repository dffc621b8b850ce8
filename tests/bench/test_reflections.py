"""What carries an error, where rows stand, and the shapes that scenes of mirrors and glass are made of."""

import argparse

import bpy
import numpy as np
import pytest

from addon.compare import reference as references
from addon.compare.cache import Reference
from bench import glass_scenes, markdown, reflection_scenes, reflection_truth, reflections, shapes
from bench.shading import glass


def _passes(**paths):
    """Passes (8, 8, 3) of these values by path, whose colours are one; lobes that are not named are dark."""
    made = {f"{lobe}_color": np.ones((8, 8, 3)) for lobe in ("diffuse", "glossy", "transmission")}
    return made | {name: np.full((8, 8, 3), value) for name, value in paths.items()}


def test_the_error_is_carried_by_the_path_that_differs():
    truth = _passes(diffuse_direct=1.0, glossy_indirect=0.5, emission=0.0)
    found = _passes(diffuse_direct=1.01, glossy_indirect=0.75, emission=0.0)
    path, share, mean = reflections.carrier(found, truth)
    assert (path, share, mean) == ("glossy indirect", pytest.approx(0.25 / 0.26), pytest.approx(1.5))


def test_rows_of_another_size_or_reference_are_not_mixed_into_a_section():
    def options(size, reference=256):
        return argparse.Namespace(size=size, reference=reference, page=True, only=["softbox"])

    page = reflections.PAGE.read_text(encoding="utf-8")
    for size in ((64, 48), (256, 192)):
        assert markdown.begin(reflections.few_command(options(size))) in page
    for other in (options((128, 96)), options((64, 48), 1024)):
        with pytest.raises(ValueError, match=r"reflections\.md has no tables of"):
            reflections._few([], other)


def test_balls_and_turned_bodies_face_outwards_and_are_closed(registered):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    ball = shapes.ball(glass(), (1, 2, 3), 0.5, 12)
    cone = shapes.lathe(glass(), [(0, 0), (0.4, 0), (0.2, 1), (0, 1)], segments=12)
    for made in (ball, cone):
        corners = np.array([one.co for one in made.data.vertices])
        edges = {}
        for face in made.data.polygons:
            assert (corners[list(face.vertices)].mean(axis=0) - corners.mean(axis=0)) @ np.array(face.normal) > 0
            for edge in face.edge_keys:
                edges[edge] = edges.get(edge, 0) + 1
        assert set(edges.values()) == {2}
    assert np.allclose(np.linalg.norm([one.co for one in ball.data.vertices], axis=1), 0.5)
    uv = np.array([one.vector for one in ball.data.uv_layers[0].uv])
    assert (uv.min(), uv.max()) == (0.0, 1.0)


def test_each_channel_of_a_truth_in_three_parts_is_of_its_own_scene():
    parts = [
        Reference({"combined": np.full((2, 3, 4), k)}, {"combined": np.full((2, 3, 4), 0.1 * k)}, 8, 1.0, key=str(k))
        for k in range(3)
    ]
    whole = reflection_truth.joined(parts)
    assert whole.images["combined"].shape == (2, 3, 3)
    assert whole.images["combined"][1, 2].tolist() == [0, 1, 2]
    assert whole.half["combined"][0, 0] == pytest.approx([0.0, 0.1, 0.2])


def test_scenes_whose_truth_has_parts_or_more_samples_are_there():
    named = {*reflection_scenes.SCENES, *glass_scenes.SCENES}
    assert {*reflection_truth.LEAST, *glass_scenes.CHANNELS} <= named


@pytest.mark.parametrize(
    ("name", "asked", "has"),
    [("gloss below glass", 256, 16384), ("gloss below glass", 20000, 20000), ("none of those", 256, 256)],
)
def test_a_truth_has_as_many_samples_as_were_asked_for_and_its_light_needs(monkeypatch, name, asked, has):
    seen = []
    monkeypatch.setattr(reflection_scenes, "make", lambda name: {"glossy_bounces": 7})
    monkeypatch.setattr(reflection_truth, "bounces", lambda scene: [scene["glossy_bounces"]])
    monkeypatch.setattr(
        references, "reference", lambda scene, samples, size, extra: seen.append((samples, size, extra)) or "truth"
    )
    assert reflection_truth.reference(name, asked, (8, 6)) == "truth"
    assert seen == [(has, (8, 6), [7])]
