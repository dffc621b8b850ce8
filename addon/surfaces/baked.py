"""Surfaces of a bake: places of one object, known by triangle, in place of what a camera sees.

Blender says for each texel of the target which triangle of the object lies there and where in it. These are records of
hits (hits.py): the material's own program runs at each, and leaves closures in the surface images, by which all
techniques light them as any surface. Light that bounces, mirrors and denoising are those of a picture.

In each sample the places lie elsewhere within their texels, as far as the triangle goes.

| cost | per sample |
|---|---|
| places | numpy, 4 x 16 bytes a texel uploaded |
| closures | 1 pass, and 1 for each material of the object |

Fails: what belongs to a view (fog before a surface, caustics that are splatted on the picture) is not in a bake; what
is transparent is shaded as if it were met.
"""

from __future__ import annotations

import numpy as np

from ..frame.picture import Frame
from ..frame.technique import Technique
from ..gfx import images
from ..sampling.sequence import FILM
from ..scene.pieces import octahedral
from ..snapshot.scene import BakedPoints, Instance, Mesh
from .hits import Hits, Records

NEUTRAL = 0  # of Snapshot.materials
BENT_OFFSET = 0.2  # as of Cycles and shaders/ask/view.glsl


class BakedSurface:
    """The places of a picture's bake (frame.shared)."""

    def __init__(self):
        self._own: tuple | None = None

    def draw(self, frame: Frame, technique: Technique, target: images.Target) -> None:
        """Closures of this sample's places into the six surface images."""
        if self._own is None:
            self._own = self._find(frame)
        instance, rows, mesh = self._own
        hits = frame.kept(Hits)
        columns, materials, facing = _columns(frame, frame.snapshot.baked, instance, rows, mesh, hits)
        points = tuple(images.upload(column) for column in columns)
        records = Records.take(frame.size)
        hits.place(frame, technique, points, records)
        closures = images.Target(target.colors, records.target.depth)
        hits.shade(frame, technique, images.upload(facing), records, materials, closures)
        records.give()

    @staticmethod
    def _find(frame: Frame) -> tuple[Instance, int, Mesh]:
        """The instance, its row and its mesh, as they are drawn."""
        placed, meshes, _ = frame.geometry.placed
        for row, one in enumerate(placed):
            if one.key == frame.snapshot.baked.instance:
                return one, row, meshes[one.mesh]
        raise ValueError("The object that is baked has no surface.")


def _columns(
    frame: Frame, baked: BakedPoints, instance: Instance, row: int, mesh: Mesh, hits: Hits
) -> tuple[list[np.ndarray], set[int], np.ndarray]:
    """What `Hits.place` takes, (H, W, 4) float32 each, the materials there, and the directions of view."""
    height, width = baked.triangle.shape
    there = (baked.triangle >= 0) & (baked.triangle < mesh.triangle_count)
    triangle = baked.triangle[there]
    jitter = np.subtract(frame.random(FILM), 0.5) if frame.sample else np.zeros(2)
    share = _inside(baked.share[there] + np.einsum("nij,i->nj", baked.step[there], jitter))
    weights = np.concatenate([1.0 - share.sum(axis=1, keepdims=True), share], axis=1)
    corners = mesh.triangle_corners[triangle]
    places = mesh.positions[mesh.corner_vertices[corners]].astype(np.float64)
    linear = instance.matrix[:3, :3]
    world = places @ linear.T + (instance.matrix[:3, 3] - frame.geometry.origin)
    first, second = world[:, 1] - world[:, 0], world[:, 2] - world[:, 0]
    plane = _unit(np.cross(first, second))
    mirrored = -1.0 if np.linalg.det(linear) < 0.0 else 1.0
    a, b, c = linear.T
    turn = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=1)
    normals = mesh.corner_normals[corners].astype(np.float64) @ (turn.T * mirrored)
    shading = _unit((weights[:, :, None] * normals).sum(axis=1))
    position = (weights[:, :, None] * world).sum(axis=1)
    along = baked.step[there][:, :, :1] * first[:, None] + baked.step[there][:, :, 1:] * second[:, None]
    # Of vertices Blender knows no texel: they are points, but a record without a width is none.
    least = 1e-3 * np.linalg.norm(first, axis=1) + 1e-20
    footprint = np.maximum(np.sqrt(np.linalg.norm(np.cross(along[:, 0], along[:, 1]), axis=1)), least)
    if baked.outward:
        plane = shading = _unit(position + frame.geometry.origin)
    material = mesh.triangle_materials(instance.materials)[triangle] if len(triangle) else np.zeros(0, int)
    material = np.full_like(material, NEUTRAL) if baked.plain else material
    if baked.through_camera:
        camera = frame.snapshot.camera
        direction = _unit(position - (camera.matrix[:3, 3] - frame.geometry.origin))
        if camera.kind == "ORTHOGRAPHIC":
            direction = np.broadcast_to(-camera.matrix[:3, 2], position.shape)
        direction = -_bent(-direction, shading)
    else:
        direction = -shading

    def column(*values) -> np.ndarray:
        made = np.zeros((height, width, 4), np.float32)
        made[there] = np.concatenate([np.reshape(value, (len(triangle), -1)) for value in values], axis=1)
        return made

    number = np.zeros(len(triangle)) if baked.plain else hits.numbers(frame, instance)[triangle]
    none, one = np.zeros(len(triangle)), np.ones(len(triangle))
    columns = [
        column(position, footprint), column(np.full(len(triangle), row), number, share),
        column(octahedral(plane), octahedral(shading)), column(material, one, none, none),
    ]  # fmt: skip
    return columns, set(np.unique(material).tolist()), column(direction, none)


def _bent(toward: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Directions to a viewer that sees what faces away, too: view_of_surface of shaders/ask/view.glsl."""
    above = (toward * normal).sum(axis=1, keepdims=True)
    raised = _unit(toward - normal * np.minimum(above - BENT_OFFSET, 0.0))
    return np.where(above <= 0.0, _unit(raised + (normal - raised) * -above), raised)


def _inside(share: np.ndarray) -> np.ndarray:
    """Weights of two corners, of which none is negative, nor that of the third."""
    weights = np.maximum(np.concatenate([1.0 - share.sum(axis=1, keepdims=True), share], axis=1), 0.0)
    return (weights / weights.sum(axis=1, keepdims=True))[:, 1:]


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-300)
