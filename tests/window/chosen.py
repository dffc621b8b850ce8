"""Runs inside a windowed Blender: this engine is chosen, then Rendered, after the second process has compiled."""

import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from stage import ENGINE, candela, result, run, viewport_area, viewports, window

TIMEOUT_S = 300.0


def steps():
    scene, space, ahead = window().scene, viewport_area().spaces.active, candela()._ahead
    scene.candela.viewport_samples, scene.render.preview_pixel_size = 2, "4"
    scene.render.engine = ENGINE
    started = time.monotonic()
    while not (ahead._job and "full" in ahead._job.done) and time.monotonic() - started < TIMEOUT_S:
        yield 0.2
        ahead._hear()
    result["foreseen"] = sorted(ahead._job.done) if ahead._job else []
    space.shading.type = "RENDERED"
    result["held"] = False
    while not (viewports() and viewports()[0].done) and time.monotonic() - started < 2 * TIMEOUT_S:
        yield 0.05
        result["held"] |= any(one.held for one in viewports())
    result["jobs"], result["status"] = ahead._jobs, viewports()[0].status()


run(steps)
