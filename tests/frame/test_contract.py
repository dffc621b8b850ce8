"""What the contract promises: how little a new technique, a new provider of visibility or a new light path costs."""

import inspect
import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from addon.frame import light_paths
from addon.frame.plan import PlanError, make_plan
from addon.frame.run import Renderer
from addon.frame.settings import Settings
from addon.frame.technique import Technique, Write
from addon.gfx import passes
from addon.lighting.visibility import NO_VIEWS, Lookup, Maps, VisibilityProvider
from addon.snapshot.scene import Instance
from addon.techniques import make_registry
from tests.frame.test_plan import lamp, room

TECHNIQUES = sorted((Path(__file__).parents[2] / "addon" / "techniques").glob("*.py"))


# Who talks to whom ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("pattern", [r"services\[", r"services\.get", r"technique\.name ==", r"sample == 0"])
def test_techniques_talk_by_services_and_stages_alone(pattern):
    assert [path.name for path in TECHNIQUES if re.search(pattern, path.read_text(encoding="utf-8"))] == []


def test_all_that_techniques_provide_and_request_is_a_named_service():
    registry = make_registry()
    provided = {service for technique in registry for service in technique.provides}
    for technique in registry:
        assert all(service.name for service in (*technique.provides, *technique.requests))
        assert set(technique.requests) <= provided


# A technique of the show stage ---------------------------------------------------------------------------------------


class Nothing(Technique):
    """A lens that does nothing."""

    name, label = "nothing", "Nothing"
    reads = ("film.combined",)
    writes = (Write("film.lens", "RGBA32F", "The picture through a lens that changes nothing"),)

    def show(self, frame):
        passes.copy(frame.images["film.combined"], frame.target("film.lens"))
        frame.picture = "film.lens"


def drawn(registry, snapshot=None, samples=1):
    renderer = Renderer(lambda: registry)
    frame = renderer.begin(snapshot or room(), Settings(samples=samples, bounces=0))
    for _ in range(samples):
        renderer.advance(frame)
    image = renderer.show(frame)
    pixels = renderer.finish(frame, [frame.picture, "film.combined"])
    renderer.release()
    return frame, image, pixels


def test_a_lens_that_does_nothing_shows_the_same_picture_in_an_image_of_its_own(gpu_context):
    frame, image, pixels = drawn((*make_registry(), Nothing()))
    assert frame.picture == "film.lens" and image is frame.images["film.lens"]
    np.testing.assert_array_equal(pixels["film.lens"], pixels["film.combined"])
    assert frame.ledger.row("nothing").milliseconds > 0


# A provider of visibility --------------------------------------------------------------------------------------------


class Half(Technique, VisibilityProvider):
    """Half of each light is seen from everywhere."""

    name, label = "half", "Half"
    fills, provides = ("shadow",), (VisibilityProvider,)
    asks_views = False
    lookup = Lookup(
        "half", text="float light_visibility(Light light, ivec2 pixel, vec3 position, vec3 normal) { return 0.5; }\n",
        maps=False,
    )  # fmt: skip

    def begin(self, frame):
        frame.provide(self, VisibilityProvider)

    def batches(self, frame, technique, points):
        yield points, Maps(None, NO_VIEWS, self.lookup)


def test_a_provider_that_answers_one_half_is_short_and_halves_the_light(gpu_context):
    assert len(inspect.getsource(Half).splitlines()) <= 30
    without = [one for one in make_registry() if "shadow" not in one.fills]
    place = np.eye(4)
    place[:3, 3] = -0.3, -0.3, -3.0
    seen = (Instance("Triangle", "mesh", place, (0,)),)
    _, _, whole = drawn(tuple(without), room(instances=seen, lights=(lamp(cast_shadow=False),)))
    _, _, half = drawn((*without, Half()), room(instances=seen))
    assert whole["film.combined"][..., :3].max() > 0
    np.testing.assert_allclose(half["film.combined"][..., :3], 0.5 * whole["film.combined"][..., :3], rtol=1e-5)


# A light path --------------------------------------------------------------------------------------------------------


def test_a_light_path_of_a_surface_of_a_lobe_or_of_a_medium_is_one_row_of_the_table():
    """Film, clamp, resolve, passes and comparison take three more rows without another line, in a process of its own:
    apart and summed up, at one point of the film for each sample and at several, where edges are lit again, too."""
    run = [sys.executable, "-m", "tests.frame.further_paths"]
    done = subprocess.run(run, check=False, capture_output=True, text=True, cwd=Path(__file__).parents[2])
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout.splitlines()[-1])
    for how in ("apart", "together", "clamped", "repeated"):
        np.testing.assert_allclose(found[how], 7.0, rtol=1e-5, err_msg=how)  # of 1, 2 and 4
    assert found["passes"] == [
        "radiance.below_direct / color.diffuse",
        "radiance.sheen_direct / color.sheen",
        "radiance.glow",
    ]
    assert found["compared"] == ["below_direct", "sheen_direct", "glow"]


# Ownership and slots -------------------------------------------------------------------------------------------------


def owner(name, transport, slots=()):
    made = Technique()
    made.name, made.label, made.owns, made.fills = name, name.title(), (transport,), slots
    return made


def test_two_owners_of_the_same_light_are_an_error_that_names_both():
    registry = [
        owner("mapping", light_paths.LIGHT_SPECULAR_DIFFUSE),
        owner("photons", light_paths.LIGHT_SPECULAR_DIFFUSE),
    ]
    with pytest.raises(PlanError, match="Mapping and Photons both bring light that mirrors and glass focus"):
        make_plan(registry, None, Settings())
    assert make_plan(registry[:1], None, Settings()).owner(light_paths.LIGHT_SPECULAR_DIFFUSE).name == "mapping"


def test_a_transport_that_is_not_in_the_table_is_an_error():
    with pytest.raises(PlanError, match="Mapping owns 'light', which is not in light_paths"):
        make_plan([owner("mapping", "light")], None, Settings())


def test_a_technique_may_fill_several_slots_of_which_others_can_be_taken_by_others():
    several = owner("micro", light_paths.IN_MEDIA, ("indirect", "environment"))
    other = owner("sky", light_paths.SUBSURFACE, ("environment",))
    assert make_plan([several, other], None, Settings()).filled == {"indirect": "micro", "environment": "sky"}
    both = Settings(slots={"environment": "micro"})
    assert make_plan([several, other], None, both).filled == {"indirect": "micro", "environment": "micro"}


def test_a_slot_that_is_off_is_filled_by_nobody():
    plan = make_plan(
        [owner("sky", light_paths.SUBSURFACE, ("environment",))], None, Settings(slots={"environment": "OFF"})
    )
    assert not plan.techniques and plan.skipped[0].reason == "the environment slot is off"
