"""The pass tree "Candela Passes" in the node editor: a node for each technique, and nodes that show pictures.

Nodes and sockets are made from the registry (addon/frame/pass_graph.py); what is wrong with a tree is worked out from
its data whenever it is drawn, and stands on the nodes as sentences and as red links. A tree is rendered by the engine
in place of Auto when it is chosen in the Techniques panel; there is nothing in it that only the interface knows.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

import bpy
import numpy as np

from ..compare import pictures
from ..frame.pass_graph import (
    FAMILY,
    RESULT,
    SERVICE,
    SUM,
    Checked,
    Link,
    PassGraph,
    PassNode,
    check,
    in_words,
    sockets,
)
from ..techniques import REGISTRY

TREE = "CandelaPassTree"
IMAGE = "image"  # the kind of socket that takes or gives any picture
_COLORS = {
    SUM: (0.95, 0.75, 0.25, 1.0),
    FAMILY: (0.39, 0.39, 0.78, 1.0),
    SERVICE: (0.65, 0.65, 0.65, 1.0),
    RESULT: (0.78, 0.78, 0.16, 1.0),
    IMAGE: (0.78, 0.78, 0.16, 1.0),
}
_KINDS = {SUM: "Light", FAMILY: "Images", SERVICE: "Service", RESULT: "Result", IMAGE: "Image"}
PREVIEW_SCALE = 6.0


class CandelaPassTree(bpy.types.NodeTree):
    """Passes of a render, wired by hand"""

    bl_idname = TREE
    bl_label = "Candela Passes"
    bl_icon = "NODE_COMPOSITING"

    samples: bpy.props.IntProperty(
        name="Samples", description="Samples of a run of this tree", default=16, min=1, max=65536
    )
    percentage: bpy.props.IntProperty(
        name="Resolution", description="Size of a run, of the render's resolution", default=50, min=1, max=100,
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
                source, output = _origin(link)
                if source is not None and source.name in names:
                    links.append(Link(source.name, output.identifier, node.name, socket.identifier))
    return PassGraph(tuple(PassNode(n.name, n.technique, n.mute) for n in nodes), tuple(links))


def _origin(link):
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
        source, output = _origin(link)
        if source is not None:
            made = Link(source.name, output.identifier, link.to_node.name, link.to_socket.identifier)
            link.is_valid = made not in wrong


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
    for node in reversed(list(made.values())):
        picture = _socket(node.outputs, "film.combined")
        if picture is not None:
            tree.links.new(output.inputs[0], picture)
            break


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


def set_result(node, made: Result) -> None:
    """Show the result on the node."""
    _results[node.id_data.session_uid, node.name] = made
    if made.picture is not None and _previews is not None:
        name = f"{node.id_data.session_uid} {node.name}"
        icon = _previews[name] if name in _previews else _previews.new(name)
        small = pictures.thumbnail(made.picture)
        side = max(small.shape[:2])
        square = np.zeros((side, side, 4), np.float32)  # icons are square
        top, left = (side - small.shape[0]) // 2, (side - small.shape[1]) // 2
        square[top : top + small.shape[0], left : left + small.shape[1]] = small
        icon.image_size = side, side
        icon.image_pixels_float.foreach_set(square.ravel())


def forget_results(tree) -> None:
    """Before another run."""
    for key in [key for key in _results if key[0] == tree.session_uid]:
        del _results[key]


# --------------------------------------------------------------------------------------------------------------- nodes


class _Socket:
    """A socket of a kind; its value is what its link brings."""

    def draw(self, context, layout, node, text):
        layout.label(text=text)

    def draw_color(self, context, node):
        return self.color

    @classmethod
    def draw_color_simple(cls):
        return cls.color


def _socket_class(kind: str) -> type:
    name = f"CandelaSocket{kind.capitalize()}"
    body = {"bl_idname": name, "bl_label": _KINDS[kind], "color": _COLORS[kind], "__module__": __name__}
    return type(name, (_Socket, bpy.types.NodeSocket), body)


class _Node:
    """What all nodes of the tree share."""

    technique = ""

    @classmethod
    def poll(cls, tree):
        return tree.bl_idname == TREE

    def free(self):
        _results.pop((self.id_data.session_uid, self.name), None)

    def draw_buttons(self, context, layout):
        for sentence in checked(graph_of(self.id_data)).sentences.get(self.name, ()):
            for number, line in enumerate(_lines(sentence)):
                layout.label(text=line, icon="ERROR" if number == 0 else "BLANK1")
        self.draw_settings(context, layout)
        shown = result(self)
        if shown is None:
            return
        if shown.milliseconds is not None:
            slow = shown.milliseconds >= 10_000
            layout.label(
                text=f"{shown.milliseconds / 1000:.1f} s" if slow else f"{shown.milliseconds:.1f} ms", icon="TIME"
            )
        name = f"{self.id_data.session_uid} {self.name}"
        if shown.picture is not None and _previews is not None and name in _previews:
            layout.template_icon(icon_value=_previews[name].icon_id, scale=PREVIEW_SCALE)
        if shown.errors:
            layout.label(text="relMSE against Cycles", icon="SPLIT_HORIZONTAL")
        for line in shown.errors:
            layout.label(text=line)

    def draw_settings(self, context, layout):
        pass


def _lines(sentence: str, width: int = 36) -> list[str]:
    import textwrap

    return textwrap.wrap(sentence, width)


def _technique_node(technique) -> type:
    """The node class of a technique, with its sockets and parameters."""
    inputs, outputs = sockets(technique, REGISTRY)
    shown = [name for socket in outputs if socket.kind != SERVICE for name in socket.images]

    def init(self, context):
        for made, wanted in ((self.inputs, inputs), (self.outputs, outputs)):
            for socket in wanted:
                new = made.new(f"CandelaSocket{socket.kind.capitalize()}", socket.label, identifier=socket.name)
                new.description = socket.description

    def draw_settings(self, context, layout):
        column = layout.column()
        for param in technique.params:
            column.prop(context.scene.candela, f"{technique.name}_{param.name}")
        if shown:
            column.prop(self, "shown")

    body = {
        "__doc__": (__import__(technique.__module__, fromlist=["_"]).__doc__ or technique.label).split("\n")[0],
        "__module__": __name__,
        "__annotations__": {},
        "bl_idname": f"CandelaPass_{technique.name}",
        "bl_label": technique.label,
        "bl_width_default": 260.0,
        "technique": technique.name,
        "init": init,
        "draw_settings": draw_settings,
    }
    if shown:
        items = [(name, in_words(name), "", number) for number, name in enumerate(shown)]
        best = "film.combined" if "film.combined" in shown else shown[0]
        body["__annotations__"]["shown"] = bpy.props.EnumProperty(
            name="Shown", description="Image that the node shows after a run", items=items, default=best
        )
    return type(f"CandelaPass_{technique.name}", (_Node, bpy.types.Node), body)


class _ShowingNode(_Node):
    """A node that makes a picture of its inputs."""

    bl_width_default = 220.0
    takes: tuple[str, ...] = ("Image",)
    gives = True

    def init(self, context):
        for name in self.takes:
            self.inputs.new("CandelaSocketImage", name, identifier=name)
        if self.gives:
            self.outputs.new("CandelaSocketImage", "Image", identifier="Image")

    def picture(self, inputs: list[np.ndarray], truth: np.ndarray | None) -> np.ndarray:
        """Of the inputs' pictures; `truth` is what Cycles says about the first one."""
        raise NotImplementedError


