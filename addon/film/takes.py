"""The takes of a picture: all that is drawn for it, as one list, and what they add up to.

| several, because of | each take shows | together they are the picture by |
|---|---|---|
| eyes of a stereoscopic picture | the scene through the camera of an eye | nothing: each eye has its own |
| shadow catchers | ALL, PLATE, then the things alone (catcher.py) | `catcher.composed` |
| light groups | what the lights of one group light | `Picture.add` |
| moments while the shutter is open | samples, shared out over snapshots | frame/time_steps.py, on the GPU |
| slices | the samples of one machine | frame/slices.py, of files |

`final.py` walks the list.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np

from ..frame.light_paths import DIRECT, INDIRECT, LIGHT_PATHS
from ..snapshot.light_groups import REST, groups_of, is_of, lit_by
from ..snapshot.scene import Camera, Film, Snapshot
from ..snapshot.shutter import Moments
from . import catcher
from .resolve import COMBINED

ORDERS = (DIRECT, INDIRECT)
GLARE = "film.lens"
NOISY = "film.noisy"
_SHARE = "light group "  # names of images of a group's share of the picture begin so
ONE_EYE = (("", None),)  # the snapshot's own camera


@dataclass(frozen=True)
class Take:
    """Samples that add up in one frame after the other."""

    snapshot: Snapshot  # at the picture's own moment
    moments: Moments | None  # while the shutter is open, where anything moves
    eye: str
    name: str  # under which slices hold its sums
    group: str  # whose lights light it, where the picture is the sum of several
    groups: int  # how many those are
    is_plate: bool  # one of the two that shadow catchers need beside the picture
    number: int  # in the list, from 0
    left: int  # takes of the eye that are still to be drawn, with this one


def takes_of(
    snapshot: Snapshot,
    moments: Moments | None = None,
    catches: bool = False,
    eyes: Iterable[tuple[str, Camera | None]] = ONE_EYE,
) -> list[Take]:
    """In the order in which they are drawn. `catches`: whether shadow catchers are drawn as such; `eyes`: name and
    camera of each, None for the snapshot's own."""
    scenes = (snapshot, *(moments.snapshots if moments else ()))
    groups = groups_of(scenes)
    shown: list[tuple[str, str, bool, Callable[[Snapshot], Snapshot]]] = []
    if catches:
        shown += [(name, REST, True, changed) for name, changed in catcher.PLATES.items()]
    for number, group in enumerate(groups):
        name = str(number) if len(groups) > 1 else ""
        shown.append((name, group, False, catcher.catchers_unseen if catches else lambda one: one))
    takes, eyes = [], tuple(eyes)
    for eye, camera in eyes:
        for place, (name, group, is_plate, changed) in enumerate(shown):
            seen = [changed(one if camera is None else replace(one, camera=camera)) for one in scenes]
            if is_plate:  # as one picture, lit by all
                seen = [replace(one, film=replace(one.film, light_groups=())) for one in seen]
            if group != groups[0]:
                seen = [replace(one, film=_light_alone(one.film)) for one in seen]
            own, *others = (lit_by(one, group) for one in seen)
            name = ".".join(part for part in (eye if len(eyes) > 1 else "", name) if part)
            then = moments and replace(moments, snapshots=tuple(others))
            takes.append(Take(own, then, eye, name, group, len(groups), is_plate, len(takes), len(shown) - place))
    return takes


def _light_alone(film: Film) -> Film:
    """The film of light groups after the first, which tells all that is no light."""
    return replace(film, position=False, indices=False, aovs=(), cryptomattes=(), open_within=None)


def share_image(group: str, order: str = "") -> str:
    """Name of the image of a light group's share of the picture: of all its light, DIRECT or INDIRECT."""
    return f"{_SHARE}{order} {group}"


def is_light(name: str) -> bool:
    """Whether an image is added up over light groups, of which any other is that of the first."""
    return name.startswith(("radiance.", COMBINED, GLARE, NOISY, _SHARE))


def frame_images(sources: set[str]) -> set[str]:
    """The images of a frame that must be read where passes are made from these."""
    read = {name for name in sources if not name.startswith(_SHARE)}
    if any(name.startswith(f"{_SHARE}{order} ") for name in sources for order in ORDERS):
        read |= {path.image for path in LIGHT_PATHS}
    return read


class Picture:
    """The mean images of an eye's takes: light of light groups is added up, all else is that of the first of them."""

    def __init__(self):
        self.images: dict[str, np.ndarray] = {}
        self._plates: dict[str, catcher.Layer] = {}
        self._groups = 0

    def add(self, take: Take, images: dict[str, np.ndarray]) -> None:
        """Take in the mean images of a take. They may be changed."""
        film, world = take.snapshot.film, take.snapshot.world
        if take.is_plate:
            self._plates[take.name.rpartition(".")[2]] = catcher.layer(images, take.snapshot)
            return
        self._groups += 1
        if take.group:
            self.images |= _shares(take, images)
        for name, pixels in images.items():
            if name not in self.images:
                self.images[name] = pixels.copy() if film.light_groups else pixels
            elif is_light(name):
                self.images[name][..., :3] += pixels[..., :3]
                if is_of(world, take.group, take.snapshot):
                    self.images[name][..., 3:] = pixels[..., 3:]  # glass lets through what of the world is there

    @property
    def is_sum(self) -> bool:
        """Whether several light groups have been added up."""
        return self._groups > 1

    def with_black(self, sources: set[str]) -> dict[str, np.ndarray]:
        """All images; groups in which nothing shines are black."""
        black = np.zeros_like(self.images[COMBINED])
        return {name: black for name in sources if name.startswith(_SHARE)} | self.images

    def catch(self, images: dict[str, np.ndarray], things: Snapshot, transparent: bool, apart: bool) -> np.ndarray:
        """(H, W, 3) the pass Shadow Catcher; Combined of the images, those of `things`, becomes the picture. `apart`:
        whether the pass is asked for, so that it is left out there."""
        if not self._plates:
            return np.ones_like(images[COMBINED][..., :3])
        everything, plate = (self._plates[name] for name in catcher.PLATES)
        alone = catcher.layer(images, things)
        change = catcher.change_of(everything, plate, alone, transparent)
        images[COMBINED] = catcher.composed(change, everything, alone, transparent, apart)
        return change


def _shares(take: Take, images: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Images of a light group's share of the picture."""
    found, film = {share_image(take.group): images[COMBINED]}, take.snapshot.film
    if all(path.image in images for path in LIGHT_PATHS):
        for order in ORDERS:
            paths = [path for path in LIGHT_PATHS if path.order == order]
            if film.transparent:
                paths = [path for path in paths if path.name != "environment"]
            light = np.sum([images[path.image][..., :3] for path in paths], axis=0, dtype=np.float32)
            found[share_image(take.group, order)] = film.exposure * light
    return found
