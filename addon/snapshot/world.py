"""The world out of its flat node graph: a constant colour or an equirectangular image where the tree says no more.

These two need no program. Any other tree is handed on as it is and compiled (scene/world_tree.py).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ..materials.graph import Graph, Node
from ..materials.sky import disc_radiance, sky_of
from ..materials.volume import medium_of
from .constants import constant_color, constant_number
from .scene import Image, Light, Visibility, World

IDENTITY = np.eye(3, 4)
LARGEST_LAMP = 0.06  # radians: a sun's disc of this size covers 20 texels of the map across


def read_world(graph: Graph, name: str, images: Mapping[str, Image], visibility: Visibility):
    """(World, notes) of a world's graph; `images` by Image.key as the graph's nodes name them."""
    notes = ()
    volume = None if graph.volume is None else graph
    plain = _plain(graph, graph.surface, images)
    if plain is None:
        return World(np.ones(3), None, IDENTITY.copy(), graph, visibility, medium_of(graph), volume), notes
    color, image, mapping = plain
    return World(color, image, mapping, None, visibility, medium_of(graph), volume), notes


def sun_of(graph: Graph, visibility: Visibility) -> tuple[Graph, Light | None]:
    """The sun of a Sky Texture that is the whole world, as a lamp: where its disc is too small for the map of light.
    The graph that comes back shows it to the camera alone."""
    shader = graph.nodes.get(graph.surface[0]) if graph.surface else None
    if shader is None or shader.type not in ("ShaderNodeBackground", "ShaderNodeEmission"):
        return graph, None
    strength, exact = constant_number(graph, shader, "Strength")
    color = shader.inputs.get("Color")
    node = graph.nodes.get(color.link[0]) if color and color.link else None
    if not exact or node is None or node.type != "ShaderNodeTexSky":
        return graph, None
    vector = node.inputs.get("Vector")
    sky = sky_of(node.properties)
    radiance = disc_radiance(sky) * strength
    if (vector is not None and vector.link is not None) or sky.sun_size > LARGEST_LAMP or not np.any(radiance):
        return graph, None
    side = np.array([np.cos(sky.sun_rotation), -np.sin(sky.sun_rotation), 0.0])
    matrix = np.eye(4)
    matrix[:3, :3] = np.stack([side, np.cross(sky.sun, side), sky.sun], axis=1)
    disc = np.pi * np.sin(sky.sun_size / 2) ** 2
    seen = replace(visibility, camera=False)
    sun = Light("sun of the sky", "Sky", "SUN", matrix, radiance * disc, angle=sky.sun_size, visibility=seen)
    shown = replace(node, properties={**node.properties, "sun_is_lamp": 1.0})
    return replace(graph, nodes={**graph.nodes, node.key: shown}), sun


def constant_world(color, visibility: Visibility) -> World:
    """A world of one radiance."""
    return World(np.asarray(color, np.float64), None, IDENTITY.copy(), None, visibility)


def _plain(graph: Graph, link, images) -> tuple[np.ndarray, Image | None, np.ndarray] | None:
    """(colour or factor, image, mapping) of what is linked to a shader input; None when it is more than that."""
    node = graph.nodes.get(link[0]) if link else None
    if node is None:
        return np.zeros(3), None, IDENTITY.copy()
    if node.type not in ("ShaderNodeBackground", "ShaderNodeEmission"):
        return None
    strength, exact = constant_number(graph, node, "Strength")
    if not exact:
        return None
    source = node.inputs.get("Color")
    linked = graph.nodes.get(source.link[0]) if source and source.link else None
    if linked is not None and linked.type == "ShaderNodeTexEnvironment":
        image, mapping = images.get(linked.image), _direction(graph, linked.inputs.get("Vector"))
        equirectangular = linked.properties.get("projection", "EQUIRECTANGULAR") == "EQUIRECTANGULAR"
        if image is None or mapping is None or not equirectangular or _has_holes(image):
            return None
        return np.full(3, strength), image, mapping
    color, exact = constant_color(graph, node, "Color")
    return (color * strength, None, IDENTITY.copy()) if exact else None


def _has_holes(image: Image) -> bool:
    """Whether the colour has to be weighed by alpha."""
    return image.alpha_mode == "STRAIGHT" and bool((image.pixels[..., 3] != 1.0).any())


def _direction(graph: Graph, source) -> np.ndarray | None:
    """(3, 4) affine map from world direction to what arrives at a vector input; None when it is not affine."""
    if source is None or source.link is None:
        return IDENTITY.copy()
    node = graph.nodes.get(source.link[0])
    if node is None:
        return None
    # For a ray that leaves the scene these outputs are its direction.
    if node.type == "ShaderNodeTexCoord" and source.link[1] in ("Generated", "Object"):
        return IDENTITY.copy() if source.link[1] == "Generated" or not node.properties.get("object") else None
    if node.type == "ShaderNodeNewGeometry" and source.link[1] == "Position":
        return IDENTITY.copy()
    if node.type != "ShaderNodeMapping":
        return None
    below = _direction(graph, node.inputs.get("Vector"))
    own = _mapping_node(graph, node)
    if below is None or own is None:
        return None
    result = own[:, :3] @ below
    result[:, 3] += own[:, 3]
    return result


def _mapping_node(graph: Graph, node: Node) -> np.ndarray | None:
    """(3, 4) of a Mapping node, as Cycles applies location, rotation and scale for each vector type."""
    values = {}
    for name, default in (("Location", 0.0), ("Rotation", 0.0), ("Scale", 1.0)):
        source = node.inputs.get(name)
        if source is not None and source.link is not None:
            return None
        values[name] = np.full(3, default) if source is None else np.asarray(source.value, np.float64)[:3]
    location, scale, rotation = values["Location"], values["Scale"], _euler(values["Rotation"])
    inverse_scale = np.divide(1.0, scale, out=np.zeros(3), where=scale != 0.0)
    kind = node.properties.get("vector_type", "POINT")
    if kind == "POINT":
        return np.column_stack([rotation * scale, location])
    if kind == "TEXTURE":
        linear = inverse_scale[:, None] * rotation.T
        return np.column_stack([linear, -linear @ location])
    if kind == "VECTOR":
        return np.column_stack([rotation * scale, np.zeros(3)])
    return np.column_stack([rotation * inverse_scale, np.zeros(3)])  # NORMAL; the look-up normalises


def _euler(angles: np.ndarray) -> np.ndarray:
    """(3, 3) rotation about X, then Y, then Z, radians."""
    (sx, sy, sz), (cx, cy, cz) = np.sin(angles), np.cos(angles)
    about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    about_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    return about_z @ about_y @ about_x
