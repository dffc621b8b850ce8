"""Bounds of the values in a tree, found by following its links: `estimate.py` applied to a graph."""

from __future__ import annotations

from . import nodes
from .estimate import Estimate, constant, image_estimate, unknown
from .expressions import Expressions
from .graph import Node
from .nodes import entry as words
from .nodes.entry import Entry
from .values import to_kind

DEEPEST = 48  # links followed to learn about a value; what lies deeper is taken as unknown


class Bounds:
    """Estimates of everything that an `Expressions` has emitted, each made once and only when asked for."""

    def __init__(self, code: Expressions) -> None:
        self._code = code
        self._known: dict[tuple[str, str], Estimate] = {}

    def sockets(self, node: Node, entry: Entry) -> NodeBounds:
        """The bounds of a node's sockets, by identifier."""
        return NodeBounds(self, node, entry, 0)

    def socket(self, node: Node, socket: words.Socket, depth: int) -> Estimate:
        """What is known about a socket's value without running the tree."""
        given = node.inputs.get(socket.identifier)
        if given is not None and self._code.exists(given.link):
            if given.link in self._code.outputs:
                estimate = self._output(given.link, depth)
                kind = self._code.outputs[given.link][1]
                if socket.kind == "FLOAT" and kind != "FLOAT":
                    return estimate.luminance() if kind == "COLOR" else estimate.average()
                return estimate
            if socket.implicit:
                return unknown()
        value, kind = (socket.default, socket.kind) if given is None else (given.value, given.kind)
        return constant(to_kind(socket.default if value is None else value, kind, socket.kind))

    def _output(self, link: tuple[str, str], depth: int) -> Estimate:
        if link not in self._known:
            self._known[link] = self._new(link, depth)
        return self._known[link]

    def _new(self, link: tuple[str, str], depth: int) -> Estimate:
        node = self._code.graph.nodes[link[0]]
        entry = nodes.find(node.type, node.properties)
        if depth > DEEPEST:
            return unknown()
        if entry.image:
            image = (self._code.images or {}).get(node.image)
            if image is None or image.pixels.size == 0:
                return unknown()
            clipped = node.properties.get("extension") == "CLIP" and not image.missing
            return image_estimate(image, clipped, link[1])
        if entry.estimate is None:
            return unknown()
        outputs = entry.estimate(NodeBounds(self, node, entry, depth + 1))
        estimate = outputs[link[1]] if link[1] in outputs else outputs["*"]
        return estimate.clipped() if node.properties.get(entry.clamp_result) else estimate


class NodeBounds:
    """Estimates of one node's sockets by identifier, made when asked for: not every image must be looked at."""

    def __init__(self, bounds: Bounds, node: Node, entry: Entry, depth: int) -> None:
        self._bounds, self._node, self._depth = bounds, node, depth
        self._sockets = {a.identifier: a for a in entry.arguments if isinstance(a, words.Socket)}

    @property
    def properties(self) -> dict[str, object]:
        """The node's settings."""
        return self._node.properties

    def __getitem__(self, identifier: str) -> Estimate:
        return self._bounds.socket(self._node, self._sockets[identifier], self._depth)
