"""What a region shows: the mean of its samples, a draft with the shapes of what it shows, or a first look.

Its picture is an image of its own, since those of a frame come and go.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import replace

from ..frame.picture import Frame
from ..frame.reads import content
from ..gfx import images, library
from ..materials.compiled import CompiledMaterial
from ..scene.geometry import SceneGeometry
from ..scene.media import has_media
from ..scene.view import View
from ..snapshot.scene import Camera, Film, Snapshot
from ..sources.lights import CAMERA_FLAG, MAPPED_FLAG
from ..surfaces.first_look import Emitted, FirstLook
from ..techniques.film import EMISSION
from .pace import GuidePace

Scene = tuple[Snapshot, SceneGeometry, list[CompiledMaterial]]  # as it was read, on the GPU, and what draws it
Place = tuple  # content of a camera, the region's size, its border


class Display:
    """Holds what a region shows, and where in it."""

    def __init__(self):
        self.guides = GuidePace()
        self.place = (0, 0, 1, 1)  # where the picture lies, in pixels of the region: x, y, width, height
        self.looks = False  # what is shown is a first look
        self.shown_with: tuple = ()  # what the picture was shown with, see Plan.shown_with
        self._look, self._guide = FirstLook(), FirstLook()
        self._look_of: tuple = ()  # of what the first look is
        self._target: images.Target | None = None
        self._refined: images.Image | None = None  # a draft with the shapes of its guide
        self._shown_place: Place = ()  # from where, and in which pixels

    @property
    def holds(self) -> bool:
        """There is a picture of samples, whether it is shown or not."""
        return self._target is not None

    @property
    def has_looked(self) -> bool:
        return bool(self._look_of)

    @property
    def picture(self) -> images.Image | None:
        """The last whole sample and those before it, or a first look; None before the first."""
        if self.looks:
            return self._look.picture
        return self._target.colors[0] if self._target else None

    @property
    def shown(self) -> images.Image | None:
        """The same as it is drawn over the region: drafts with the shapes of what they show."""
        return self.picture if self.looks or self._refined is None else self._refined

    def take(self, frame: Frame, place: Place, put: Callable[[images.Target], None]) -> None:
        """Show what `put` draws of a frame that was begun for that place."""
        if self._target is None or self._target.size != frame.size:
            self.drop_picture()
            self._target = images.Target((images.pool.take(*frame.size, "RGBA32F"),))
        put(self._target)
        self.shown_with, self.looks = frame.plan.shown_with(frame.snapshot, frame.settings), False
        self._refined, self._shown_place = None, place
        film, (_, size, _) = frame.snapshot.film, place
        x, y = size[0] / film.width, size[1] / film.height
        x0, y0, x1, y1 = film.border
        self.place = x0 * x, y0 * y, (x1 - x0) * x, (y1 - y0) * y

    def fill_in(self, shown: images.Image, target: images.Target, scene: Scene, frame: Frame) -> None:
        """Into the target what is shown of a frame that lacks indirect light, with a faint light from the eye."""
        self._guide.fill_in(shown, target, *scene, _view(frame.snapshot.camera, frame.snapshot.film, scene))

    def refining(self, frame: Frame, scene: Scene, scale: int, step: float) -> Iterator[None]:
        """Show the draft that is the picture in finer pixels, if there is time for that within a step and no lens blurs
        what it shows. In parts, one for each program."""
        if frame.snapshot.camera.aperture is not None:
            return
        x0, y0, x1, y1 = self._shown_place[2]
        pixels = (x1 - x0) * (y1 - y0)
        guided = self.guides.scale(pixels, scale, step)
        if guided is None:
            return
        spent, fresh = 0.0, library.news()
        started = time.perf_counter()
        for _ in self._guiding(frame, scene, scale // guided):
            spent += time.perf_counter() - started
            yield
            started = time.perf_counter()
        images.finish()
        if library.news() == fresh:
            self.guides.learn(spent + time.perf_counter() - started, pixels // guided**2)
        self._refined = self._guide.fine

    def _guiding(self, frame: Frame, scene: Scene, finer: int) -> Iterator[None]:
        # The rectangle of the draft's own pixels, which begins and ends with whole ones.
        film = frame.snapshot.film
        whole = replace(
            film, width=film.width * finer, height=film.height * finer, border=tuple(finer * e for e in film.border)
        )
        self._guide.draw(*scene, _view(frame.snapshot.camera, whole, scene), guides=True)
        yield
        yield from self._guide.refining(self.picture, film.exposure, emitted_in(frame))

    def look_at(self, camera: Camera, size, border, scene: Scene) -> None:
        """Show a first look, unless the picture is of this very place."""
        place = content(camera, ("name",)), size, border
        if self._target is not None and self._shown_place == place and not self.looks:
            return
        snapshot, geometry, _ = scene
        made = (*place, geometry.changes, id(snapshot))
        if made != self._look_of:
            film = replace(snapshot.film, width=size[0], height=size[1], border=border)
            self._look.draw(*scene, _view(camera, film, scene))
            self._look_of = made
        x0, y0, x1, y1 = border
        self.place, self.looks = (x0, y0, x1 - x0, y1 - y0), True

    def drop_look(self) -> None:
        """Free first looks and shapes, which only moving views need."""
        self._look.release()
        self._guide.release()
        self._look_of, self.looks, self._refined = (), False, None

    def drop_picture(self) -> None:
        """Free the picture."""
        if self._target is not None:
            images.pool.give(self._target.colors[0])
            self._target = self._refined = None

    def drop(self) -> None:
        """Free all on the GPU."""
        self.drop_picture()
        self.drop_look()


def emitted_in(frame: Frame) -> Emitted | None:
    """What a draft shows of what emits; None where it does not hold that apart, media dim it, or the picture that is
    shown is more than the mean of samples. Lamps whose node trees vary are left to the draft's own pixels."""
    if EMISSION not in frame.images or has_media(frame.snapshot) or frame.picture != Frame.picture:
        return None
    lamps = [one for one in frame.emitters if one.flags & CAMERA_FLAG and not one.flags & MAPPED_FLAG]
    exposure = frame.snapshot.film.exposure
    return Emitted(frame.held.to_show(EMISSION), exposure / max(frame.samples_done, 1), exposure, lamps)


def _view(camera: Camera, film: Film, scene: Scene) -> View:
    return View(camera, film, scene[1].origin)
