"""The world as a light: its radiance as an image, and directions drawn in proportion to it.

Directions are drawn from a grid over the equirectangular image, with a density per steradian that follows the mean
luminance of each cell; a twentieth is spread evenly, so that no direction with light has zero density. The technique
may guide the density further, to directions from which light reaches what the camera sees (a window, the open sky).
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from ..gfx import images
from ..gfx.struct import Block, Struct
from ..scene.world_tree import WorldTree
from ..snapshot.scene import Note, World
from . import irradiance
from .irradiance import WorldCells
from .lights import LUMINANCE

WORLD = Struct(
    "World",
    ("vec4", "color"),  # factor on the map; w = 1 if the camera sees the world
    ("vec4", "map_x"),  # world direction -> map direction, row by row
    ("vec4", "map_y"),
    ("vec4", "map_z"),
    ("vec4", "map_options"),  # x = 1 for a transparent film
)
LARGEST_GRID = (256, 512)
LEAST_BAKED = 512  # rows
SMALLEST_GRID = (32, 64)  # for guiding, even where the image is smaller
GUIDE_ROWS, GUIDE_COLUMNS = 16, 32
OPEN = 0.06  # of the light, from which directions for what the camera does not see are drawn by radiance alone


class Environment:
    """GPU images and sampling tables of one World."""

    def __init__(self, world: World, transparent_film: bool, tree: WorldTree | None = None):
        self.color = np.asarray(world.color, np.float64)
        self.tree = tree  # what the camera sees instead of the map, if not None
        pixels, mapping = _pixels(world) if tree is None else (_finite(tree.bake()), np.eye(3))
        self.pixels = pixels
        self.rotation = mapping[:, :3]
        self._to_world = np.linalg.inv(self.rotation)
        luminance = np.maximum(pixels @ np.abs(LUMINANCE * np.sign(self.color)), 0.0)
        self.power = float(np.abs(self.color).max() * luminance.max())
        density = _density(luminance)
        self._by_radiance = density  # per steradian, rows from the bottom
        self.map = images.upload(np.dstack([pixels, np.ones(pixels.shape[:2])]).astype(np.float32))
        rows = np.concatenate([mapping, np.zeros((3, 4 - mapping.shape[1]))], axis=1)
        self.block = Block(
            WORLD, color=(*self.color, float(world.visibility.camera and tree is None)),
            map_x=rows[0], map_y=rows[1], map_z=rows[2],
            map_options=(float(transparent_film), 0, 0, 0),
        )  # fmt: skip
        self._openness: np.ndarray | None = None  # of the cells of light
        self.open_share = 1.0  # of the world's light, how much reaches what the camera sees, as `guide` was told
        self._known: tuple[images.Image, int] | None = None
        self._set_density(density)

    @cached_property
    def _light_cells(self) -> WorldCells:
        pixels = self.pixels
        height, width = max(pixels.shape[0], 2 * irradiance.ROWS), max(pixels.shape[1], 2 * irradiance.COLUMNS)
        if (height, width) != pixels.shape[:2]:  # smaller ones are seen interpolated
            v, u = np.mgrid[0:height, 0:width]
            latitude, azimuth = ((v + 0.5) / height - 0.5) * np.pi, (0.5 - (u + 0.5) / width) * 2 * np.pi
            ring = np.cos(latitude)
            pixels = self.lookup(np.stack([ring * np.cos(azimuth), ring * np.sin(azimuth), np.sin(latitude)], axis=-1))
        return WorldCells(pixels * self.color)

    def known_irradiance(self) -> tuple[images.Image, int]:
        """What normals get of the world where it is as open as `guide` was told, as shaders/lib/known_irradiance.glsl
        reads it, and how many bright cells stand in it."""
        if self._known is None:
            known = self._light_cells.irradiance(self._to_world, 1.0 if self._openness is None else self._openness)
            self._known = images.upload(known.texels()), len(known.bright)
        return self._known

    def mean_radiance(self, rows: int, columns: int, most: float = np.inf) -> np.ndarray:
        """(rows, columns, 3) W / (m2 sr), of cells of equal solid angle in the world's own frame, by height from the
        nadir and by azimuth from -pi on, without what is of more luminance than `most`."""
        fine = 6  # places of a cell along each side
        z = (np.arange(fine * rows) + 0.5) / (fine * rows) * 2 - 1
        azimuth = ((np.arange(fine * columns) + 0.5) / (fine * columns) - 0.5) * 2 * np.pi
        ring = np.sqrt(1 - z * z)[:, None]
        up = np.broadcast_to(z[:, None], (len(z), len(azimuth)))
        directions = np.stack([ring * np.cos(azimuth), ring * np.sin(azimuth), up], axis=-1)
        radiance = self._light_cells.radiance[self._light_cells.of(directions @ self.rotation.T)]
        radiance = np.where((radiance @ LUMINANCE > most)[..., None], 0.0, radiance)
        return radiance.reshape(rows, fine, columns, fine, 3).mean(axis=(1, 3))

    @property
    def is_shut_out(self) -> bool:
        """Whether so little of the light reaches what the camera sees that what it does not see is lit from there, too:
        elsewhere such places want directions by radiance alone."""
        return self.open_share < OPEN

    def openness(self, directions: np.ndarray) -> np.ndarray:
        """(...) how open the scene is towards directions (..., 3) of the world, as `guide` was told; else 1."""
        if self._openness is None:
            return np.ones(directions.shape[:-1])
        return self._openness[self._light_cells.of(directions @ self.rotation.T)]

    @property
    def notes(self) -> tuple[Note, ...]:
        """What of the world is drawn otherwise than Cycles would."""
        return () if self.tree is None else self.tree.notes

    def guide(self, usefulness: np.ndarray | None, openness: np.ndarray | None = None) -> None:
        """Prefer directions from which light reaches what the camera sees.

        `usefulness`, (GUIDE_ROWS, GUIDE_COLUMNS), is the mean of visibility x cosine over probes, for cells of equal
        solid angle in the world's own frame. A tenth of the directions ignores it, so that what the probes missed is
        still drawn. None: back to radiance alone. `openness`, of the same cells: the mean of visibility over probes
        that face them.
        """
        self._known, self._openness, self.open_share = None, None, 1.0
        if openness is not None:
            seen = self._by_radiance * openness[self._guide_cells()]
            self.open_share = float((seen * self._cell_solid_angle(*seen.shape)).sum())
            self._openness = _between_cells(openness, self._light_cells.centres() @ self._to_world.T)
        if usefulness is None:
            if self.density is not self._by_radiance:
                self._set_density(self._by_radiance)
            return
        row, column = self._guide_cells()
        usefulness = np.maximum(usefulness, 0.5 * _largest_nearby(usefulness))
        guided = self._by_radiance * usefulness[row, column]
        solid_angle = self._cell_solid_angle(*self._by_radiance.shape)
        total = float((guided * solid_angle).sum())
        self._set_density(0.9 * guided / total + 0.1 * self._by_radiance if total > 0 else self._by_radiance)

    def guide_moments(self) -> np.ndarray:
        """(3, GUIDE_ROWS, GUIDE_COLUMNS): for cells as of `guide` the means of the world's luminance (in any unit), of
        its square, and of its square over the density with which directions are drawn."""
        light = self._by_radiance
        place, solid_angle = self._guide_cells(), np.broadcast_to(self._cell_solid_angle(*light.shape), light.shape)
        sums = np.zeros((4, GUIDE_ROWS, GUIDE_COLUMNS))
        for total, values in zip(sums, (np.ones_like(light), light, light**2, light**2 / self.density)):
            np.add.at(total, place, values * solid_angle)
        means = sums[1:].sum(axis=(1, 2), keepdims=True) / sums[0].sum()  # where a turned map has no cell of its own
        return np.where(sums[0] > 0, sums[1:] / np.maximum(sums[0], 1e-300), means)

    def _guide_cells(self) -> tuple[np.ndarray, np.ndarray]:
        """Row and column of the guiding cell that holds each cell of the density."""
        height, width = self._by_radiance.shape
        z = np.sin(((np.arange(height) + 0.5) / height - 0.5) * np.pi)
        azimuth = (0.5 - (np.arange(width) + 0.5) / width) * 2 * np.pi
        ring = np.sqrt(1 - z * z)[:, None]
        in_map = np.stack(
            [ring * np.cos(azimuth), ring * np.sin(azimuth), np.repeat(z[:, None], width, axis=1)], axis=-1
        )
        world = in_map @ self._to_world.T
        rows = np.clip((world[..., 2] + 1) / 2 * GUIDE_ROWS, 0, GUIDE_ROWS - 1).astype(int)
        turn = np.arctan2(world[..., 1], world[..., 0]) / (2 * np.pi) + 0.5
        columns = np.clip(turn * GUIDE_COLUMNS, 0, GUIDE_COLUMNS - 1).astype(int)
        return rows, columns

    @staticmethod
    def _cell_solid_angle(height: int, width: int) -> np.ndarray:
        return np.diff(np.sin((np.arange(height + 1) / height - 0.5) * np.pi))[:, None] * (2 * np.pi / width)

    def _set_density(self, density: np.ndarray) -> None:
        self.density = density
        self.density_map = images.upload(density.astype(np.float32), "R32F")
        height = len(density)
        self._edges = np.sin((np.arange(height + 1) / height - 0.5) * np.pi)
        self._sums = self._running_sums(density)

    def _running_sums(self, density: np.ndarray) -> np.ndarray:
        """Of the shares of cells, row after row, from 0 on."""
        return np.concatenate([[0.0], np.cumsum(density * self._cell_solid_angle(*density.shape))])

    @cached_property
    def _sums_by_radiance(self) -> np.ndarray:
        return self._running_sums(self._by_radiance)

    def draw(self, x, y, guided: bool = True) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """From uniform numbers of any shape: directions (..., 3), unit, in the world; radiance from there (..., 3), and
        densities per steradian (...). Not `guided`: by radiance alone, the same whatever the camera sees."""
        density, cells = (self.density, self._sums) if guided else (self._by_radiance, self._sums_by_radiance)
        height, width = density.shape
        rows = cells[::width]
        x, y = np.asarray(x, np.float64), np.asarray(y, np.float64) * rows[-1]
        row = np.clip(np.searchsorted(rows, y, side="right") - 1, 0, height - 1)
        low, mass = rows[row], rows[row + 1] - rows[row]
        along = (y - low) / np.maximum(mass, 1e-300)
        place = low + x * mass  # on the curve that runs through one row after the other
        column = np.searchsorted(cells, place, side="right") - 1 - row * width
        column = np.clip(column, 0, width - 1)
        start = cells[row * width + column]
        across = (place - start) / np.maximum(cells[row * width + column + 1] - start, 1e-300)
        z = self._edges[row] + np.clip(along, 0, 1) * (self._edges[row + 1] - self._edges[row])
        azimuth = (0.5 - (column + np.clip(across, 0, 1)) / width) * 2 * np.pi
        ring = np.sqrt(np.maximum(1.0 - z * z, 0.0))
        in_map = np.stack([ring * np.cos(azimuth), ring * np.sin(azimuth), z], axis=-1)
        direction = in_map @ self._to_world.T
        direction /= np.linalg.norm(direction, axis=-1, keepdims=True)
        return direction, self.lookup(in_map) * self.color, density[row, column]

    def lookup(self, in_map: np.ndarray) -> np.ndarray:
        """Bilinear radiance (..., 3), without the factor, in directions (..., 3) of the map's own frame."""
        height, width = self.pixels.shape[:2]
        u = 0.5 - np.arctan2(in_map[..., 1], in_map[..., 0]) / (2 * np.pi)
        v = 0.5 + np.arcsin(np.clip(in_map[..., 2], -1, 1)) / np.pi
        px, py = u * width - 0.5, v * height - 0.5
        x0, y0 = np.floor(px).astype(int), np.floor(py).astype(int)
        tx, ty = (px - x0)[..., None], (py - y0)[..., None]
        left, right = x0 % width, (x0 + 1) % width
        lower, upper = np.clip(y0, 0, height - 1), np.clip(y0 + 1, 0, height - 1)
        pixels = self.pixels
        below = pixels[lower, left] * (1 - tx) + pixels[lower, right] * tx
        above = pixels[upper, left] * (1 - tx) + pixels[upper, right] * tx
        return below * (1 - ty) + above * ty


