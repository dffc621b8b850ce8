"""How a panoramic camera's surfaces are drawn: by ordinary views of parts of its sphere of directions, the tiles.

Triangles have straight edges only in a picture of a plane. So surfaces are drawn onto the faces of a cube about the
camera, and each pixel takes what the texel shows that its ray goes through (shaders/view/from_tile.frag.glsl); all that
lights surfaces then works on the panorama's own pixels (shaders/view/panorama.glsl). Texels are finer than pixels by
FINER, and shifted within their width in each sample, so that the mean over samples is a box of a texel's size beside
the pixel filter and no edge of a texel shows. Faces that no pixel looks at are not drawn.

Through a lens, or as an eye of a stereoscopic pair, each direction is seen from another place. Faces are then cut into
tiles, each of which is drawn from the place of its middle direction; pixels look through it at what is in focus.

Bias: clip distances are those of faces, along their axes, and up to 1.7 times as far in their corners; of a lens, and
of an eye of a spherical pair, the place is exact in the middles of tiles.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..gfx.struct import Block
from ..snapshot.scene import Camera
from .view import VIEW, View

FINER = 1.5  # texels by the width of a pixel
LENS_SIDE, EYE_SIDE = 3, 8  # tiles along a face, of a lens and of an eye
MOST = 8192  # texels along a tile
MARGIN = 3  # pixels that the film's points may lie off, and texels around a tile
CLOSER = 0.8  # of the clip distance: along the axes of faces, for what is seen beside them
# Right, up and backward of the faces in the camera's (right, up, forward).
FACES = tuple(
    np.array([right, up, np.negative(forward)], np.float64)
    for right, up, forward in (
        ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
        ((0, 0, -1), (0, 1, 0), (1, 0, 0)),
        ((-1, 0, 0), (0, 1, 0), (0, 0, -1)),
        ((0, 0, 1), (0, 1, 0), (-1, 0, 0)),
        ((1, 0, 0), (0, 0, -1), (0, 1, 0)),
        ((1, 0, 0), (0, 0, 1), (0, -1, 0)),
    )
)


# What programs are made of that read a block of a panoramic view (gfx/struct.py, Block.answers).
ANSWERS = (("ask/view.glsl", '#include "view/panorama.glsl"\n'),)


@dataclass
class Tile:
    """A part of a face: the pixels whose directions lie in `bounds` (left, right, bottom, top one unit along its axis)
    see it, in the rows `rows` of the picture."""

    axes: np.ndarray  # as FACES
    bounds: tuple[float, float, float, float]
    rows: tuple[int, int]
    view: View
    fineness: float  # texels by a pixel
    block: Block | None = None
    drawn_rows: np.ndarray | None = None  # rows x, y, w, q of the projection, of this sample
    eye: np.ndarray | None = None  # where it is seen from, in the camera's axes, m

    @property
    def middle(self) -> np.ndarray:
        """The unit direction in the middle, (right, up, forward)."""
        left, right, bottom, top = self.bounds
        found = np.array([(left + right) / 2, (bottom + top) / 2, -1.0]) @ self.axes
        return found / np.linalg.norm(found)


def tiles_of(view: View) -> list[Tile]:
    """Those that pixels of a panoramic view see."""
    camera, (x0, y0, x1, y1) = view.camera, view.film.border
    columns, rows = min(x1 - x0, 512), min(y1 - y0, 512)
    u = np.linspace(x0 - MARGIN, x1 + MARGIN, columns + 1) / view.film.width
    v = np.linspace(y0 - MARGIN, y1 + MARGIN, rows + 1) / view.film.height
    u, v = camera.panorama.film(u, v)
    seen = camera.panorama.directions(u, v[:, None])
    there = np.abs(seen).sum(axis=-1) > 0.0
    if camera.panorama.stereo is not None:
        side = EYE_SIDE
    else:
        side = LENS_SIDE if camera.aperture is not None else 1
    pixel = (camera.frame[1] - camera.frame[0]) / view.film.width
    found = []
    for axes in FACES:
        local = seen @ axes.T
        along = -local[..., 2]
        inside = there & (along > 0.0) & (np.abs(local[..., :2]).max(axis=-1) <= along * 1.02)
        if not inside.any():
            continue
        places = local[..., :2] / np.where(inside, along, 1.0)[..., None]
        for row in range(side):
            for column in range(side):
                left, right, bottom, top = (
                    2.0 * one / side - 1.0 for one in (column, column + 1, row, row + 1)
                )  # fmt: skip
                slack = 4.0 * pixel
                own = inside & (places[..., 0] >= left - slack) & (places[..., 0] <= right + slack)
                own &= (places[..., 1] >= bottom - slack) & (places[..., 1] <= top + slack)
                if own.any():
                    step = (y1 - y0 + 2 * MARGIN) / rows
                    hit = np.flatnonzero(own.any(axis=1)) * step - MARGIN
                    room = MARGIN + step
                    shown = max(int(hit[0] - room), 0), min(int(hit[-1] + room) + 1, y1 - y0)
                    low, high = places[own].min(axis=0), places[own].max(axis=0)
                    found.append(_tile(view, axes, (left, right, bottom, top), low, high, shown, pixel))
    return found


def _tile(view: View, axes: np.ndarray, bounds, low, high, rows: tuple[int, int], pixel: float) -> Tile:
    """A tile of which pixels see the places from `low` to `high`."""
    camera = view.camera
    texel = pixel / FINER
    reach = 0.0
    if camera.aperture is not None:  # a point of the lens looks at what is in focus past the tile's bounds
        reach = 2.0 * camera.aperture.radius / camera.aperture.focus
    if camera.panorama.stereo is not None and np.isfinite(camera.panorama.stereo.convergence):
        reach += 2.0 * abs(camera.panorama.stereo.offset) / camera.panorama.stereo.convergence
    room = MARGIN * texel + 4.0 * pixel / np.sqrt(2.0) + reach
    left, bottom = np.maximum(low, (bounds[0], bounds[2])) - room
    right, top = np.minimum(high, (bounds[1], bounds[3])) + room
    size = [int(np.clip(np.ceil(extent / texel), 1, MOST)) for extent in (right - left, top - bottom)]
    matrix = camera.matrix.copy()
    # The camera's own axes are right, up and backward; those of faces are given with forward.
    matrix[:3, :3] = camera.matrix[:3, :3] @ (axes * (1.0, 1.0, -1.0)).T
    # An even way of texels, whatever the clip to MOST has cut off.
    frame = tuple(float(side) for side in (left, right, bottom, top))
    face = Camera(matrix, "PERSPECTIVE", frame, CLOSER * camera.clip_start, camera.clip_end, camera.name)
    film = replace(view.film, width=size[0], height=size[1], border=(0, 0, *size))
    return Tile(axes, bounds, rows, View(face, film, view.origin), size[0] / (right - left) * pixel)


def look(tiles: list[Tile], view: View, sample: int, seed: int, scene_size: float, lens, footprints) -> None:
    """Set the tiles' views of a sample: as of View.values of the panoramic `view`."""
    shift = np.modf(np.array([0.7548776662, 0.5698402910]) * (sample + 1))[0] - 0.5
    axes = view.camera.matrix[:3, :3] * (1.0, 1.0, -1.0)  # right, up and forward as columns
    for tile in tiles:
        tile.eye = eye_of(view.camera, tile.middle, lens)
        placed = replace(tile.view.camera, matrix=tile.view.camera.matrix.copy())
        placed.matrix[:3, 3] = view.camera.matrix[:3, 3] + axes @ tile.eye
        own = View(placed, tile.view.film, tile.view.origin)
        wide = tuple(side * tile.fineness for side in footprints)
        values = own.values(sample, seed, tuple(shift), scene_size, footprints=wide)
        if tile.block is None:
            tile.block = Block(VIEW, **values)
        else:
            tile.block.update(**values)
        tile.drawn_rows = np.stack([values[f"row_{name}"] for name in "xywq"])


def eye_of(camera: Camera, seen: np.ndarray, lens: tuple[float, float]) -> np.ndarray:
    """Where rays to a direction begin, in the camera's axes: panorama_begins of shaders/view/panorama.glsl."""
    between = seen + (0.0, 0.0, 1.0)
    found = np.array([*lens, 0.0]) - (seen[:2] @ lens) / max(1.0 + seen[2], 1e-3) * between
    stereo = camera.panorama.stereo
    if stereo is not None:
        altitude, fade = abs(np.arcsin(np.clip(seen[1], -1.0, 1.0))), 1.0
        if stereo.merge_to > 0.0:
            share = (altitude - stereo.merge_from) / max(stereo.merge_to - stereo.merge_from, 1e-6)
            fade = np.cos(0.5 * np.pi * np.clip(share, 0.0, 1.0))
        beside = np.array([seen[2], 0.0, -seen[0]])
        found += beside / max(np.linalg.norm(beside), 1e-30) * stereo.offset * fade
    return found
