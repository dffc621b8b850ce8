"""Irradiance under Cycles' light shapes by brute-force integration: midpoints of fine grids over each source.

A source is a function of receivers (N, 3) that returns directions (N, M, 3), distances (N, M; inf for suns) and
weights (N, M): radiance times the solid angle that each direction stands for. Radiance follows from the light's
strength as in Cycles: see the formulas at each function.
"""

import numpy as np

STEPS = 64  # per axis of the grid over a source


def grid(steps=None):
    """Midpoints of a square grid over the unit square, (M, 2)."""
    steps = steps or STEPS
    return (np.mgrid[0:steps, 0:steps].reshape(2, -1).T + 0.5) / steps


def disc(steps=None):
    """Points over the unit disc, each standing for the same area, (M, 2)."""
    u = grid(steps)
    radius, turn = np.sqrt(u[:, 0]), 2 * np.pi * u[:, 1]
    return np.column_stack([radius * np.cos(turn), radius * np.sin(turn)])


def basis(axis):
    """Two unit vectors across `axis` (N, 3)."""
    helper = np.where(np.abs(axis[..., :1]) < 0.9, [1.0, 0, 0], [0, 1.0, 0])
    u = np.cross(helper, axis)
    u /= np.linalg.norm(u, axis=-1, keepdims=True)
    return u, np.cross(axis, u)


def point(centre, strength):
    """Radiant intensity S / 4 pi."""

    def source(receivers):
        offset = np.asarray(centre, float) - receivers
        distance = np.linalg.norm(offset, axis=-1)
        weight = strength / (4 * np.pi) / distance**2
        return (offset / distance[:, None])[:, None], distance[:, None], weight[:, None]

    return source


def soft_point(centre, radius, strength):
    """A disc that faces each receiver, radiance S / (4 pi^2 r^2)."""
    place = disc() * radius

    def source(receivers):
        axis = np.asarray(centre, float) - receivers
        axis /= np.linalg.norm(axis, axis=-1, keepdims=True)
        u, v = basis(axis)
        offset = (centre - receivers)[:, None] + place[:, :1] * u[:, None] + place[:, 1:] * v[:, None]
        squared = (offset**2).sum(axis=-1)
        direction = offset / np.sqrt(squared)[..., None]
        cosine = np.einsum("nmi,ni->nm", direction, axis)
        radiance = strength / (4 * np.pi**2 * radius**2)
        return direction, np.sqrt(squared), radiance * np.pi * radius**2 / len(place) * cosine / squared

    return source


def sphere(centre, radius, strength):
    """A sphere of radiance S / (4 pi^2 r^2), seen within a cone of directions."""
    u = grid()

    def source(receivers):
        to_centre = np.asarray(centre, float) - receivers
        distance = np.linalg.norm(to_centre, axis=-1)
        limit = np.sqrt(1 - (radius / distance) ** 2)
        direction = cone(to_centre / distance[:, None], limit, u)
        along = np.einsum("nmi,ni->nm", direction, to_centre)
        hit = along - np.sqrt(np.maximum(radius**2 - distance[:, None] ** 2 + along**2, 0))
        radiance = strength / (4 * np.pi**2 * radius**2)
        weight = radiance * 2 * np.pi * (1 - limit)[:, None] / len(u)
        return direction, hit, np.broadcast_to(weight, hit.shape)

    return source


def cone(axis, cos_limit, u):
    """Directions evenly over the solid angle of a cone around axis (N, 3) with the cosine cos_limit (N,)."""
    a, b = basis(axis)
    cosine = 1 - u[None, :, 0] * (1 - cos_limit[:, None])
    sine, turn = np.sqrt(1 - cosine**2), 2 * np.pi * u[None, :, 1]
    return (
        cosine[..., None] * axis[:, None]
        + (sine * np.cos(turn))[..., None] * a[:, None]
        + (sine * np.sin(turn))[..., None] * b[:, None]
    )


def sun(towards, angle, strength):
    """Radiance S / (pi sin^2(angle / 2)) within half the angle around the direction towards the sun."""
    axis = np.asarray(towards, float) / np.linalg.norm(towards)
    u = grid()

    def source(receivers):
        half = angle / 2
        direction = cone(axis[None], np.array([np.cos(half)]), u)
        weight = strength / (np.pi * np.sin(half) ** 2) * 4 * np.pi * np.sin(half / 2) ** 2 / len(u)
        shape = (len(receivers), len(u))
        return np.broadcast_to(direction, (*shape, 3)), np.full(shape, np.inf), np.full(shape, weight)

    return source


def area(centre, u, v, strength, round_shape=False, normal=(0, 0, -1), spread=np.pi):
    """A rectangle or ellipse with full side (axis) vectors u and v: radiance S / (pi A), narrowed by the spread."""
    u, v = np.asarray(u, float), np.asarray(v, float)
    place = disc() / 2 if round_shape else grid() - 0.5
    size = np.linalg.norm(np.cross(u, v)) * (np.pi / 4 if round_shape else 1.0)
    points = np.asarray(centre, float) + place[:, :1] * u + place[:, 1:] * v

    def source(receivers):
        offset = points[None] - receivers[:, None]
        squared = (offset**2).sum(axis=-1)
        direction = offset / np.sqrt(squared)[..., None]
        cosine = np.maximum(-direction @ np.asarray(normal, float), 0)
        radiance = strength / (np.pi * size)
        if spread < np.pi:
            half = spread / 2
            tangent = np.sqrt(1 - cosine**2) / np.maximum(cosine, 1e-9)
            radiance = radiance * np.maximum(np.tan(half) - tangent, 0) / (np.tan(half) - half)
        return direction, np.sqrt(squared), radiance * size / len(points) * cosine / squared

    return source


def spot(source, matrix, angle, blend):
    """A point source narrowed to a cone along the local -Z of `matrix` (3, 3), per ray; smoothstep over the blend."""
    inverse = np.linalg.inv(matrix)

    def narrowed(receivers):
        direction, distance, weight = source(receivers)
        local = -direction @ inverse.T
        cosine = -local[..., 2] / np.linalg.norm(local, axis=-1)
        edge = np.cos(angle / 2)
        if blend > 0:
            x = np.clip((cosine - edge) / ((1 - edge) * blend), 0, 1)
            return direction, distance, weight * x * x * (3 - 2 * x)
        return direction, distance, weight * (cosine > edge)

    return narrowed


def irradiance(source, receivers, blockers=(), opacity=1.0):
    """W/m2 on receivers (N, 3) that face up. `blockers` are (low, high, z) rectangles, see Stage.blocker."""
    direction, distance, weight = source(receivers)
    seen = np.ones(weight.shape)
    for low, high, z in blockers:
        with np.errstate(divide="ignore", invalid="ignore"):
            t = (z - receivers[:, None, 2]) / direction[..., 2]
            place = receivers[:, None, :2] + t[..., None] * direction[..., :2]
        crossed = (t > 0) & (t < distance) & ((place > low) & (place < high)).all(axis=-1)
        seen *= np.where(crossed, 1 - opacity, 1.0)
    return (weight * seen * np.maximum(direction[..., 2], 0)).sum(axis=1)
