"""G-buffers seen from a light: views fitted to casters of caustics, and drawing surfaces into them.

A view looks from one point of a light (or along one direction of a sun) at a box of casters; texels are an even grid
over the rectangle around it, shifted below a texel in each sample. Its fields are those of VIEW, so that every program
that reads surfaces or traces rays takes it in place of the camera.

| light | view |
|---|---|
| sun | orthographic |
| point, spot, area from outside, up to WIDEST from the middle | one perspective, clipped to the spot's cone |
| the same from within or close by | faces of a cube that see the box |

A texel at the tangents (x, y) stands for the solid angle  a / (1 + x^2 + y^2)^(3/2),  a its area one unit before the
light; of a sun for the area a across its direction.

Casters are drawn with the program of one lobe (MaterialSet.lobe_program): reflection or refraction, so that
neighbouring texels are photons of one smooth bundle. What stands before them is drawn first and leaves its depth.

Fails: casters far apart share the texels of MOST_GROUPS boxes at most; a caster larger than what light reaches wastes
them.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..frame.picture import Frame
from ..frame.technique import Technique
from ..gfx import images
from ..gfx.struct import Block
from ..kernels.morton import morton_codes
from ..scene.culling import CORNERS
from ..scene.geometry import DIFFUSE_FLAG
from ..scene.materials import SURFACE_IMAGES
from ..scene.view import STRAIGHT, VIEW
from ..sources import lights
from ..surfaces.draw import OPAQUE, STOCHASTIC, draw_view
from ..surfaces.places import draw_places, told_by_place

WIDEST = 1.4  # tangent of half the angle of one view
FARTHEST = 4.0  # the same of what light may reach that casters bend
MOST_GROUPS, MOST_APART = 4, 32
PLACE_IMAGES = SURFACE_IMAGES[:2]  # of which a place and its normal are all that is asked
REFRACTED, REFLECTED = 1, 2  # wanted_lobe of the program of one lobe


@dataclass(frozen=True)
class LightView:
    """One projection: fields of VIEW, and its rows x, y, w, q (4, 4)."""

    values: dict
    rows: np.ndarray
    low: np.ndarray  # (3,) the box that it is about, relative to the render origin
    high: np.ndarray

    @property
    def side(self) -> int:
        return int(self.values["film"][0])


def groups(low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Boxes (K, 3), K <= MOST_GROUPS, that hold the boxes (N, 3) and do not overlap: of those that do, and of the two
    whose common box is least, one is made."""
    low, high = np.reshape(low, (-1, 3)), np.reshape(high, (-1, 3))
    if len(low) > MOST_APART:  # neighbours along a curve first: pairs of all would take a scene's time
        runs = np.array_split(np.argsort(morton_codes((low + high) / 2), kind="stable"), MOST_APART)
        low, high = (
            np.array([each(side[run], axis=0) for run in runs]) for each, side in ((np.min, low), (np.max, high))
        )
    while True:
        i, j = np.tril_indices(len(low), -1)
        overlapping = ((low[i] <= high[j]) & (low[j] <= high[i])).all(axis=1)
        if not overlapping.any() and len(low) <= MOST_GROUPS:
            return low, high
        if overlapping.any():
            i, j = i[overlapping], j[overlapping]
        extent = np.linalg.norm(high - low, axis=1)
        joined = np.minimum(low[i], low[j]), np.maximum(high[i], high[j])
        grown = np.linalg.norm(joined[1] - joined[0], axis=1) - np.maximum(extent[i], extent[j])
        least = np.lexsort((j, i, grown))[0]
        low, high = (np.delete(side, (i[least], j[least]), axis=0) for side in (low, high))
        low, high = (np.concatenate([side, one[least][None]]) for side, one in zip((low, high), joined))