class CandelaPassOutput(_ShowingNode, bpy.types.Node):
    """The tree's picture: what a run shows in the Image Editor. What does not lead to such a node does not run"""

    bl_idname, bl_label, gives = "CandelaPassOutput", "Image Output", False

    def picture(self, inputs, truth):
        return inputs[0]


class CandelaPassDifference(_ShowingNode, bpy.types.Node):
    """Absolute difference of two images, channel by channel"""

    bl_idname, bl_label, takes = "CandelaPassDifference", "Difference", ("First", "Second")

    def picture(self, inputs, truth):
        return pictures.difference(*inputs)


class CandelaPassErrorMap(_ShowingNode, bpy.types.Node):
    """Relative squared error of each pixel against Cycles, as colours; needs a run of Compare with Cycles"""

    bl_idname, bl_label = "CandelaPassErrorMap", "Error against Cycles"

    def picture(self, inputs, truth):
        return pictures.error_map(inputs[0], truth) if truth is not None else None


class CandelaPassFalseColor(_ShowingNode, bpy.types.Node):
    """Luminance as colours, in stops"""

    bl_idname, bl_label = "CandelaPassFalseColor", "False Color"

    lowest: bpy.props.FloatProperty(name="Lowest Stop", description="Luminance 2^x at the dark end", default=-8.0)
    highest: bpy.props.FloatProperty(name="Highest Stop", description="Luminance 2^x at the bright end", default=4.0)

    def draw_settings(self, context, layout):
        layout.prop(self, "lowest")
        layout.prop(self, "highest")

    def picture(self, inputs, truth):
        return pictures.false_color(inputs[0], self.lowest, self.highest)


