"""Triangles whose material emits, or pieces of them, ready to draw points of light from."""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from operator import or_

import numpy as np

from ..frame.picture import Frame
from ..kernels.morton import morton_codes
from ..materials.compiled import CompiledMaterial
from ..scene.emission_maps import EmissiveLevel, TriangleEmission
from ..scene.receivers import Receivers
from ..snapshot.scene import Instance, Mesh
from ..sources import lights
from .caustic_casters import convex_facing

LONG = 8.0  # squared longest side by area, from which on a triangle is halved; half a square has 4
LARGE_SHARE = 1 / 256  # of all power: smaller triangles stay whole
MOST_OWN, NEAR_TILES = 16384, 0.5  # triangles that pixels search; share of what is lit that is near
MOST_SPACED = 256  # points whose distance from each other is measured
MOST_ASKED = 512  # triangles whose distance from what is lit is measured
TURN = np.array([[1, -0.02, -0.02], [0.02, 1, -0.02], [0.02, 0.02, 1]])  # the axes' six directions into six octants
PATHS = {"diffuse": lights.DIFFUSE_FLAG, "glossy": lights.GLOSSY_FLAG, "transmission": lights.TRANSMISSION_FLAG}
LEAST_VOLUME = 1e-9  # of a body along skewed axes, over that along as long ones at right angles
SOLID = ("camera", "diffuse", "glossy", "transmission", "volume", "shadow")  # what an object lets nothing pass of
PATHS["volume"] = 0  # media ask for no flag: their lights are those that they see


