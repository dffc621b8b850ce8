"""What pictures lack by design is said: for the scene's size, and where systems meet."""

from dataclasses import replace
from types import SimpleNamespace

import pytest

from addon.frame import left_out
from addon.frame.ledger import SKIPPED, Row
from addon.frame.plan import Plan
from addon.materials.graph import Graph, Input, Node
from addon.scene import acceleration
from addon.snapshot.panorama import bends_lines
from addon.ui.notes import losses

SCENE = SimpleNamespace(camera=None)
FEW = SimpleNamespace(bounces=0)


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
    (note,) = losses(left_out.notes_of(Plan((), skipped, {}), SCENE, FEW, ()))
    assert str(note).startswith(f"Scene: {large}: bounced light, light in volumes and what mirrors and glass show")
    assert "are missing from the picture" in note.text and "copies" in note.text


def test_a_slot_that_another_technique_fills_is_not_missing(large):
    plan = Plan((), (row("instant_radiosity", large, "indirect"),), {"indirect": "ssdo"})
    (note,) = losses(left_out.notes_of(plan, SCENE, FEW, ()))
    assert "missing where it comes from what the camera does not see" in note.text


def test_scenes_that_can_be_traced_say_nothing(monkeypatch):
    monkeypatch.setattr(acceleration, "too_many", lambda snapshot: None)
    monkeypatch.setattr(acceleration, "too_many_copies", lambda snapshot: "many")
    skipped = row("implicit_visibility", "many", "indirect"), row("image_space_subsurface", "many", "subsurface")
    notes = left_out.notes_of(Plan((), skipped[:1], {"indirect": "instant_radiosity"}), SCENE, FEW, ())
    assert notes == ()
    (note,) = left_out.notes_of(Plan((), skipped, {"indirect": "instant_radiosity"}), SCENE, FEW, ())
    assert note.text.startswith("many: light below surfaces is missing")


@pytest.mark.parametrize(("bounces", "count"), [(0, 0), (2, 1)])
def test_what_mirrors_lack_of_volumes_and_grass_is_said(monkeypatch, bounces, count):
    for name in ("too_many", "too_many_copies"):
        monkeypatch.setattr(acceleration, name, lambda snapshot: None)
    settings = SimpleNamespace(bounces=bounces, get=lambda technique, name: bounces)
    names = "airlight", "shaded_reflections", "grass", "volume_caustics"
    air, mirrors, grass, beams = (SimpleNamespace(name=name) for name in names)
    assert len(left_out.notes_of(Plan((air, mirrors), (), {}), SCENE, settings, ())) == count
    assert len(left_out.notes_of(Plan((air, mirrors, grass), (), {}), SCENE, settings, ())) == count + 1
    assert len(left_out.notes_of(Plan((air, beams, mirrors), (), {}), SCENE, settings, ())) == count + 1
    assert left_out.notes_of(Plan((air, grass, beams), (), {}), SCENE, settings, ()) == ()


def test_grass_whose_patch_cannot_be_read_is_said(monkeypatch):
    for name in ("too_many", "too_many_copies"):
        monkeypatch.setattr(acceleration, name, lambda snapshot: None)
    for reason, count in (("no material that is shown is covered with grass", 0), ("'a.grass' does not exist", 1)):
        assert len(left_out.notes_of(Plan((), (row("grass", reason),), {}), SCENE, FEW, ())) == count


def test_what_panoramas_lack_is_said(monkeypatch):
    for name in ("too_many", "too_many_copies"):
        monkeypatch.setattr(acceleration, name, lambda snapshot: None)
    scene = SimpleNamespace(camera=SimpleNamespace(panorama="equirectangular"))
    skipped = (row("volume_caustics", bends_lines(scene)), row("screen_space_photons", bends_lines(scene), "caustics"))
    (note,) = losses(left_out.notes_of(Plan((), skipped, {"caustics": "caustics_mapping"}), scene, FEW, ()))
    assert note.text == f"{bends_lines(scene)}: light of caustics in volumes is missing from the picture."


def test_coloured_layers_that_bounced_light_passes_as_grey_are_named(monkeypatch):
    for name in ("too_many", "too_many_copies"):
        monkeypatch.setattr(acceleration, name, lambda snapshot: None)
    scene = SimpleNamespace(camera=None, used_materials={0, 1})
    materials = [
        SimpleNamespace(name=name, tinted=tinted, emissive=False)
        for name, tinted in (("A", False), ("B", True), ("C", True))
    ]
    (note,) = left_out.notes_of(Plan((), (), {"indirect": "ssdo"}), scene, FEW, materials)
    assert note.subject == "Material 'B'" and "grey" in note.text
    glowing = [SimpleNamespace(name="D", tinted=True, emissive=True)]
    assert left_out.notes_of(Plan((), (), {"indirect": "instant_radiosity"}), scene, FEW, glowing)
    for filled in ({}, {"indirect": "instant_radiosity"}):
        assert left_out.notes_of(Plan((), (), filled), scene, FEW, materials) == ()


