"""Cryptomatte: which objects, materials or assets cover each pixel, and how much of it.

Source: Friedman and Jones, "Fully automatic ID mattes with support for motion blur and transparency", SIGGRAPH 2015
posters; the specification's hashes, ranks and manifest stand in kernels/ranks.py. Names are those of Cycles: objects
and materials by their own, assets by the name of an object's topmost parent.

At each point of the film the surfaces are drawn once more by the surface pass's own programs, which leave the numbers
of instance and material instead of a place. A dispatch for each kind looks their ids up in a table and adds the point's
weight to the pairs of all pixels whose filter covers it: the point's share of a pixel is that in light, so that edges
of mattes are edges of the picture. Transparent layers count by their opacity: each sample either meets or passes them.

| cost | per point of the film |
|---|---|
| draws | those of the surface pass, with six images of which one is used |
| dispatches | 1 for each kind: 9 fetches and look-ups a pixel (25 for wide filters) |
| bytes per pixel | 8 for each kind and level |

Bias: none while a pixel shows no more names than there are levels; later ones are left out, where Cycles gives their
weight to the last. Glass that bends light is what it shows, also in Cycles. Media have no matte. Nothing is drawn,
compiled or held where the view layer asks for no matte.
"""

from __future__ import annotations

from contextlib import ExitStack
from functools import cache

import numpy as np

from ..film import filter as film_filter
from ..film.points import Coverage
from ..frame.picture import Frame
from ..frame.technique import Technique, Write
from ..gfx import images, passes
from ..gfx.library import Program
from ..kernels.ranks import ids_of
from ..snapshot.scene import CRYPTO_DEFAULT
from ..surfaces.draw import SURFACES, draw_numbers

ID = {  # of what a point shows
    "object": "instance_ids(seen.z).x",
    "material": "material_of(seen.y).x",
    "asset": "instance_ids(seen.z).y",
}


@cache
def adding(kind: str, count: int, pixels: int) -> Program:
    """The dispatch for `count` images of pairs; `pixels` as of film/filter.py, reach."""
    moved = [(f"pairs_{k}", 2 * k) for k in range(count)]
    return Program(
        name=f"cryptomatte of {kind}s, {2 * count} levels",
        compute="film/cryptomatte.comp.glsl",
        textures=(("FLOAT_2D", "seen_surface"), ("FLOAT_2D", "object_ids"), ("FLOAT_2D", "material_ids")),
        images=tuple((name, "RGBA32F", "FLOAT_2D", "READ_WRITE") for name, _ in moved),
        constants=film_filter.CONSTANTS,
        defines=(
            ("PIXELS", str(pixels)), ("SLOTS", str(2 * count)), ("CRYPTO_ID(seen)", ID[kind]),
            ("LOAD_ALL", " ".join(
                f"pair = imageLoad({name}, pixel); ids[{k}] = pair.x; shares[{k}] = pair.y; "
                f"ids[{k + 1}] = pair.z; shares[{k + 1}] = pair.w;"
                for name, k in moved
            )),
            ("STORE_ALL", " ".join(
                f"imageStore({name}, pixel, vec4(ids[{k}], shares[{k}], ids[{k + 1}], shares[{k + 1}]));"
                for name, k in moved
            )),
        ),
    )  # fmt: skip


DECLARED = tuple(adding(kind, count, pixels) for kind in ID for count, pixels in ((3, 1), (8, 0)))


class Cryptomatte(Technique):
    name = "cryptomatte"
    label = "Cryptomatte"
    provides = (Coverage,)

    def skip(self, snapshot, settings):
        if not settings.schedule.has_passes:
            return "a viewport shows no passes"
        return None if snapshot.film.cryptomattes else "the view layer asks for no Cryptomatte"

    def programs(self, snapshot, settings):
        film = snapshot.film
        pixels = film_filter.reach(film.filter_width)
        return tuple(adding(kind, film.cryptomatte_images, pixels) for kind in film.cryptomattes)

    def begin(self, frame: Frame) -> None:
        film = frame.snapshot.film
        for kind in film.cryptomattes:
            for name in film.cryptomatte_names(kind):
                frame.held.add(Write(name, "RGBA32F", f"Cryptomatte of {kind}s: id, weight, id, weight", ranked=True))
        placed = frame.geometry.placed[0]
        names = ids_of([one.object_name for one in placed]), ids_of([one.asset or one.object_name for one in placed])
        self._objects = images.upload_list(_columns(*names))
        shown = [CRYPTO_DEFAULT if k == 0 else one.name for k, one in enumerate(frame.snapshot.materials)]
        self._materials = images.upload_list(_columns(ids_of(shown)))
        frame.provide(Coverage(self._add))

    def _add(self, frame: Frame, surfaces: dict, place: tuple[float, float], share: float) -> None:
        film = frame.snapshot.film
        pixels = film_filter.reach(film.filter_width)
        with ExitStack() as stack:
            drawn, (depth,) = (
                [stack.enter_context(images.borrowed(*frame.size, kind)).colors[0] for _ in range(count)]
                for kind, count in (("RGBA32F", len(SURFACES)), ("DEPTH_COMPONENT32F", 1))
            )
            draw_numbers(frame, self, images.Target(tuple(drawn), depth))
            for kind in film.cryptomattes:
                names = film.cryptomatte_names(kind)
                passes.compute(
                    adding(kind, len(names), pixels),
                    frame.size,
                    textures={
                        "seen_surface": drawn[0], "object_ids": self._objects, "material_ids": self._materials,
                    },
                    images={f"pairs_{k}": frame.images[name] for k, name in enumerate(names)},
                    constants=film_filter.place_constants(frame, place, share),
                )  # fmt: skip
        frame.count(self, "passes", 1 + len(film.cryptomattes))

    def release(self) -> None:
        self._objects = self._materials = None


def _columns(*columns: np.ndarray) -> np.ndarray:
    """Rows for upload_list, at least one."""
    rows = np.zeros((max(len(columns[0]), 1), 4), np.float32)
    for k, column in enumerate(columns):
        rows[: len(column), k] = column
    return rows