def _largest_nearby(cells: np.ndarray) -> np.ndarray:
    """Maximum over a cell and its eight neighbours: what probes saw there is likely to be seen here by others."""
    round_about = np.pad(np.pad(cells, ((0, 0), (1, 1)), mode="wrap"), ((1, 1), (0, 0)), mode="edge")
    return np.lib.stride_tricks.sliding_window_view(round_about, (3, 3)).max(axis=(2, 3))


def _between_cells(cells: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """Values (GUIDE_ROWS, GUIDE_COLUMNS) of cells as of `guide`, bilinear in directions (N, 3) of the world."""
    row = np.clip((directions[:, 2] + 1) / 2 * GUIDE_ROWS - 0.5, 0, GUIDE_ROWS - 1)
    column = (np.arctan2(directions[:, 1], directions[:, 0]) / (2 * np.pi) + 0.5) * GUIDE_COLUMNS - 0.5
    y, x = np.minimum(row.astype(int), GUIDE_ROWS - 2), np.floor(column).astype(int)
    ty, tx = row - y, column - x
    left, right = x % GUIDE_COLUMNS, (x + 1) % GUIDE_COLUMNS
    return (cells[y, left] * (1 - tx) + cells[y, right] * tx) * (1 - ty) + (
        cells[y + 1, left] * (1 - tx) + cells[y + 1, right] * tx
    ) * ty


def _pixels(world: World) -> tuple[np.ndarray, np.ndarray]:
    """Radiance image (H, W, 3) finite and linear, and the mapping to it, which turns or mirrors (3, 3)."""
    if world.image is None:
        return np.ones((1, 1, 3)), np.eye(3)
    pixels = _finite(world.image.pixels[..., :3].astype(np.float64))
    if world.image.encoding == "SRGB":
        pixels = np.where(pixels < 0.04045, pixels / 12.92, ((np.maximum(pixels, 0) + 0.055) / 1.055) ** 2.4)
    mapping = np.eye(3, 4) if world.mapping is None else np.asarray(world.mapping, np.float64)
    linear, offset = mapping[:, :3], mapping[:, 3]
    scale = np.cbrt(abs(np.linalg.det(linear)))
    if scale > 0 and not offset.any() and np.allclose(linear @ linear.T, np.eye(3) * scale**2, atol=1e-5 * scale**2):
        return pixels, linear / scale
    # A sheared or shifted mapping is baked once into an image of the world itself.
    height = max(len(pixels), LEAST_BAKED)
    width = max(pixels.shape[1], 2 * LEAST_BAKED)
    v, u = np.mgrid[0:height, 0:width]
    latitude, azimuth = ((v + 0.5) / height - 0.5) * np.pi, (0.5 - (u + 0.5) / width) * 2 * np.pi
    direction = np.stack(
        [np.cos(latitude) * np.cos(azimuth), np.cos(latitude) * np.sin(azimuth), np.sin(latitude)], axis=-1
    )
    mapped = direction @ linear.T + offset
    mapped /= np.maximum(np.linalg.norm(mapped, axis=-1, keepdims=True), 1e-20)
    column = 0.5 - np.arctan2(mapped[..., 1], mapped[..., 0]) / (2 * np.pi)
    row = 0.5 + np.arcsin(np.clip(mapped[..., 2], -1, 1)) / np.pi
    return _between(pixels, row, column), np.eye(3)


def _between(pixels: np.ndarray, row: np.ndarray, column: np.ndarray) -> np.ndarray:
    """Pixels (H, W, C), interpolated at rows and columns from 0 to 1; columns wrap around."""
    height, width = pixels.shape[:2]
    y, x = row * height - 0.5, column * width - 0.5
    low, left = np.floor(y).astype(int), np.floor(x).astype(int)
    up, right = (y - low)[..., None], (x - left)[..., None]
    below, above = (np.clip(low + one, 0, height - 1) for one in (0, 1))
    west, east = left % width, (left + 1) % width
    lower = pixels[below, west] * (1 - right) + pixels[below, east] * right
    return lower * (1 - up) + (pixels[above, west] * (1 - right) + pixels[above, east] * right) * up


def _finite(pixels: np.ndarray) -> np.ndarray:
    return np.nan_to_num(pixels, nan=0.0, posinf=65504.0, neginf=0.0)


def _density(luminance: np.ndarray) -> np.ndarray:
    """Density per steradian on a grid of at most LARGEST_GRID cells."""
    height, width = luminance.shape
    repeat_rows, repeat_columns = -(-SMALLEST_GRID[0] // height), -(-SMALLEST_GRID[1] // width)
    luminance = np.repeat(np.repeat(luminance, repeat_rows, axis=0), repeat_columns, axis=1)
    height, width = luminance.shape
    rows, columns = min(height, LARGEST_GRID[0]), min(width, LARGEST_GRID[1])
    row_of, column_of = np.arange(height) * rows // height, np.arange(width) * columns // width
    total, count = np.zeros((rows, columns)), np.zeros((rows, columns))
    np.add.at(total, (row_of[:, None], column_of[None]), luminance)
    np.add.at(count, (row_of[:, None], column_of[None]), 1.0)
    cells = total / count
    # Radiance is filtered over the neighbours, so a cell beside a bright one holds light too.
    cells = (cells + np.maximum(np.roll(cells, 1, 1), np.roll(cells, -1, 1)) * 0.25) / 1.25
    padded = np.pad(cells, ((1, 1), (0, 0)), mode="edge")
    cells = (cells + np.maximum(padded[:-2], padded[2:]) * 0.25) / 1.25
    edges = np.sin((np.arange(rows + 1) / rows - 0.5) * np.pi)
    solid_angle = np.diff(edges)[:, None] * (2 * np.pi / columns)
    flux = float((cells * solid_angle).sum())
    if not flux > 0:
        return np.full((rows, columns), 1.0 / (4 * np.pi))
    return 0.95 * cells / flux + 0.05 / (4 * np.pi)
