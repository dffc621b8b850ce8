"""What a render of several eyes tells of itself: to whom the view belongs, what is left, and all that it warns of."""

from types import SimpleNamespace

import numpy as np
import pytest

from addon import engine, final
from addon.frame.ledger import Ledger
from addon.frame.settings import Settings
from addon.snapshot.scene import Note

OWN = engine.CandelaEngine
EYES = ("left", "right")


class Engine:
    """What Blender is to a render of both eyes, of which each has notes and bad pixels; `stops` in the second one."""

    is_preview, _sync_seconds = False, 0.0
    _render, _tell, _warn = OWN._render, OWN._tell, OWN._warn

    def __init__(self, stops: bool):
        self.stops, self.view, self.reports, self.begun = stops, "", [], []

    def render(self, monkeypatch):
        monkeypatch.setattr(engine, "settings_of", lambda *_, **__: Settings())
        monkeypatch.setattr(engine, "eyes_of", lambda scene: EYES)
        monkeypatch.setattr(engine, "check_tree", lambda passes: None)
        monkeypatch.setattr(engine.main_loop, "taken", lambda steps: steps)
        monkeypatch.setattr(final, "steps", self.steps)
        self._render(SimpleNamespace(scene=None, view_layer=SimpleNamespace(name="Layer")), None)

    def steps(self, order):
        for eye in EYES:
            yield final.Progress("Rendering", 0.5, eye=eye)
            notes = (Note("Film", f"of {eye}."), Note("Film", "of both."))
            ledger = Ledger(samples=1, notes=notes, bad_pixels=3)
            yield final.Progress("Finishing", eye=eye, pixels={"Combined": np.zeros((2, 2, 4))}, ledger=ledger)

    def _camera_of(self, depsgraph, snapshot, eye):
        self.active_view_set(eye)

    def active_view_set(self, eye):
        self.view = eye

    def begin_result(self, *place, layer, view):
        self.begun.append((view, self.view))
        return view

    def report(self, kind, text):
        self.reports.append(text)

    def test_break(self):
        return self.stops and self.view == "left" and bool(self.begun)

    def _fail_unforeseen(self, error):
        raise error

    def __getattr__(self, name):
        return lambda *_, **__: None


def test_a_render_of_two_eyes_warns_of_both_and_shows_each_as_itself(monkeypatch):
    blender = Engine(stops=False)
    blender.render(monkeypatch)
    assert blender.begun == [("left", "left"), ("right", "right")]
    bad = "6 values were not finite and were set to 0."
    assert blender.reports == ["Film: of left.", "Film: of both.", "Film: of right.", bad]


def test_a_render_that_is_stopped_after_the_first_eye_warns_of_that(monkeypatch):
    blender = Engine(stops=True)
    blender.render(monkeypatch)
    assert blender.reports == ["Film: of left.", "Film: of both.", "3 values were not finite and were set to 0."]


@pytest.mark.parametrize("limit, left", [(0.0, 10 + 20), (5.0, 5 + 5)])
def test_what_is_left_of_the_first_eye_counts_the_second(limit, left):
    """Two takes of each eye with 10 samples of a second each; one of the four is done."""
    settings = Settings(samples=10, time_limit=limit)
    order = SimpleNamespace(eyes=tuple((eye, None) for eye in EYES), settings=settings)
    shot = final._Shot(order, SimpleNamespace(number=1, left=1), settings, 4, final.time.perf_counter(), None)
    assert shot.left(0, 10, 1.0) == pytest.approx(left, abs=2 * final.TAIL + 0.1)
