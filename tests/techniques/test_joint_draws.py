"""Surfaces and casters of many meshes in few draws: the same pictures, whatever moves or changes."""

import numpy as np
import pytest

from addon.gfx import passes
from addon.scene import casters, joint_draws


@pytest.fixture
def boxes(stage):
    """A floor and twelve cards of six materials of two programs under a lamp, some of them the same mesh."""
    stage.floor(material=stage.principled())
    grey = [stage.diffuse(k / 6) for k in (1, 2, 3)]
    gloss = [stage.principled(Roughness=0.3 + k / 6) for k in (1, 2, 3)]
    stage.cards = [
        stage.rectangle((x, y), (x + 0.4, y + 0.5), 0.2 + 0.1 * k, material=material)
        for k, (x, y, material) in enumerate(zip(np.tile(np.arange(-2, 1), 2), np.repeat((-1, 0), 3), grey + gloss))
    ]
    for card in stage.cards[:6]:
        twin = card.copy()
        twin.location.y += 1.1
        stage.scene.collection.objects.link(twin)
    stage.light("POINT", (0.3, 0.2, 3.0))
    stage.scene.candela.accumulated_maps_by = "MAPS"
    stage.camera_above(4.0)
    return stage


@pytest.fixture
def calls(monkeypatch):
    """Names of the functions that drew meshes."""
    made = []
    for name in ("draw", "draw_range"):
        original = getattr(passes, name)
        monkeypatch.setattr(passes, name, lambda *a, of=original, name=name: made.append(name) or of(*a))
    return made


def anew(stage):
    """The picture of a renderer that knows nothing of pictures before."""
    stage.renderer.release()
    return stage.render(2)


def apart(stage, monkeypatch):
    """The same with a draw for each mesh and material."""
    with monkeypatch.context() as patch:
        patch.setattr(joint_draws, "MOST_TRIANGLES", 0)
        patch.setattr(casters, "MOST_TOGETHER", 0)
        return anew(stage)


def same(one, other):
    return all(np.array_equal(one[name], other[name]) for name in one)


def test_a_picture_drawn_together_is_that_drawn_apart_in_fewer_calls(boxes, calls, monkeypatch):
    expected = apart(boxes, monkeypatch)
    alone = len(calls)
    calls.clear()
    assert same(anew(boxes), expected)
    assert len(calls) < alone / 2


@pytest.mark.parametrize("change", ("moved", "mirrored", "recoloured", "another material", "one less"))
def test_what_changes_is_drawn_as_if_it_were_new(boxes, change, monkeypatch):
    boxes.render(2)
    card = boxes.cards[1]
    if change == "moved":
        card.location.z += 0.3
    elif change == "mirrored":
        card.scale.x = -1
    elif change == "recoloured":
        card.data.materials[0].node_tree.nodes["Diffuse BSDF"].inputs["Color"].default_value = (0.1, 0.9, 0.2, 1)
    elif change == "another material":
        card.data.materials[0] = boxes.cards[5].data.materials[0]
    else:
        card.hide_render = True
    assert same(boxes.render(2), apart(boxes, monkeypatch))


def test_layers_that_are_drawn_at_random_stay_apart(boxes, monkeypatch):
    boxes.cards[2].data.materials[0] = boxes.see_through(0.5)
    expected = apart(boxes, monkeypatch)
    assert same(anew(boxes), expected)
