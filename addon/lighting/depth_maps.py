"""Depth maps from points and directions of light: which views are needed, where they lie in the atlas, drawing them.

A view covers what the camera sees (the receivers), not the scene, so that texels are not spent on what no pixel
asks for. Receivers are given as boxes of screen tiles. Where the picture reaches from near to far, they are split by
distance and the near part gets a view of its own; where a light sees them under wide angles, faces of a cube do.
Every view is shifted and turned at random each sample, so that texel edges average out instead of standing.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import nullcontext
from dataclasses import dataclass

import numpy as np

from ..gfx import images, passes
from ..gfx.geometry import Batch
from ..gfx.library import Program, Shader
from ..scene.casters import Clusters
from ..scene.culling import CORNERS, Boxes, calls, entered, joined
from ..scene.geometry import Draw, SceneGeometry
from ..scene.projection import PROJECTION_CONSTANTS, PROJECTION_DEFINES, ROWS
from ..scene.receivers import Receivers
from ..sources.lights import VIEW_TEXELS

WIDEST_TANGENT = 2.5  # a single view up to 68 degrees half angle; beyond it, cube faces


@dataclass(frozen=True)
class MapView:
    """One projection: rows x, y, w, q (see addon/scene/view.py) and the near distance of its depth buffer."""

    rows: np.ndarray  # (4, 4) float64
    near: float
    light_point: tuple[float, float, float, float]  # xyz, w: position (1) or direction (0)
    scale: int = 1  # resolution is divided by this
    least_q: float = -np.inf  # of the receivers: what lies farther from the light casts no shadow on any of them
    cell: float = 0.0  # share of the light's extent, along each axis, that the map stands for; 0: a point
    glass_blocks: bool = False  # what passes glass arrives otherwise (caustic_casters.py)
    channel: int = 0  # of light that coloured casters let pass: 1 to 3; 0: their mean


def directional_views(
    direction, receivers: Receivers, geometry: SceneGeometry, jitter, resolution, reach: float = 0.0
) -> list[MapView]:
    """Orthographic views for light from `direction` (unit, towards the light). `jitter`: four uniform numbers.

    `reach`: the light's tangent of half angle, if the map also serves directions around this one.
    """
    if not len(receivers.distance):
        return []
    u, v = _frame(direction, jitter[2] * 2 * np.pi)
    corners = receivers.corners
    place = np.stack([corners @ u, corners @ v], axis=-1)  # (T, 8, 2)
    scene_low, scene_high = geometry.bounds_min - geometry.origin, geometry.bounds_max - geometry.origin
    heights = (scene_low + CORNERS * (scene_high - scene_low)) @ direction
    bottom = min(float((corners @ direction).min()), float(heights.max()))
    top = max(float(heights.max()), float((corners @ direction).max()))
    margin = 1e-3 * max(top - bottom, 1e-6 * geometry.size)
    bottom, top = bottom - margin, top + margin
    one = np.array([0.0, 0.0, 0.0, 1.0])
    row_q = np.append(direction, -bottom) / (top - bottom)
    q = (corners @ direction - bottom) / (top - bottom)
    views = []
    for low, high, _ in _merged_rectangles(place, receivers.groups(), 1e-6 * geometry.size):
        low, high = _padded(*_widened(low, high, reach * (top - bottom)), jitter, resolution)
        asked = _that_meet(place, low, high)
        row_x = np.append(2 * u, -(low[0] + high[0])) / (high[0] - low[0])
        row_y = np.append(2 * v, -(low[1] + high[1])) / (high[1] - low[1])
        rows = np.stack([row_x, row_y, one, row_q])
        views.append(MapView(rows, 1.0, (*direction, 0.0), least_q=float(q[asked].min())))
    return views


def point_views(
    position,
    axis,
    cone_tangent: float,
    receivers: Receivers,
    geometry: SceneGeometry,
    jitter,
    resolution,
    reach: float = 0.0,
) -> list[MapView]:
    """Perspective views from `position` (relative to the origin).

    `axis` is None for a light that shines everywhere; else the unit axis of emission, and only receivers within
    `cone_tangent` (inf for a half space) of it matter. Empty if no receiver can be lit. `reach`: half the light's
    extent in metres, if the map also serves points around this one.
    """
    offsets = receivers.corners - position
    if axis is not None:
        keep = ((offsets @ axis) > 0).any(axis=1)
        offsets = offsets[keep]
        index = np.flatnonzero(keep)
    else:
        index = np.arange(len(offsets))
    if not len(index):
        return []
    centre = offsets.mean(axis=(0, 1))
    forward = axis if axis is not None else _unit(centre)
    u, v = _frame(-forward, jitter[2] * 2 * np.pi)
    depth = offsets @ forward
    lateral = np.stack([offsets @ u, offsets @ v], axis=-1)
    ahead = depth > 1e-6 * geometry.size
    tangents = np.where(ahead[..., None], lateral / np.where(ahead, depth, 1.0)[..., None], np.inf)
    if cone_tangent <= WIDEST_TANGENT:
        tangents = np.clip(tangents, -cone_tangent, cone_tangent)
        crossing = ~ahead.all(axis=1)  # reaches behind the light: lit as far as the cone on all sides
        tangents[crossing, 0], tangents[crossing, 1] = -cone_tangent, cone_tangent
    wide = ~np.isfinite(tangents).all(axis=(1, 2)) | (np.abs(tangents) > WIDEST_TANGENT).any(axis=(1, 2))
    if not wide.any():
        groups = [g for g in (np.flatnonzero(np.isin(index, group)) for group in receivers.groups()) if len(g)]
        scene_low, scene_high = geometry.bounds_min - geometry.origin, geometry.bounds_max - geometry.origin
        nearest = float(((scene_low + CORNERS * (scene_high - scene_low) - position) @ forward).min())
        views = []
        for low, high, members in _merged_rectangles(tangents, groups, 1e-6):
            far = float(depth[members].max())
            wide = reach * (1.0 / max(nearest, 0.1 * far) - 1.0 / far)
            low, high = _padded(*_widened(low, high, wide), jitter, resolution)
            far = float(depth[_that_meet(tangents, low, high)].max())
            views += _perspectives(position, np.array([[u, v, forward]]), low, high, geometry.size, [far])
        return views
    centre, radius = offsets.mean(axis=1), np.linalg.norm(offsets[:, 7] - offsets[:, 0], axis=1) / 2
    faces = np.array((
        (forward, u, v), (u, v, forward), (-u, v, -forward), (v, forward, u), (-v, forward, -u), (-forward, u, -v),
    ))  # fmt: skip
    # A box meets the face's pyramid if its sphere lies on the inner side of all four planes.
    along, beside = centre @ faces[:, 0].T, np.abs(centre @ faces[:, 1:].reshape(12, 3).T).reshape(-1, 6, 2)
    inside = along - beside.max(axis=2) > (-np.sqrt(2.0) * radius)[:, None]
    met = inside.any(axis=0)
    if axis is not None:  # beside the first face, what lies behind the light is not lit
        lit = (offsets @ axis > 0).any(axis=1)
        met[1:] &= inside[lit, 1:].any(axis=0)
    far = np.where(inside, (offsets @ faces[:, 0].T).max(axis=1), -np.inf).max(axis=0)
    size = max(resolution // 2, 1)
    slack = 2.0 / size  # faces overlap by more than their jitter
    low, high = np.full(2, -1.0 - slack), np.full(2, 1.0 + slack)
    shift = (np.array(jitter[:2]) - 0.5) * (high - low) / size
    low, high = low + shift, high + shift
    return _perspectives(position, faces[met][:, [1, 2, 0]], low, high, geometry.size, far[met].tolist(), 2)


def _perspectives(
    position, axes: np.ndarray, low, high, size: float, far: list[float], scale: int = 1
) -> list[MapView]:
    """Views along the last of `axes` (V, 3, 3), from `low` to `high` along the others, one metre ahead."""
    rows = np.zeros((len(axes), 4, 4))
    rows[:, :3, :3] = axes
    rows[:, :3, 3] = -(axes @ position)
    rows[:, :2] = (2 * rows[:, :2] - (low + high)[:, None] * rows[:, 2:3]) / (high - low)[:, None]
    rows[:, 3, 3] = 1.0
    place, views = (*position, 1.0), []
    for own, farthest in zip(rows, far):
        near = 1e-4 * min(size, max(farthest, 1e-6 * size))  # what is seen may be small before a far background
        views.append(MapView(own, near, place, scale, 1.0 / max(farthest, near)))
    return views


def _merged_rectangles(place: np.ndarray, groups: list[np.ndarray], floor: float):
    """Rectangles (low, high, members) for groups from near to far; a group joins the last one if that is affordable."""
    rectangles = []
    for group in groups:
        low, high = place[group].min(axis=(0, 1)), place[group].max(axis=(0, 1))
        high = np.maximum(high, low + floor)
        if rectangles:
            last_low, last_high, members = rectangles[-1]
            both_low, both_high = np.minimum(last_low, low), np.maximum(last_high, high)
            if (both_high - both_low).max() <= 3.0 * (last_high - last_low).max():
                rectangles[-1] = (both_low, both_high, np.concatenate([members, group]))
                continue
        rectangles.append((low, high, group))
    return rectangles


def _that_meet(place: np.ndarray, low, high) -> np.ndarray:
    """Which boxes project into a rectangle: receivers there ask its view, whether it was made for them or not."""
    return ((place.max(axis=1) >= low) & (place.min(axis=1) <= high)).all(axis=1)


def _padded(low, high, jitter, resolution):
    """Room for the film filter and for a shift below one texel."""
    size = high - low
    low, high = low - 0.02 * size, high + 0.02 * size
    shift = (np.array(jitter[:2]) - 0.5) * (high - low) / resolution
    return low + shift, high + shift


def _widened(low, high, margin: float):
    """Room for blockers beside the receivers, at most as much again on all sides together."""
    margin = np.minimum(margin, 0.5 * (high - low))
    return low - margin, high + margin


def _frame(normal, turn: float):
    """Two unit vectors that make a right-handed frame with `normal`, turned about it by `turn` radians."""
    x, y, z = (float(value) for value in normal)
    # The cross product of the first or second axis with the normal; by hand, because numpy's takes many times longer.
    a = _unit(np.array([0.0, -z, y] if abs(x) < 0.9 else [z, 0.0, -x]))
    b = np.array([y * a[2] - z * a[1], z * a[0] - x * a[2], x * a[1] - y * a[0]])
    return np.cos(turn) * a + np.sin(turn) * b, np.cos(turn) * b - np.sin(turn) * a


def turn_along(normal, direction) -> float:
    """The third number of `jitter` that lays the rows of views against `normal` along `direction`."""
    a, b = _frame(normal, 0.0)
    return float(np.arctan2(direction @ b, direction @ a) / (2 * np.pi))


def _unit(v):
    length = np.linalg.norm(v)
    return v / length if length > 0 else np.array([0.0, 0.0, -1.0])


# ------------------------------------------------------------------------------------------------ atlas and drawing


OPAQUE = Program(
    name="depth map",
    vertex="depth_map/opaque.vert.glsl",
    fragment="depth_map/opaque.frag.glsl",
    inputs=(("VEC3", "position"), ("INT", "local_instance")),
    varyings=(("smooth", "VEC2", "depth_terms"),),
    outputs=(("VEC4", "out_depth"),),
    textures=(("RGBA32F", "instances"),),
    constants=PROJECTION_CONSTANTS,
    defines=PROJECTION_DEFINES,
)
RESTING = Program(
    name="depth map of resting casters",
    vertex="depth_map/resting.vert.glsl",
    fragment="depth_map/opaque.frag.glsl",
    inputs=(("VEC3", "position"),),
    varyings=(("smooth", "VEC2", "depth_terms"),),
    outputs=(("VEC4", "out_depth"),),
    constants=ROWS,
    defines=(("PROJECTION", "row_x, row_y, row_w, row_q, near"),),
)


class Atlas:
    """One image of depth maps in equal cells."""

    def __init__(self):
        self.target: images.Target | None = None
        self._targets: dict[tuple[int, int], images.Target] = {}
        self._resolution = 0

    def prepare(self, views: list[MapView], resolution: int) -> tuple[list[tuple[int, int, int]], np.ndarray]:
        """Cells (x, y, size) for the views, and what shaders must know of them, (V, VIEW_TEXELS, 4).

        The number of views varies from sample to sample, and a new size costs an allocation, so rows are counted in
        powers of two, and an image of each size is kept: a few views do not clear the rows of many.
        """
        if resolution != self._resolution:
            self.release()
            self._resolution = resolution
        whole = sum(view.scale == 1 for view in views)
        needed = whole + -(-(len(views) - whole) // 4)
        columns = max(1, min(4, 8192 // resolution, needed))
        quarters = sorted(range(len(views)), key=lambda k: views[k].scale)  # four half-size views share a cell
        cells, taken, quarter = [(0, 0, 0)] * len(views), 0, 0
        for k in quarters:
            side = resolution // views[k].scale
            if views[k].scale == 1 or quarter % 4 == 0:
                corner = (taken % columns * resolution, taken // columns * resolution)
                taken += 1
            place = (0, 0) if views[k].scale == 1 else (quarter % 2 * side, quarter // 2 % 2 * side)
            quarter += views[k].scale > 1
            cells[k] = (corner[0] + place[0], corner[1] + place[1], side)
        rows = 1
        while rows * columns < taken:
            rows *= 2
        size = (columns * resolution, rows * resolution)
        if size not in self._targets:
            self._targets[size] = images.Target(
                (images.pool.take(*size, "RGBA32F"),), images.pool.take(*size, "DEPTH_COMPONENT32F")
            )
        self.target = self._targets[size]
        texels = np.zeros((len(views), VIEW_TEXELS, 4))
        for k, view in enumerate(views):
            texels[k, :4] = view.rows
            texels[k, 4] = *cells[k], view.cell
        return cells, texels

    def release(self) -> None:
        for target in self._targets.values():
            images.pool.give(target.colors[0])
            images.pool.give(target.depth)
        self._targets, self.target = {}, None


@dataclass(frozen=True)
class AlphaCasters:
    """Casters whose material lets some light pass, and the shader and bindings of each material; layers on surfaces
    (see shaders/lib/shadow.glsl) with what draws each."""

    draws: list[Draw]
    programs: dict[int, tuple[Shader, dict]]
    layers: tuple[tuple[Draw, Shader, dict, dict], ...] = ()  # bindings, constants


def draw_views(
    atlas: Atlas,
    views: list[MapView],
    cells,
    geometry: SceneGeometry,
    alpha: AlphaCasters,
    sample: int,
    lasting: bool = True,
) -> Iterator[int]:
    """Draw all casters into every view of sample number `sample`. Yields after each how many triangles were sent.

    `lasting`: the picture has more samples to come, so that what helps them may cost this one something.
    """
    atlas.target.clear((0.0, 0.0, 0.0, 0.0), 1.0)
    # What has not moved since the first sample is worth being written out; a view that turns finds it so.
    resting = geometry.resting_casters(make=sample > 0 and lasting)
    together = geometry.casters_together() if resting is None else None
    boxes, alpha_boxes = geometry.caster_boxes, Boxes.of(alpha.draws)
    shells = np.array([draw.closed for draw in geometry.opaque_casters], bool)
    for view, (x, y, side) in zip(views, cells):
        sent = 0
        viewport = (x, y, side, side)
        rows = {"row_x": view.rows[0], "row_y": view.rows[1], "row_w": view.rows[2], "row_q": view.rows[3]}
        constants = {**rows, "near": view.near}
        light_point = np.array(view.light_point[:3]) if view.light_point[3] else None
        if resting is not None:
            for clusters in resting:
                sent += _draw_resting(atlas, viewport, constants, clusters, view, light_point)
        elif together is not None:
            parts, chunks, closed = together
            seen = chunks.seen(view.rows, view.least_q)
            one_sided = seen & closed & (True if light_point is None else chunks.without(light_point))
            for drawn, cull in ((one_sided, "BACK"), (seen & ~one_sided, "NONE")):
                for casters, own in parts:
                    runs = joined(casters.first, drawn[own])
                    sent += _draw_runs(atlas, viewport, constants, geometry, casters.batch, runs, cull)
        else:
            seen = boxes.seen(view.rows, view.least_q)
            one_sided = seen & shells & (True if light_point is None else boxes.without(light_point))
            for drawn, cull in ((one_sided, "BACK"), (seen & ~one_sided, "NONE")):
                sent += _draw_instanced(atlas, viewport, constants, geometry, np.flatnonzero(drawn), cull)
        layered = (
            [*calls(alpha.draws, np.flatnonzero(alpha_boxes.seen(view.rows, view.least_q)))] if alpha.draws else []
        )
        with passes.drawing(atlas.target, viewport=viewport) if layered else nullcontext():
            from_outside = entered(alpha.draws, alpha_boxes, view.rows) if layered else ()
            for call in layered:
                passes.set_culling("BACK" if call.draw.material in from_outside else "NONE")
                shader, bindings = alpha.programs[call.draw.material]
                own = {"first_instance": call.first, "caster_sample": sample, "light_point": view.light_point,
                       "glass_blocks": int(view.glass_blocks), "channel_asked": view.channel}  # fmt: skip
                shader.bind(**bindings, constants={**constants, **own})
                passes.draw(shader, call.draw.batch, call.count)
                sent += call.triangles
            passes.set_culling("NONE")
        seen = Boxes.of([draw for draw, *_ in alpha.layers]).seen(view.rows, view.least_q) if alpha.layers else ()
        with passes.drawing(atlas.target, viewport=viewport) if np.any(seen) else nullcontext():
            for draw, shader, bindings, extra in (alpha.layers[k] for k in np.flatnonzero(seen)):
                passes.write_alpha_alone()
                own = {"first_instance": draw.first, "caster_sample": sample, "light_point": view.light_point,
                       "glass_blocks": 0, "channel_asked": 0}  # fmt: skip
                shader.bind(**bindings, constants={**constants, **own, **extra})
                passes.draw(shader, draw.batch, draw.count)
                sent += draw.triangles
        yield sent


def _draw_resting(atlas: Atlas, viewport, constants: dict, clusters: Clusters, view: MapView, light_point) -> int:
    shader = passes.get(RESTING)
    seen = clusters.boxes.seen(view.rows, view.least_q)
    one_sided = seen & clusters.one_sided(light_point)
    sent = 0
    for drawn, cull in ((one_sided, "BACK"), (seen & ~one_sided, "NONE")):
        runs = clusters.calls(drawn)
        if runs:
            with passes.drawing(atlas.target, viewport=viewport, cull=cull):
                shader.bind(constants=constants)
                for first, count in runs:
                    passes.draw_range(shader, clusters.batch, first, count)
                    sent += count
    return sent


def _draw_runs(atlas: Atlas, viewport, constants: dict, geometry: SceneGeometry, batch: Batch, runs, cull) -> int:
    if not runs:
        return 0
    shader = passes.get(OPAQUE)
    with passes.drawing(atlas.target, viewport=viewport, cull=cull):
        shader.bind(textures={"instances": geometry.instances}, constants={**constants, "first_instance": 0})
        for first, count in runs:
            passes.draw_range(shader, batch, first, count)
    return sum(count for _, count in runs)


def _draw_instanced(atlas: Atlas, viewport, constants: dict, geometry: SceneGeometry, seen: np.ndarray, cull) -> int:
    shader = passes.get(OPAQUE)
    sent = 0
    if not len(seen):
        return sent
    with passes.drawing(atlas.target, viewport=viewport, cull=cull):
        shader.bind(textures={"instances": geometry.instances}, constants={**constants, "first_instance": 0})
        for call in calls(geometry.opaque_casters, seen):
            shader.set_constant("first_instance", call.first)
            passes.draw(shader, call.draw.batch, call.count)
            sent += call.triangles
    return sent