def views_of(
    emitter: lights.Emitter, sample: np.ndarray, low: np.ndarray, high: np.ndarray, side: int, shift, size: float
) -> list[LightView]:
    """Views of `side` x `side` texels from the light's point `sample` over the box `low` to `high`; none where its
    light cannot reach it. `shift`: two uniform numbers; `size`: the scene's, in metres."""
    corners = low + CORNERS * (high - low)
    if emitter.kind == lights.SUN:
        u, v = _frame(sample)
        place = np.stack([corners @ u, corners @ v], axis=1)
        top = float((corners @ sample).max()) + size  # what stands before the casters counts, too
        bottom = float((corners @ sample).min())
        eye = top * sample
        return [_view(True, eye, u, v, sample, _shifted(*_square(place), side, shift), side, top - bottom, low, high)]
    position = emitter.position(sample)
    cone = _cone(emitter)
    if cone is not None and not _may_reach(position, emitter.axis, cone, low, high):
        return []
    near, far = _distances(position, low, high)
    outside = near > 1e-4 * max(far, 1e-30)
    forward = (low + high) / 2 - position
    if outside:
        forward = forward / np.linalg.norm(forward)
        tangents = _tangents(corners - position, forward)
        if tangents is not None and np.abs(tangents).max() <= WIDEST:
            box = _square(tangents)
            if cone is not None and cone <= WIDEST and 2 * cone < (box[1] - box[0]).max():
                forward = emitter.axis
                box = np.full(2, -cone), np.full(2, cone)
            u, v = _frame(-forward)
            window = _shifted(*box, side, shift)
            return [_view(False, position, u, v, -forward, window, side, far, low, high)]
    if cone is not None and cone <= WIDEST:
        u, v = _frame(-emitter.axis)
        window = _shifted(np.full(2, -cone), np.full(2, cone), side, shift)
        return [_view(False, position, u, v, -emitter.axis, window, side, far, low, high)]
    found = []
    for axis in range(3):
        for sign in (1.0, -1.0):
            forward = np.zeros(3)
            forward[axis] = sign
            if emitter.has_span and emitter.axis @ forward < -0.999:
                continue
            u, v = np.roll(np.eye(3), axis, axis=1)[1], np.roll(np.eye(3), axis, axis=1)[2]
            offsets = corners - position
            if not _face_sees(offsets, forward, u, v):
                continue
            if np.dot(np.cross(u, v), -forward) < 0:
                u, v = v, u
            # No shift: faces meet without gap or overlap. Their texels still differ from sample to sample by `turn`.
            window = (-1.0, 1.0, -1.0, 1.0)
            found.append(_view(False, position, u, v, -forward, window, side, far, low, high))
    return found


def _face_sees(offsets: np.ndarray, forward, u, v) -> bool:
    """Whether a box of corners `offsets` may meet a cube face's pyramid: no plane has all corners outside."""
    planes = (forward, forward - u, forward + u, forward - v, forward + v)
    return all((offsets @ plane > 0).any() for plane in planes)


def _cone(emitter: lights.Emitter) -> float | None:
    """Tangent of half the cone outside of which the light gives nothing; None: everywhere; inf: a half space."""
    if emitter.has_span:
        return np.inf
    if emitter.flags & lights.SPOT_FLAG:
        half = emitter.light.spot_angle / 2
        if half < np.pi / 2 - 0.01:
            scale = np.linalg.norm(emitter.light.matrix[:3, :3], axis=0)
            return float(np.tan(half) * max(scale[0], scale[1]) / max(scale[2], 1e-12)) * 1.001
        return None
    return None


def _may_reach(position, axis, cone: float, low, high) -> bool:
    """Whether the box's bounding sphere meets the cone about `axis`."""
    centre, radius = (low + high) / 2 - position, float(np.linalg.norm(high - low)) / 2
    along = float(centre @ axis)
    if not np.isfinite(cone):
        return along > -radius
    across = float(np.linalg.norm(centre - along * axis))
    cosine = 1.0 / np.sqrt(1.0 + cone * cone)
    return across * cosine - along * cone * cosine <= radius and along > -radius


def _distances(position, low, high) -> tuple[float, float]:
    nearest = np.clip(position, low, high) - position
    farthest = np.maximum(np.abs(low - position), np.abs(high - position))
    return float(np.linalg.norm(nearest)), float(np.linalg.norm(farthest))


def _tangents(offsets: np.ndarray, forward: np.ndarray) -> np.ndarray | None:
    u, v = _frame(-forward)
    depth = offsets @ forward
    if depth.min() <= 1e-4 * np.abs(depth).max():
        return None
    return np.stack([offsets @ u, offsets @ v], axis=1) / depth[:, None]


