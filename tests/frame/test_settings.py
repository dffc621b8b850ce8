"""Settings from texts, as the command line gives them; every mistake is answered with a sentence."""

from dataclasses import replace

import pytest

from addon.frame.schedule import AT_REST
from addon.frame.settings import SAMPLES, Settings
from addon.frame.technique import Param, Technique
from addon.techniques import make_registry


class Rays(Technique):
    name, label = "rays", "Rays"
    params = (
        Param("count", "Count", 4, "Rays per pixel", 1, 64),
        Param("reach", "Reach", 0.5, "Share of the scene", 0.0, 1.0),
        Param("jitter", "Jitter", True, "Turn each pixel"),
        Param("kind", "Kind", "COSINE", "Distribution", items=(("COSINE", "Cosine", 0), ("EVEN", "Even", 1))),
    )


RAYS = Rays()


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("rays.count=8", 8),
        ("rays.reach=0.25", 0.25),
        ("rays.reach=1", 1.0),
        ("rays.jitter=off", False),
        ("rays.jitter=True", True),
        ("rays.kind=EVEN", "EVEN"),
    ],
)
def test_a_text_sets_a_parameter_in_its_own_type(text, value):
    name = text.partition("=")[0].partition(".")[2]
    found = Settings().override([RAYS], [text]).get(RAYS, name)
    assert found == value
    assert type(found) is type(value)


def test_samples_and_seed_are_settings_too():
    settings = Settings().override([RAYS], ["samples=7", "seed=3"])
    assert (settings.samples, settings.seed) == (7, 3)


def test_a_text_fills_a_slot():
    class Other(Rays):
        fills = ("light",)

    assert Settings().override([Other()], ["slot.light=rays"]).slots == {"light": "rays"}
    assert Settings(slots={"light": "rays"}).override([Other()], ["slot.light=AUTO"]).slots == {"light": "AUTO"}
    with pytest.raises(ValueError, match=r"'slot.light' must be one of AUTO, OFF, rays, not 'maps'"):
        Settings().override([Other()], ["slot.light=maps"])


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("rays.count", "'rays.count' is not of the form name=value"),
        (
            "rays.counts=2",
            (
                "There is no setting 'rays.counts'. Did you mean rays.count.*"
                "Known settings: samples, seed, bounces, .*rays.count"
            ),
        ),
        ("rays.count=many", "'count' needs a whole number, not 'many'"),
        ("rays.count=0", "'count' must be at least 1, not 0"),
        ("rays.count=65", "'count' must be at most 64, not 65"),
        ("rays.reach=nan", "'reach' must be at least 0.0, not nan"),
        ("rays.jitter=perhaps", "'jitter' needs on or off, not 'perhaps'"),
        ("rays.kind=ODD", "'kind' must be one of COSINE, EVEN, not 'ODD'"),
        ("samples=0", "'samples' must be at least 1, not 0"),
        ("samples=1e3", "'samples' needs a whole number, not '1e3'"),
    ],
)
def test_a_mistake_is_answered_with_a_sentence_that_names_it(text, sentence):
    with pytest.raises(ValueError, match=sentence):
        Settings().override([RAYS], [text])


@pytest.mark.parametrize("scope", ["LIGHT", "MATERIAL", "OBJECT"])
def test_what_each_lamp_material_or_object_has_is_no_setting_of_a_picture(scope):
    class Own(Rays):
        params = (Param("steps", "Steps", 8, "", 1, 64, scope=scope), Param("count", "Count", 8, "", 1, 64))

    kind = scope.lower()
    with pytest.raises(ValueError, match=f"'rays.steps' is a setting of each {kind}.*set it on the {kind} in the file"):
        Settings().override([Own()], ["rays.steps=9"])
    with pytest.raises(ValueError, match="Known settings") as listed:
        Settings().override([Own()], ["rays.unknown=9"])
    assert "rays.count" in str(listed.value) and "rays.steps" not in str(listed.value)


@pytest.mark.parametrize("scope", ["CAMERA", "WORLD"])
def test_what_the_camera_or_the_world_has_is_a_setting_of_a_picture(scope):
    class Own(Rays):
        params = (Param("steps", "Steps", 8, "", 1, 64, scope=scope),)

    assert Settings().override([Own()], ["rays.steps=9"]).get(Own(), "steps") == 9


def test_overriding_changes_a_copy():
    before = Settings()
    after = before.override([RAYS], ["rays.count=8", "samples=2"])
    assert before == Settings()
    assert after != before


def test_what_is_not_set_has_its_declared_default():
    assert Settings().of(RAYS) == (4, 0.5, True, "COSINE")
    assert Settings().samples == SAMPLES.default


def test_asking_for_an_undeclared_parameter_is_an_error():
    with pytest.raises(KeyError, match="Technique rays declares no parameter 'bounces'"):
        Settings().get(RAYS, "bounces")


@pytest.mark.parametrize("technique", make_registry(), ids=lambda t: t.name)
def test_every_declared_default_passes_its_own_check(technique):
    for param in technique.params:
        assert param.check(param.default) == param.default
        assert param.description
        for limit in filter(lambda x: x is not None, (param.minimum, param.maximum)):
            assert param.check(limit) == limit


class Drafted(Technique):
    name, label = "drafted", "Drafted"
    params = (
        Param("count", "Count", 8, "Rays per pixel", 1, 64, draft=2),
        Param("guided", "Guided", True, "Look first", draft=False),
        Param("reach", "Reach", 0.5, "Share of the scene", 0.0, 1.0),
    )


@pytest.mark.parametrize(("count", "drawn"), [(8, 2), (2, 2), (1, 1)])
def test_a_draft_takes_at_most_what_is_declared_for_it(count, drawn):
    settings = Settings(values={("drafted", "count"): count}).as_draft()
    assert settings.of(Drafted()) == (drawn, False, 0.5)
    assert replace(settings, schedule=AT_REST).of(Drafted()) == (count, True, 0.5)


@pytest.mark.parametrize(("bounces", "drawn"), [(0, 0), (1, 1), (16, 8)])
def test_a_draft_has_few_bounces(bounces, drawn):
    assert Settings(bounces=bounces).as_draft().bounces == drawn


def test_a_draft_holds_nearly_all_that_bright_walls_reflect():
    """In a closed room of walls that reflect .6 those reflections that are left out hold .6^bounces of the light."""
    assert 0.6 ** Settings(bounces=64).as_draft().bounces < 0.02
