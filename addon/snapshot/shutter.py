"""Motion blur: the scene at several moments while the shutter is open, as one snapshot each.

The shutter is open from `begin` to `begin + shutter` (frames), around, after or before the frame as Blender's setting
says. Step k of n is looked at where the shutter's curve has let (k + 1/2) / n of its light pass: with the curve that
new scenes have, in the middle of the k-th of n equal parts. Blender evaluates the scene anew at each moment (`moved_to`
of the engine), so that whatever moves is blurred along its own path: objects, cameras, lamps, bones and shape keys,
materials with keyframes. Cycles interpolates between a few such evaluations instead, and holds lamps and materials.
What holds still here: steady.py.

Steps at which the scene is the same are one step; where it is the same at all of them there is nothing to blur.

| cost | |
|---|---|
| time | one evaluation and one sync for each step; meshes that stay are not read again |
| memory | arrays of meshes that change their shape, once for each step |

Not followed: rolling shutters; a note says so.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np

from .scene import Note, Snapshot
from .steady import equal, held

CURVE_POINTS = 256  # at which the shutter's curve is asked
_BEGINS = {"START": 0.0, "CENTER": -0.5, "END": -1.0}  # of the shutter, in shutter times from the frame


@dataclass(frozen=True)
class Moments:
    """The scene while the shutter is open: different snapshots, and for each of the steps the number of its own."""

    snapshots: tuple[Snapshot, ...]
    steps: tuple[int, ...]


def is_blurred(scene, view_layer) -> bool:
    """Whether Blender's settings ask for motion blur in this view layer."""
    render = scene.render
    return render.use_motion_blur and render.motion_blur_shutter > 0.0 and getattr(view_layer, "use_motion_blur", True)


def shutter_times(scene, count: int) -> list[float]:
    """Moments of `count` steps, in frames from the scene's frame, ascending."""
    render = scene.render
    curve = render.motion_blur_shutter_curve
    curve.initialize()
    places = (np.arange(CURVE_POINTS) + 0.5) / CURVE_POINTS
    open_for = np.array([max(curve.evaluate(curve.curves[0], place), 0.0) for place in places])
    passed = np.concatenate([[0.0], np.cumsum(open_for)])
    if not passed[-1] > 0.0:  # a shutter that stays closed: as if it had no curve
        passed = np.arange(CURVE_POINTS + 1.0)
    wanted = (np.arange(count) + 0.5) / count * passed[-1]
    shares = np.interp(wanted, passed, np.linspace(0.0, 1.0, CURVE_POINTS + 1))
    return [float(render.motion_blur_shutter * (_BEGINS[render.motion_blur_position] + share)) for share in shares]


def take_moments(
    central: Snapshot,
    times: Sequence[float],
    moved_to: Callable[[float], None],
    take: Callable[[], Snapshot],
    camera_blurred: bool = True,
) -> Moments | None:
    """The scene at `times`, in frames from its own; None where it is the same at all of them.

    `central`: its snapshot at its own frame. `moved_to(time)` evaluates it at a time, `take()` reads it. It is left at
    its own frame, whatever happens. `camera_blurred`: whether the camera moves, too.
    """
    taken = []
    try:
        for time in times:
            moved_to(time)
            taken.append(take())
    finally:
        moved_to(0.0)
    found, steps = [central], []
    for now in held(central, taken, times):
        now = replace(now, moment=central.moment)  # what only the eye asks for is that of the frame
        if not camera_blurred:
            now = replace(now, camera=central.camera)
        if not alike(now, found[-1]):
            found.append(now)
        steps.append(len(found) - 1)
    used = sorted(set(steps))
    if used == [0]:
        return None
    return Moments(tuple(found[k] for k in used), tuple(used.index(k) for k in steps))


def notes_of(scene) -> list[Note]:
    """What of Blender's settings is not followed."""
    cycles = getattr(scene, "cycles", None)  # there while the Cycles add-on is enabled
    if getattr(cycles, "rolling_shutter_type", "NONE") == "NONE":
        return []
    text = "the rolling shutter of Cycles is not drawn: all rows of the picture are exposed at the same time."
    return [Note("Motion blur", text)]


def blurs(owner) -> bool:
    """Whether an object's motion is seen; what is no object of Cycles' moves."""
    return getattr(getattr(owner, "cycles", None), "use_motion_blur", True)


_ASIDE = {"notes", "moment", "sync_stats", "scene_name"}


def alike(a: Snapshot, b: Snapshot) -> bool:
    """Whether two snapshots show the same, but for when."""
    return all(equal(getattr(a, one.name), getattr(b, one.name)) for one in fields(a) if one.name not in _ASIDE)
