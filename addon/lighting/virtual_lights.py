"""Virtual lights: points of surfaces that light the picture, with the radiance that they reflect. For any gatherer.

Instant radiosity (Keller 1997) starts paths at the lights; in a scene of rooms most of them end where nobody looks. So
points are found from the picture, as in bidirectional instant radiosity (Segovia et al. 2006): at P pixels of a coarse
grid, shifted in every sample, R cosine-distributed rays are traced, and where one meets a surface, at y, stands a
candidate. Its radiance is what light sources send to y straight (all kinds of lights, emissive meshes and the world, as
points shared by the sample) and what a path on from y finds in up to `bounces` reflections in all:

    L(y) = rho / pi * (E(y) + sum over further bounces of their albedos x E there)

From its second reflection on a path ends by lot, in proportion to its albedos. The next surfaces z_i that the paths of
GROUP candidates y_j meet, which lie beside each other and face alike, are shared by them (path reuse, Bekaert et al.
2002): j takes the part p_j(z_i) / sum over k of p_k(z_i) of what z_i sends, p_k = cos cos V / (pi d^2), the density of
its own directions there. No candidate's path is lost, and single ones weigh less. Any probe could have found y, so the
density of candidates there is the sum over all probes x (the balance heuristic)

    n(y) = sum over x of  R cos_x cos_y V(x, y) / (pi |x - y|^2)      per m2

and a candidate stands for the area 1 / n(y): it has the intensity L / n. `count` of them are kept by systematic
resampling in proportion to L, which is what they bring to the picture (L / n times the probes that see them), each
weighted by the inverse of its chance (Georgiev & Slusallek 2010 keep by the same measure, by lot): along a curve
through space, so that they spread, and cell by cell, so that a candidate more or less changes what is kept nearby, not
the whole set: a viewport shows the picture of a final render to within 2/255 in .998 of the pixels after eight samples
when the camera has moved by a micrometre, .991 without cells, at the same error. Only for those that are kept the
densities are traced.

Colours of a path's surfaces are those of the picture where the camera sees them, else the mean of the material
(reflectance.py), in both cases with a lobe of microfacets (shaders/indirect/albedo.glsl). L is the radiance towards the
probe whose ray has found y. A virtual light shines evenly, but its mean over those who find it is what they get of the
lobe together: the energy that is seen is right, and only among those who see it is its direction blurred.

| cost | per sample, with P = 192 probes and N virtual lights |
|---|---|
| candidates | 1152, or 4 N if that is more |
| rays | 2 per bounce + 19 for each candidate, then 192 for the density of each virtual light |
| readback | 160 bytes per candidate, 768 per virtual light |

Bias, in diffuse and glossy indirect light:

- Points that only pixels see which no probe of a sample came near are missing in that sample. With 192 probes, that is
  light which reaches less than about half a hundredth of the picture. In the town of the sample with instances, one
  bounce of the sky has 0.977 of Cycles' mean (0.953 with 96 probes, 0.99 with 384).
- A virtual light that stands for the area A in one of n samples is no brighter at any distance than at
  sqrt(A / (pi n)), the radius of a disc of its part: what a wall seen at a grazing angle sends to what lies beside it
  is otherwise without bound. The loss is a share of a single sample and falls with n.
- Gloss is shared evenly among the pixels that see it. Its sum is right: in the sample with a window, where low sun
  falls on varnished boards, the mean of the pass is 1.007 of Cycles' (1.041 while gloss counted as diffuse, since most
  of that light goes to walls behind the camera; 0.97 with a layer's losses as the camera's view has them).
- Normals are those of the triangles: a coarse smooth lamp shade about a lamp sends 3 % too much.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache

import numpy as np

from ..frame.run import Frame
from ..gfx import images, passes
from ..gfx.context import to_hold
from ..gfx.library import Program
from ..gfx.struct import Block
from ..kernels.morton import BITS, morton_codes
from ..materials.compiler import may_emit
from ..scene import acceleration
from ..scene.view import VIEW
from ..sources import lights
from ..surfaces.draw import SURFACE_TEXTURES, surface_bindings
from ..surfaces.reflectance import Reflectance
from .caustic_casters import answered
from .emissive_triangles import EmissiveTriangles
from .media import MediaService, attenuated

PROBES, DRAFT_PROBES = (16, 12), (12, 8)
LEAST_RAYS, DRAFT_RAYS = 6, 3  # per probe
CHOICE = 4  # candidates at least, for each virtual light that is kept
NEAR = 0.1  # the bound of 128 virtual lights, in median distances of what is seen
LAMP_POINTS = 16  # on all lamps, which the paths of a sample look for
OTHER_POINTS = (32, 24)  # of emissive surfaces and of the world: of one of them, or of each of both
GROUP = 16  # candidates that share the next surfaces of their paths
FLOOR = 1.0  # share of the mean importance that every candidate keeps
CELL = 8  # virtual lights of a cell in which they are chosen by themselves
FEW = 2048  # at least, of the lights of a cell times all of them
MOST_VIRTUAL = 2048

PATH_TEXTURES = (
    *acceleration.HIERARCHY_TEXTURES, *SURFACE_TEXTURES, ("RGBA32F", "energy_table"), ("RGBA32F", "reflectance"),
)  # fmt: skip
PATH_BLOCKS = ((VIEW, "film_view"), (lights.SOURCES, "sources"))
PATH_CONSTANTS = (
    ("INT", "light_count"), ("FLOAT", "offset_size"), ("INT", "bounces"),
)  # fmt: skip
PROBE_CONSTANTS = (("IVEC2", "probes"), ("INT", "rays"))


# Of each candidate: its place; its normal; radiance of what its own path alone says, w: luminance of the part that was
# reflected at least once less than allowed; diffuse albedo, w: that luminance of what comes from the next surface; the
# place of that; what comes from there. Two numbers of the next surface's normal stand in w of normal and next_radiance,
# the third one's sign in w of next_point: a framebuffer has six images at most.
FOUND = ("point", "normal", "radiance", "albedo", "next_point", "next_radiance")


@cache
def candidates_program(kinds: int) -> Program:
    """For sources of these kinds (bits as in lights.LAMPS)."""
    return passes.fullscreen_program(
        "virtual light candidates",
        "indirect/candidates.frag.glsl",
        textures=PATH_TEXTURES,
        blocks=PATH_BLOCKS,
        constants=(*PATH_CONSTANTS, *PROBE_CONSTANTS),
        defines=(("LIGHT_KINDS", str(kinds)),),
        outputs=tuple(("VEC4", f"out_{name}") for name in FOUND),
    )


CANDIDATES = tuple(candidates_program(kinds) for kinds in (-1, 0))
DENSITY = passes.fullscreen_program(
    "virtual light density",
    "indirect/density.frag.glsl",
    textures=(*PATH_TEXTURES, ("RGBA32F", "candidate_point"), ("RGBA32F", "candidate_normal"), ("R32F", "kept")),
    blocks=PATH_BLOCKS,
    constants=(*PATH_CONSTANTS, *PROBE_CONSTANTS),
    outputs=(("FLOAT", "out_density"),),
)
PAIRS = passes.fullscreen_program(
    "virtual light pairs",
    "indirect/pairs.frag.glsl",
    textures=(
        *PATH_TEXTURES, ("RGBA32F", "candidate_point"), ("RGBA32F", "candidate_normal"), ("RGBA32F", "next_point"),
        ("RGBA32F", "next_radiance"), ("R32F", "grouped"),
    ),
    blocks=PATH_BLOCKS,
    constants=(*PATH_CONSTANTS, ("INT", "rays")),
    defines=(("GROUP", str(GROUP)),),
    outputs=(("FLOAT", "out_density"),),
)  # fmt: skip


@dataclass(frozen=True)
class Gather:
    """GLSL file with `vec3 virtual_gather(Surface, vec3 to_viewer, bool reflected, vec3 origin, float u, uint salt)`,
    the light by all virtual lights and what hides them, and what else it binds."""

    name: str
    file: str
    textures: tuple[tuple[str, str], ...] = ()
    constants: tuple[tuple[str, str], ...] = ()
    defines: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True)
class BoundGather:
    """A way to gather with what it binds for the virtual lights of a sample."""

    gather: Gather
    textures: dict[str, images.Image] = field(default_factory=dict)
    constants: dict[str, object] = field(default_factory=dict)


TRACED = Gather("rays", "indirect/traced_gather.glsl", constants=(("INT", "rays"),))


@dataclass(frozen=True)
class VirtualLightSet:
    """The virtual lights of one sample, as arrays and as the image that shaders/indirect/lights.glsl reads."""

    positions: np.ndarray  # (N, 3) relative to the render origin
    normals: np.ndarray  # (N, 3) unit; a virtual light shines to this side, Lambertian
    intensities: np.ndarray  # (N, 3) along the normal, W/sr
    footprints: np.ndarray  # (N,) least squared distance, m2, at which it stands for its area
    image: images.Image

    def __len__(self) -> int:
        return len(self.positions)


class VirtualLights:
    """Finds the virtual lights of each sample. A technique owns one, calls `begin`, then `make` in each sample,
    and binds `path_bindings`."""

    def __init__(self):
        self._sources = lights.Sources()
        self._source_block: Block | None = None
        self._source_count = 0
        self._emissive: EmissiveTriangles | None = None
        self.kinds = 0  # of the sources, as bits

    def make(self, frame: Frame, technique, count: int) -> VirtualLightSet:
        """About `count` virtual lights for this sample. Counts rays in the technique's ledger row."""
        self.draw_sources(frame)
        grid = Grid.of(frame, count)
        found = self._candidates(frame, grid)
        point, normal, radiance, shorter = self._radiances(frame, grid, found)
        keep, weight = _resample(point, radiance, count, frame.random("virtual lights/keep")[0])
        density = self._densities(frame, grid, found, keep)
        for image in found.colors:
            images.pool.give(image)
        keep, weight = keep[density > 0], (weight[density > 0] / density[density > 0])
        candidates = grid.count * grid.rays
        frame.count(technique, "path rays", candidates * (4 + 2 * frame.settings.bounces))
        frame.count(technique, "density rays", len(density) * grid.count)
        intensity = radiance[keep] * weight[:, None]
        footprints = lights.footprint(weight, frame.settings.samples)
        packed = np.zeros((3, max(len(keep), 1), 4), np.float32)
        if len(keep):
            packed[0, :, :3], packed[1, :, :3], packed[2, :, :3] = point[keep], normal[keep], intensity
            whole = np.abs(radiance[keep]) @ lights.LUMINANCE
            packed[0, :, 3] = np.abs(intensity) @ lights.LUMINANCE
            packed[2, :, 3] = footprints
            packed[1, :, 3] = shorter[keep] / np.maximum(whole, 1e-300)
        frame.count(technique, "virtual lights", len(keep))
        return VirtualLightSet(point[keep], normal[keep], intensity, footprints, images.upload_varying(packed))

    def draw_sources(self, frame: Frame) -> None:
        """Points on light sources for this sample's paths, and what materials reflect: what `path_bindings` needs."""
        rows = self._source_rows(frame)
        self._source_block, self._source_count = self._sources.set(rows), len(rows)

    def path_bindings(self, frame: Frame) -> dict:
        """What shaders/indirect/path.glsl needs: textures, blocks and constants of this sample."""
        hierarchy = frame.hierarchy("diffuse")
        return {
            "textures": {
                **surface_bindings(frame), "energy_table": frame.materials.energy_table,
                **hierarchy.textures, "reflectance": frame.kept(Reflectance).image,
            },
            "blocks": {"film_view": frame.view_block, "sources": self._source_block},
            "constants": {
                "light_count": self._source_count, "offset_size": frame.offset_size,
                "bounces": frame.settings.bounces,
            },
        }  # fmt: skip

    def begin(self, frame: Frame) -> None:
        """Find the light sources of this picture and what its materials reflect. Called in the stage of that name."""
        frame.kept(Reflectance).update(frame)
        emitters = frame.emitters
        self._emitters = [e for e in emitters if e.light.bounces and e.light.visibility.diffuse]
        self._emissive = None
        used = {slot for instance in frame.snapshot.instances for slot in instance.materials}
        if any(may_emit(frame.snapshot.materials[slot].graph) for slot in used):
            triangles = EmissiveTriangles(frame, ("diffuse",))
            self._emissive = triangles if triangles.power > 0 else None
        self._world = frame.environment.power > 0 and frame.snapshot.world.visibility.diffuse
        others = (self._emissive is not None) << lights.SURFACE | bool(self._world) << lights.DIRECTION
        self.kinds = to_hold(lights.kinds_of(self._emitters) | others, -1)

    def _source_rows(self, frame: Frame) -> list[np.ndarray]:
        """Points of this sample on lights, emissive surfaces and the world."""
        rows = self._light_rows(frame, LAMP_POINTS) if self._emitters else []
        seen = lights.SHADOW_FLAG + lights.DIFFUSE_FLAG
        share = OTHER_POINTS[self._emissive is not None and bool(self._world)]
        total = share * frame.settings.samples
        numbers = range(frame.sample * share, (frame.sample + 1) * share)
        if self._emissive is not None:
            for index in numbers:
                drawn = frame.random_volume_at(index, "virtual lights/emissive")
                rows.append(self._emissive.row(drawn, share, lights.SHADOW_FLAG, samples=total / share))
        if self._world:
            chosen = np.array([frame.random_at(index, "virtual lights/world") for index in numbers])
            for direction, radiance, density in zip(*frame.environment.draw(*chosen.T)):
                rows.append(lights.direction_row(direction, radiance / (density * share), density, seen, 0, 1))
        return rows

    def _light_rows(self, frame: Frame, share: int) -> list[np.ndarray]:
        """`share` points in all; several on each light, or one on each of some, drawn in proportion to power."""
        chosen = [(emitter, 1.0) for emitter in self._emitters]
        if len(chosen) > share:
            power = np.array([emitter.power for emitter in self._emitters])
            chance = np.minimum(share * (0.8 * power / max(power.sum(), 1e-300) + 0.2 / len(power)), 1.0)
            edges = np.concatenate([[0.0], np.cumsum(chance)])
            marks = np.arange(share) + frame.lot("virtual lights/choose")
            picked = np.unique(np.searchsorted(edges, marks[marks < edges[-1]], side="right") - 1)
            chosen = [(self._emitters[k], 1.0 / chance[k]) for k in picked]
        each = max(share // max(len(chosen), 1), 1)
        rows = []
        for emitter, weight in chosen:
            # A light without extent is one point however often it is drawn.
            points = each if emitter.has_span or emitter.radius > 0 else 1
            for k in range(points):
                sample = emitter.sample(*frame.random_volume_at(frame.sample * points + k, "virtual lights/light"))
                total = points * frame.settings.samples / weight
                shadowed = int(emitter.light.cast_shadow)
                row = emitter.row(sample, 0, shadowed, weight / points, points=total)
                row[0, 1] += lights.GLASS_BLOCKS_FLAG * answered(frame, emitter)
                rows.append(row)
        return rows

    def _probing(self, frame: Frame, grid: Grid) -> dict:
        bindings = self.path_bindings(frame)
        bindings["constants"] |= {"probes": grid.probes, "rays": grid.rays}
        return bindings

    def _candidates(self, frame: Frame, grid: Grid) -> images.Target:
        """FOUND, a row per probe."""
        size = (grid.rays, grid.count)
        found = images.Target(tuple(images.pool.take(*size, "RGBA32F") for _ in FOUND))
        program, bindings, media = (
            candidates_program(self.kinds),
            self._probing(frame, grid),
            frame.service(MediaService),
        )
        if media is not None:
            program = attenuated(program)
            bindings["textures"] |= media.bindings
        passes.fullscreen(program, found, **bindings)
        return found

    def _radiances(self, frame: Frame, grid: Grid, found: images.Target) -> tuple[np.ndarray, ...]:
        """Points, normals and radiances (N, 3) of all candidates, and luminances (N,) of what was reflected at least
        once less than allowed. Candidates share what their paths met next: `_shared`."""
        point, normal, radiance, albedo, _, later = (
            images.read(image).reshape(-1, 4).astype(np.float64) for image in found.colors
        )
        later[:, 3] = albedo[:, 3]
        later[~np.isfinite(later).all(axis=1)] = 0.0
        if frame.settings.bounces > 1 and not frame.settings.draft:
            later = self._shared(frame, grid, found, point, normal[:, :3], later)
        reflected = albedo[:, :3] * later[:, :3]
        # Of light of any colour on a surface of any: luminances of factors do not multiply.
        part = later[:, 3] / np.maximum(np.abs(later[:, :3]) @ lights.LUMINANCE, 1e-300)
        shorter = radiance[:, 3] + part * (np.abs(reflected) @ lights.LUMINANCE)
        return point[:, :3], normal[:, :3], radiance[:, :3] + reflected, shorter

    def _shared(self, frame: Frame, grid: Grid, found: images.Target, point, normal, later: np.ndarray) -> np.ndarray:
        """`later` (N, C), what each candidate's path brings per albedo, from the paths of all GROUP candidates that
        stand beside each other and face alike, by the balance heuristic."""
        there = np.flatnonzero(point[:, 3])
        if not len(there):
            return later
        axis = np.abs(normal[there]).argmax(axis=1)
        side = 2 * axis + (normal[there, axis] < 0)
        groups = np.full((-(-len(there) // GROUP), GROUP), -1)
        groups.reshape(-1)[: len(there)] = there[np.lexsort((morton_codes(point[there, :3]), side))]
        bindings = self.path_bindings(frame)
        bindings["constants"]["rays"] = grid.rays
        bindings["textures"] |= {
            "candidate_point": found.colors[0], "candidate_normal": found.colors[1], "next_point": found.colors[4],
            "next_radiance": found.colors[5], "grouped": images.upload_varying(groups.astype(np.float32), "R32F"),
        }  # fmt: skip
        with images.borrowed(GROUP, groups.size, "R32F") as target:
            passes.fullscreen(PAIRS, target, **bindings)
            density = images.read(target.colors[0]).astype(np.float64).reshape(-1, GROUP, GROUP)
        share = density / np.maximum(density.sum(axis=1, keepdims=True), 1e-300)
        shared = later.copy()
        members = groups >= 0
        shared[groups[members]] = (share @ np.where(members[..., None], later[groups], 0.0))[members]
        return shared

    def _densities(self, frame: Frame, grid: Grid, found: images.Target, keep: np.ndarray) -> np.ndarray:
        """(N,) how many rays of all probes fall on a square metre around each candidate that is kept."""
        if not len(keep):
            return np.zeros(0)
        bindings = self._probing(frame, grid)
        kept = np.zeros((1, MOST_VIRTUAL), np.float32)
        kept[0, : len(keep)] = keep
        bindings["textures"] |= {
            "candidate_point": found.colors[0], "candidate_normal": found.colors[1],
            "kept": images.upload(kept, "R32F"),
        }  # fmt: skip
        with images.borrowed(len(keep), grid.count, "R32F") as target:
            passes.fullscreen(DENSITY, target, **bindings)
            return images.read(target.colors[0])[..., 0].astype(np.float64).sum(axis=0)

    def release(self) -> None:
        self._sources.release()
        self._source_block = self._emissive = None


@dataclass(frozen=True)
class Grid:
    """Where candidates are looked for: probes along each side of the picture, and rays of each."""

    probes: tuple[int, int]
    rays: int

    @classmethod
    def of(cls, frame: Frame, count: int) -> Grid:
        """For `count` virtual lights."""
        if frame.settings.draft:
            return cls(DRAFT_PROBES, DRAFT_RAYS)
        return cls(PROBES, max(LEAST_RAYS, -(-CHOICE * count // (PROBES[0] * PROBES[1]))))

    @property
    def count(self) -> int:
        """Of probes."""
        return self.probes[0] * self.probes[1]


def near_radius(frame: Frame, count: int) -> float:
    """Distance below which `count` virtual lights leave light to short rays, m: in proportion to their spacing."""
    return NEAR * float(np.sqrt(128 / max(count, 1)) * frame.typical_distance)


def _resample(point: np.ndarray, radiance: np.ndarray, count: int, u: float) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of the candidates that are kept, in an order in space, and how many candidates each stands for.

    Marks at equal steps of the importance run along a curve through space, so that what is kept is spread over the
    surfaces as evenly as the candidates allow. They start anew in every cell of an octree that holds no more than
    CELL of them: a candidate that another picture has or lacks then changes what is kept nearby, not all that is kept.
    Few have larger cells: each cell keeps one more or less than it should, which shows in the sum of few.
    """
    importance = np.abs(np.nan_to_num(radiance, posinf=0.0, neginf=0.0)) @ lights.LUMINANCE
    if not importance.sum() > 0:
        return np.zeros(0, int), np.zeros(0)
    importance = np.where(importance > 0, importance + FLOOR * importance.mean(), 0.0)
    expected = importance / importance.sum() * count
    codes = morton_codes(point, _round_bounds(point))
    order = np.argsort(codes, kind="stable")
    first, start = _cells(codes[order], expected[order], max(CELL, FEW / count))
    sums = np.concatenate([[0.0], np.cumsum(expected[order])])
    lengths = np.diff(np.append(first, len(order)))
    along = sums[1:] - np.repeat(sums[first], lengths) + np.repeat((u + start) % 1.0, lengths)
    before = np.concatenate([[0.0], along[:-1]])
    before[first] = (u + start) % 1.0
    times = np.floor(along).astype(int) - np.floor(before).astype(int)
    place = np.flatnonzero(times)
    keep = order[place]
    return keep, times[place] / expected[keep]


def _round_bounds(point: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Bounds of points that others of about the same bounds have, too."""
    low, high = point.min(axis=0), point.max(axis=0)
    side = 2.0 ** np.ceil(np.log2(max(float((high - low).max()), 1e-30)))
    low = np.floor(low / side) * side
    return low, low + 2.0 * side


def _cells(codes: np.ndarray, expected: np.ndarray, most: float) -> tuple[np.ndarray, np.ndarray]:
    """Where, among sorted codes, each cell of an octree begins that holds at most `most` expected; and a number for it
    that the cell beside it makes up for: the bits of its place in reverse."""
    cell, place = np.zeros(len(codes), np.uint64), np.zeros(len(codes), np.uint64)
    for depth in range(1, BITS // 3 + 1):
        first = np.concatenate([[0], np.flatnonzero(np.diff(cell)) + 1])
        full = np.repeat(np.add.reduceat(expected, first) > most, np.diff(np.append(first, len(codes))))
        if not full.any():
            break
        shift = np.uint64(BITS - 3 * depth)
        cell = np.where(full, codes >> shift << shift, cell)
        place = np.where(full, codes >> shift, place)
    first = np.concatenate([[0], np.flatnonzero(np.diff(cell)) + 1])
    bits = (place[first, None] >> np.arange(12, dtype=np.uint64)) & np.uint64(1)
    return first, bits @ 0.5 ** np.arange(1, 13)
