"""What a tree reads of the world around it: attributes of its mesh (asked when a mesh is read, long before anything is
compiled), the instance that shows it, and the camera."""

from __future__ import annotations

from . import nodes
from .compiled import Attribute
from .graph import Graph, Node
from .nodes import entry as words

IMPLICIT = {
    "@UV": Attribute("UV", ""), "@GENERATED": Attribute("GENERATED", ""), "@RADIAL": Attribute("GENERATED", ""),
}  # fmt: skip


def asked_for(node: Node, socket: words.Socket) -> bool:
    """Whether the implicit value of an unlinked socket matters, see Socket.only_with."""
    other = node.inputs.get(socket.only_with)
    return not socket.only_with or (other is not None and (other.link is not None or bool(other.value)))


def attributes_of(graph: Graph) -> frozenset[Attribute]:
    """All attributes that the nodes of the table look up."""
    found = set()
    read = graph.read
    for node in graph.nodes.values():
        entry = nodes.find(node.type, node.properties)
        for argument in entry.arguments if entry is not None else ():
            if isinstance(argument, words.Attribute) and (not argument.output or (node.key, argument.output) in read):
                name = argument.name or str(node.properties.get(argument.property, ""))
                found.add(Attribute(argument.kind, name))
            elif isinstance(argument, words.Socket) and argument.implicit in IMPLICIT:
                given = node.inputs.get(argument.identifier)
                if (given is None or given.link is None) and asked_for(node, argument):
                    found.add(IMPLICIT[argument.implicit])
    return frozenset(found)


INSTANCE, CAMERA = "instance", "camera"
# Node types, of some only these outputs, whose values differ between instances of one mesh: by what the object says of
# itself, or by where it stands.
_OF_INSTANCE = {
    "ShaderNodeObjectInfo": (), "ShaderNodeParticleInfo": (), "ShaderNodeCameraData": (),
    "ShaderNodeVectorTransform": (),
    "ShaderNodeNewGeometry": ("Position", "Normal", "Tangent", "True Normal", "Incoming"),
    "ShaderNodeTexCoord": ("Camera", "Window", "Reflection"), "ShaderNodeLightPath": ("Ray Length",),
}  # fmt: skip
_OF_CAMERA = {
    "ShaderNodeCameraData": (), "ShaderNodeTexCoord": ("Camera", "Window"), "ShaderNodeLightPath": ("Ray Length",),
    "ShaderNodeVectorTransform": (),
}  # fmt: skip


def surroundings_of(graph: Graph) -> frozenset[str]:
    """INSTANCE where a tree may give other values for instances of one mesh, CAMERA where for other views."""
    read = graph.read
    found = set()
    for node in graph.nodes.values():
        for name, table in ((INSTANCE, _OF_INSTANCE), (CAMERA, _OF_CAMERA)):
            outputs = table.get(node.type)
            if outputs is not None and (not outputs or any((node.key, output) in read for output in outputs)):
                found.add(name)
        if any(node.properties.get(name) for name in ("from_instancer", "of_another_object", "of_instance")):
            found.add(INSTANCE)
    return frozenset(found)
