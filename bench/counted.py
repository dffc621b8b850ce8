"""What a piece of work asks of the GPU, counted, and Python's own time in it: figures that need no GPU to be true.

Calls into Blender's GPU module are counted by Python's profiler, framebuffers where `gfx` makes them. Own time is what
the add-on's functions take themselves, without what they call in numpy, Blender and the driver.
"""

from __future__ import annotations

import cProfile
import pstats
from collections.abc import Callable
from dataclasses import dataclass

DRAWS = ("draw", "draw_instanced", "draw_range")


@dataclass(frozen=True)
class Counts:
    """Of one call. `waits` are texels read for the sake of waiting, `readbacks` all other reads of images."""

    readbacks: int
    waits: int
    draws: int
    dispatches: int
    uploads: int  # images made with content, and uniform blocks written
    framebuffers: int
    own_ms: float


def counted(work: Callable[[], object]) -> Counts:
    """Run `work` under the profiler and count."""
    from addon.gfx import images

    made = [0]
    original = images.gpu
    images.gpu = _Watched(original, made)
    profiler = cProfile.Profile()
    try:
        profiler.enable()
        work()
    finally:
        profiler.disable()
        images.gpu = original
    return of_stats(pstats.Stats(profiler).stats, made[0])


def of_stats(stats: dict, framebuffers: int) -> Counts:
    """The same from pstats' rows."""
    calls: dict[str, int] = {}
    own = 0.0
    for (file, _, name), (_, count, seconds, *_) in stats.items():
        path = file.replace("\\", "/")
        if "/addon/" in path:
            own += seconds
            name = f"{path.rpartition('/addon/')[2]}:{name}"
        calls[name] = calls.get(name, 0) + count

    def gpu_calls(kind: str, method: str) -> int:
        return sum(count for name, count in calls.items() if f"method '{method}'" in name and kind in name)

    waits = calls.get("gfx/images.py:finish", 0)
    return Counts(
        readbacks=gpu_calls("GPUTexture", "read") - waits,
        waits=waits,
        draws=sum(gpu_calls("GPUBatch", method) for method in DRAWS),
        dispatches=sum(count for name, count in calls.items() if name.startswith("<built-in") and "dispatch" in name),
        uploads=calls.get("gfx/images.py:upload", 0) + gpu_calls("GPUUniformBuf", "update"),
        framebuffers=framebuffers,
        own_ms=1000 * own,
    )


class _Watched:
    """Blender's GPU module, with a count of the framebuffers that are made."""

    def __init__(self, module, made: list[int]):
        self._module, self._made = module, made

    def __getattr__(self, name: str):
        if name == "types":
            return _Watched(self._module.types, self._made)
        if name == "GPUFrameBuffer":
            self._made[0] += 1
        return getattr(self._module, name)
