"""The pass tree "Candela Passes" in the node editor: the tree as data, and what the last run said of its nodes.

What is wrong with a tree is worked out from its data whenever it is drawn, and stands on the nodes (pass_nodes.py) as
sentences and as red links. A tree is rendered by the engine in place of Auto when it is chosen in the Techniques panel;
there is nothing in it that only the interface knows.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

import bpy
import numpy as np

from ..compare import pictures
from ..frame.pass_graph import Checked, Link, PassGraph, PassNode, check
from ..techniques import REGISTRY

TREE = "CandelaPassTree"


class CandelaPassTree(bpy.types.NodeTree):
    """Passes of a render, wired by hand"""

    bl_idname = TREE
    bl_label = "Candela Passes"
    bl_icon = "NODE_COMPOSITING"

    samples: bpy.props.IntProperty(
        name="Samples", description="Samples of a run of this tree", default=16, min=1, max=65536
    )
    percentage: bpy.props.IntProperty(
        name="Resolution", description="Size of a run, in percent of the render resolution", default=50, min=1, max=100,
        subtype="PERCENTAGE",
    )  # fmt: skip
    reference_samples: bpy.props.IntProperty(
        name="Reference Samples",
        description="Samples of each of the two renders by Cycles",
        default=64,
        min=1,
        max=65536,
    )

    def update(self):
        """Mark the links that do not fit."""
        mark_links(self)


# --------------------------------------------------------------------------------------------------------------- data


def graph_of(tree) -> PassGraph:
    """The tree as data."""
    nodes = [node for node in tree.nodes if node.bl_idname.startswith("CandelaPass")]
    names = {node.name for node in nodes}
    links = []
    for node in nodes:
        for socket in node.inputs:
            for link in socket.links:
                source, output = origin(link)
                if source is not None and source.name in names:
                    links.append(Link(source.name, output.identifier, node.name, socket.identifier))
    return PassGraph(tuple(PassNode(n.name, n.technique, n.mute) for n in nodes), tuple(links))


def origin(link):
    """Node and socket where a link comes from, through reroutes; (None, None) if a reroute has no source."""
    for _ in range(1000):
        if link.from_node.bl_idname != "NodeReroute":
            return link.from_node, link.from_socket
        before = link.from_node.inputs[0].links
        if not before:
            break
        link = before[0]
    return None, None


@lru_cache(maxsize=64)
def checked(graph: PassGraph, root: str = "") -> Checked:
    """What is wrong with a tree, and the order of its passes."""
    return check(graph, REGISTRY, root)


def order_of(tree) -> tuple[str, ...]:
    """Names of the techniques that a render with this tree runs."""
    return checked(graph_of(tree)).order


def mark_links(tree) -> None:
    """Let Blender draw the links red that cannot be followed."""
    wrong = checked(graph_of(tree)).wrong_links
    for link in tree.links:
        source, output = origin(link)
        if source is not None:
            made = Link(source.name, output.identifier, link.to_node.name, link.to_socket.identifier)
            link.is_valid = made not in wrong


SHOWN = ("film.lens", "film.combined")  # the picture, as an eye sees it or else as it is


def fill(tree, graph: PassGraph, columns: dict[str, int]) -> None:
    """Replace the tree's nodes by those of `graph`, placed by column, with one that shows the picture."""
    tree.nodes.clear()
    made, height = {}, {}
    for node in graph.nodes:
        new = made[node.name] = tree.nodes.new(f"CandelaPass_{node.technique}")
        new.name = node.name
        new.select = False
        column = columns[node.name]
        new.location = 360 * column, -height.get(column, 0)
        height[column] = height.get(column, 0) + 260 + 22 * (len(new.inputs) + len(new.outputs))
    for link in graph.links:
        tree.links.new(_socket(made[link.target].inputs, link.input), _socket(made[link.source].outputs, link.output))
    output = tree.nodes.new("CandelaPassOutput")
    output.select = False
    output.location = 360 * (max(columns.values(), default=0) + 1), 0
    pictures = [_socket(node.outputs, name) for name in SHOWN for node in reversed(list(made.values()))]
    picture = next((socket for socket in pictures if socket is not None), None)
    if picture is not None:
        tree.links.new(output.inputs[0], picture)


def _socket(found, identifier: str):
    return next((socket for socket in found if socket.identifier == identifier), None)


# ------------------------------------------------------------------------------------------------------------- results


@dataclass
class Result:
    """What the last run said of a node; it is not kept in the file."""

    picture: np.ndarray | None = None
    milliseconds: float | None = None
    errors: list[str] = field(default_factory=list)  # against Cycles, a line for each light path


_results: dict[tuple[int, str], Result] = {}
_previews = None


def result(node) -> Result | None:
    """What the last run said of a node, if it took part."""
    return _results.get((node.id_data.session_uid, node.name))


def preview(node) -> int | None:
    """Number of the icon with the node's picture, if it has one."""
    name, shown = _preview_name(node), result(node)
    if shown is None or shown.picture is None or _previews is None or name not in _previews:
        return None
    return _previews[name].icon_id


def _preview_name(node) -> str:
    return f"{node.id_data.session_uid} {node.name}"


def set_result(node, made: Result) -> None:
    """Show the result on the node."""
    _results[node.id_data.session_uid, node.name] = made
    if made.picture is not None and _previews is not None:
        name = _preview_name(node)
        icon = _previews[name] if name in _previews else _previews.new(name)
        small = pictures.thumbnail(made.picture)
        side = max(small.shape[:2])
        square = np.zeros((side, side, 4), np.float32)  # icons are square
        top, left = (side - small.shape[0]) // 2, (side - small.shape[1]) // 2
        square[top : top + small.shape[0], left : left + small.shape[1]] = small
        icon.image_size = side, side
        icon.image_pixels_float.foreach_set(square.ravel())


def forget_result(node) -> None:
    """When the node is removed."""
    _results.pop((node.id_data.session_uid, node.name), None)


def forget_results(tree) -> None:
    """Before another run."""
    for key in [key for key in _results if key[0] == tree.session_uid]:
        del _results[key]


def register() -> None:
    global _previews
    import bpy.utils.previews

    bpy.utils.register_class(CandelaPassTree)
    _previews = bpy.utils.previews.new()


def unregister() -> None:
    global _previews
    import bpy.utils.previews

    bpy.utils.previews.remove(_previews)
    _previews = None
    _results.clear()
    bpy.utils.unregister_class(CandelaPassTree)