def test_gems_that_mirror_more_often_than_is_followed_are_named(monkeypatch):
    for name in ("too_many", "too_many_copies"):
        monkeypatch.setattr(acceleration, name, lambda snapshot: None)
    scene = SimpleNamespace(camera=None, used_materials={0, 1})
    materials = [
        SimpleNamespace(name=name, tinted=False, emissive=False, glass=SimpleNamespace(ior=ior, share=1.0))
        for name, ior in (("Window", 1.5), ("Diamond", 2.42))
    ]
    plan = Plan((SimpleNamespace(name="traced_refraction", label="Refraction"),), (), {})
    few, enough = (SimpleNamespace(bounces=0, get=lambda technique, name, n=n: n) for n in (8, 32))
    (note,) = left_out.notes_of(plan, scene, few, materials)
    assert note.subject == "Material 'Diamond'" and "2.42" in note.text and "(8 Interfaces)" in note.text
    assert left_out.notes_of(plan, scene, enough, materials) == ()


def glossy(name, **inputs):
    values = {"Base Color": (0.8, 0.8, 0.8, 1.0), "Specular IOR Level": 0.5, **inputs}
    node = Node("shader", "shader", "ShaderNodeBsdfPrincipled", {k: Input("FLOAT", v) for k, v in values.items()})
    return SimpleNamespace(name=name, tinted=False, emissive=False, glass=None), Graph({"shader": node})


@pytest.mark.parametrize(("inputs", "said"), [
    ({"Metallic": 1.0, "Roughness": 0.4}, True), ({"Metallic": 1.0, "Roughness": 0.2}, False),
    ({"Metallic": 1.0, "Roughness": 0.5}, False), ({"Roughness": 0.1}, False),
    ({"Roughness": 0.1, "Base Color": (0.02, 0.02, 0.02, 1.0)}, True),
    ({"Roughness": 0.6, "Base Color": (0.02, 0.02, 0.02, 1.0)}, False),
    ({"Roughness": 0.6, "Base Color": (0.02,) * 3 + (1.0,), "Coat Weight": 1.0, "Coat Roughness": 0.03}, True),
])  # fmt: skip
def test_gloss_that_is_thrown_wider_than_it_is_is_named(monkeypatch, inputs, said):
    for name in ("too_many", "too_many_copies"):
        monkeypatch.setattr(acceleration, name, lambda snapshot: None)
    material, graph = glossy("Pan", **inputs)
    scene = SimpleNamespace(camera=None, used_materials={0}, materials=[SimpleNamespace(graph=graph)])
    plan, some = Plan((), (), {"indirect": "instant_radiosity", "caustics": "caustics"}), SimpleNamespace(bounces=4)
    notes = left_out.notes_of(plan, scene, some, [material])
    assert bool(notes) == said and all("'Pan'" in note.text and note.subject == "Gloss" for note in notes)
    assert all("as by a roughness of 0.5" in note.text for note in notes)
    assert all("of roughness 0.35 or less throw caustics" in note.text for note in notes)
    evenly, by_direction = (
        left_out.notes_of(replace(plan, filled=plan.filled | {"indirect": name}), scene, some, [material])
        for name in ("implicit_visibility", "micro_rendering")
    )
    assert bool(evenly) == said and all("as by dull surfaces" in note.text for note in evenly)
    assert by_direction == ()
    assert (
        left_out.notes_of(plan, scene, FEW, [material])
        == left_out.notes_of(Plan((), (), {}), scene, some, [material])
        == left_out.notes_of(Plan((), (), {"indirect": None}), scene, some, [material])
        == ()
    )


def test_metal_is_named_from_where_it_throws_no_caustics(monkeypatch):
    """As widely as it throws them all that is narrower than the lobes of paths does."""
    for name in ("too_many", "too_many_copies"):
        monkeypatch.setattr(acceleration, name, lambda snapshot: None)
    monkeypatch.setattr(left_out.gloss, "THROWS", 0.3)
    plan = Plan((), (), {"indirect": "instant_radiosity", "caustics": "caustics"})
    for rough, said in ((0.31, True), (0.3, False)):
        material, graph = glossy("Pan", Metallic=1.0, Roughness=rough)
        scene = SimpleNamespace(camera=None, used_materials={0}, materials=[SimpleNamespace(graph=graph)])
        notes = left_out.notes_of(plan, scene, SimpleNamespace(bounces=4), [material])
        assert [("roughness 0.3 or less" in note.text) for note in notes] == [True] * said


def test_smooth_metal_is_named_where_nothing_throws_caustics(monkeypatch):
    for name in ("too_many", "too_many_copies"):
        monkeypatch.setattr(acceleration, name, lambda snapshot: None)
    made = [glossy(f"Metal {k}", Metallic=1.0, Roughness=0.1) for k in range(4)]
    materials = [SimpleNamespace(graph=graph) for _, graph in made]
    scene = SimpleNamespace(camera=None, used_materials={0, 1, 2, 3}, materials=materials)
    plan = Plan((), (), {"indirect": "instant_radiosity"})
    (note,) = left_out.notes_of(plan, scene, SimpleNamespace(bounces=4), [one for one, _ in made])
    assert "'Metal 0', 'Metal 1' and 2 other materials" in note.text and "caustics" not in note.text
