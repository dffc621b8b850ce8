"""The world as a constant colour or an equirectangular image, read from its flat node graph.

Anything else in the tree falls back to the nearest constant with a Note: the picture is lit, and says it is wrong.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..materials.graph import Graph, Node
from .constants import constant_color, constant_number
from .scene import Image, Note, Visibility, World

IDENTITY = np.eye(3, 4)


def read_world(graph: Graph, name: str, images: Mapping[str, Image], visibility: Visibility):
    """(World, notes) of a world's graph; `images` by Image.key as the graph's nodes name them."""
    subject = f"World '{name}'"
    notes: list[Note] = []
    if graph.volume is not None:
        notes.append(Note(subject, "the world's volume is not drawn."))
    color, image, mapping = _shader(graph, graph.surface, images, subject, notes)
    return World(color, image, mapping, visibility), tuple(notes)


def constant_world(color, visibility: Visibility) -> World:
    """A world of one radiance."""
    return World(np.asarray(color, np.float64), None, IDENTITY.copy(), visibility)


def _shader(graph: Graph, link, images, subject: str, notes: list[Note]):
    """(colour or factor, image, mapping) of what is linked to a shader input."""
    node = graph.nodes.get(link[0]) if link else None
    if node is None:
        return np.zeros(3), None, IDENTITY.copy()
    if node.type in ("ShaderNodeBackground", "ShaderNodeEmission"):
        return _background(graph, node, images, subject, notes)
    if node.type == "ShaderNodeAddShader":
        parts = [_constant_shader(graph, source.link, images, subject, notes) for source in node.inputs.values()]
        _say_constant(notes, subject, node)
        return sum(parts, np.zeros(3)), None, IDENTITY.copy()
    if node.type == "ShaderNodeMixShader":
        return _mix(graph, node, images, subject, notes)
    text = f"node '{node.label}' is not supported in a world and is drawn black; use Background."
    notes.append(Note(subject, text, node=node.label))
    return np.zeros(3), None, IDENTITY.copy()


def _mix(graph: Graph, node: Node, images, subject: str, notes: list[Note]):
    """A Mix Shader: the first input alone where the factor is linked.

    Mostly a Light Path node is linked there, to show the camera another background than the one that lights the
    scene: factor 0 is what the light sees.
    """
    factor = node.inputs.get("Fac") or node.inputs.get("Factor")
    shaders = [source for source in node.inputs.values() if source.kind == "SHADER"]
    if factor is None or len(shaders) < 2:
        return np.zeros(3), None, IDENTITY.copy()
    if factor.link is not None:
        text = f"the factor of '{node.label}' varies and is taken as 0: only its first background is drawn."
        notes.append(Note(subject, text, node=node.label))
        return _shader(graph, shaders[0].link, images, subject, notes)
    share = float(np.clip(np.atleast_1d(factor.value)[0], 0.0, 1.0))
    if share in (0.0, 1.0):
        return _shader(graph, shaders[int(share)].link, images, subject, notes)
    first, second = (_constant_shader(graph, source.link, images, subject, notes) for source in shaders[:2])
    _say_constant(notes, subject, node)
    return (1.0 - share) * first + share * second, None, IDENTITY.copy()


def _constant_shader(graph: Graph, link, images, subject: str, notes: list[Note]) -> np.ndarray:
    color, image, _ = _shader(graph, link, images, subject, notes)
    return color if image is None else color * mean_radiance(image)


def _say_constant(notes: list[Note], subject: str, node: Node) -> None:
    notes.append(Note(subject, f"'{node.label}' is drawn as one constant colour.", node=node.label))


def _background(graph: Graph, node: Node, images, subject: str, notes: list[Note]):
    strength, exact = constant_number(graph, node, "Strength")
    if not exact:
        text = f"the strength of '{node.label}' varies and is taken as {strength:g}."
        notes.append(Note(subject, text, node=node.label))
    source = node.inputs.get("Color")
    linked = graph.nodes.get(source.link[0]) if source and source.link else None
    if linked is not None and linked.type == "ShaderNodeTexEnvironment":
        image, mapping = _environment(graph, linked, images, subject, notes)
        if image is None:
            return np.zeros(3), None, IDENTITY.copy()
        if mapping is None:
            return mean_radiance(image) * strength, None, IDENTITY.copy()
        return np.full(3, strength), image, mapping
    color, exact = constant_color(graph, node, "Color")
    if not exact:
        label = linked.label if linked is not None else "?"
        text = f"what node '{label}' makes is not supported in a world; '{node.label}' is drawn as one constant colour."
        notes.append(Note(subject, text, node=label))
    return color * strength, None, IDENTITY.copy()


def _environment(graph: Graph, node: Node, images, subject: str, notes: list[Note]):
    """(image, mapping) of an environment texture; mapping None when the directions cannot be followed."""
    image = images.get(node.image)
    if image is None:
        notes.append(Note(subject, f"node '{node.label}' has no image and is drawn black.", node=node.label))
        return None, None
    if node.properties.get("projection", "EQUIRECTANGULAR") != "EQUIRECTANGULAR":
        text = f"node '{node.label}': only the equirectangular projection is supported; its mean colour is drawn."
        notes.append(Note(subject, text, node=node.label))
        return image, None
    mapping = _direction(graph, node.inputs.get("Vector"))
    if mapping is None:
        text = f"node '{node.label}' is mapped by something else than Generated coordinates; its mean colour is drawn."
        notes.append(Note(subject, text, node=node.label))
    return image, mapping


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


def mean_radiance(image: Image) -> np.ndarray:
    """(3,) mean of an equirectangular image over the sphere, decoded to linear."""
    rgb = image.pixels[..., :3].astype(np.float64)
    if image.encoding == "SRGB":
        rgb = np.where(rgb < 0.04045, rgb / 12.92, ((np.maximum(rgb, 0.0) + 0.055) / 1.055) ** 2.4)
    height = len(rgb)
    edge = np.linspace(-0.5 * np.pi, 0.5 * np.pi, height + 1)
    weight = np.diff(np.sin(edge)) * 0.5  # solid angle of each row, all together 1
    return np.einsum("h,hwc->c", weight, rgb) / rgb.shape[1]
