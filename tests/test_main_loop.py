"""Steps that a render's thread hands to the main loop, without a window: this test calls the timer itself."""

import threading
import time
from collections import namedtuple

import bpy  # noqa: F401 - gpu comes with it
import pytest

from addon import final, main_loop
from addon.frame.within_sample import USUALLY_LATER


@pytest.fixture
def handed_over(gpu_context, monkeypatch):
    """Runs `taken(steps)` in a thread as a render's job does; returns what came there, while the main loop ticks."""
    monkeypatch.setattr(main_loop, "_is_at_hand", lambda: False)
    monkeypatch.setattr(main_loop, "BUDGET_S", 0.0)  # one step a tick
    monkeypatch.setattr(main_loop, "MOST_BUDGET_S", 0.0)

    def run(steps, stop_at=None):
        told, end = [], {}

        def job():
            parts = main_loop.taken(steps)
            try:
                while True:
                    news = next(parts)
                    told.extend([news] if news is not None else [])
                    if news is not None and news == stop_at:
                        parts.close()
                        end["cancelled"] = time.perf_counter()
                        return
            except StopIteration as stop:
                end["result"] = stop.value
            except ValueError as error:
                end["error"] = str(error)

        thread = threading.Thread(target=job)
        thread.start()
        while thread.is_alive():
            main_loop._tick()
            time.sleep(0.005)
        main_loop._tick()
        return told, end

    yield run
    main_loop.close_all()


def test_steps_run_in_the_main_thread_and_their_news_come_to_the_job(handed_over):
    ran = []

    def steps():
        for number in range(5):
            ran.append(threading.current_thread())
            yield number if number % 2 == 0 else None
        return "done"

    told, end = handed_over(steps())
    assert told == [0, 2, 4] and end == {"result": "done"}
    assert set(ran) == {threading.main_thread()}


def test_what_a_step_raises_is_raised_in_the_job(handed_over):
    def steps():
        yield 1
        raise ValueError("There is no camera.")

    told, end = handed_over(steps())
    assert told == [1] and end == {"error": "There is no camera."}


def test_a_cancelled_job_waits_for_no_step_and_the_main_loop_closes_them(handed_over):
    closed = []

    def steps():
        try:
            yield from range(1000)
        finally:
            closed.append(threading.current_thread())

    told, end = handed_over(steps(), stop_at=2)
    assert told[-1] == 2 and "cancelled" in end
    assert closed == [threading.main_thread()]
    assert not main_loop._errands


def test_steps_are_closed_before_another_file_is_opened(gpu_context):
    closed = []

    def steps():
        try:
            yield 1
        finally:
            closed.append(True)

    errand = main_loop.Errand(steps())
    main_loop._errands.append(errand)
    errand.work(0.0)
    main_loop.close_all()
    assert closed and errand.ended.is_set() and not main_loop._errands


@pytest.mark.parametrize(("seconds", "text"), [(0.4, "0:00"), (7.2, "0:07"), (750, "12:30"), (3750, "1:02:30")])
def test_the_time_that_is_left_is_told_as_clocks_show_it(seconds, text):
    assert final.clock(seconds) == text
    assert final.sentence(3, 8, seconds) == f"Rendering 3 / 8 samples, {text} left"
    assert final.sentence(3, 8, None) == "Rendering 3 / 8 samples"


def test_time_that_is_left_forgets_the_first_sample_once_there_is_another():
    """The first compiles programs and prepares much: of ten samples of 2 s, the first of which took 30 s, 16 s are left
    after two."""
    pace = final.SamplePace(100.0, 10)
    pace.learn(1, 130.0)
    assert pace.each is None
    pace.learn(2, 132.0)
    assert 8 * pace.each == 16.0
    pace.learn(3, 134.0)
    assert 7 * pace.each == 14.0


def test_a_render_says_what_it_does_within_a_sample_and_how_long_it_takes():
    """Of two techniques that take as long one is done, and half of the other: 3 s for 3/4 of the first sample, of which
    a later one takes the usual share, and nothing of what is found once."""
    technique = namedtuple("Technique", "label name")
    plan = type("Plan", (), {"techniques": [technique("One", "one"), technique("Other", "other")]})
    bands = type("Bands", (), {"part": 0.5})
    frame = type("Frame", (), {"at": "Other", "plan": plan, "samples_done": 0, "shared_out": bands})
    inside = final.Inside(frame, 100.0)
    assert inside.news(100.1) is None and inside.each is None
    assert inside.news(103.0) == "Other"
    assert inside.done == pytest.approx(0.75) and inside.each == pytest.approx(4.0 * USUALLY_LATER)
    bands.part = 0.1  # a second pass of the same technique
    inside.news(104.0)
    assert inside.done == pytest.approx(0.75)
    frame.samples_done = 1
    assert inside.done == 1.0
    plan.techniques = [technique("Light probes", "light_probes")]
    probes = final.WithinSample(frame)
    assert probes.later("Light probes") == 0.0
    assert final.sentence(2, 4, 7.0, "Direct light") == "Rendering 2 / 4 samples, 0:07 left, Direct light"
