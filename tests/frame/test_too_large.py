"""Scenes with more triangles than rays or points can have say what their pictures lack."""

from types import SimpleNamespace

import pytest

from addon.frame import too_large
from addon.frame.ledger import SKIPPED, Row
from addon.frame.plan import Plan
from addon.scene import acceleration
from addon.ui.notes import losses

SCENE = SimpleNamespace()


def row(name, reason, slot=""):
    return Row(name, name, SKIPPED, reason, slot=slot)


@pytest.fixture
def large(monkeypatch):
    monkeypatch.setattr(acceleration, "too_many", lambda snapshot: "9 triangles are more than the 4 that can be traced")
    monkeypatch.setattr(acceleration, "too_many_copies", lambda snapshot: None)
    return acceleration.too_many(SCENE)


def test_what_is_left_out_for_the_scene_s_size_is_said(large):
    skipped = (
        row("instant_radiosity", large, "indirect"), row("airlight", large, "volume"),
        row("shaded_reflections", large), row("traced_refraction", "no material is glass", "transmission"),
        row("light_probes", large),
    )  # fmt: skip
    (note,) = losses(too_large.notes_of(Plan((), skipped, {}), SCENE))
    assert str(note).startswith(f"Scene: {large}: bounced light, light in volumes and what mirrors and glass show")
    assert "are missing from the picture" in note.text and "copies" in note.text


def test_a_slot_that_another_technique_fills_is_not_missing(large):
    plan = Plan((), (row("instant_radiosity", large, "indirect"),), {"indirect": "ssdo"})
    (note,) = losses(too_large.notes_of(plan, SCENE))
    assert "missing where it comes from what the camera does not see" in note.text


def test_scenes_that_can_be_traced_say_nothing(monkeypatch):
    monkeypatch.setattr(acceleration, "too_many", lambda snapshot: None)
    monkeypatch.setattr(acceleration, "too_many_copies", lambda snapshot: "many")
    skipped = row("implicit_visibility", "many", "indirect"), row("image_space_subsurface", "many", "subsurface")
    notes = too_large.notes_of(Plan((), skipped[:1], {"indirect": "instant_radiosity"}), SCENE)
    assert notes == ()
    (note,) = too_large.notes_of(Plan((), skipped, {"indirect": "instant_radiosity"}), SCENE)
    assert note.text.startswith("many: light below surfaces is missing")
