"""What runs, in which order, and why the rest is left out."""

from dataclasses import replace

import numpy as np
import pytest

from addon.frame.ledger import SKIPPED
from addon.frame.plan import PlanError, make_plan
from addon.frame.settings import Settings
from addon.frame.technique import Technique, Write
from addon.materials.compiler import default_graph
from addon.snapshot.scene import Camera, Film, Instance, Light, Material, Mesh, Snapshot, Visibility, World
from addon.techniques import make_registry


def technique(name, reads=(), writes=(), slot="", reason=None):
    """A technique that computes nothing; `reason` makes it skip."""
    made = Technique()
    made.name, made.label, made.reads = name, name.title(), tuple(reads)
    made.fills = (slot,) if slot else ()
    made.writes = tuple(Write(image, "RGBA32F", "") for image in writes)
    made.skip = lambda snapshot, settings: reason
    return made


def names(plan):
    return [t.name for t in plan.techniques]


# Order ---------------------------------------------------------------------------------------------------------------


def test_writers_run_before_readers_whatever_the_registry_says():
    plan = make_plan(
        [technique("c", ["b"], ["c"]), technique("b", ["a"], ["b"]), technique("a", (), ["a"])], None, Settings()
    )
    assert names(plan) == ["a", "b", "c"]


def test_techniques_that_do_not_wait_keep_the_registrys_order():
    plan = make_plan([technique(name) for name in "zyx"], None, Settings())
    assert names(plan) == ["z", "y", "x"]


def test_several_writers_of_an_image_all_run_before_its_reader():
    plan = make_plan(
        [technique("sum", ["light"]), technique("sun", (), ["light"]), technique("lamp", (), ["light"])],
        None,
        Settings(),
    )
    assert names(plan) == ["sun", "lamp", "sum"]


def closing(name, closed, writes=()):
    made = technique(name, (), (*closed, *writes))
    made.finishes = tuple(closed)
    return made


def test_who_closes_a_sum_runs_after_all_who_add_to_it():
    plan = make_plan(
        [closing("film", ["light"]), technique("sun", (), ["light"]), technique("lamp", (), ["light"])],
        None,
        Settings(),
    )
    assert names(plan) == ["sun", "lamp", "film"]


def test_readers_of_a_closed_sum_run_before_it_is_taken_up():
    film, bounce = closing("film", ["light"], ["color"]), technique("bounce", ["light"], ["light"])
    registry = [film, bounce, technique("sun", (), ["light"]), technique("tint", ["color"])]
    assert names(make_plan(registry, None, Settings())) == ["sun", "bounce", "film", "tint"]


def test_reading_what_nothing_writes_is_an_error_that_says_what_was_skipped():
    with pytest.raises(PlanError, match=r"Blur reads depth, which nothing writes \(skipped: Surfaces\)"):
        make_plan([technique("surfaces", (), ["depth"], reason="none"), technique("blur", ["depth"])], None, Settings())


def test_techniques_that_wait_for_each_other_are_an_error():
    with pytest.raises(PlanError, match="wait for each other: A, B"):
        make_plan([technique("a", ["y"], ["x"]), technique("b", ["x"], ["y"])], None, Settings())


# Slots ---------------------------------------------------------------------------------------------------------------


def test_one_technique_fills_a_slot_and_the_others_say_which():
    plan = make_plan([technique("maps", slot="shadow"), technique("volumes", slot="shadow")], None, Settings())
    assert names(plan) == ["maps"]
    (row,) = plan.skipped
    assert (row.name, row.state, row.slot) == ("volumes", SKIPPED, "shadow")
    assert row.reason == "the shadow slot is filled by Maps"


def test_the_artists_choice_for_a_slot_wins():
    settings = Settings(slots={"shadow": "volumes"})
    plan = make_plan([technique("maps", slot="shadow"), technique("volumes", slot="shadow")], None, settings)
    assert names(plan) == ["volumes"]
    assert plan.skipped[0].reason == "the shadow slot is set to Volumes"


