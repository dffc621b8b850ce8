"""Edits of reflections as data: constraints and regions of one object, ready for the solve (shaders/edit/solve.glsl).

A constraint says: what arrives at `place` along `before` is to come from `after`. Its directions refer to the view in
which it was made. Regions say where constraints act, and how they fade. All places and directions are in the scene's
space relative to the render origin.

    B(q) = sum over constraints n of  w_n after_n before_n^T + 1e-4 I,   w_n = 1 / d(n, q)^2 over the largest
    R(q) = the rotation nearest to B;   faded by a(q):  the rotation nearest to  a R + (1 - a) r r^T

T. Ritschel, M. Okabe, T. Thormaehlen, H.-P. Seidel, "Interactive reflection editing", 2009. R(q) minimises sum w |R
before - after|^2 (Wahba's problem); the small identity decides the spin that single pairs leave open, so one constraint
alone is the shortest way.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..gfx import passes
from ..gfx.struct import Block, Struct
from .geodesic import Surface

MOST_CONSTRAINTS, MOST_REGIONS, MOST_LAYERS = 32, 16, 16
EUCLIDEAN, GEODESIC, PAINTED = 0, 1, 2
MOST_INSIDE = 8  # ways inside a solid that are followed
LARGE_ANGLE = 120.0  # degrees of one constraint, from which on edits fold over
FLOOR = 1e-4  # of the extent: distances below count as that
EDITS = Struct(
    "Edits",
    ("vec4", f"region[{2 * MOST_REGIONS}]"),
    ("vec4", f"pair[{3 * MOST_CONSTRAINTS}]"),
    ("vec4", "frozen"),  # the eye of the view that stays, and 1
    (
        "vec4",
        "shape",
    ),  # whether the object is closed, whether a constraint is about what passes, number of the frozen eye
)
SOLVE_CONSTANTS = (("INT", "region_count"), ("INT", "constraint_count"), ("FLOAT", "distance_floor"))
SOLVE = passes.fullscreen_program(
    "solve edits",
    "edit/solve.frag.glsl",
    textures=(("RGBA32F", "places"), ("RGBA32F", "directions")),
    blocks=((EDITS, "edits"),),
    constants=SOLVE_CONSTANTS,
    outputs=(("VEC4", "out_edit"),),
)


@dataclass(frozen=True)
class Constraint:
    place: np.ndarray  # (3,)
    before: np.ndarray  # (3,) unit: where light comes from without the edit
    after: np.ndarray  # (3,) unit: where it is to come from
    normal: np.ndarray  # (3,) unit, of the surface there
    bent: bool = False  # about what passes glass
    layer: int = -1  # of its distances along the surface

    @property
    def angle(self) -> float:
        """Degrees between before and after."""
        return float(np.degrees(np.arccos(np.clip(self.before @ self.after, -1.0, 1.0))))


@dataclass(frozen=True)
class Region:
    kind: int  # EUCLIDEAN, GEODESIC, PAINTED
    centre: np.ndarray  # (3,)
    radius: float
    border: float  # width inside the radius over which it fades
    layer: int = -1  # of its distances along the surface, or of painted weights


def influence(region: Region, value: np.ndarray) -> np.ndarray:
    """1 inside, 0 outside, smooth across the border, for distances (or painted weights) of any shape."""
    if region.kind == PAINTED:
        return np.clip(value, 0.0, 1.0)
    if region.border <= 0.0:
        return np.where(np.asarray(value) <= region.radius, 1.0, 0.0)
    t = np.clip((np.asarray(value) - region.radius + region.border) / region.border, 0.0, 1.0)
    return 1.0 - t * t * (3.0 - 2.0 * t)


def mirrored(view: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Direction that a mirror shows towards unit `view`."""
    return unit(2.0 * (view @ normal) * normal - view)


def bent(view: np.ndarray, normal: np.ndarray, ior: float) -> np.ndarray:
    """Direction that an interface of index `ior` shows straight through; mirrored where it reflects all."""
    normal = normal if view @ normal >= 0 else -normal
    cosine = view @ normal
    squared = 1.0 - (1.0 - cosine * cosine) / (ior * ior)
    if squared < 0.0:
        return mirrored(view, normal)
    return unit((cosine / ior - np.sqrt(squared)) * normal - view / ior)


def leaving(
    surface: Surface, normals: np.ndarray, point: np.ndarray, direction: np.ndarray, ior: float, offset: float
) -> tuple[np.ndarray, np.ndarray]:
    """Where light that comes into a solid of index `ior` along a unit direction leaves it, and along which, (3,) each.

    `normals`: (T, 3, 3) of the corners of the surface's triangles, on either side. Where the surface lets nothing
    through the way is mirrored, MOST_INSIDE times; where the solid is open it goes straight on. `offset`: that rays
    begin with, m.
    """
    for _ in range(MOST_INSIDE):
        met = surface.met(point + offset * direction, direction)
        if met is None:
            break
        triangle, weights = met
        point = weights @ surface.positions[surface.triangles[triangle]]
        normal = unit(weights @ normals[triangle])
        onwards = bent(-direction, normal, 1.0 / ior)
        if (onwards @ normal) * (direction @ normal) > 0.0:
            return point, onwards
        direction = onwards
    return point, direction


@dataclass
class EditTable:
    """Constraints and regions of an object in a uniform block."""

    block: Block
    constants: dict[str, object]


def edit_table(
    constraints: Sequence[Constraint],
    regions: Sequence[Region],
    members: Sequence[int],
    extent: float,
    frozen: np.ndarray | None = None,
    closed: bool = False,
    frozen_number: int = 0,
) -> EditTable:
    """`members`: for each region the bits of its constraints. `extent` of the object, m. `frozen`: an eye (3,), of
    those for what is seen through closed objects the one that `frozen_number` says, from 1; 0: none. `closed`: rays
    that edits send into the object go on where they leave it."""
    region = np.zeros((2 * MOST_REGIONS, 4), np.float32)
    pair = np.zeros((3 * MOST_CONSTRAINTS, 4), np.float32)
    for k, (one, bits) in enumerate(zip(regions, members)):
        region[2 * k] = *one.centre, one.radius
        region[2 * k + 1] = one.border, one.kind + 4 * (one.layer + 1), bits & 0xFFFF, bits >> 16
    for n, one in enumerate(constraints):
        pair[3 * n] = *one.place, one.layer
        pair[3 * n + 1] = *one.before, 0.0
        pair[3 * n + 2] = *_decided(one), float(one.bent)
    eye = np.zeros(4) if frozen is None else np.append(frozen, 1.0)
    constants = {
        "region_count": len(regions), "constraint_count": len(constraints),
        "distance_floor": max(FLOOR * extent, 1e-30),
    }  # fmt: skip
    return EditTable(
        Block(
            EDITS,
            region=region,
            pair=pair,
            frozen=eye,
            shape=(float(closed), float(any(one.bent for one in constraints)), float(frozen_number), 0.0),
        ),
        constants,
    )


def _decided(one: Constraint) -> np.ndarray:
    """Where `after` is opposite to `before` any way round is as short: the one over the normal is taken."""
    if one.before @ one.after > -0.99999:
        return one.after
    side = one.normal - (one.normal @ one.before) * one.before
    if np.linalg.norm(side) < 1e-6:
        side = np.cross(one.before, np.eye(3)[np.argmin(np.abs(one.before))])
    return unit(one.after + 5e-3 * unit(side))


def unit(v: np.ndarray) -> np.ndarray:
    """A vector (3,) at length 1."""
    return np.asarray(v, float) / max(float(np.linalg.norm(v)), 1e-300)
