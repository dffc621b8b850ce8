"""Which attributes of a mesh a tree reads: asked when a mesh is read, long before anything is compiled."""

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
    read = {socket.link for node in graph.nodes.values() for socket in node.inputs.values()}
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
