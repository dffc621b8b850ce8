"""Surfaces: what each pixel sees, as closures of the material there (the G-buffer).

Every material's graph runs once per visible pixel and leaves its closures in six images (`surface.*`); all lighting
reads them. Transparency is stochastic: a layer is drawn with the probability of its opacity, numbers stratified over
the samples per pixel and layer, so the mean over samples is exact alpha blending of any number of layers, at the
price of noise that falls like 1/n. Glass bends what it lets through where a technique of the transmission slot runs
(traced_refraction.py), and else is such a layer. Where such layers are coloured, a second pass multiplies what was
hit, or the world, by the colour of each layer before it over its mean (the order does not matter), so the mean is exact
by channel. Of several glossy lobes one is kept per sample (shaders/lib/closure.glsl).

The camera is shifted within the pixel filter (Blackman-Harris, importance-sampled) and over the lens
(sampling/lens.py), the same for all pixels.

On the first sample the picture is also reduced to boxes of 16x16-pixel tiles around what is seen: the receivers, to
which depth maps are fitted. With alpha materials both ends of the layers are drawn for it, opaque and left out; with
depth of field all that the rim of the lens sees, too.

| cost | per sample |
|---|---|
| draws | one per material (meshes shown once are joined) and one per instanced mesh and material |
| bytes written per pixel | 6 x 16 + 4 |
| coloured layers | + 1 pass of their draws, blended into three of the images |
| marks | 1 pass: which pixels show a surface, which one with a narrow lobe; others are left out by the depth test |
| first picture of a view | + one reduction to 1/128 of the pixels, read together with what light probes find |
| the same with alpha | + 2 surface passes and another reduction |
| first sample with depth of field | 7 times that |

Fails: more layers than samples look dithered; light through coloured layers casts grey shadows.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass

import numpy as np

from ..film import points as film_points
from ..frame.picture import Frame
from ..frame.technique import Technique, Write
from ..gfx import images, library, passes
from ..lighting.visibility import traced_roughness
from ..sampling.lens import rim
from ..scene.receivers import TILE, Receivers, merged
from ..scene.view import VIEW
from ..surfaces.baked import BakedSurface
from ..surfaces.draw import (
    LEFT_OUT,
    MARKS,
    OPAQUE,
    STOCHASTIC,
    SURFACES,
    StandIns,
    draw_sample,
    draw_surfaces,
    draw_view,
    drawing_constants,
    lobes_kept,
)

DESCRIPTIONS = {  # the layout in full: shaders/lib/gbuffer.glsl
    "position": "Position relative to the render origin, m; whether something was hit, and held out",
    "normal": "Shading normal and the triangle's normal",
    "diffuse": "Diffuse albedo; roughness, anisotropy and tangent",
    "tint": "Weight of the glossy or soft lobe; its reflectance at normal incidence",
    "lobe": "Normal and kind of the lobe, edge reflectance, index of refraction",
    "emission": "Emitted radiance towards the viewer; glossy roughness",
}


MARK_IMAGES = ("position", "tint", "lobe", "emission")
MARK = passes.fullscreen_program(
    "surface marks",
    "surface/marks.frag.glsl",
    textures=tuple(("RGBA32F", f"surface_{name}") for name in MARK_IMAGES),
    constants=(("FLOAT", "traced_roughness"),),
    writes_depth=True,
)
TILE_BOUNDS = passes.fullscreen_program(
    "tile bounds",
    "surface/tile_bounds.frag.glsl",
    textures=(("RGBA32F", "surface_position"),),
    blocks=((VIEW, "film_view"),),
    constants=(("INT", "tile"),),
    outputs=(("VEC4", "out_low"), ("VEC4", "out_high")),
)


class Surfaces(Technique):
    name = "surfaces"
    label = "Surfaces"
    writes = (
        *(Write(f"surface.{name}", "RGBA32F", text) for name, text in DESCRIPTIONS.items()),
        Write("surface.depth_buffer", "DEPTH_COMPONENT32F", "Depth buffer of the surface pass"),
        Write(MARKS, "DEPTH_COMPONENT32F", "0 nothing, 0.5 a surface, 1 one with a lobe that rays are traced for"),
    )

    def __init__(self):
        self._drawn = False  # `begin` has left the first sample in the images
        # Programs that had a first draw and are fresh still: of their boxes a view sees something, of their parts none.
        self._tried: set[library.Program] = set()

    def begin(self, frame: Frame) -> Iterator[None]:
        yield from self._first_draws(frame)
        modes = (OPAQUE, LEFT_OUT) if any(m.transparent for m in frame.materials.compiled) else (STOCHASTIC,)
        film = next((one for one in frame.plan.techniques if film_points.POINTS in one.params), None)
        if film is not None:
            frame.film_points = film_points.points_of_sample(frame, frame.settings.get(film, film_points.POINTS.name))
        known = frame.kept(_KnownReceivers)
        key = _receivers_key(frame, modes)
        if known.key == key:
            frame.find_receivers = lambda: known.receivers
            frame.look((0.0, 0.0))
        else:
            frame.find_receivers = yield from self._receivers(frame, self._target(frame), modes, known, key)
        if modes != (STOCHASTIC,) or known.key == key:  # else what was drawn for the receivers is the first sample
            self._draw(frame)
        self._drawn = True

    def sample(self, frame: Frame) -> None:
        if not self._drawn:
            self._draw(frame)
        self._drawn = False
        passes.fullscreen(
            MARK,
            frame.target(depth=MARKS),
            textures={f"surface_{name}": frame.images[f"surface.{name}"] for name in MARK_IMAGES},
            constants={"traced_roughness": traced_roughness(frame)},
        )
        frame.count(self, "passes")

    def _draw(self, frame: Frame) -> None:
        if frame.snapshot.baked is not None:
            frame.shared(BakedSurface).draw(frame, self, self._target(frame))
        else:
            draw_sample(frame, self, self._target(frame))

    def _first_draws(self, frame: Frame) -> Iterator[None]:
        """In a viewport, draw each program of materials in view that has never been drawn with in a part of its own,
        once: that takes some drivers as long as to compile it. What is drawn is not used."""
        schedule = frame.settings.schedule
        if not (schedule.is_draft or schedule.shows_each) or frame.snapshot.baked is not None or frame.tiles:
            return
        sharing: dict[library.Program, set[int]] = {}
        seen = np.flatnonzero(frame.geometry.boxes.seen(frame.view_rows))
        for material in {frame.geometry.draws[k].material for k in seen}.difference(frame.shared(StandIns).of):
            if not frame.materials.compiled[material].bounds_alone:
                sharing.setdefault(frame.materials.surface_program(material), set()).add(material)
        fresh = {program: materials for program, materials in sharing.items() if not library.has_drawn(program)}
        self._tried &= fresh.keys()
        left = [program for program in fresh if program not in self._tried]
        constants = drawing_constants(STOCHASTIC, lobes_kept(frame))
        for program in left[1:]:  # the first one in the picture's own draw
            target, program_of = self._target(frame), frame.materials.surface_program
            target.clear()
            draw_view(frame, self, target, frame.view_block, frame.view_rows, program_of, fresh[program], constants)
            self._tried.add(program)
            yield

    @staticmethod
    def _target(frame: Frame) -> images.Target:
        return frame.target(*SURFACES, depth="surface.depth_buffer")

    def _receivers(
        self, frame: Frame, surfaces: images.Target, modes: tuple[int, ...], known: _KnownReceivers, key
    ) -> Generator[None, None, Callable[[], Receivers]]:
        """Draw what tells the receivers, in parts; what is returned reads it."""
        width, height = frame.size
        tiles = -(-width // TILE), -(-height // TILE)
        aperture = frame.snapshot.camera.aperture
        bounds = []
        for lens in (*(rim(aperture) if aperture else ()), (0.0, 0.0)):  # the middle last: it is the first sample
            frame.look(lens)
            for mode in modes:
                if frame.snapshot.baked is not None:
                    frame.shared(BakedSurface).draw(frame, self, surfaces)
                else:
                    draw_surfaces(frame, self, surfaces, mode, lobes_kept(frame))
                yield
                target = images.Target(tuple(images.pool.take(*tiles, "RGBA32F") for _ in range(2)))
                passes.fullscreen(
                    TILE_BOUNDS,
                    target,
                    textures={"surface_position": frame.images["surface.position"]},
                    blocks={"film_view": frame.view_block},
                    constants={"tile": TILE},
                )
                bounds.append([frame.readback.later(image) for image in target.colors])

        def found() -> Receivers:
            low = np.min([low.pixels() for low, _ in bounds], axis=0)
            high = np.max([high.pixels() for _, high in bounds], axis=0)
            known.receivers, known.key = _boxes(low, high), key
            return known.receivers

        return found


@dataclass
class _KnownReceivers:
    """Receivers of the picture before, and what they were found in."""

    key: object = None
    receivers: Receivers | None = None


def _receivers_key(frame: Frame, modes: tuple[int, ...]) -> tuple:
    camera, settings = frame.snapshot.camera, frame.settings
    return (
        frame.size, modes, frame.snapshot.baked, camera.matrix.tobytes(), camera.kind, camera.frame,
        camera.clip_start, camera.clip_end, camera.aperture, camera.panorama, frame.snapshot.film, settings.seed,
        settings.schedule.is_draft, lobes_kept(frame),
        frame.geometry.changes, frame.geometry.origin.tobytes(), frame.materials.fingerprint(),
        tuple(sorted(settings.values.items())), tuple(technique.name for technique in frame.plan.techniques),
        frame.snapshot.own_values,
    )  # fmt: skip


def _boxes(low: np.ndarray, high: np.ndarray) -> Receivers:
    """From bounds of tiles, (rows, columns, 4) each, w: least and greatest depth."""
    low, high = low.astype(np.float64), high.astype(np.float64)
    seen = (np.isfinite(low) & np.isfinite(high)).all(axis=-1) & (low <= high).all(axis=-1)
    seen &= low[..., 3] < 1e29
    low, high, side = merged(np.where(seen[..., None], low, 1e30), np.where(seen[..., None], high, -1e30))
    low, high = low.reshape(-1, 4), high.reshape(-1, 4)
    seen = (low <= high).all(axis=1)
    order = np.argsort(low[seen, 3], kind="stable")
    low, high = low[seen][order], high[seen][order]
    return Receivers(low[:, :3], high[:, :3], low[:, 3], side * TILE)
