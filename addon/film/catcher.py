"""Shadow catchers: surfaces that show only by how things change the light on them, over a plate that is put in later.

As in Cycles three pictures are made of a scene with catchers, with the same samples:

    all       everything as it is
    plate     the catchers alone, as they would be lit if nothing else were there
    things    everything, but the camera does not see the catchers

    change = 1 - a + a (all - things) / plate       where a catcher is seen, by what each covers; a: alpha of all

is the pass Shadow Catcher: below 1 in shadows, above where things shine on a catcher, 1 where no catcher is. A view
layer that asks for it gets `things` alone as Combined. For others, with a transparent film,

    rgb = things,   alpha = a + (1 - a) (1 - mean of change),   a: alpha of things

which cannot say where a catcher is brighter than before; else the world stands for the plate, darkened by the mean.

| cost | |
|---|---|
| time | three pictures; other passes are those of `things` |
| memory | two pictures on the CPU |

Scenes without catchers make one picture, as ever. Slices hold sums of all three (frame/slices.py). Viewports at rest
compose the same on the GPU (viewport/catchers.py, shaders/film/catchers.frag.glsl).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..snapshot.scene import Snapshot

COMBINED, WORLD = "film.combined", "radiance.environment"
IMAGES = (COMBINED, WORLD)  # what is read of each of the three
ALL, PLATE = "all", "plate"  # under which slices hold the first two
SURE = 0.5  # share of a pixel from which on its own light is enough to know what has changed
LEAST = 0.01  # share of a pixel below which nothing is known of what covers it


def over_nothing(snapshot: Snapshot) -> Snapshot:
    """The scene of `all`, on a transparent film: pictures then say what they cover."""
    return replace(snapshot, film=replace(snapshot.film, transparent=True))


def catchers_alone(snapshot: Snapshot) -> Snapshot:
    """The scene of `plate`."""
    catchers = tuple(one for one in snapshot.instances if one.shadow_catcher)
    return replace(over_nothing(snapshot), instances=catchers, volumes=())


def catchers_unseen(snapshot: Snapshot) -> Snapshot:
    """The scene of `things`."""
    instances = (
        replace(one, visibility=replace(one.visibility, camera=False)) if one.shadow_catcher else one
        for one in snapshot.instances
    )
    return replace(over_nothing(snapshot), instances=tuple(instances))


PLATES = {ALL: over_nothing, PLATE: catchers_alone}  # in the order in which they are drawn


@dataclass(frozen=True)
class Layer:
    """Of one of the three pictures: the light of its objects (H, W, 3), what they cover (H, W, 1), and the world."""

    light: np.ndarray
    covered: np.ndarray
    world: np.ndarray


def layer(images: dict[str, np.ndarray], snapshot: Snapshot) -> Layer:
    """From IMAGES of a picture of one of these scenes."""
    return Layer(images[COMBINED][..., :3], images[COMBINED][..., 3:], snapshot.film.exposure * images[WORLD][..., :3])


def change_of(everything: Layer, plate: Layer, things: Layer, transparent: bool) -> np.ndarray:
    """(H, W, 3) the pass Shadow Catcher: 1 where nothing changes, and where there is no catcher."""
    shown = _shown(everything, things)
    known = (shown > LEAST) & (plate.covered > LEAST)
    now, alone = (
        _per_unit(light, covered, shown < SURE)
        for light, covered in ((everything.light - things.light, shown), (plate.light, plate.covered))
    )
    lit = known & (alone > 0.0)
    ratio = np.where(lit, now / np.where(lit, alone, 1.0), 1.0)
    alpha = np.clip(everything.covered, 0.0, 1.0) if transparent else 1.0
    return (1.0 - alpha + alpha * ratio).astype(np.float32)


def _per_unit(light: np.ndarray, covered: np.ndarray, unsure: np.ndarray) -> np.ndarray:
    """Light (H, W, 3) per unit of what covers a pixel; of 3x3 pixels where it is `unsure`: at their rims things bring
    noise of their own, which little of a catcher would enlarge."""
    both = np.concatenate([light, covered], axis=-1)
    both = np.where(unsure, _around(both), both)
    return np.maximum(both[..., :3], 0.0) / np.maximum(both[..., 3:], LEAST)


def _around(image: np.ndarray) -> np.ndarray:
    """Sums over 3x3 pixels, each (H, W, C)."""
    height, width = image.shape[:2]
    wide = np.pad(image, ((1, 1), (1, 1), (0, 0)))
    return sum(wide[y : y + height, x : x + width] for y in range(3) for x in range(3))


def composed(change: np.ndarray, everything: Layer, things: Layer, transparent: bool, apart: bool) -> np.ndarray:
    """(H, W, 4) Combined. `transparent`: the film; `apart`: the change is a pass of its own."""
    mean = np.clip(change.mean(axis=-1, keepdims=True), 0.0, 1.0)
    if transparent:
        rgb, alpha = things.light, things.covered
        alpha = alpha if apart else alpha + (1.0 - alpha) * (1.0 - mean)
    else:
        shown = _shown(everything, things)
        share = np.clip(shown / np.clip(1.0 - things.covered, LEAST, 1.0), 0.0, 1.0)  # of what things leave open
        rgb = things.light + things.world * (1.0 - share + (0.0 if apart else share * mean))
        alpha = 1.0 - shown if apart else np.ones_like(shown)
    return np.concatenate([rgb, alpha], axis=-1).astype(np.float32)


def _shown(everything: Layer, things: Layer) -> np.ndarray:
    """(H, W, 1) share of each pixel that shows catchers."""
    return np.clip(everything.covered - things.covered, 0.0, 1.0)