def test_a_chosen_technique_that_is_not_needed_leaves_the_slot_empty_and_says_so():
    settings = Settings(slots={"shadow": "volumes"})
    wanted = technique("volumes", slot="shadow", reason="no light casts a shadow")
    plan = make_plan([technique("maps", slot="shadow"), wanted], None, settings)
    assert names(plan) == []
    assert {row.name: row.reason for row in plan.skipped} == {
        "maps": "the shadow slot is set to Volumes",
        "volumes": "no light casts a shadow",
    }


def test_auto_takes_the_first_that_claims_the_scene_else_the_first():
    registry = [technique("maps", slot="shadow"), technique("volumes", slot="shadow")]
    assert names(make_plan(registry, None, Settings())) == ["maps"]
    registry[1].claims = lambda snapshot, settings: settings.samples == 1
    few = make_plan(registry, None, Settings(samples=1))
    assert names(few) == ["volumes"]
    assert few.skipped[0].reason == "the shadow slot is filled by Volumes"
    assert names(make_plan(registry, None, Settings(samples=64))) == ["maps"]
    assert names(make_plan(registry, None, Settings(samples=1, slots={"shadow": "maps"}))) == ["maps"]


def test_a_technique_that_skips_leaves_its_slot_to_the_next():
    first = technique("maps", slot="shadow", reason="not needed")
    assert names(make_plan([first, technique("volumes", slot="shadow")], None, Settings())) == ["volumes"]


# What scenes need ----------------------------------------------------------------------------------------------------


def lamp(**changes):
    return replace(Light("lamp", "Lamp", "POINT", np.eye(4), np.ones(3)), **changes)


def room(**changes):
    """One triangle under one lamp."""
    mesh = Mesh(
        "mesh", 1, np.eye(3, dtype=np.float32), np.arange(3, dtype=np.int32), np.eye(3, dtype=np.float32),
        np.array([[0, 1, 2]], np.int32), np.zeros(1, np.int32), 1, bounds_min=np.zeros(3), bounds_max=np.ones(3),
    )  # fmt: skip
    whole = Snapshot(
        meshes={"mesh": mesh},
        instances=(Instance("Triangle", "mesh", np.eye(4), (0,)),),
        materials=(Material("default", "default", default_graph()),),
        images={},
        lights=(lamp(),),
        world=World(np.zeros(3)),
        camera=Camera(np.eye(4), "PERSPECTIVE", (-1, 1, -1, 1), 0.1, 100),
        film=Film(8, 8, (0, 0, 8, 8)),
    )
    return replace(whole, **changes)


ALWAYS = {"surfaces", "film"}


@pytest.mark.parametrize(
    ("changes", "planned"),
    [
        ({}, {"accumulated_maps", "direct_light"}),
        ({"lights": ()}, set()),
        ({"lights": (lamp(strength=np.zeros(3)),)}, set()),
        ({"lights": (lamp(cast_shadow=False),)}, {"direct_light"}),
        ({"world": World(np.ones(3))}, {"light_probes", "accumulated_maps", "direct_light", "environment_light"}),
        ({"world": World(np.ones(3)), "lights": ()}, {"light_probes", "environment_light"}),
        ({"world": World(np.ones(3)), "instances": ()}, set()),
        (
            {"world": World(np.ones(3), visibility=Visibility(diffuse=False, glossy=False))},
            {"accumulated_maps", "direct_light"},
        ),
        (
            {"instances": (Instance("Triangle", "mesh", np.eye(4), (0,), Visibility(shadow=False)),)},
            {"direct_light"},
        ),
    ],
)
def test_only_what_the_scene_needs_is_planned(changes, planned):
    plan = make_plan(make_registry(), room(**changes), Settings(bounces=0))
    assert set(names(plan)) == planned | ALWAYS | ({"denoise"} if planned else set())
    assert all(row.reason for row in plan.skipped)
    assert set(names(plan)) | {row.name for row in plan.skipped} == {t.name for t in make_registry()}


