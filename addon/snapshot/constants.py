"""The constant value of a node's input, as far as a snapshot has to know it (world and light node trees)."""

from __future__ import annotations

import numpy as np

from ..materials.graph import Graph, Node

# Nodes that hold one value: bl_idname -> where the reader may have put it (output default as property or input).
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
    return float(numbers[0] if numbers.size == 1 else numbers[:3] @ (0.2126, 0.7152, 0.0722)), exact


def _constant(graph: Graph, node: Node, socket: str):
    source = node.inputs.get(socket)
    if source is None:
        return None, True
    if source.link is None:
        return source.value, True
    linked = graph.nodes.get(source.link[0])
    if linked is not None and linked.type in _VALUE_NODES:
        name = _VALUE_NODES[linked.type]
        for value in (linked.properties.get(name), linked.properties.get("value"), linked.properties.get("color")):
            if value is not None:
                return value, True
        if name in linked.inputs:
            return linked.inputs[name].value, True
    if linked is not None and linked.type == "ShaderNodeBlackbody":
        temperature, exact = constant_number(graph, linked, "Temperature")
        return blackbody(temperature), exact
    return source.value, False


def blackbody(kelvin: float) -> np.ndarray:
    """(3,) linear Rec.709 colour of a black body, luminance 1.

    Planck's law integrated against the CIE 1931 observer in the Gaussian fits of Wyman, Sloan and Shirley (2013),
    "Simple Analytic Approximations to the CIE XYZ Color Matching Functions". Held outside 800 to 12000 K, as in Cycles.
    """
    wavelength = np.arange(380.0, 781.0, 5.0)

    def lobe(peak, below, above):
        return np.exp(-0.5 * ((wavelength - peak) * np.where(wavelength < peak, below, above)) ** 2)

    x = 0.362 * lobe(442.0, 0.0624, 0.0374) + 1.056 * lobe(599.8, 0.0264, 0.0323) - 0.065 * lobe(501.1, 0.049, 0.0382)
    y = 0.821 * lobe(568.8, 0.0213, 0.0247) + 0.286 * lobe(530.9, 0.0613, 0.0322)
    z = 1.217 * lobe(437.0, 0.0845, 0.0278) + 0.681 * lobe(459.0, 0.0385, 0.0725)
    kelvin = min(max(kelvin, 800.0), 12000.0)
    spectrum = wavelength**-5.0 / np.expm1(1.4387769e7 / (wavelength * kelvin))
    xyz = np.array([spectrum @ x, spectrum @ y, spectrum @ z])
    xyz_to_rgb = np.array([[3.2406, -1.5372, -0.4986], [-0.9689, 1.8758, 0.0415], [0.0557, -0.2040, 1.0570]])
    return np.maximum(xyz_to_rgb @ (xyz / xyz[1]), 0.0)  # deep red lies outside Rec.709