def _square(place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The square around places (N, 2): footprints of neighbours are then as wide as high."""
    low, high = place.min(axis=0), place.max(axis=0)
    middle, half = (low + high) / 2, max(float((high - low).max()) / 2, 1e-12)
    return middle - half, middle + half


def _shifted(low, high, side: int, shift) -> tuple[float, float, float, float]:
    """Left, right, bottom, top with room for a shift below one texel."""
    texel = (high - low) / max(side - 2, 1)
    low, high = low - texel, high + texel
    move = (np.asarray(shift) - 0.5) * texel
    return low[0] + move[0], high[0] + move[0], low[1] + move[1], high[1] + move[1]


def _frame(backward: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    helper = np.array([1.0, 0.0, 0.0]) if abs(backward[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    u = np.cross(helper, backward)
    u /= np.linalg.norm(u)
    return u, np.cross(backward, u)


def _view(orthographic: bool, eye, u, v, backward, window, side: int, far: float, low, high) -> LightView:
    left, right, bottom, top = window

    def affine(direction):
        return np.append(direction, -direction @ eye)

    depth, one = affine(-backward), np.array([0.0, 0.0, 0.0, 1.0])
    far = 1.01 * float(far) + 1e-6
    if orthographic:
        w, q, near = one, (one * far - depth) / far, 1.0
    else:
        w, q, near = depth, one, 1e-4 * far
    row_x = (2.0 * affine(u) - (left + right) * w) / (right - left)
    row_y = (2.0 * affine(v) - (bottom + top) * w) / (top - bottom)
    rows = np.stack([row_x, row_y, w, q])
    values = {
        "row_x": row_x, "row_y": row_y, "row_w": w, "row_q": q,
        "eye": (*eye, float(orthographic)), "right": (*u, 0.0), "up": (*v, 0.0), "backward": (*backward, near),
        "frame": window, "film": (side, side, 0.0, 1e30), "sample_index": 0, "seed": 0,
        "bits_x": 0, "bits_y": 0, "bits_z": 0, "bits_w": 0, "visibility": DIFFUSE_FLAG,
        "footprint_exact": 0.0, "footprint_first": 0.0, **STRAIGHT,
    }  # fmt: skip
    return LightView(values, rows, low, high)


def widened(view: LightView, factor: float, receivers: np.ndarray, side: int, shift) -> LightView:
    """The same view over a rectangle `factor` times as wide, but no wider than what holds the corners (N, 8, 3) of
    receivers: of what light may reach that casters have bent."""
    values = view.values
    left, right, bottom, top = values["frame"]
    middle, half = np.array([left + right, bottom + top]) / 2, np.array([right - left, top - bottom]) / 2 * factor
    low, high = middle - half, middle + half
    eye, u, v, backward = (np.array(values[name][:3]) for name in ("eye", "right", "up", "backward"))
    orthographic = bool(values["eye"][3])
    if not orthographic:
        low, high = np.maximum(low, -FARTHEST), np.minimum(high, FARTHEST)
    far = float(np.linalg.norm(receivers.reshape(-1, 3) - eye, axis=1).max()) if len(receivers) else 1.0
    if len(receivers):
        offsets = receivers.reshape(-1, 3) - eye
        depth = offsets @ -backward
        place = np.stack([offsets @ u, offsets @ v], axis=1)
        if not orthographic:
            place = np.where((depth > 1e-4 * far)[:, None], place / np.maximum(depth, 1e-30)[:, None], np.nan)
        if np.isfinite(place).all():
            within_low, within_high = np.maximum(low, place.min(axis=0)), np.minimum(high, place.max(axis=0))
            if (within_low < within_high).all():
                low, high = within_low, within_high
    half = max(float((high - low).max()) / 2, 1e-12)
    middle = (low + high) / 2
    window = _shifted(middle - half, middle + half, side, shift)
    return _view(orthographic, eye, u, v, backward, window, side, far, view.low, view.high)


class LightBuffers:
    """The images of one size that views are drawn into, kept from view to view."""

    def __init__(self):
        self._target: images.Target | None = None
        self._block: Block | None = None

    def draw(
        self, frame: Frame, technique: Technique, view: LightView, materials: frozenset[int], lobes: tuple[int, ...],
        choice: float,
    ) -> Iterator[tuple[int, Block, dict[str, images.Image]]]:  # fmt: skip
        """Draw `materials` as they reflect or refract the light, once for each of `lobes`; all other surfaces hide
        them. Yields the lobe, the view's block and the surface images by name (surface_*), valid until the next."""
        target = self._of(view.side)
        self._viewed(frame, view)
        everything = frozenset(range(len(frame.materials.compiled)))
        bound = {f"surface_{name}": image for name, image in zip(SURFACE_IMAGES, target.colors)}
        target.clear((0.0, 0.0, 0.0, 0.0), 1.0)
        self._places(frame, technique, view, everything - materials, STOCHASTIC)
        for lobe in lobes:
            # Depths stay from lobe to lobe: what is nearest is the same in all.
            images.Target(target.colors).clear()
            constants = {
                "transparent_mode": STOCHASTIC, "glass_bends": 1, "index_shown": -1, "wanted_lobe": lobe,
                "lobe_choice": choice,
            }  # fmt: skip
            draw_view(
                frame, technique, target, self._block, view.rows, frame.materials.lobe_program, materials, constants
            )
            frame.count(technique, "light views")
            yield lobe, self._block, bound

    def farthest(
        self, frame: Frame, technique: Technique, view: LightView, materials: frozenset[int]
    ) -> dict[str, images.Image]:
        """Draw where light leaves `materials`, if it went straight: of all that the view sees of them the farthest, by
        what they refract there."""
        target = self._of(view.side)
        target.clear((0.0, 0.0, 0.0, 0.0), 0.0)
        constants = {
            "transparent_mode": OPAQUE, "glass_bends": 1, "index_shown": -1, "wanted_lobe": REFRACTED,
            "lobe_choice": 0.5,
        }  # fmt: skip
        draw_view(
            frame, technique, target, self._viewed(frame, view), view.rows, frame.materials.lobe_program, materials,
            constants, depth_test="GREATER",
        )  # fmt: skip
        return {f"behind_{name}": image for name, image in zip(SURFACE_IMAGES, target.colors)}

    def _viewed(self, frame: Frame, view: LightView) -> Block:
        values = {**view.values, "sample_index": frame.sample, "seed": frame.settings.seed}
        if self._block is None:
            self._block = Block(VIEW, **values)
        else:
            self._block.update(**values)
        return self._block

    def receivers(
        self, frame: Frame, technique: Technique, view: LightView, casters: frozenset[int]
    ) -> tuple[Block, dict[str, images.Image]]:
        """Draw where all surfaces but `casters` lie that the view sees first: images of place and normal."""
        target = self._of(view.side)
        self._viewed(frame, view)
        target.clear((0.0, 0.0, 0.0, 0.0), 1.0)
        everything = frozenset(range(len(frame.materials.compiled)))
        self._places(frame, technique, view, everything - casters, OPAQUE)
        frame.count(technique, "light views")
        return self._block, {f"surface_{name}": image for name, image in zip(PLACE_IMAGES, target.colors)}

    def _places(
        self, frame: Frame, technique: Technique, view: LightView, materials: frozenset[int], mode: int
    ) -> None:
        """Draw where `materials` lie: their own programs find it only where the triangles do not tell."""
        plain = told_by_place(frame, materials, mode == STOCHASTIC)
        if plain:
            places = images.Target(self._target.colors[: len(PLACE_IMAGES)], self._target.depth)
            draw_places(frame, technique, places, self._block, view.rows, plain)
        if materials - plain:
            constants = {"transparent_mode": mode, "glass_bends": 1, "index_shown": -1}
            draw_view(
                frame, technique, self._target, self._block, view.rows, frame.materials.surface_program,
                materials - plain, constants,
            )  # fmt: skip

    def _of(self, side: int) -> images.Target:
        if self._target is None or self._target.size != (side, side):
            self.release()
            colors = tuple(images.pool.take(side, side, "RGBA32F") for _ in SURFACE_IMAGES)
            self._target = images.Target(colors, images.pool.take(side, side, "DEPTH_COMPONENT32F"))
        return self._target

    def release(self) -> None:
        if self._target is not None:
            for image in (*self._target.colors, self._target.depth):
                images.pool.give(image)
        self._target = self._block = None
