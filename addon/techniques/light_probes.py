"""Light probes: before the first sample, a few rays tell which light reaches the picture, and where points are needed.

Two questions are asked at pixels of a coarse grid, by rays through the hierarchy of all triangles:

- From which directions does the world's light arrive? (108 probes, or 432 where that is little beside the picture; 512
  directions.) Directions of the world are then drawn in proportion to radiance times usefulness: a room lit through a
  window spends them on the window. What each probe sees is also left for tables of single tiles (environment_light.py).
- How much do single points of a light differ in what they bring? (432 probes, 8 to 32 points per light; beyond a door
  ajar 8 find a quarter of the variance that 32 find. Of the guided world the directions above tell it: a point brings
  radiance over density times what the probe sees of its cell.) Their variance, in units of the light that the probe
  gets, is the error that one point leaves; sources/rates.py turns it into the number of points per sample. Only for
  pictures whose samples are shown together: otherwise every sample has one point per light.

| cost | once per picture |
|---|---|
| rays | 55,296 or 221,184 for the world, 3,456 to 13,824 per light |
| readback | 1, with the bounds of receivers; 16 bytes per probe and direction, 16 per probe and light |

Bias: none; only the density of samples depends on it. Fails: where the scene has too many triangles for a hierarchy,
every light gets one point per sample and the world is drawn by its radiance alone.
"""

from __future__ import annotations

import numpy as np

from ..frame.picture import Frame
from ..frame.settings import Settings
from ..frame.technique import Param, Technique
from ..gfx import images, passes
from ..gfx.readback import Reading
from ..lighting.light_rates import WORLD, LightRates
from ..sampling.sequence import point, third
from ..scene import acceleration
from ..scene.view import VIEW
from ..snapshot.scene import Snapshot, World
from ..sources import environment, lights
from ..sources.rates import USUAL_SAMPLES, Rate, allocate, budget_for, directions_for, paying
from ..surfaces.draw import SURFACE_TEXTURES, SURFACES, surface_bindings
from .accumulated_maps import AccumulatedMaps
from .shadows_by_light import ShadowsByLight, seen_in_parts

GUIDE_PROBES, SPREAD_PROBES = (12, 9), (24, 18)
FINE_PROBES = (24, 18)  # for guiding, where their rays are few
FEW = 0.3  # guiding rays per pixel and sample
POINTS, FEWEST_POINTS, RAYS_OF_PROBE = 32, 8, 128  # of each light at most, at least, and of all
# relMSE that one lit sample leaves at edges, by four points of the film: of the sample scenes at 256x192, 16 samples.
EDGES = 0.04
ROUNDING = 1e-5  # of sums of POINTS equal numbers and their squares
MOST_LIGHTS = 16  # more are drawn at random, and then each sample has a point on each that was drawn
RAYS = (*acceleration.HIERARCHY_TEXTURES, *SURFACE_TEXTURES)
GUIDE = passes.fullscreen_program(
    "environment guide",
    "light/guide.frag.glsl",
    textures=RAYS,
    blocks=((VIEW, "film_view"),),
    constants=(
        ("INT", "columns"), ("INT", "rows"), ("IVEC2", "probes"), ("FLOAT", "offset_size"),
    ),
    outputs=(("VEC2", "out_useful"),),
)  # fmt: skip
SPREAD = passes.fullscreen_program(
    "light spread",
    "light/spread.frag.glsl",
    textures=RAYS,
    blocks=((VIEW, "film_view"), (lights.SOURCES, "sources")),
    constants=(("IVEC2", "probes"), ("FLOAT", "offset_size"), ("INT", "points")),
    outputs=(("VEC4", "out_moments"),),
)