class EmissiveTriangles:
    """World-space triangles that emit, ready to draw points from; of objects that any of these paths (names of
    Visibility) may see, `without` those that another one sees. As in Cycles, an object lights what its ray visibility
    says. What media see has the flag of diffuse light where surfaces see it, too.

    They stand along a space-filling curve, so that points drawn by well-spread numbers are spread in space: in the
    order of the meshes, rows of a ball or lamps of a room would get no point in a picture of few samples.

    Half of the points are drawn by power and half by area, with the density (Le + level) / power per m2: a faint lamp
    near by is else found by no point while a strong one is far away, and then counts many times in another sample.
    """

    def __init__(self, frame: Frame, paths: Sequence[str], without: str | None = None):
        corners, radiance, normals, sided, flags = [], [], [], [], []
        self.unlit: list[int] = []  # by triangle, see lights.unlit_bits
        self.passing: list[frozenset[int]] = []  # by triangle: groups of blockers that let its light pass
        front, behind = (
            np.array([_emission(m, side) for m in frame.measured_materials]).reshape(-1, 3) for side in (0, 1)
        )
        emissive = {k for k, material in enumerate(frame.measured_materials) if material.emissive}
        for instance in frame.snapshot.instances:
            mesh = frame.snapshot.meshes[instance.mesh]
            visible = [path for path in paths if getattr(instance.visibility, path)]
            hidden = not visible or (without is not None and getattr(instance.visibility, without))
            seen = sum(PATHS[path] for path in visible)
            seen |= lights.DIFFUSE_FLAG if "volume" in paths and instance.visibility.diffuse else 0
            if hidden or emissive.isdisjoint(instance.materials) or not mesh.triangle_count:
                continue
            slots = mesh.triangle_materials(instance.materials)
            local = mesh.positions[mesh.corner_vertices[mesh.triangle_corners]]
            of_sides = np.stack([front[slots], behind[slots]], axis=1)
            known = frame.emission_maps.of(instance)
            if known is not None:
                local, of_sides = _in_pieces(local, of_sides, known)
            matrix = instance.matrix.copy()
            matrix[:3, 3] -= frame.geometry.origin
            outwards = _outwards(frame, instance, mesh) if known is None else 0.0
            alike = (of_sides[:, 0] == of_sides[:, 1]).all(axis=1)
            for side, chosen, sign in ((0, alike, outwards or 1.0), (0, ~alike, 1.0), (1, ~alike, -1.0)):
                shining = np.flatnonzero(chosen & (np.abs(of_sides[:, side]).max(axis=1) > 0))
                if not len(shining):
                    continue
                corners.append(local[shining] @ matrix[:3, :3].T + matrix[:3, 3])
                radiance.append(of_sides[shining, side])
                # A mirrored triangle's corners run the other way round.
                normals.append(np.full(len(shining), sign * np.sign(np.linalg.det(matrix[:3, :3])) or 1.0))
                sided.append(np.full(len(shining), chosen is not alike or outwards != 0.0))
                flags.append(np.full(len(shining), seen))
                self.passing += [instance.links.passing] * len(shining)
                self.unlit += [lights.unlit_bits(instance.links)] * len(shining)
        self.corners = np.concatenate(corners) if corners else np.zeros((0, 3, 3))
        self.radiance = np.concatenate(radiance) if radiance else np.zeros((0, 3))
        self.sided = np.concatenate(sided) if sided else np.zeros(0, bool)
        self.flags = np.concatenate(flags) if flags else np.zeros(0, int)  # of lights.py, for `paths`
        facing = np.concatenate(normals) if normals else np.zeros(0)
        self.corners, source = compact(self.corners, self.radiance)
        normal = np.cross(self.corners[:, 1] - self.corners[:, 0], self.corners[:, 2] - self.corners[:, 0])
        double_area = np.linalg.norm(normal, axis=1)
        self.normal = normal / np.maximum(double_area, 1e-30)[:, None] * facing[source, None]
        middle = self.corners.mean(axis=1)
        order = along_curve(middle, self.normal, _distance(middle, frame.receivers))
        double_area, self.normal = double_area[order], self.normal[order]
        self.corners, source = self.corners[order], source[order]
        self.radiance, self.sided, self.flags = self.radiance[source], self.sided[source], self.flags[source]
        self.unlit, self.passing = [self.unlit[k] for k in source], [self.passing[k] for k in source]
        self._unlit_by_some = reduce(or_, self.unlit, 0) // lights.KIND_STEPS
        weight = np.abs(self.radiance) @ lights.LUMINANCE * double_area / 2
        weight = np.where(np.isfinite(weight), weight, 0.0)
        shining = np.where(weight > 0.0, double_area / 2, 0.0)
        level = frame.shared(EmissiveLevel)
        if not level.value > 0.0 and weight.sum() > 0.0:  # one for all who share light between points and rays
            level.value = float(weight.sum() / shining.sum())
        self.level = level.value
        self.power = float(weight.sum() + self.level * shining.sum())
        # As one light: where its power is, and half the diagonal of a square that is as large. Several lamps of one
        # size stand for as much area.
        self.centre = np.average(self.corners.mean(axis=1), axis=0, weights=weight) if self.power > 0 else np.zeros(3)
        density = (weight * weight / np.maximum(double_area / 2, 1e-30)).sum()
        self.reach = float(np.sqrt(weight.sum() ** 2 / max(float(density), 1e-300) / 2)) if self.power > 0 else 0.0
        self._edges = np.concatenate([[0.0], np.cumsum(weight + self.level * shining)]) / max(self.power, 1e-300)
        self._receivers = frame.receivers

    @property
    def may_be_own(self) -> bool:
        """Whether pixels may draw points of their own: the triangles are few, and all light the same."""
        if not self.power > 0 or len(self.radiance) > MOST_OWN:
            return False
        if self._receivers is None or not len(self._receivers.distance):
            return False
        return not any(self.unlit) and not any(self.passing) and bool((self.flags == self.flags[0]).all())

    @property
    def near(self) -> bool:
        """Whether half of what is lit is so near that points of all would be seen apart."""
        boxes = self._receivers
        step = -(-len(boxes.distance) // 64)
        low, high = boxes.low[::step, None], boxes.high[::step, None]
        places = self.corners[:: -(-len(self.corners) // MOST_ASKED)].mean(axis=1)
        gaps = np.maximum(np.maximum(low - places, places - high), 0.0)
        nearest = np.sqrt((gaps**2).sum(axis=2)).min(axis=1)
        return bool(np.quantile(nearest, NEAR_TILES) < 0.75 * self.reach)

    def spacing(self, count: int) -> float:
        """Squared distance from one of `count` points to the next, m2, times what they are drawn in proportion to: the
        median."""
        asked = max(min(count, MOST_SPACED), 2)
        numbers = (np.arange(asked)[:, None] * (0.0, 0.754878, 0.569840)) % 1.0
        numbers[:, 0] = (np.arange(asked) + 0.5) / asked
        drawn = [self.draw(*one) for one in numbers]
        places, density = np.array([one[1] for one in drawn]), np.array([one[2] for one in drawn])
        squared = ((places[:, None] - places) ** 2).sum(axis=2)
        np.fill_diagonal(squared, np.inf)
        return float(np.median(squared.min(axis=1) * density)) * self.power * asked / max(count, 1)

    def reach_of(self, least: float) -> float:
        """The root, m, of `least` over what the faintest triangle is drawn in proportion to."""
        luminance = np.abs(self.radiance) @ lights.LUMINANCE
        return float(np.sqrt(least / (luminance[luminance > 0].min() + self.level)))

    def beside(self, least: float) -> tuple[np.ndarray, np.ndarray] | None:
        """The box, low and high, in which a place may be nearer to a point than the root of `least` over what it is
        drawn in proportion to; None where nothing there is lit."""
        reach = self.reach_of(least)
        corners, lit = self.corners.reshape(-1, 3), self._receivers
        low, high = corners.min(axis=0) - reach, corners.max(axis=0) + reach
        return (low, high) if ((lit.low <= high) & (low <= lit.high)).all(axis=1).any() else None

    def texels(self) -> np.ndarray:
        """(4 N, 4): what shaders/light/mesh_rays.glsl reads."""
        found = np.zeros((len(self.radiance), 4, 4))
        found[:, 0, :3], found[:, 0, 3] = self.corners[:, 0], self._edges[:-1]
        found[:, 1:3, :3] = self.corners[:, 1:] - self.corners[:, :1]
        across = np.cross(found[:, 1, :3], found[:, 2, :3])
        found[:, 1, 3] = self.sided
        found[:, 2, 3] = np.where((across * self.normal).sum(axis=1) < 0, -1.0, 1.0)
        found[:, 3, :3] = self.radiance
        return found.reshape(-1, 4)

    def row(
        self, numbers: tuple[float, float, float], share: float, flags: int, views: int = 1, samples: float = np.inf,
        at_hits: bool = False,
    ) -> np.ndarray:  # fmt: skip
        """Of a point drawn by three uniform numbers, one of `share` in each of `samples` samples; see lights.py. Flags
        of the paths that see it are added. `at_hits`: of the row of a light for traced paths."""
        k, point, density = self.draw(*numbers)
        flags += int(self.flags[k]) + lights.SIDED_FLAG * bool(self.sided[k])
        normal, radiance = self.normal[k], self.radiance[k]
        row = lights.surface_row(point, normal, radiance, density * share, flags, 0, views, samples)
        row[lights.LIGHT.at.kind] += self.unlit[k]
        row[lights.LIGHT.at.edge], row[lights.LIGHT.at.cone] = self.level, self._unlit_by_some
        if at_hits:
            row[lights.LIGHT.at.first_view] = lights.passing_bits(self.passing[k])
        return row

    def passing_at(self, x: float) -> frozenset[int]:
        """Groups of blockers that let the light pass of the point that is drawn by this number first."""
        return self.passing[self._at(x)]

    def stretched(self, x: float, y: float) -> np.ndarray:
        """Three numbers for `draw` out of two: where `x` lies within a triangle's share of the power is the third."""
        k = self._at(x)
        share = max(self._edges[k + 1] - self._edges[k], 1e-300)
        return np.array([x, y, np.clip((x - self._edges[k]) / share, 0.0, 1.0)])

    def draw(self, x: float, y: float, z: float) -> tuple[int, np.ndarray, float]:
        """From three uniform numbers: a triangle, a point on it, and the density per m2."""
        k = self._at(x)
        root = np.sqrt(y)
        a, b, c = self.corners[k]
        point = (1 - root) * a + root * (1 - z) * b + root * z * c
        return k, point, (float(np.abs(self.radiance[k]) @ lights.LUMINANCE) + self.level) / self.power

    def _at(self, x: float) -> int:
        return int(np.clip(np.searchsorted(self._edges, x, side="right") - 1, 0, len(self.radiance) - 1))


def _outwards(frame: Frame, instance: Instance, mesh: Mesh) -> float:
    """Of a closed convex mesh that is opaque and not entered, of which only the outside sends light to what is seen: 1
    where its triangles face outwards, -1 where inwards; of others 0. Rays to its far side would else be lost."""
    visible = instance.visibility
    solid = not any(frame.materials.compiled[k].transparent for k in instance.materials) and not instance.links.passing
    if not (solid and all(getattr(visible, path) for path in SOLID)):
        return 0.0
    camera, axes = frame.snapshot.camera, instance.matrix[:3, :3].astype(np.float64)
    if camera.from_above or camera.bends:
        return 0.0
    if not abs(np.linalg.det(axes)) > LEAST_VOLUME * np.linalg.norm(axes, axis=0).prod():
        return 0.0  # flattened: it has no inside
    inverse = np.linalg.inv(axes)
    eye = inverse @ (camera.matrix[:3, 3] - instance.matrix[:3, 3])
    near = camera.clip_start * np.linalg.norm(inverse, axis=1)  # from the box's sides
    if ((mesh.bounds_min - near <= eye) & (eye <= mesh.bounds_max + near)).all():
        return 0.0
    return convex_facing(mesh)


def compact(corners: np.ndarray, radiance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Triangles (N, 3, 3), of which long ones of a large share of the power are halved across their longest side until
    neither holds; and of which triangle each is a part. Along a curve through space the parts of a strip light stand
    apart."""
    source = np.arange(len(corners))
    luminance = np.abs(radiance) @ lights.LUMINANCE
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    large = LARGE_SHARE * float(np.nan_to_num(luminance * area).sum())
    done_corners, done_source = [], []
    while len(corners):
        sides = np.roll(corners, -1, axis=1) - corners
        squared = (sides**2).sum(axis=2)
        area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1) / 2
        with np.errstate(invalid="ignore"):
            cut = (squared.max(axis=1) > LONG * area) & (luminance[source] * area > large)
        done_corners.append(corners[~cut])
        done_source.append(source[~cut])
        corners, source = corners[cut], source[cut]
        first = squared[cut].argmax(axis=1)
        a, b, c = (corners[np.arange(len(corners)), (first + k) % 3] for k in range(3))
        middle = (a + b) / 2
        corners = np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])
        source = np.concatenate([source, source])
    return (np.concatenate(done_corners), np.concatenate(done_source)) if done_corners else (corners, source)


def _distance(places: np.ndarray, receivers: Receivers | None) -> float:
    """Metres from what is lit to the nearest of `places` (N, 3), about; their extent where nothing is known of that."""
    if not len(places):
        return 1.0
    some = places[:: -(-len(places) // MOST_ASKED)]
    if receivers is None or not len(receivers.distance):
        return max(float(np.ptp(places, axis=0).max()), 1e-9)
    lit = (receivers.low + receivers.high)[:: -(-len(receivers.distance) // 64)] / 2
    nearest = np.sqrt(((lit[:, None] - some[None]) ** 2).sum(axis=2)).min(axis=1)
    return max(float(np.median(nearest)), 1e-9)


def along_curve(places: np.ndarray, normals: np.ndarray, distance: float) -> np.ndarray:
    """Order of triangles by place and direction (N, 3) along a Morton curve of six dimensions.

    A step of `distance` counts as much as a turn by a radian: what is lit from so far away sees a small lamp's sides
    differ, and a large lamp's places.
    """
    if not len(places):
        return np.zeros(0, int)
    places = places / distance
    low = places.min(axis=0)
    # A power of two, so that the steps at which places are told apart are those of directions, too.
    extent = 2.0 ** max(np.ceil(np.log2(max(float(np.ptp(places, axis=0).max()), 1e-9))), 1.0)
    turned = normals @ TURN.T
    codes = [
        morton_codes(places, (low, low + extent)),
        morton_codes(turned + 1.0, (np.zeros(3), np.full(3, extent))),
    ]
    keys = [np.zeros(len(places), np.uint64) for _ in range(2)]  # of 21 groups of 6 bits the upper and the lower ones
    for group in range(21):
        at, key = np.uint64(3 * (20 - group)), keys[group > 9]
        for code in codes:
            key[:] = key << np.uint64(3) | code >> at & np.uint64(7)
    return np.lexsort((keys[1], keys[0]))


def _emission(material: CompiledMaterial, side: int) -> tuple[float, float, float]:
    """What a material emits to its front (0) or its back (1), on average."""
    if not material.emissive:
        return 0.0, 0.0, 0.0
    return material.emission_behind if side else material.emission


def _in_pieces(corners: np.ndarray, radiance: np.ndarray, known: TriangleEmission) -> tuple[np.ndarray, np.ndarray]:
    """Triangles (N, 3, 3) and what they emit (N, 2, 3), with pieces in the place of those that were measured."""
    rest = ~known.measured
    first, edges = corners[known.triangle, :1], corners[known.triangle, 1:] - corners[known.triangle, :1]
    pieces = first + known.places[..., :1] * edges[:, :1] + known.places[..., 1:] * edges[:, 1:]
    return np.concatenate([corners[rest], pieces]), np.concatenate([radiance[rest], known.radiance])
