"""Rendering outside of Blender's render jobs: the frame's own images, for the pass tree and for comparisons.

Pictures are plain arrays here, by the frame's names. The renderers are kept by scene, so that a second run of a tree
that has changed a little does little.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import bpy
import numpy as np

from ..compare.cache import Reference
from ..compare.passes import IMAGE_OF_PASS, Passes
from ..frame.bands import samples_in_parts
from ..frame.ledger import Ledger
from ..frame.run import Renderer
from ..frame.settings import Settings
from ..gfx import context as gpu_context
from ..gfx import images, library
from ..gfx.context import turn
from ..snapshot import SnapshotCache, UnsupportedScene, take
from ..techniques import make_registry
from .passes import PASSES


@dataclass
class Rendered:
    """What came out of a run: mean images by the frame's names, (H, W, C) float32, bottom row first."""

    images: dict[str, np.ndarray]
    ledger: Ledger
    samples: int
    seed: int
    exposure: float
    film_transparent: bool

    def passes(self) -> Passes:
        """The same under the names of comparisons, made as a final render makes its passes."""
        named = {"combined": self.images["film.combined"]}
        for made in PASSES:
            if all(name in self.images for name in made.images):
                named[IMAGE_OF_PASS[made.name]] = made.pixels(self.images, self.exposure)
        seconds = self.ledger.times.get("total", 0.0)
        return Passes(named, "CANDELA", self.samples, self.seed, seconds, self.film_transparent)


@dataclass
class _Kept:
    renderer: Renderer = field(default_factory=lambda: Renderer(make_registry))
    cache: SnapshotCache = field(default_factory=SnapshotCache)


MOST_KEPT = 2
_kept: dict[int, _Kept] = {}  # by session_uid of the scene, the one that was asked for last at the end


def render_steps(
    scene, depsgraph, size: tuple[int, int], settings: Settings, profile: bool = True
) -> Iterator[tuple[float, str]]:
    """Render all samples of the scene with these settings; yields the share done and a sentence, returns `Rendered`.

    With `profile` each technique's time is true, and the whole takes longer, for the GPU is waited for after each.

    Raises ValueError with a sentence when there is nothing to look through or the passes do not fit together, and
    RuntimeError when the GPU cannot.
    """
    gpu_context.ensure()
    settings = replace(settings.with_all_samples(), profile=profile)
    kept = _kept[scene.session_uid] = _kept.pop(scene.session_uid, None) or _Kept()
    try:
        snapshot = take(depsgraph, kept.cache, *size)
    except UnsupportedScene as error:
        raise ValueError(str(error)) from None
    yield 0.0, "compiling shaders"
    with turn:
        for other in list(_kept)[:-MOST_KEPT]:
            _kept.pop(other).renderer.release()
    compiled = library.compile_count
    frame = yield from _begun(kept.renderer, snapshot, settings)
    if profile and compiled != library.compile_count:
        # Drivers make the rest of a program at its first draw. Drawn again, each technique's time is its own.
        for _ in samples_in_parts(kept.renderer, frame):
            yield 0.0, "preparing shaders"
            if frame.samples_done:
                break
        kept.renderer.forget()
        frame = yield from _begun(kept.renderer, snapshot, settings)
    for _ in samples_in_parts(kept.renderer, frame):
        drawing = min(frame.samples_done + 1, settings.samples)
        yield frame.samples_done / settings.samples, f"sample {drawing} of {settings.samples}"
    with turn:
        kept.renderer.show(frame)
        colors = sorted(name for name, image in frame.images.items() if image.format == "RGBA32F")
        arrays = kept.renderer.finish(frame, colors)
    ledger = frame.ledger
    ledger.times["total"] = sum(ledger.times.values())
    return Rendered(arrays, ledger, settings.samples, settings.seed, snapshot.film.exposure, snapshot.film.transparent)


def _begun(renderer: Renderer, snapshot, settings: Settings) -> Iterator[tuple[float, str]]:
    """Begin a frame in parts, and return it."""
    parts = renderer.beginning(snapshot, settings)
    while True:
        with turn:
            try:
                done, total = next(parts)
            except StopIteration as end:
                return end.value
        yield 0.0, f"compiling shaders, {done} of {total}" if total else "reading the scene"


def reference_images(reference: Reference) -> dict[str, np.ndarray]:
    """Cycles' pictures under the frame's names, where both mean the same."""
    paths, _ = reference.paths()
    found = {f"radiance.{name}": path for name, path in paths.items()}
    found |= {f"color.{name.removesuffix('_color')}": p for name, p in reference.images.items() if "_color" in name}
    return found | {"film.combined": reference.images["combined"], "film.depth": reference.images["depth"]}


def free() -> None:
    """Free what runs hold."""
    for kept in _kept.values():
        kept.renderer.release()
    _kept.clear()
    images.pool.trim()


@bpy.app.handlers.persistent
def _another_file(*_) -> None:
    free()


def register() -> None:
    bpy.app.handlers.load_post.append(_another_file)


def unregister() -> None:
    bpy.app.handlers.load_post.remove(_another_file)
    free()
