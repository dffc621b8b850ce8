"""The constant value of a node's input, as far as a snapshot has to know it (world and light node trees)."""

from __future__ import annotations

import numpy as np

from ..materials.graph import Graph, Node
from ..materials.working_space import current

# Nodes that are one value: bl_idname -> the input under which the reader keeps it.
_VALUE_NODES = {"ShaderNodeRGB": "Color", "ShaderNodeValue": "Value"}


def constant_color(graph: Graph, node: Node, socket: str) -> tuple[np.ndarray, bool]:
    """(3,) float64 of a colour input, and whether it is exact (False: linked to something that varies)."""
    value, exact = _constant(graph, node, socket)
    numbers = np.atleast_1d(np.asarray(value if value is not None else 0.0, np.float64))
    return (np.repeat(numbers, 3) if numbers.size == 1 else numbers[:3].copy()), exact


def constant_number(graph: Graph, node: Node, socket: str) -> tuple[float, bool]:
    """A number input; a colour counts as its luminance."""
    value, exact = _constant(graph, node, socket)
    numbers = np.atleast_1d(np.asarray(value if value is not None else 0.0, np.float64))
    return float(numbers[0] if numbers.size == 1 else numbers[:3] @ current().luminance), exact


def _constant(graph: Graph, node: Node, socket: str):
    source = node.inputs.get(socket)
    if source is None:
        return None, True
    if source.link is None:
        return source.value, True
    linked = graph.nodes.get(source.link[0])
    if linked is not None and linked.type in _VALUE_NODES:
        return linked.inputs[_VALUE_NODES[linked.type]].value, True
    if linked is not None and linked.type == "ShaderNodeBlackbody":
        temperature, exact = constant_number(graph, linked, "Temperature")
        return blackbody(temperature), exact
    if linked is not None and linked.type == "ShaderNodeLightFalloff" and source.link[1] == "Quadratic":
        strength, exact = constant_number(graph, linked, "Strength")
        smooth, constant = constant_number(graph, linked, "Smooth")
        return strength, exact and constant and smooth == 0.0
    return source.value, False


# Linear Rec.709 colours of black bodies at luminance 1, evenly spaced in 1e6 / kelvin from 12000 K to 800 K, where
# Blender holds them. Measured from Light.temperature_color of Blender 5.2; in between linear to 0.012.
_BLACK_BODIES = np.array(
    [
        (0.8263, 0.9945, 1.5663),
        (0.9925, 0.9883, 1.1366),
        (1.1917, 0.9642, 0.7918),
        (1.4141, 0.9236, 0.5337),
        (1.6491, 0.8729, 0.3452),
        (1.8938, 0.8140, 0.2102),
        (2.1426, 0.7496, 0.1141),
        (2.3938, 0.6817, 0.0464),
        (2.6453, 0.6118, 0.0000),
        (2.8958, 0.5406, 0.0000),
        (3.1423, 0.4695, 0.0000),
        (3.3847, 0.3989, 0.0000),
        (3.6222, 0.3292, 0.0000),
        (3.8526, 0.2613, 0.0000),
        (4.0762, 0.1951, 0.0000),
        (4.2928, 0.1308, 0.0000),
        (4.5004, 0.0691, 0.0000),
        (4.7006, 0.0095, 0.0000),
        (4.8917, 0.0000, 0.0000),
        (5.0739, 0.0000, 0.0000),
        (5.2476, 0.0000, 0.0000),
        (5.4139, 0.0000, 0.0000),
    ]
)


def blackbody(kelvin: float) -> np.ndarray:
    """(3,) linear colour of Blender's Blackbody node, in the current working space."""
    mired = np.linspace(1e6 / 12000.0, 1e6 / 800.0, len(_BLACK_BODIES))
    at = 1e6 / max(kelvin, 1.0)
    color = np.array([np.interp(at, mired, channel) for channel in _BLACK_BODIES.T])
    return np.maximum(current().from_rec709 @ color, 0.0)