class LightProbes(Technique):
    name = "light_probes"
    label = "Light probes"
    params = (
        Param(
            "guiding", "Guiding", True,
            "Sample more directions of the world from where its light reaches the picture",
            draft=False,
        ),
        Param(
            "maps", "Maps per sample", 8.0,
            "Number of depth maps in each sample of a final render, distributed among lights and world in proportion "
            "to their error; more are used where that leaves too much noise. 0: one for every light",
            0.0, 64.0,
        ),
    )  # fmt: skip
    reads = SURFACES
    provides = (LightRates,)

    def __init__(self):
        self._sources = lights.Sources()

    def skip(self, snapshot: Snapshot, settings: Settings) -> str | None:
        if not snapshot.instances:
            return "the scene has no surface"
        if not _lit(snapshot.world):
            if not any(np.any(light.strength) for light in snapshot.lights):
                return "the scene has no light to look for"
            if not settings.schedule.may_measure:
                return "every sample is shown, so each has one point per light"
        return acceleration.too_many(snapshot)

    def begin(self, frame: Frame) -> None:
        # All is drawn before the first of it is read, and nothing yet known of the receivers.
        lit = _lit(frame.snapshot.world)
        guided = self._draw_guide(frame) if lit and frame.settings.get(self, "guiding") else None
        shares = frame.settings.schedule.may_measure and frame.settings.get(self, "maps") > 0
        trials = self._draw_trials(frame, lit) if shares else []
        if lit and guided is None:
            frame.environment.guide(None)
        if frame.receivers is None or not len(frame.receivers.distance):
            return
        found = LightRates()
        frame.provide(found)
        if guided is not None:
            found.world_seen = self._guide(frame, guided)
        if shares:
            self._share_out(frame, lit, trials, found)

    def _rays(self, frame: Frame) -> dict:
        hierarchy = frame.hierarchy()
        return {
            "textures": {
                **surface_bindings(frame), **hierarchy.textures,
            },
            # By all that there is: what is seen is not known yet, and only densities depend on these rays.
            "constants": {"offset_size": 1e-6 * frame.geometry.size},
        }  # fmt: skip

    def _draw_guide(self, frame: Frame) -> Reading:
        """Ask probes for directions from which they see the world."""
        rays = self._rays(frame)
        rows, columns = environment.GUIDE_ROWS, environment.GUIDE_COLUMNS
        affordable = FEW * frame.size[0] * frame.size[1] * frame.settings.samples / (rows * columns)
        fine = frame.settings.schedule.may_measure and affordable >= FINE_PROBES[0] * FINE_PROBES[1]
        grid = FINE_PROBES if fine else GUIDE_PROBES
        image = images.pool.take(rows * columns, grid[0] * grid[1], "RG32F")
        passes.fullscreen(
            GUIDE,
            images.Target((image,)),
            textures=rays["textures"],
            blocks={"film_view": frame.view_block},
            constants={**rays["constants"], "columns": columns, "rows": rows, "probes": grid},
        )
        return frame.readback.later(image)

    def _guide(self, frame: Frame, drawn: Reading) -> np.ndarray:
        """Guide directions of the world; what each probe sees of it, as in LightRates.world_seen."""
        found = drawn.pixels()
        grid = FINE_PROBES if len(found) == FINE_PROBES[0] * FINE_PROBES[1] else GUIDE_PROBES
        found = found.reshape(grid[1], grid[0], environment.GUIDE_ROWS, environment.GUIDE_COLUMNS, 2)
        useful, facing = found[..., 0], found[..., 1].sum(axis=(0, 1))
        frame.environment.guide(useful.mean(axis=(0, 1)), useful.sum(axis=(0, 1)) / np.maximum(facing, 1e-30))
        frame.count(self, "guiding rays", found[..., 0].size)
        return useful

    def _draw_trials(self, frame: Frame, lit: bool) -> list[Reading]:
        """Ask probes what points of each light, and of the world where it is not guided, bring."""
        emitters, points = self._asked(frame, lit)
        trials = [self._points_of(frame, emitter, points) for emitter in emitters]
        if lit and not frame.settings.get(self, "guiding"):
            frame.environment.guide(None)
            trials.append(self._points_of_world(frame, points))
        return self._draw_moments(frame, trials)

    @staticmethod
    def _asked(frame: Frame, lit: bool) -> tuple[list[lights.Emitter], int]:
        """Lights that are asked about, and how many points of each."""
        emitters = frame.emitters if len(frame.emitters) <= MOST_LIGHTS else []
        return emitters, int(np.clip(RAYS_OF_PROBE // max(len(emitters) + lit, 1), FEWEST_POINTS, POINTS))

    def _share_out(self, frame: Frame, lit: bool, trials: list[Reading], into: LightRates) -> None:
        """Rates of the lights and of WORLD, and what they follow from, into `into`."""
        emitters, asked_points = self._asked(frame, lit)
        if not emitters and not lit:
            return
        seen = into.world_seen  # where the world is guided
        found = [drawn.pixels()[..., :2].astype(np.float64) for drawn in trials]
        if seen is not None:
            repeat = SPREAD_PROBES[0] // seen.shape[1]
            of_world = self._moments_of_world(frame, seen, asked_points)
            found.append(of_world.repeat(repeat, axis=0).repeat(repeat, axis=1).reshape(1, -1, 2))
        moments = np.concatenate(found)
        variance = relative_variance(moments[..., 0], moments[..., 1])
        # Lights in one place count as one, so that two half lights are sampled like the whole.
        places = [_place(emitter) for emitter in emitters] + [WORLD] * lit
        distinct = list(dict.fromkeys(places))
        joint = [sum(np.sqrt(v) for v, place in zip(variance, places) if place == one) ** 2 for one in distinct]
        share = relative_share(moments[..., 0])
        film = [EDGES * sum(s for s, place in zip(share, places) if place == one) ** 2 for one in distinct]
        # Soft maps show a light as a whole: few samples need no more of them, but where none has one.
        by_light = frame.plan.runs(ShadowsByLight.name)
        points = frame.plan.runs(AccumulatedMaps.name) or (by_light and all(seen_in_parts(frame, e) for e in emitters))
        keys = [emitter.light.key for emitter in emitters] + [WORLD] * lit
        by_place = [self._rates(frame, lit, joint, film, all_points) for all_points in (points, True)]
        rates, of_points = (dict(zip(distinct, one)) for one in by_place)
        into.by_light = {key: rates[place] for key, place in zip(keys, places)}
        into.of_points = {key: of_points[place] for key, place in zip(keys, places)}
        # That of a place is shared by its lamps.
        known = np.nan_to_num(np.array(joint, float), nan=0.0, posinf=1e30)
        into.variance = {
            key: float(known[distinct.index(place)]) / places.count(place) for key, place in zip(keys, places)
        }
        frame.count(self, "probing rays", (len(moments) - (seen is not None)) * moments.shape[1] * asked_points)

    def _rates(self, frame: Frame, lit: bool, joint: list, film: list, points: bool) -> list[Rate]:
        """Rates of lights of the variances `joint`, of which the last is the world's if it is `lit`. `points`: whether
        points show them, of which few samples need several."""
        samples = frame.settings.samples
        planned = samples if points else max(samples, USUAL_SAMPLES)
        alone = not frame.plan.fills("indirect")
        # Light groups that are added up share them out.
        asked = max(frame.settings.get(self, "maps") / frame.settings.takes, 1.0)
        budget = budget_for(joint, planned, paying(asked, planned, alone), film)
        rates = allocate(joint, samples, budget, film)
        if lit:
            rates[-1] = directions_for(joint[-1], samples, rates[-1], asked, alone)
        if any(material.transparent or material.soft for material in frame.materials.compiled):
            # Layers and soft lobes are drawn at random in each sample: a light that misses samples would see few.
            rates = [Rate(max(rate.exponent, 0)) for rate in rates]
        return rates

    def _points_of(self, frame: Frame, emitter: lights.Emitter, count: int) -> list[np.ndarray]:
        seed = frame.settings.seed
        samples = [emitter.sample(*point(k, "light", seed), third(k, "light", seed)) for k in range(count)]
        shadowed, total = int(emitter.light.cast_shadow), frame.settings.samples
        return [emitter.row(sample, 0, shadowed, points=total) for sample in samples]

    def _points_of_world(self, frame: Frame, count: int) -> list[np.ndarray]:
        flags = lights.SHADOW_FLAG + lights.DIFFUSE_FLAG
        chosen = np.array([point(k, "environment", frame.settings.seed) for k in range(count)])
        drawn = zip(*frame.environment.draw(*chosen.T))
        return [lights.direction_row(d, radiance / density, density, flags, 0, 1) for d, radiance, density in drawn]

    @staticmethod
    def _moments_of_world(frame: Frame, seen: np.ndarray, count: int) -> np.ndarray:
        """(rows, columns, 2) by probe, of directions as guided; what the probe sees there is that of their cell."""
        chosen = np.array([point(k, "environment", frame.settings.seed) for k in range(count)])
        direction, radiance, density = frame.environment.draw(*chosen.T)
        rows, columns = seen.shape[2:]
        row = np.clip((direction[:, 2] + 1) / 2 * rows, 0, rows - 1).astype(int)
        turn = np.arctan2(direction[:, 1], direction[:, 0]) / (2 * np.pi) + 0.5
        column = np.clip(turn * columns, 0, columns - 1).astype(int)
        brings = np.abs(radiance) @ lights.LUMINANCE / density
        irradiance = seen[:, :, row, column] * brings
        return np.stack([irradiance.mean(axis=-1), (irradiance**2).mean(axis=-1)], axis=-1)

    def _draw_moments(self, frame: Frame, trials: list[list[np.ndarray]]) -> list[Reading]:
        """(lights, probes, 2): mean and mean square of a point's irradiance at each probe that sees a surface; some of
        the lights in each reading."""
        if not trials:
            return []
        rays = self._rays(frame)
        out = []
        points = len(trials[0])
        step = lights.MOST_LIGHTS // points  # of one uniform block
        for first in range(0, len(trials), step):
            part = trials[first : first + step]
            image = images.pool.take(SPREAD_PROBES[0] * SPREAD_PROBES[1], len(part), "RGBA32F")
            passes.fullscreen(
                SPREAD,
                images.Target((image,)),
                textures=rays["textures"],
                blocks={
                    "film_view": frame.view_block,
                    "sources": self._sources.set([row for rows in part for row in rows]),
                },
                constants={**rays["constants"], "probes": SPREAD_PROBES, "points": points},
            )
            out.append(frame.readback.later(image))
        return out

    def release(self) -> None:
        self._sources.release()


def relative_variance(mean: np.ndarray, square: np.ndarray) -> np.ndarray:
    """(L,) variance that a single point of each light leaves, relative to the light at the probes, as relMSE counts it.

    `mean`, `square`: (L, P) moments of a point's irradiance.
    """
    total = mean.sum(axis=0)
    scale = total**2 + (0.1 * total.mean()) ** 2
    # Sums of equal points in float32 differ by their rounding.
    spread = np.where(square > (1 + ROUNDING) * mean**2, square - mean**2, 0.0)
    return (spread / np.maximum(scale, 1e-300)).mean(axis=1)


def relative_share(mean: np.ndarray) -> np.ndarray:
    """(L,) share of each light at the probes; `mean`: (L, P) irradiance."""
    return (mean / np.maximum(mean.sum(axis=0), 1e-300)).mean(axis=1)


def _lit(world: World) -> bool:
    return bool(np.any(world.color)) and (world.visibility.diffuse or world.visibility.glossy)


def _place(emitter: lights.Emitter) -> tuple:
    shape = (emitter.centre, emitter.u, emitter.v, emitter.axis)
    return (emitter.kind, emitter.flags, emitter.radius, *(part.tobytes() for part in shape))
