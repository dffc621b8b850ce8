"""Programs that a second process compiles, and what a viewport shows until they are there."""

import subprocess
import sys
import time
from dataclasses import replace

import bpy
import numpy as np
import pytest

from addon.gfx import images
from addon.surfaces import first_look
from addon.viewport import ahead
from addon.viewport.ahead import DRAFT, FULL, Ahead, needs_of
from tests.viewport.region import Region


class Slow:
    """Another process that has compiled nothing until it is told."""

    doing = "Compiling shaders for Film (3 so far)"

    def __init__(self):
        self.ready, self.asked = set(), []

    def left(self, renderer, whole, settings, draft, edit=False):
        self.asked.append((whole.film.width, whole.film.height, settings.schedule.is_draft))
        return None if (DRAFT if draft else FULL) in self.ready else 5


@pytest.fixture
def own_folder(tmp_path, monkeypatch):
    monkeypatch.setenv("CANDELA_CACHE", str(tmp_path))
    return tmp_path


def test_view_shows_a_first_look_then_direct_light_then_all_as_the_other_process_gets_ready(region):
    viewport = region.viewport
    viewport.ahead = slow = Slow()
    region.draw()
    assert viewport.looks and viewport.picture is not None and viewport.frame is None  # nothing else in the same redraw
    region.draw(region.moved(0.1))  # the first look follows the view
    for _ in range(20):
        region.clock.now += 1.0
        region.draw()
    assert viewport.held and viewport.direct and not viewport.looks and not viewport.done
    assert viewport.scale > 1 and viewport.frame.settings.bounces == 0
    assert viewport.status() == f"{slow.doing}, direct light only meanwhile"
    region.draw(region.moved(0.1))  # so does the picture without indirect light
    assert viewport.direct and viewport.frame.settings.bounces == 0
    assert not viewport.frame.plan.runs("traced_glossy")
    slow.ready.add(DRAFT)
    for _ in range(20):
        region.clock.now += 1.0
        region.draw()
    assert viewport.held and not viewport.direct and viewport.scale > 1 and viewport.frame.settings.bounces > 0
    slow.ready.add(FULL)
    held = region.rest()
    assert slow.asked[-1][:2] == viewport.frame.size and not slow.asked[-1][2]
    free = Region()
    assert np.array_equal(held, free.rest())
    free.viewport.release()


def test_an_update_that_changes_nothing_leaves_direct_light_as_it_is(region):
    region.viewport.ahead = Slow()
    for _ in range(20):
        region.clock.now += 1.0
        region.draw()
    frame = region.viewport.frame
    region.viewport.dirty = True
    for _ in range(10):
        region.clock.now += 1.0
        region.draw()
    assert region.viewport.frame is frame and region.viewport.held and region.viewport.direct


def test_without_bounces_nothing_is_left_out(region, scene):
    scene.candela.bounces = 0
    region.viewport.ahead = slow = Slow()
    for _ in range(20):
        region.clock.now += 1.0
        region.draw()
    assert region.viewport.held and not region.viewport.direct
    slow.ready.add(FULL)
    region.rest()


def test_an_edit_that_needs_other_programs_shows_its_direct_light_first(region):
    region.rest()
    region.viewport.ahead = other = Slow()
    bpy.context.scene.objects["Point"].data.type = "SUN"
    region.viewport.dirty = True
    for _ in range(20):
        region.clock.now += 1.0
        region.draw()
    assert region.viewport.held and region.viewport.direct and not region.viewport.looks
    other.ready |= {DRAFT, FULL}
    edited = region.rest()
    free = Region()
    assert np.array_equal(edited, free.rest())
    free.viewport.release()


