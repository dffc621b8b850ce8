"""Light points for surfaces that no depth map covers: those that rays meet, and glass.

Each sample draws one point on each lamp (where there are many, on some of them by chance), some on emissive
triangles and some directions of the world, the same ones for all pixels; who lights surfaces by them traces what stands
between. A ray of a lobe may find the same light: shaders weigh both by the power heuristic, with the rates that the
rows and the constants tell.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from ..frame.picture import Frame
from ..frame.technique import Service
from ..gfx.context import to_hold
from ..materials.compiler import may_emit
from ..sources import lights
from .caustic_casters import MESHES, WORLD, bright_world
from .emissive_triangles import PATHS, EmissiveTriangles

SHOWN_THROUGH = "transmission.shown"  # image: the same of what is seen through glass
SHOWN = "reflection.shown"  # image: how much surfaces reflect that reflections show, summed up over samples


@dataclass(frozen=True)
class ShadedLobes(Service):
    """Lobes up to `roughness`, and glass, show surfaces with their own materials: others leave them out."""

    name = "shaded_lobes"
    roughness: float


def shaded_roughness(frame: Frame) -> float:
    """Up to where lobes are shaded so; -1 where none are."""
    lobes = frame.service(ShadedLobes)
    return lobes.roughness if lobes else -1.0


class PathSources:
    """Light sources that surfaces lit by any of these paths (names of Visibility) may see."""

    def __init__(self, paths: Sequence[str], use: str, directions: int = 2, emissive_points: int = 2):
        self.paths, self.use = tuple(paths), use
        self.directions, self.emissive_points = directions, emissive_points
        self._sources = lights.Sources()
        self._emitters: list[lights.Emitter] = []
        self._triangles: EmissiveTriangles | None = None
        self.world_flags = 0  # of lights.py: which paths see the world

    def begin(self, frame: Frame) -> None:
        """Once per picture, before `rows`."""
        wanted = sum(PATHS[path] for path in self.paths)
        self._emitters = [emitter for emitter in frame.emitters if emitter.flags & wanted]
        used = frame.snapshot.used_materials
        self._triangles = None
        if any(may_emit(frame.snapshot.materials[slot].graph) for slot in used):
            triangles = EmissiveTriangles(frame, self.paths)
            self._triangles = triangles if triangles.power > 0 else None
        seen = frame.snapshot.world.visibility
        self.world_flags = sum(PATHS[path] * getattr(seen, path) for path in self.paths)
        if frame.environment.power <= 0:
            self.world_flags = 0

    @property
    def kinds(self) -> int:
        """Of all these, as bits, for LIGHT_KINDS of a program."""
        others = (self._triangles is not None) << lights.SURFACE | bool(self.world_flags) << lights.DIRECTION
        return to_hold(lights.kinds_of(self._emitters) | others, -1)

    @property
    def most_lamps(self) -> int:
        """In a sample."""
        return lights.MOST_LIGHTS - self.directions - self.emissive_points

    @property
    def emissive_power(self) -> float:
        """Of all triangles, W/sr: luminance times area. 0 where none emits."""
        return self._triangles.power if self._triangles else 0.0

    def rows(self, frame: Frame, by_photons: Collection[str] = ()) -> list[np.ndarray]:
        """Points of this sample, for lights.Sources. More lamps than fit are drawn by chance, and count more: both as
        points and where a ray meets them. Light of lamps with the keys `by_photons` passes no glass on its way."""
        rows = []
        count = len(self._emitters)
        chosen = np.arange(count)
        if count > self.most_lamps:
            chosen = (np.arange(self.most_lamps) + frame.uniform(f"{self.use}/choose")) * count / self.most_lamps
            chosen = chosen.astype(int)
        for number in chosen:
            emitter = self._emitters[number]
            narrow, drawn = emitter.is_narrow(frame.receivers), frame.random_volume(f"{self.use}/light")
            sample = emitter.narrow_sample(*drawn[:2]) if narrow else emitter.sample(*drawn)
            weight = max(count / self.most_lamps, 1.0)
            row = emitter.row(sample, 0, int(emitter.light.cast_shadow), weight)
            row[lights.LIGHT.at.flags] += lights.NARROW_FLAG * narrow
            row[lights.LIGHT.at.flags] += lights.GLASS_BLOCKS_FLAG * (emitter.light.key in by_photons)
            rows.append(row)
        if self._triangles is not None:
            for k in range(self.emissive_points):
                index = frame.sample * self.emissive_points + k
                drawn = frame.random_volume(f"{self.use}/emissive", index)
                blocked = lights.GLASS_BLOCKS_FLAG * (MESHES in by_photons)
                flags, samples = lights.SHADOW_FLAG + blocked, frame.settings.samples
                rows.append(self._triangles.row(drawn, self.emissive_points, flags, samples=samples))
        if self.world_flags:
            seen = lights.SHADOW_FLAG + self.world_flags
            bright = bright_world(frame) if WORLD in by_photons else None
            numbers = range(frame.sample * self.directions, (frame.sample + 1) * self.directions)
            chosen = np.array([frame.random(f"{self.use}/world", index) for index in numbers]).reshape(-1, 2)
            for direction, radiance, density in zip(*frame.environment.draw(*chosen.T)):
                light = radiance / density
                blocked = lights.GLASS_BLOCKS_FLAG * (bright is not None and bright.holds(radiance))
                rows.append(lights.direction_row(direction, light, density, seen + blocked, 0, 1, self.directions))
        return rows

    def block(self, rows: list[np.ndarray]):
        """The uniform block `sources` with these rows."""
        return self._sources.set(rows)

    def release(self) -> None:
        self._sources.release()
        self._emitters, self._triangles = [], None
