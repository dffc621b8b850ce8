"""Who waits for the turn to draw gets it."""

import threading
import time

from addon.gfx.context import Turn


def test_who_waits_draws_before_the_last_one_draws_again():
    turn, order = Turn(), []

    def render():
        for _ in range(20):
            with turn:
                order.append("render")
                time.sleep(0.005)

    thread = threading.Thread(target=render)
    thread.start()
    while not order:
        time.sleep(0.001)
    for _ in range(3):
        with turn:
            order.append("viewport")
    thread.join()
    first = order.index("viewport")
    assert order[first : first + 6].count("viewport") == 3


def test_waiting_ends_in_time_and_leaves_the_turn_to_others():
    turn = Turn()
    with turn:
        started = time.monotonic()
        assert not turn.acquire(timeout=0.0)
        assert not turn.acquire(timeout=0.02)
        assert time.monotonic() - started < 1.0
    assert turn.acquire(timeout=0.0)
    turn.release()
