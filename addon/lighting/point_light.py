"""Direct light at points of surfaces: the light loop's program over images of points, with rays as visibility.

What the camera does not see (the far side of an ear, the inside of a niche) is lit by the same points of lamps, of the
world and of emissive meshes for all of it, drawn here with numbers of their own. In pictures of few samples each source
has several, so that a picture of one sample is smooth.

| cost | per sample |
|---|---|
| rays | a point: one for each point of a light source |
| passes | 1 over the points for each 64 points of light sources; lights that other objects block are asked apart |
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import replace

import numpy as np

from ..frame.picture import Frame
from ..gfx import images, passes
from ..gfx.interface import answered
from ..materials.compiler import may_emit
from ..sampling.sequence import uniform
from ..sources import lights
from . import caustic_casters, linked
from .asked import asked
from .emissive_triangles import EmissiveTriangles
from .loop import OUTPUTS, lighting
from .visibility import RAYS, ray_bindings

FEW_POINTS = 16  # on each lamp, of the world and of emissive meshes, in a picture of few samples
OTHER_POINTS = 4  # of the world and of emissive meshes, in each sample at least
LIGHTING = replace(lighting(RAYS, False), name="light of points")

# With where mirrors at the points would send it, for targets of three images.
LIGHTING_WITH_WAYS = replace(
    LIGHTING, name="light of points and its ways", defines=(*LIGHTING.defines, ("WAYS", "1")),
    outputs=(*OUTPUTS, ("VEC4", "out_ways")),
)  # fmt: skip
# Of light in directions about the points' normals alone.
LIGHTING_IN_LOBES = replace(
    LIGHTING, name="light of points in lobes", defines=(*LIGHTING.defines, ("IN_LOBES", "1")),
    constants=(*LIGHTING.constants, ("FLOAT", "lobe_power")),
)  # fmt: skip


class PointLight:
    """Lights images of points. A technique owns one, calls `begin` once a picture and `add` in each sample.

    In a picture of few samples, so many points are drawn on each lamp (`few`), and in each sample at least so many of
    the world and of emissive meshes (`others`); with `each`, so many of every source in each sample, whatever the
    picture's samples. `reflected`: lamps that give no light to reflections are left out. `sharpness`: how many times as
    many points a light counts as having where surfaces are near to one of them (lights.footprint): more lose less
    light, but leave bright spots.
    """

    def __init__(
        self, use: str, few: int = FEW_POINTS, others: int = OTHER_POINTS, each: int | None = None,
        reflected: bool = False, sharpness: float = 1.0,
    ):  # fmt: skip
        self._use = use  # of the sequence
        self._few, self._others, self._each = few, others, each
        self._reflected, self._sharpness = reflected, sharpness
        self._sources = lights.Sources()
        self._emissive: EmissiveTriangles | None = None

    def begin(self, frame: Frame) -> None:
        """Find the meshes that emit."""
        used = frame.snapshot.used_materials
        self._emissive = None
        if any(may_emit(frame.snapshot.materials[material].graph) for material in used):
            triangles = EmissiveTriangles(frame, ("diffuse",))
            self._emissive = triangles if triangles.power > 0.0 else None

    def add(
        self, frame: Frame, surfaces: dict[str, images.Image], target: images.Target, number: int | None = None,
        instances: images.Image | None = None, without: frozenset[int] = frozenset(), photons: bool = False,
        lobe: float = 0.0,
    ) -> tuple[int, int]:  # fmt: skip
        """Add this sample's diffuse and glossy direct light, or that of sample `number`, on `surfaces` (by the names of
        SURFACE_IMAGES) to the two images of `target`. Of three, the second one gets what falls across its direction and
        the third where mirrors would send it, by luminance. `instances`: of which instance each point is (z: its row in
        the geometry's image), for lights that leave out objects. `without`: ids of lamps that are left out.
        `photons`: what glass passes of light that photons answer for arrives with these; of a target of three, w of the
        second says how much is of such light. `lobe`: above 0 light counts by that power of the cosine,
        normalized, as at the normal. Returns the numbers of passes and of rays a point."""
        number = frame.sample if number is None else number
        by_blockers: dict[frozenset[int], list[np.ndarray]] = {}  # that let light pass
        for passing, row in (*self._lamps(frame, number, without, photons), *self._emitted(frame, number, photons)):
            by_blockers.setdefault(passing, []).append(row)
        by_blockers[frozenset()] = by_blockers.get(frozenset(), []) + list(self._world(frame, number, photons))
        rows = [row for some in by_blockers.values() for row in some]
        drawn = 0
        in_lobes = {"lobe_power": lobe} if lobe else {}
        bound = {f"surface_{name}": image for name, image in surfaces.items()}
        with_ways = len(target.colors) > 2
        program = asked(frame, LIGHTING_IN_LOBES if lobe else LIGHTING_WITH_WAYS if with_ways else LIGHTING, bound)
        with ExitStack() as stack:
            if instances is not None and linked.has_links(rows):
                groups = stack.enter_context(images.borrowed(instances.width, instances.height, "R32F"))
                linked.find_groups(frame, instances, groups)
                program = answered(program, (linked.LINKS,))
                bound["receiver_groups"] = groups.colors[0]
            for passing, of_those in by_blockers.items():
                textures, constants = ray_bindings(frame, passing)
                for first in range(0, len(of_those), lights.MOST_LIGHTS):
                    some = of_those[first : first + lights.MOST_LIGHTS]
                    passes.fullscreen(
                        program, target, blend="ADDITIVE_PREMULT",
                        textures={**bound, **textures, "energy_table": frame.materials.energy_table},
                        blocks={"film_view": frame.view_block, "sources": self._sources.set(some)},
                        constants={"light_count": len(some), "traced_roughness": -1.0, **constants, **in_lobes},
                    )  # fmt: skip
                    drawn += 1
        return drawn, len(rows)

    def _points(self, frame: Frame, least: int) -> int:
        """On a source in a sample."""
        return max(self._few // frame.settings.samples, least) if self._each is None else self._each

    def _lamps(
        self, frame: Frame, sample_number: int, without: frozenset[int], photons: bool
    ) -> Iterator[tuple[frozenset[int], np.ndarray]]:
        """Points on all lamps, several on each in a picture of few samples; of many lamps some, by power. With each the
        groups of blockers that let its light pass."""
        settings = frame.settings
        emitters = [
            one
            for one in frame.emitters
            if one.flags & lights.DIFFUSE_FLAG and (one.light.bounces or not self._reflected) and id(one) not in without
        ]
        chosen = [(emitter, 1.0) for emitter in emitters]
        if len(chosen) > FEW_POINTS:
            power = np.array([emitter.power for emitter in emitters])
            chance = np.minimum(FEW_POINTS * (0.8 * power / max(power.sum(), 1e-300) + 0.2 / len(power)), 1.0)
            edges = np.concatenate([[0.0], np.cumsum(chance)])
            marks = np.arange(FEW_POINTS) + uniform(sample_number, f"{self._use}/choose", settings.seed)
            picked = np.unique(np.searchsorted(edges, marks[marks < edges[-1]], side="right") - 1)
            chosen = [(emitters[k], 1.0 / chance[k]) for k in picked]
        for emitter, weight in chosen:
            each, narrow = self._points(frame, 1) if emitter.extended else 1, emitter.is_narrow(frame.receivers)
            for number in range(sample_number * each, (sample_number + 1) * each):
                drawn = frame.random_volume(f"{self._use}/light", number)
                sample = emitter.narrow_sample(*drawn[:2]) if narrow else emitter.sample(*drawn)
                points = self._sharpness * each * settings.samples / weight
                shadowed = int(emitter.light.cast_shadow)
                row = emitter.row(sample, 0, shadowed, weight, each, points)
                row[lights.LIGHT.at.flags] += lights.NARROW_FLAG * narrow
                row[lights.LIGHT.at.flags] += lights.GLASS_BLOCKS_FLAG * (
                    photons and caustic_casters.answered(frame, emitter)
                )
                yield emitter.light.links.passing, row

    def _world(self, frame: Frame, sample_number: int, photons: bool) -> Iterator[np.ndarray]:
        world = frame.snapshot.world
        if not frame.environment.power > 0 or not world.visibility.diffuse:
            return
        each = self._points(frame, self._others)
        numbers = range(sample_number * each, (sample_number + 1) * each)
        drawn = np.array([frame.random(f"{self._use}/world", number) for number in numbers])
        flags = lights.SHADOW_FLAG + lights.DIFFUSE_FLAG + lights.EVEN_FLAG * world.even
        bright = caustic_casters.bright_world(frame) if photons else None
        # Points lie where the camera sees nothing, too, as on the far side of a body that light comes through.
        for direction, radiance, density in zip(*frame.environment.draw(*drawn.T, frame.environment.is_shut_out)):
            blocked = lights.GLASS_BLOCKS_FLAG * (bright is not None and bright.holds(radiance))
            yield lights.direction_row(direction, radiance / density, density, flags + blocked, 0, 1, each)

    def _emitted(self, frame: Frame, sample_number: int, photons: bool) -> Iterator[tuple[frozenset[int], np.ndarray]]:
        if self._emissive is None:
            return
        each = self._points(frame, self._others)
        for number in range(sample_number * each, (sample_number + 1) * each):
            numbers = frame.random_volume(f"{self._use}/emissive", number)
            samples = self._sharpness * frame.settings.samples
            blocked = lights.GLASS_BLOCKS_FLAG * (photons and caustic_casters.meshes_answered(frame))
            row = self._emissive.row(numbers, each, lights.SHADOW_FLAG + blocked, samples=samples)
            yield self._emissive.passing_at(numbers[0]), row

    def release(self) -> None:
        self._sources.release()
        self._emissive = None