def test_an_edit_of_a_material_alone_does_not_wait_for_another_process(region, own_folder, monkeypatch):
    """Its own programs are few and small: compiled here they are there sooner than a second Blender has read it."""
    monkeypatch.setattr(Ahead, "_start", lambda self: None)
    monkeypatch.setattr(ahead, "_send", lambda *_: None)
    region.rest()
    viewport, other = region.viewport, Ahead()
    seen, settings = viewport.frame.snapshot, viewport.frame.settings
    *_, features = needs_of(viewport.renderer, seen, settings)
    other._remember({f"{ahead._digest(features)} {stage}" for stage in (DRAFT, FULL)})
    assert other.left(viewport.renderer, seen, settings, True, edit=True) is None
    assert other.left(viewport.renderer, seen, settings, True) is not None


def needs(region):
    region.viewport.dirty = True
    region.rest()
    viewport = region.viewport
    return set(map(repr, needs_of(viewport.renderer, viewport.frame.snapshot, viewport.frame.settings)))


def test_what_needs_programs_is_told_from_what_does_not(region):
    first = needs(region)
    cube, lamp = bpy.context.scene.objects["Cube"], bpy.context.scene.objects["Point"]
    cube.location.x += 0.5
    lamp.data.energy *= 2.0
    assert needs(region) == first
    lamp.data.type = "SPOT"
    assert needs(region) != first


@pytest.mark.slow
def test_another_process_draws_and_is_remembered(region, own_folder):
    region.viewport.ahead = other = Ahead()
    said, ended = set(), time.monotonic() + 300.0
    while not region.viewport.done and time.monotonic() < ended:
        time.sleep(0.05)
        region.clock.now += 1.0
        region.draw()
        said.add(region.viewport.status().split(" ")[0])
    other.close()
    assert region.viewport.done and not other.failed and "Compiling" in said
    assert (own_folder / "compiled_ahead.json").exists()
    again = Region()
    again.viewport.ahead = other = Ahead()
    again.rest()  # nothing is waited for
    assert other._process is None
    again.viewport.release()


def test_two_viewports_do_not_take_the_other_process_from_each_other(region, own_folder, monkeypatch):
    begun = []
    monkeypatch.setattr(Ahead, "_start", lambda self: begun.append(self._job.number))
    monkeypatch.setattr(ahead, "_send", lambda *_: None)
    region.rest()
    viewport = region.viewport
    other, settings = Ahead(), viewport.frame.settings
    seen = viewport.frame.snapshot
    lit = replace(seen, lights=tuple(replace(one, kind="SPOT") for one in seen.lights))
    second = type("Renderer", (), {"materials": viewport.renderer.materials, "geometry": viewport.renderer.geometry})()
    for _ in range(3):
        assert other.left(viewport.renderer, seen, settings, True) == 1
        assert other.left(second, lit, settings, True) == 1
    assert begun == [1]
    other._job.asked_at -= 2 * ahead.TURN_S
    other.left(second, lit, settings, True)
    assert begun == [1, 2]


def test_process_that_ends_is_done_without(region, own_folder, monkeypatch):
    started = subprocess.Popen
    nothing = (sys.executable, "-c", "")
    monkeypatch.setattr(ahead.subprocess, "Popen", lambda command, **options: started(nothing, **options))
    region.viewport.ahead = other = Ahead()
    ended = time.monotonic() + 30.0
    while not other.failed and time.monotonic() < ended:
        time.sleep(0.02)
        region.clock.now += 1.0
        region.draw()
    assert other.failed and not region.viewport.held
    region.rest()


def test_shadows_of_direct_light_are_not_black_meanwhile(region, monkeypatch):
    """A faint light from the eye stands in for indirect light until its programs are there."""

    def direct():
        region.viewport.drop()
        region.viewport.ahead = Slow()
        for _ in range(12):
            region.clock.now += 1.0
            region.draw()
        assert region.viewport.held and region.viewport.direct
        return images.read(region.viewport.picture)

    filled = direct()
    monkeypatch.setattr(first_look, "FILLED", 0.0)
    plain = direct()
    assert 0.01 < (filled - plain)[..., :3].mean() < 0.1
    np.testing.assert_allclose(filled[..., 3], plain[..., 3], atol=1e-3)
