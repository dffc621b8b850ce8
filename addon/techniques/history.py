"""History: light of the pictures before, carried along while the view moves.

Diffuse light, straight from sources and by way of surfaces, is carried without the surface's colour. A pixel asks
where its surface was in the picture before, by the motion of the camera and of its object, and joins what that shows
of the same surface with its own fresh light:

    light = mix(before, fresh, 1 / (1 + n)),  n = samples that stand behind `before`, at most MANY

so that n pictures of a still surface have the error of n samples. The same surface is one that lies on the tangent
plane within 1.5 pixels, no farther away than six, and faces alike (within 26 degrees); n is multiplied by the share of
the bilinear weights that is on it. Indirect light is filtered over neighbours (film/neighbours.py) when it is joined:
over 13x13 pixels up to 2 samples, over 4x4 at 8, from 24 on not at all. On objects that move n is at most FEW, as for
light straight from lamps where a moving object's box stands or stood before one of them; there it counts for fewer
where means of 5x5 pixels of it and of fresh light differ by more than noise explains (`in_time` in recall.frag.glsl).
(Everywhere, where the world or meshes shine.) Beside moving objects indirect
light counts for as many pictures as leave the least error, by the share of the hemisphere that a step changes. While
lamps move n is at most LAMPS, and less where a step changes more than LAG / LAMPS of their light. After any other edit
(and while lamps of node trees move) there is no history at all (frame/history.py); what shines is never carried.

In drafts of the viewport, and, where `animation` says so, in final pictures of one sample drawn one after the other
by one process. Never in slices, with motion blur or where samples may end early: all machines would need one past.

| cost | per picture |
|---|---|
| pass | 16 + 4 fetches of history per pixel; while objects move 14 for each of them and lamp, 125 in their shadows |
| images | 4 RGBA32F of the picture's size, kept |

Bias: light that changes as things move lags by up to FEW pictures, bounced light far from them by MANY, light of lamps
that move by LAMPS; sharp shadows of moved cameras are looked up between pixels. Sources: Nehab et al. 2007
(reprojection); Schied et al. 2017 (SVGF: light without colour, tests of surfaces); Salvi 2016 (bounds by neighbours).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..film import neighbours
from ..frame.history import Before
from ..frame.picture import Frame
from ..frame.settings import Settings
from ..frame.technique import Param, Technique, Write
from ..gfx import images, passes
from ..materials.compiler import may_emit
from ..scene.view import VIEW
from ..snapshot.scene import Light, Snapshot
from ..sources import lights
from ..surfaces.draw import SURFACE_TEXTURES, SURFACES, surface_bindings

MANY, FEW = 32, 8  # samples that history counts for at most; on objects that move and in their shadows
NOISE = 0.05  # relative variance of the indirect light of a draft, by `bench orbit`: what a step is weighed against
LAMPS = 3.0  # while lamps move: what is shown lags by so many steps
LAG = 0.3  # of their light, by which what is shown may lag behind lamps that move
PATHS = ("radiance.diffuse_direct", "radiance.diffuse_indirect")
REMEMBERED = (
    Write("history.place", "RGBA32F", "Where the surface is from the render origin, m; alpha: samples of direct light"),
    Write("history.facing", "RGBA32F", "Octahedral normal; z: samples of indirect light"),
    Write("history.direct", "RGBA32F", "Diffuse direct light without the surface's colour"),
    Write("history.indirect", "RGBA32F", "Diffuse indirect light without the surface's colour"),
)
RECALL = passes.fullscreen_program(
    "history",
    "history/recall.frag.glsl",
    textures=(
        *SURFACE_TEXTURES, ("RGBA32F", "fresh_direct"), ("RGBA32F", "fresh_indirect"), ("RGBA32F", "before_table"),
        *(("RGBA32F", f"before_{write.name.partition('.')[2]}") for write in REMEMBERED),
    ),
    blocks=((VIEW, "film_view"),),
    constants=(("FLOAT", "most_still"), ("FLOAT", "most_moved"), ("FLOAT", "draft_noise")),
    outputs=tuple(
        ("VEC4", f"out_{name}") for name in ("place", "facing", "direct", "indirect", "direct_light", "indirect_light")
    ),
)  # fmt: skip
SHOW = passes.fullscreen_program(
    "history as it is shown",
    "history/show.frag.glsl",
    textures=tuple(
        ("RGBA32F", name)
        for name in ("surface_diffuse", "fresh_indirect", "before_facing", "before_indirect", "nearer", "farther")
    ),
    outputs=(("VEC4", "out_light"),),
)
ROWS_OF_VIEW = 5
MOST_LAMPS = 16  # of which it is looked up whether what moves is before them
SLACK = 0.02  # of a box's longest side, by which it is larger than its object


class History(Technique):
    name = "history"
    label = "History"
    params = (
        Param(
            "drafts", "While the View Moves", True,
            "Reuse diffuse light from the previous pictures while the viewport changes, for less noise",
        ),
        Param(
            "animation", "In Animations", False,
            "Reuse diffuse light from the previous frames of an animation of one sample, for less flicker; each frame "
            "then depends on those that the same process rendered before",
        ),
    )  # fmt: skip
    reads = SURFACES
    finishes = PATHS
    writes = (
        *(Write(path, "RGBA32F", "Diffuse light, joined with that of the pictures before", True) for path in PATHS),
        *REMEMBERED,
    )
    remembers = REMEMBERED

    def skip(self, snapshot: Snapshot, settings: Settings) -> str | None:
        if snapshot.camera is not None and snapshot.camera.panorama is not None:
            return "places are not looked up in pictures of panoramic cameras"
        if settings.schedule.is_draft:
            return None if settings.get(self, "drafts") else "it is off for moving views"
        if settings.schedule.shows_each:
            return "the picture is at rest"
        if not settings.get(self, "animation"):
            return "it is off in final pictures"
        if settings.samples > 1:
            return "it joins light in pictures of one sample alone"
        if settings.is_slice or settings.may_end_early:
            return "other machines, or other runs, would have another past"
        return "motion blur looks at several moments" if snapshot.motion is not None else None

    def sample(self, frame: Frame) -> Iterator[None]:
        """Cut into parts between its programs, so that a viewport answers while they are compiled."""
        if not frame.is_first:
            return
        before = frame.before
        table = images.upload_list(_table(frame, before))
        kept = before.images if before else {write.name: frame.images[PATHS[0]] for write in REMEMBERED}
        with images.borrowed(*frame.size, "RGBA32F") as direct, images.borrowed(*frame.size, "RGBA32F") as indirect:
            remembered = tuple(frame.images[write.name] for write in REMEMBERED)
            passes.fullscreen(
                RECALL,
                images.Target((*remembered, direct.colors[0], indirect.colors[0])),
                textures={
                    **surface_bindings(frame), "fresh_direct": frame.images[PATHS[0]],
                    "fresh_indirect": frame.images[PATHS[1]], "before_table": table,
                    **{f"before_{name.partition('.')[2]}": image for name, image in kept.items()},
                },
                blocks={"film_view": frame.view_block},
                constants={"most_still": float(MANY), "most_moved": float(FEW), "draft_noise": NOISE},
            )  # fmt: skip
            yield
            if frame.settings.samples == 1 or frame.settings.schedule.is_draft:
                yield from self._filtered(frame, indirect)
            for path, found in zip(PATHS, (direct, indirect)):
                passes.copy(found.colors[0], frame.target(path))
        frame.count(self, "passes", 3)
        if before:
            frame.count(self, "pictures before", before.turn)
            frame.count(self, "moved objects", len(before.moved))
            frame.count(self, "moved lamps", len(before.lamps))

    def _filtered(self, frame: Frame, shown: images.Target) -> Iterator[None]:
        """Indirect light of neighbours where few pictures stand behind it."""
        light, surfaces = frame.images["history.indirect"], surface_bindings(frame)
        with images.borrowed(*frame.size, "RGBA32F") as near, images.borrowed(*frame.size, "RGBA32F") as far:
            yield from neighbours.means(frame, light, near, far)
            yield
            textures = {
                "surface_diffuse": surfaces["surface_diffuse"], "fresh_indirect": frame.images[PATHS[1]],
                "before_facing": frame.images["history.facing"], "before_indirect": light,
                "nearer": near.colors[0], "farther": far.colors[0],
            }  # fmt: skip
            passes.fullscreen(SHOW, shown, textures=textures)
        frame.count(self, "passes", 3)


def _table(frame: Frame, before: Before | None) -> np.ndarray:
    """(N, 4) what shaders/history/recall.frag.glsl reads; without a picture before, a view that sees nothing."""
    if before is None:
        return np.zeros((ROWS_OF_VIEW, 4))
    origin = frame.geometry.origin
    lamps = [] if _other_light(frame) else frame.emitters
    most = _most(frame, before)
    # Where objects move, too, what they hid from a lamp's former place is not looked up.
    sharp = float(bool(before.lamps and before.moved) or any(_outruns_penumbra(*pair) for pair in before.lamps))
    counts = (len(lamps), float(not lamps), most, sharp)
    rows = [*before.rows[:3], (*(origin - before.origin), len(before.moved)), counts]
    meshes, emissive = frame.snapshot.meshes, [material.emissive for material in frame.materials.compiled]
    for one in frame.snapshot.instances:
        if one.key not in before.moved:
            continue
        moved, mesh = before.moved[one.key], meshes[one.mesh]
        rows += [
            *_between(moved, origin, before.origin),
            *_into_box(one.matrix, mesh, origin),
            *_into_box(moved @ one.matrix, mesh, before.origin),
            *_sphere(moved, one.matrix, mesh, origin, any(emissive[k] for k in one.materials)),
        ]
    rows += [
        (*one.centre, -1.0 - np.tan(one.radius) if one.kind == lights.SUN else one.reach) for one in lamps
    ]  # fmt: skip
    return np.array(rows, np.float64)


def _most(frame: Frame, before: Before) -> float:
    """How many pictures light of the picture before counts for at most, by how far lamps have moved."""
    if not before.lamps:
        return float(MANY)
    if frame.receivers is None or not len(frame.receivers.distance):
        return 0.0
    places = (frame.receivers.low + frame.receivers.high) / 2 + frame.geometry.origin
    moved = [(_straight_light(old, places), _straight_light(new, places)) for old, new in before.lamps]
    change = sum(np.linalg.norm(now - then, axis=1).mean() for then, now in moved)
    light = sum(max(np.linalg.norm(one, axis=1).mean() for one in pair) for pair in moved)
    return min(LAMPS, LAG * light / change) if change > 0.0 else float(MANY)


def _outruns_penumbra(old: Light, new: Light) -> bool:
    """Whether a lamp moves by more than its own width while history counts: its shadows then leave others behind."""
    turned = np.linalg.norm(_ahead(new) - _ahead(old))
    if new.kind == "SUN":
        return bool(LAMPS * turned > new.angle)
    if new.kind == "SPOT" and LAMPS * turned > max(new.spot_blend, 0.02) * new.spot_angle:
        return True
    scales = np.linalg.norm(new.matrix[:3, :2], axis=0)
    width = min(scales * new.size) if new.kind == "AREA" else 2.0 * new.radius
    return bool(LAMPS * np.linalg.norm(new.matrix[:3, 3] - old.matrix[:3, 3]) > width)


def _ahead(lamp: Light) -> np.ndarray:
    """(3,) unit, where a lamp looks."""
    return -lamp.matrix[:3, 2] / max(np.linalg.norm(lamp.matrix[:3, 2]), 1e-30)


def _straight_light(lamp: Light, places: np.ndarray) -> np.ndarray:
    """(N, 3) vectors along which a lamp's light comes to places (N, 3) of the world, as long as it is strong there:
    about W/m2. Cones of spots have soft edges here."""
    strength = float(np.abs(lamp.strength).mean()) or 1.0
    if lamp.kind == "AREA" and not lamp.normalize:
        strength *= float(np.linalg.norm(np.cross(*lamp.matrix[:3, :2].T)))
    ahead = _ahead(lamp)
    if lamp.kind == "SUN":
        return np.broadcast_to(strength * ahead, places.shape)
    way = places - lamp.matrix[:3, 3]
    distance = np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-3)
    way = way / distance
    towards = np.maximum(way @ ahead, 0.0)[:, None]
    narrow = {"AREA": 1.0, "SPOT": np.clip((np.pi / max(lamp.spot_angle, 1e-2)) ** 2, 1.0, 200.0)}.get(lamp.kind, 0.0)
    return strength * way * towards**narrow / (4.0 * np.pi * distance**2)


def _other_light(frame: Frame) -> bool:
    """Whether there is light whose shadows are not looked for: of the world, of meshes, of very many lamps."""
    snapshot = frame.snapshot
    glows = any(may_emit(snapshot.materials[slot].graph) for slot in snapshot.used_materials)
    return glows or frame.environment.power > 0 or len(frame.emitters) > MOST_LAMPS


def _between(matrix: np.ndarray, now: np.ndarray, then: np.ndarray) -> np.ndarray:
    """(3, 4) rows of a matrix of the world, from places relative to the origin `now` to those relative to `then`."""
    out = matrix[:3].copy()
    out[:, 3] += matrix[:3, :3] @ now - then
    return out


def _sphere(moved: np.ndarray, matrix: np.ndarray, mesh, origin: np.ndarray, emits: bool = False) -> np.ndarray:
    """(2, 4) the sphere around an object's box: middle, relative to the origin, and radius; how far a corner of the box
    has moved at most, m, and whether the object emits."""
    sides = np.array([mesh.bounds_min, mesh.bounds_max])
    corners = np.stack(np.meshgrid(*sides.T), axis=-1).reshape(8, 3) @ matrix[:3, :3].T + matrix[:3, 3]
    then = corners @ moved[:3, :3].T + moved[:3, 3]
    middle = corners.mean(axis=0)
    radius = np.linalg.norm(corners - middle, axis=1).max()
    return np.array(
        [(*(middle - origin), radius), (np.linalg.norm(then - corners, axis=1).max(), float(emits), 0.0, 0.0)]
    )


def _into_box(matrix: np.ndarray, mesh, origin: np.ndarray) -> np.ndarray:
    """(3, 4) rows that take a place relative to the origin into a mesh's box, which is -1..1 there."""
    low, high = mesh.bounds_min, mesh.bounds_max
    half = (high - low) / 2
    half = half + SLACK * max(half.max(), 1e-6)
    inverse = np.linalg.inv(matrix)[:3]
    inverse = inverse / half[:, None]
    inverse[:, 3] += inverse[:, :3] @ origin - (low + high) / 2 / half
    return inverse
