"""Attributes of a mesh over its face corners, as material programs read them."""

from __future__ import annotations

import numpy as np

from ..materials.compiled import Attribute
from ..snapshot.scene import Mesh

MOTIONS = ("MOTION_BEFORE", "MOTION_AFTER")


def corner_attribute(mesh: Mesh, attribute: Attribute) -> np.ndarray:
    """A named attribute over the corners as (C, 4) float32; zeros where the mesh does not have it, as in Blender."""
    out = np.zeros((len(mesh.corner_vertices), 4), np.float32)
    if attribute.kind == "UV":
        source = mesh.uv_maps.get(attribute.name or mesh.active_uv)
        if source is None and attribute.name in mesh.colors:
            source = mesh.colors[attribute.name][:, :3]  # what is no map, too, may be named
    elif attribute.kind == "UV_PASS":
        source = mesh.uv_maps.get(mesh.active_uv)
        out[:, 2] = 1.0 if source is not None else 0.0
    elif attribute.kind in MOTIONS:
        moved = mesh.motion and mesh.motion[MOTIONS.index(attribute.kind)]
        source = None if moved is None else moved[mesh.corner_vertices]
    elif attribute.kind == "COLOR":
        source = mesh.colors.get(attribute.name or mesh.active_color)
        if source is None and attribute.name in mesh.uv_maps:
            source, out[:, 3] = mesh.uv_maps[attribute.name], 1.0
    elif attribute.kind == "NAMED":
        source, out[:, 3] = mesh.colors.get(attribute.name), 1.0
        if source is None and attribute.name in mesh.uv_maps:
            source, out[:, 3] = mesh.uv_maps[attribute.name], 2.0  # see material/input.glsl
    elif attribute.kind == "GENERATED":
        source = None if mesh.generated is None else mesh.generated[mesh.corner_vertices]
    else:
        source = mesh.tangents.get(attribute.name or mesh.active_uv)
    if source is not None:
        out[:, : source.shape[1]] = source
    return out