@pytest.mark.parametrize(
    ("changes", "bounces", "reason"),
    [
        ({}, 4, ""),
        ({}, 0, "the scene's bounces are set to 0"),
        ({"instances": ()}, 4, "the scene has no surface"),
        ({"lights": ()}, 4, "no light reaches any surface"),
        ({"lights": (), "world": World(np.ones(3))}, 4, ""),
        ({"lights": (lamp(visibility=Visibility(diffuse=False)),)}, 4, "no light reaches any surface"),
    ],
)
def test_indirect_light_runs_only_where_there_is_some(changes, bounces, reason):
    plan = make_plan(make_registry(), room(**changes), Settings(bounces=bounces))
    reasons = {row.name: row.reason for row in plan.skipped}
    assert reasons.get("instant_radiosity", "") == reason


def test_every_reason_is_part_of_a_sentence_an_artist_understands():
    plan = make_plan(make_registry(), room(lights=(), instances=()), Settings())
    for row in plan.skipped:
        assert row.reason[0].islower()
        assert not row.reason.endswith(".")
        assert "_" not in row.reason
        assert len(row.reason.split()) >= 4


def test_the_plan_as_text_names_all_techniques():
    text = make_plan(make_registry(), room(lights=()), Settings()).text()
    for one in make_registry():
        assert one.label in text
    assert "skipped: the scene has no light with power" in text


def test_names_in_the_registry_are_unique_and_all_writers_of_an_image_agree_on_its_format():
    registry = make_registry()
    assert len({t.name for t in registry}) == len(registry)
    formats = {}
    for write in (write for one in registry for write in one.writes):
        assert formats.setdefault(write.name, (write.format, write.accumulates)) == (write.format, write.accumulates)
        assert write.description


def test_of_a_pass_tree_the_first_one_fills_a_slot():
    both = [technique("maps", slot="shadow"), technique("volumes", slot="shadow")]
    plan = make_plan(both, None, Settings(passes=("volumes", "maps")))
    assert names(plan) == ["volumes"]
    (row,) = plan.skipped
    assert (row.name, row.reason) == ("maps", "the shadow slot is filled by Volumes")


def test_a_plan_tells_what_runs_who_fills_a_slot_and_who_writes_last():
    registry = [
        technique("maps", slot="shadow"), technique("volumes", slot="shadow"),
        technique("light", writes=("sum",)), technique("glare", reads=("sum",), writes=("picture",)),
    ]  # fmt: skip
    plan = make_plan(registry, None, Settings())
    assert plan.runs("maps") and plan.runs("light") and not plan.runs("volumes") and not plan.runs("nothing")
    assert plan.slots_of(registry[0]) == ["shadow"] and plan.slots_of(registry[2]) == []
    assert plan.last_writer("sum") is registry[2] and plan.last_writer("nothing") is None


def test_of_those_that_claim_a_scene_the_first_one_is_taken_and_the_reason_does_not_say_that_it_was_set():
    registry = [technique(name, slot="shadow") for name in ("maps", "volumes", "wedges")]
    for one in registry[1:]:
        one.claims = lambda snapshot, settings: True
    plan = make_plan(registry, None, Settings())
    assert names(plan) == ["volumes"]
    assert [row.reason for row in plan.skipped] == ["the shadow slot is filled by Volumes"] * 2
    asked = make_plan(registry, None, Settings(slots={"shadow": "wedges"}))
    assert [row.reason for row in asked.skipped] == ["the shadow slot is set to Wedges"] * 2


def test_who_asks_for_what_it_provides_itself_does_not_wait_for_itself():
    both = technique("both")
    both.provides = both.requests = (Settings,)
    assert names(make_plan([both], None, Settings())) == ["both"]