class CandelaPassSplit(_ShowingNode, bpy.types.Node):
    """Two images in one, side by side"""

    bl_idname, bl_label, takes = "CandelaPassSplit", "Split View", ("Left", "Right")

    share: bpy.props.FloatProperty(
        name="Split", description="Share of the width that shows the left image", default=0.5, min=0.0, max=1.0,
        subtype="FACTOR",
    )  # fmt: skip

    def draw_settings(self, context, layout):
        layout.prop(self, "share")

    def picture(self, inputs, truth):
        return pictures.split_view(*inputs, self.share)


SHOWING = (CandelaPassOutput, CandelaPassDifference, CandelaPassErrorMap, CandelaPassFalseColor, CandelaPassSplit)


def pictures_of(tree, images: dict[str, np.ndarray], truth: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The picture of each node that has one, by name. `images` and `truth` are by the frame's names."""
    made: dict[str, np.ndarray | None] = {}

    def of_socket(node, socket) -> tuple[np.ndarray | None, np.ndarray | None]:
        """What a socket gives, and what Cycles says of it."""
        if not node.technique:
            return of_node(node), None
        given = next((s for s in sockets(_technique(node), REGISTRY)[1] if s.name == socket.identifier), None)
        names = given.images if given is not None else ()
        name = node.shown if len(names) > 1 and node.shown in names else next(iter(names), "")
        return images.get(name), truth.get(name)

    def of_node(node) -> np.ndarray | None:
        if node.name in made:
            return made[node.name]
        made[node.name] = None  # a circle shows nothing
        if node.technique:
            made[node.name] = images.get(getattr(node, "shown", ""))
            return made[node.name]
        found = []
        for socket in node.inputs:
            source, output = _origin(socket.links[0]) if socket.links else (None, None)
            found.append(of_socket(source, output) if source is not None else (None, None))
        if found and all(picture is not None for picture, _ in found):
            made[node.name] = node.picture([picture for picture, _ in found], found[0][1])
        return made[node.name]

    for node in tree.nodes:
        if node.bl_idname.startswith("CandelaPass"):
            of_node(node)
    return {name: picture for name, picture in made.items() if picture is not None}


def _technique(node):
    return next(technique for technique in REGISTRY if technique.name == node.technique)


NODES = (*(_technique_node(technique) for technique in REGISTRY), *SHOWING)
_CLASSES = (CandelaPassTree, *(_socket_class(kind) for kind in _KINDS), *NODES)


class NODE_MT_candela_passes(bpy.types.Menu):
    """Nodes of a pass tree"""

    bl_label = "Passes"

    def draw(self, context):
        for made in NODES:
            if made is SHOWING[0]:
                self.layout.separator()
            add = self.layout.operator("node.add_node", text=made.bl_label)
            add.type, add.use_transform = made.bl_idname, True


def _draw_add_menu(self, context):
    if context.space_data.tree_type == TREE:
        self.layout.menu_contents("NODE_MT_candela_passes")


def register() -> None:
    global _previews
    import bpy.utils.previews

    for made in (*_CLASSES, NODE_MT_candela_passes):
        bpy.utils.register_class(made)
    bpy.types.NODE_MT_add.append(_draw_add_menu)
    _previews = bpy.utils.previews.new()


def unregister() -> None:
    global _previews
    import bpy.utils.previews

    bpy.utils.previews.remove(_previews)
    _previews = None
    _results.clear()
    bpy.types.NODE_MT_add.remove(_draw_add_menu)
    for made in reversed((*_CLASSES, NODE_MT_candela_passes)):
        bpy.utils.unregister_class(made)
