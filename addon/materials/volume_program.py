"""Compiles the volume part of a node tree to GLSL: one function from a point in space to the medium there.

Only trees that vary need it; what is the same everywhere is a `Medium` of numbers (volume.py). The value nodes are
those of surfaces (expressions.py), asked at points of a grid over the object instead of on its surface
(scene/media.py, shaders/media/bake.frag.glsl). Attributes are grids: those of an OpenVDB object, by name; w = 0 where
there is no such grid, so that Principled Volume leaves its density alone, as Cycles does.

The phase function's kind is that of the part that scatters most; its anisotropy may vary.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace

import numpy as np

from .compiled import Attribute
from .expressions import Expressions
from .graph import Graph, Input, Node
from .nodes.color import _spectrum
from .nodes.entry import Attribute as NodeAttribute
from .nodes.entry import Entry, Expression, Socket
from .spectra import BLACKBODY

HEAD = "void evaluate_volume(SurfacePoint point, inout VolumePoint volume)"
SOURCE = "media/nodes.glsl"
GREY, WHITE = (0.8, 0.8, 0.8), (1.0, 1.0, 1.0)
INFO = {"Density": "density", "Color": "color", "Flame": "flame", "Temperature": "temperature"}  # outputs: grids


@dataclass(frozen=True)
class CompiledVolume:
    """As CompiledMaterial; `glsl` defines evaluate_volume."""

    name: str
    program_key: str
    glsl: str
    attributes: tuple[Attribute, ...]
    images: tuple[str, ...]
    values: np.ndarray  # (P, 4) float32, P >= 1
    fallbacks: tuple[tuple[str, str], ...]


def compile_volume(name: str, graph: Graph, images: dict | None = None) -> CompiledVolume:
    """Compile what is linked to the volume output of `graph`."""
    graph = _without_volume_info(_without_instances(graph))
    code = Expressions(name, graph, images)
    code.includes.setdefault(SOURCE)
    if code.exists(graph.volume):
        _walk(code, graph.volume, "1.0", 0)
    glsl, values = code.text(HEAD), code.values.array()
    kinds = ",".join(attribute.kind for attribute in code.attributes)
    identity = f"{glsl}\0{kinds}\0{len(code.image_keys)}\0{len(values)}"
    return CompiledVolume(
        name, hashlib.sha256(identity.encode()).hexdigest()[:32], glsl, tuple(code.attributes), tuple(code.image_keys),
        values, tuple(code.fallbacks),
    )  # fmt: skip


DEEPEST = 64  # shaders above each other
# Outputs that follow the camera; without a name: all of the node's.
OF_CAMERA = {
    ("ShaderNodeTexCoord", "Camera"), ("ShaderNodeTexCoord", "Window"), ("ShaderNodeTexCoord", "Reflection"),
    ("ShaderNodeNewGeometry", "Incoming"), ("ShaderNodeLightPath", "Ray Length"), ("ShaderNodeCameraData", ""),
    ("ShaderNodeLightFalloff", ""), ("ShaderNodeFresnel", ""), ("ShaderNodeLayerWeight", ""),
}  # fmt: skip


def reads_camera(graph: Graph) -> bool:
    """Whether what is linked to the volume output depends on where the camera stands or how it is turned."""
    waiting, seen = [graph.volume], set()
    while waiting:
        link = waiting.pop()
        if link is None or link in seen or link[0] not in graph.nodes:
            continue
        seen.add(link)
        node = graph.nodes[link[0]]
        if not OF_CAMERA.isdisjoint(((node.type, link[1]), (node.type, ""))):
            return True
        if "CAMERA" in (node.properties.get("convert_from"), node.properties.get("convert_to")):
            return True
        waiting += [socket.link for socket in node.inputs.values()]
    return False


def _walk(code: Expressions, link: tuple[str, str], weight: str, depth: int) -> None:
    node = code.graph.nodes[link[0]]
    if depth > DEEPEST:
        return
    if node.type in ("ShaderNodeAddShader", "ShaderNodeMixShader"):
        weights = (weight, weight)
        if "Mix" in node.type:
            entry = Entry(node.type, arguments=(Socket("Fac", "FLOAT", 0.5),))
            code.require(node, entry)
            factor = f"f{len(code.lines)}"
            code.lines.append(f"float {factor} = clamp({code.socket(node, entry.arguments[0])}, 0.0, 1.0);")
            weights = (f"{weight} * (1.0 - {factor})", f"{weight} * {factor}")
        for name, share in zip(("Shader", "Shader_001"), weights):
            socket = node.inputs.get(name)
            if socket is not None and code.exists(socket.link):
                _walk(code, socket.link, share, depth + 1)
        return
    if node.type not in LEAVES:
        code.note(node, f"'{node.label}' is no volume shader and is left out.")
        return
    entry = LEAVES[node.type](node)
    code.require(node, entry)
    code.include(entry)
    arguments = ", ".join(code.argument(node, entry, argument) for argument in entry.arguments)
    code.lines.append(f"{entry.function}(volume, {weight}, {arguments});")


def _absorption(node: Node) -> Entry:
    return Entry(node.type, "volume_absorption", (Socket("Color", "COLOR", GREY), Socket("Density", "FLOAT", 1.0)))


def _scatter(node: Node) -> Entry:
    sockets = (Socket("Color", "COLOR", GREY), Socket("Density", "FLOAT", 1.0), Socket("Anisotropy", "FLOAT"))
    return Entry(node.type, "volume_scatter", sockets)


def _coefficients(node: Node) -> Entry:
    names = ("Absorption Coefficients", "Scatter Coefficients", "Emission Coefficients")
    sockets = (*(Socket(name, "VECTOR") for name in names), Socket("Anisotropy", "FLOAT"))
    return Entry(node.type, "volume_coefficients", sockets)


def _emission(node: Node) -> Entry:
    return Entry(node.type, "volume_emission", (Socket("Color", "COLOR", WHITE), Socket("Strength", "FLOAT", 1.0)))


def _principled(node: Node) -> Entry:
    def grid(socket: str, default: str):
        given = node.inputs.get(socket)
        name = default if given is None or given.value is None else str(given.value)
        return NodeAttribute("NAMED", name=name) if name else Expression("vec4(0.0)")

    return Entry(
        node.type,
        "volume_principled",
        (
            Socket("Color", "COLOR", (0.5, 0.5, 0.5)), grid("Color Attribute", ""),
            Socket("Density", "FLOAT", 1.0), grid("Density Attribute", "density"),
            Socket("Anisotropy", "FLOAT"), Socket("Absorption Color", "COLOR"),
            Socket("Emission Strength", "FLOAT"), Socket("Emission Color", "COLOR", WHITE),
            Socket("Blackbody Intensity", "FLOAT"), Socket("Blackbody Tint", "COLOR", WHITE),
            Socket("Temperature", "FLOAT", 1000.0), grid("Temperature Attribute", "temperature"),
            *_spectrum(BLACKBODY),
        ),
        include="material/curves.glsl",
    )  # fmt: skip


LEAVES = {
    "ShaderNodeVolumeAbsorption": _absorption,
    "ShaderNodeVolumeScatter": _scatter,
    "ShaderNodeVolumePrincipled": _principled,
    "ShaderNodeVolumeCoefficients": _coefficients,
    "ShaderNodeEmission": _emission,
}


def _without_instances(graph: Graph) -> Graph:
    """With Attribute nodes of objects and instancers as stand-ins: the grid's points know no instance."""
    reading = {key: node for key, node in graph.nodes.items() if node.properties.get("of_instance")}
    plain = {key: replace(node, properties={**node.properties, "of_instance": False}) for key, node in reading.items()}
    return replace(graph, nodes={**graph.nodes, **plain}) if plain else graph


def _without_volume_info(graph: Graph) -> Graph:
    """Volume Info nodes as the Attribute nodes that they stand for."""
    infos = {key for key, node in graph.nodes.items() if node.type == "ShaderNodeVolumeInfo"}
    if not infos:
        return graph
    nodes = {}
    for key, node in graph.nodes.items():
        inputs = {}
        for name, socket in node.inputs.items():
            if socket.link is not None and socket.link[0] in infos and socket.link[1] in INFO:
                info, output = socket.link
                made = f"{info} . {output}"
                kind = "COLOR" if output == "Color" else "FLOAT"
                read = "Color" if output == "Color" else "Fac"
                settings = {"attribute_type": "GEOMETRY", "attribute_name": INFO[output]}
                nodes[made] = Node(made, info, "ShaderNodeAttribute", {}, {read: kind}, settings)
                socket = Input(socket.kind, socket.value, (made, read))
            inputs[name] = socket
        nodes[key] = replace(node, inputs=inputs)
    return replace(graph, nodes=nodes)
