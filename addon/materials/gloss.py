"""How narrow the gloss of a material is, as far as its tree says so without running."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from .graph import Graph, Node
from .working_space import current

THROWS = 0.35  # roughness up to which metal throws caustics: all photons of a sample share the lobe's numbers
SMOOTH = 0.25  # up to which photons and paths go on from it; above it gloss takes photons (shaders/caustics/gloss.glsl)
METALLIC = 0.5  # from which on a Principled BSDF mirrors
DARK = 0.1  # luminance of a base of which the polish above it throws more light
_GLASS = ("ShaderNodeBsdfGlass", "ShaderNodeBsdfRefraction")
_MIRRORS = ("ShaderNodeBsdfGlossy", "ShaderNodeBsdfAnisotropic", "ShaderNodeBsdfMetallic")


def mirrors(graph: Graph) -> Iterator[float]:
    """Roughness of each lobe of metal; 1 where a texture says it."""
    for node in graph.nodes.values():
        metal = node.type == "ShaderNodeBsdfPrincipled" and value(node, "Metallic") >= METALLIC
        if metal or node.type in _MIRRORS:
            yield value(node, "Roughness", 1.0)


def glass(graph: Graph) -> Iterator[float]:
    """Roughness of each lobe of glass; 1 where a texture says it."""
    for node in graph.nodes.values():
        if node.type in _GLASS or (
            node.type == "ShaderNodeBsdfPrincipled" and value(node, "Transmission Weight", 1.0) > 0.0
        ):
            yield value(node, "Roughness", 1.0)


def polish(graph: Graph) -> Iterator[float]:
    """Roughness of each lobe of varnish over a base as dark as DARK; 1 where a texture says it."""
    for node in graph.nodes.values():
        opaque = node.type == "ShaderNodeBsdfPrincipled" and value(node, "Transmission Weight") < 0.5
        if opaque and value(node, "Metallic") < METALLIC and _luminance(node) <= DARK:
            yield value(node, "Roughness", 1.0) if value(node, "Specular IOR Level") > 0.0 else 1.0
            yield value(node, "Coat Roughness", 1.0) if value(node, "Coat Weight") >= 0.5 else 1.0


def coated(graph: Graph) -> bool:
    """Whether a Principled BSDF of the tree may have a coat."""
    nodes = (node for node in graph.nodes.values() if node.type == "ShaderNodeBsdfPrincipled")
    return any(value(node, "Coat Weight", 1.0) > 0.0 for node in nodes)


def value(node: Node, name: str, unknown: float = 0.0) -> float:
    """A socket's own value, or `unknown` where it is linked or missing."""
    own = _own(node, name)
    return unknown if own is None else float(own[0])


def _luminance(node: Node) -> float:
    """Of a Principled BSDF's base; 1 where it is linked."""
    own = _own(node, "Base Color")
    return 1.0 if own is None else float(own[:3] @ current().luminance)


def _own(node: Node, name: str) -> np.ndarray | None:
    """Numbers of a socket that has some of its own."""
    socket = node.inputs.get(name)
    return None if socket is None or socket.link is not None or socket.value is None else np.ravel(socket.value)
