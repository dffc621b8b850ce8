"""Hair of particle systems: every strand as a row of points, as Cycles asks Blender for them.

A system has as many strands as it has children, or particles where it has no children, each of 2^steps + 1 points. Its
radius falls from root to tip by the system's shape:

    r(t) = (root - tip) (1 - t)^k + tip,   k = 1 + shape below 0, 1 / (1 - shape) above,   t: share of the length

Blender hands out one point a call: 0.5 s for a million. So a system is read again only when its object's geometry has
been evaluated anew.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain

import bpy
import numpy as np

MOST_STEPS = 10  # doublings of a strand's points: as far as Blender's own settings go


@dataclass(frozen=True, slots=True)
class HairSystem:
    """The hair of one particle system; stands where others have their evaluated mesh."""

    owner: object  # evaluated object
    modifier: object  # its particle system modifier
    number: int  # among the object's modifiers
    final: bool  # as in a final render, not as in the viewport

    @property
    def id_type(self) -> str:
        """Of what data-blocks are called, it is none."""
        return "HAIR"

    @property
    def session_uid(self) -> int:
        """A new number where the object was evaluated anew; 0 where nobody knows."""
        return getattr(self.owner.data, "session_uid", 0)

    @property
    def pointer(self) -> int:
        """What tells it from all other systems and meshes."""
        return self.modifier.particle_system.as_pointer()

    @property
    def slot(self) -> int:
        """Material slot, from 0 on; there may be fewer."""
        return self.modifier.particle_system.settings.material - 1


@dataclass(frozen=True)
class Strands:
    """Curve k holds the points from offsets[k] up to offsets[k + 1]."""

    points: np.ndarray  # (P, 3) float32, in the object's space
    radii: np.ndarray  # (P,) float32
    offsets: np.ndarray  # (C + 1,) int
    uv_maps: dict[str, np.ndarray]  # (C, 2) float32: where the strand grows
    active_uv: str
    generated: np.ndarray  # (C, 3) float32: of the root


def hair_systems(owner, final: bool) -> Iterator[HairSystem]:
    """The systems of an evaluated object that are drawn as strands."""
    for number, modifier in enumerate(owner.modifiers):
        if modifier.type != "PARTICLE_SYSTEM" or not (modifier.show_render if final else modifier.show_viewport):
            continue
        settings = modifier.particle_system.settings
        if settings.type == "HAIR" and settings.render_type == "PATH":
            yield HairSystem(owner, modifier, number, final)


def read_hair(hair: HairSystem) -> Strands:
    """All strands of a system; without any the arrays are empty."""
    system, owner = hair.modifier.particle_system, hair.owner
    settings = system.settings
    first, end = _strands(system, hair.final)
    count = _points_a_strand(hair)
    ask = system.co_hair
    rows = (ask(owner, particle_no=strand, step=step) for strand in range(first, end) for step in range(count))
    points = np.fromiter(chain.from_iterable(rows), np.float64, (end - first) * count * 3).reshape(-1, count, 3)
    to_object = np.array(owner.matrix_world.inverted_safe(), np.float64)
    points = points @ to_object[:3, :3].T + to_object[:3, 3]
    # A strand that Blender has not made stays where it was, at zero.
    points = points[np.isfinite(points).all(axis=(1, 2))]
    uv_maps, active = _uv_maps(hair, first, end) if len(points) == end - first else ({}, "")
    return Strands(
        points.reshape(-1, 3).astype(np.float32), _radii(points, settings).reshape(-1).astype(np.float32),
        np.arange(len(points) + 1) * count, uv_maps, active, _generated(owner.data, points[:, 0]),
    )  # fmt: skip


def point_count(hair: HairSystem) -> int:
    """Points of all strands, without reading them."""
    first, end = _strands(hair.modifier.particle_system, hair.final)
    return (end - first) * _points_a_strand(hair)


def _points_a_strand(hair: HairSystem) -> int:
    settings = hair.modifier.particle_system.settings
    steps = settings.render_step if hair.final else settings.display_step
    count = (1 << min(max(steps, 0), MOST_STEPS)) + 1
    return count + settings.kink_extra_steps if settings.kink == "SPIRAL" else count


def _strands(system, final: bool) -> tuple[int, int]:
    """Numbers of the strands that are drawn: children hide their parents."""
    parents, children = len(system.particles), len(system.child_particles)
    settings = system.settings
    if not final:
        children = int(children * settings.display_percentage * 0.01)
    without = settings.child_type == "NONE" or children == 0
    return (0, parents) if without else (parents, parents + children)


def _radii(points: np.ndarray, settings) -> np.ndarray:
    """(C, count) of strands (C, count, 3)."""
    lengths = np.linalg.norm(np.diff(points, axis=1), axis=2)
    along = np.concatenate([np.zeros((len(points), 1)), np.cumsum(lengths, axis=1)], axis=1)
    left = 1.0 - along / np.maximum(along[:, -1:], 1e-30)
    shape = settings.shape
    power = 1.0 + shape if shape < 0.0 else 1.0 / max(1.0 - shape, 1e-6)
    scale = 0.5 * settings.radius_scale
    root, tip = scale * settings.root_radius, scale * settings.tip_radius
    radii = (root - tip) * np.clip(left, 0.0, 1.0) ** power + tip
    if settings.use_close_tip:
        radii[:, -1] = 0.0
    return np.maximum(radii, 0.0)


def _uv_maps(hair: HairSystem, first: int, end: int) -> tuple[dict[str, np.ndarray], str]:
    layers = getattr(hair.owner.data, "uv_layers", ())
    system = hair.modifier.particle_system
    if not len(layers) or first == end or not len(system.particles):
        return {}, ""
    particles = list(system.particles)
    last = len(particles) - 1
    ask, found = system.uv_on_emitter, {}
    for number, layer in enumerate(layers):
        values = (
            ask(hair.modifier, particle=particles[min(strand, last)], particle_no=strand, uv_no=number)
            for strand in range(first, end)
        )
        flat = np.fromiter(chain.from_iterable(values), np.float32, 2 * (end - first))
        found[layer.name] = np.nan_to_num(flat.reshape(-1, 2), posinf=0.0, neginf=0.0)
    return found, next((layer.name for layer in layers if layer.active_render), "")


def _generated(data, roots: np.ndarray) -> np.ndarray:
    """Roots in the texture space of the mesh that they grow on, mapped to 0..1."""
    if not isinstance(data, bpy.types.Mesh):
        return np.zeros((len(roots), 3), np.float32)
    centre, size = np.array(data.texspace_location), np.array(data.texspace_size)
    scale = np.divide(0.5, size, out=np.zeros(3), where=size != 0.0)
    return ((roots - centre) * scale + 0.5).astype(np.float32)
