"""What a picture remembers of the one before it: images of techniques, and where camera and objects stood.

A technique `remembers` images that it writes; the renderer takes them out of the last picture before that is dropped
and hands them to the next one as `frame.before`. It does so only where the light that surfaces receive is the same
but for what moves: the camera, objects that keep their form, and lamps that keep all but their place. After any other
edit (of a lamp's power, a material, the world, a mesh, the settings; an object that comes or goes) there is no picture
before.

So that errors are not the same in all pictures, each of a row of pictures has a seed of its own. The first one has
the scene's.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace

import numpy as np

from ..gfx import images
from ..snapshot.scene import Instance, Light, Snapshot
from .settings import Settings

MOST_MOVED = 16  # objects that move at once; with more there is no picture before
SEED_STEP = 7919  # between the seeds of two pictures


@dataclass
class Before:
    """The picture before."""

    images: dict[str, images.Image]  # by name; of the pool
    rows: np.ndarray  # (4, 4) x, y, w, q of View in its first sample
    origin: np.ndarray  # (3,) m, its render origin
    snapshot: Snapshot
    key: object  # of all that gives its light but what may move
    turn: int = 1  # how many pictures came before the one after it
    moved: dict[str, np.ndarray] = field(default_factory=dict)  # (4, 4) world now -> world then, by key of the instance
    lamps: tuple[tuple[Light, Light], ...] = ()  # then and now, of those that have moved

    def drop(self) -> None:
        """Give the images back."""
        for image in self.images.values():
            images.pool.give(image)
        self.images = {}


def remembered(frame, key: object) -> Before | None:
    """What is kept of a frame that is dropped next; of one without samples what it was given itself."""
    if frame is None:
        return None
    names = [write.name for technique in frame.plan.techniques for write in technique.remembers]
    if not names:
        return None
    if not frame.samples_done:
        before, frame.before = frame.before, None
        return before
    kept = {name: frame.images.pop(name) for name in names if name in frame.images}
    turn = frame.before.turn + 1 if frame.before else 1
    return Before(kept, frame.first_rows, frame.geometry.origin.copy(), frame.snapshot, key, turn)


def usable(before: Before | None, snapshot: Snapshot, key: object) -> Before | None:
    """The same for a picture of this snapshot, with what has moved; None, and dropped, where its light is another."""
    if before is None:
        return None
    moved = moved_since(before.snapshot, snapshot) if key == before.key else None
    if moved is None or len(moved) > MOST_MOVED:
        before.drop()
        return None
    return replace(before, moved=moved, lamps=lamps_moved(before.snapshot, snapshot))


def seeded(settings: Settings, before: Before | None) -> Settings:
    """Settings of the picture after that."""
    return replace(settings, seed=(settings.seed + SEED_STEP * before.turn) % 2**31) if before else settings


def lamps_moved(before: Snapshot, now: Snapshot) -> tuple[tuple[Light, Light], ...]:
    """Lamps of equal keys, then and now, that stand elsewhere. Both snapshots have the same ones in the same order."""

    def place(one: Light) -> np.ndarray:
        return one.matrix[:3, :3] if one.kind == "SUN" else one.matrix

    pairs = zip(before.lights, now.lights)
    return tuple((old, new) for old, new in pairs if old is not new and not np.array_equal(place(old), place(new)))


_COMPARED: tuple[Callable, ...] = tuple(
    lambda one, name=f.name: getattr(one, name) for f in fields(Instance) if f.name not in ("matrix", "attributes")
)


def moved_since(before: Snapshot, now: Snapshot) -> dict[str, np.ndarray] | None:
    """By key, (4, 4) from where an instance is to where it was, of those that have moved; None where more has changed
    of any than its place."""
    if before.instances is now.instances:
        return {}
    if len(before.instances) != len(now.instances):
        return None
    then, moved = {one.key: one for one in before.instances}, {}
    for one in now.instances:
        old = then.get(one.key)
        if old is one and before.meshes.get(one.mesh) is now.meshes.get(one.mesh):
            continue
        if old is None or any(read(old) != read(one) for read in _COMPARED):
            return None
        if before.meshes.get(one.mesh) is not now.meshes.get(one.mesh):
            return None
        if not np.array_equal(old.matrix, one.matrix):
            try:
                moved[one.key] = old.matrix @ np.linalg.inv(one.matrix)
            except np.linalg.LinAlgError:
                return None
    return moved
