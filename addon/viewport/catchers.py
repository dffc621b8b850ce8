"""Shadow catchers in a view: the three pictures of film/catcher.py, two of which are drawn once the view is at rest.

What a view draws first, while it moves, too, is `things`: catchers are left out. When that has all its samples, a
renderer of its own draws `all` and `plate` with as many, and its light is kept in one image each; then the picture is
composed by the GPU, and the renderer frees what it holds. Whatever changes the picture drops both images.

| cost | |
|---|---|
| time | three pictures at rest, one while the view moves |
| memory | while they are drawn a scene once more; two images of the view's size as long as it rests |
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

from .. import techniques
from ..film import catcher
from ..frame.bands import Bands
from ..frame.picture import Frame
from ..frame.run import Renderer
from ..frame.settings import Settings
from ..gfx import images, library, passes
from ..gfx.library import Program
from ..snapshot.scene import Note, Snapshot

COMPOSE: Program = passes.fullscreen_program(
    "shadow catchers",
    "film/catchers.frag.glsl",
    textures=tuple(("RGBA32F", name) for name in ("everything", "plate", "things", "world", "seen")),
    constants=(("FLOAT", "world_scale"), ("INT", "transparent"), ("INT", "known")),
    outputs=(("VEC4", "out_color"),),
)
LEFT_OUT = Note("Shadow catchers", "what they show is left out until the view rests and all its samples are drawn.")


class Catchers:
    """What a view draws of its scene's shadow catchers; nothing where there are none."""

    def __init__(self):
        self.scene: Snapshot | None = None  # of the view, where it has catchers
        self.doing = ""
        self._renderer: Renderer | None = None
        self._work: Iterator[None] | None = None
        self._lit: dict[str, images.Image] = {}  # by which of the three pictures: their light, and what they cover
        self._samples = 0  # of each

    @property
    def known(self) -> bool:
        """Whether all three pictures are there."""
        return len(self._lit) == len(catcher.PLATES)

    def look_at(self, scene: Snapshot | None, same: bool) -> bool:
        """The view shows this scene; None: one without catchers, or a pass in the picture's place. `same`: `things`
        are those of before. Whether the picture has to be composed anew nevertheless."""
        films = [one and one.film.transparent for one in (self.scene, scene)]
        anew = same and films[0] != films[1]
        if self.scene is not None and (anew or not same):
            self.forget()
        self.scene = scene
        return anew

    def draw(self, settings: Settings, bands: Bands, enough: Callable[[], bool]) -> None:
        """Go on with `all` and `plate` until it is enough, or they are `known`. `settings`: those of `things`."""
        if self._samples != settings.samples:
            self.forget()
        if self._work is None and not self.known:
            self._samples, self._work = settings.samples, self._parts(settings, bands)
        try:
            while self._work is not None:
                fresh = library.news()
                if next(self._work, self) is self:
                    self._free()
                elif enough() or library.news() != fresh:
                    return
        except BaseException:
            self.forget()
            raise

    def _parts(self, settings: Settings, bands: Bands) -> Iterator[None]:
        self._renderer = renderer = Renderer(techniques.make_registry)
        renderer.publishes = False
        left_out = set(passes.left_out)  # of `things`, whose ledger is still to be published
        for name, changed in catcher.PLATES.items():
            beginning, frame = renderer.beginning(changed(self.scene), settings), None
            while frame is None:
                try:
                    _, left = next(beginning)
                    self.doing = f"Shadow catchers: compiling shaders ({left})" if left else "Shadow catchers"
                    yield
                except StopIteration as end:
                    frame = end.value
            frame.shared_out = bands
            while frame.samples_done < settings.samples:
                self.doing = f"Shadow catchers: sample {frame.samples_done} of {settings.samples} of '{name}'"
                yield from renderer.steps(frame)
            renderer.show(frame)
            kept = images.pool.take(*frame.size, "RGBA32F")
            passes.copy(frame.images[catcher.COMBINED], images.Target((kept,)))
            self._lit[name] = kept
            yield
        passes.left_out |= left_out

    def compose(self, frame: Frame, seen: images.Image, target: images.Target) -> None:
        """Into the target the picture of `things`, which is shown as `seen`, with what is known of the catchers."""
        things, known = frame.images[catcher.COMBINED], self.known
        has_world = catcher.WORLD in frame.images
        lit = self._lit if known else dict.fromkeys(catcher.PLATES, things)
        passes.fullscreen(
            COMPOSE,
            target,
            textures={
                "everything": lit[catcher.ALL], "plate": lit[catcher.PLATE], "things": things, "seen": seen,
                "world": frame.held.to_show(catcher.WORLD) if has_world else things,
            },
            constants={
                "world_scale": has_world * frame.snapshot.film.exposure / (frame.samples_done + frame.part_done or 1.0),
                "transparent": int(self.scene.film.transparent), "known": int(known),
            },
        )  # fmt: skip

    def _free(self) -> None:
        self._work, self.doing = None, ""
        if self._renderer is not None:
            self._renderer.release()
            self._renderer = None

    def forget(self) -> None:
        """Drop what is drawn and free all on the GPU."""
        self._free()
        for image in self._lit.values():
            images.pool.give(image)
        self._lit, self._samples = {}, 0
