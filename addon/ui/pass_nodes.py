"""Nodes and sockets of the pass tree: a node for each technique, and nodes that show pictures.

They are made from the registry (addon/frame/pass_graph.py).
"""

from __future__ import annotations

import bpy
import numpy as np

from ..compare import pictures
from ..frame.pass_graph import FAMILY, RESULT, SERVICE, SUM, in_words, sockets
from ..frame.technique import OF_A_PICTURE, identifier
from ..techniques import REGISTRY
from .pass_tree import SHOWN, TREE, checked, forget_result, graph_of, origin, preview, result
from .properties import block_of, titled

IMAGE = "image"  # the kind of socket that takes or gives any picture
_COLORS = {
    SUM: (0.95, 0.75, 0.25, 1.0),
    FAMILY: (0.39, 0.39, 0.78, 1.0),
    SERVICE: (0.65, 0.65, 0.65, 1.0),
    RESULT: (0.78, 0.78, 0.16, 1.0),
    IMAGE: (0.78, 0.78, 0.16, 1.0),
}
_KINDS = {SUM: "Light", FAMILY: "Images", SERVICE: "Service", RESULT: "Result", IMAGE: "Image"}
# Of nodes, by what they are for: dark enough for white text.
_NODE_COLORS = {
    "SURFACE": (0.20, 0.34, 0.25),
    "LIGHT": (0.40, 0.32, 0.16),
    "SERVICE": (0.28, 0.28, 0.30),
    "FILM": (0.22, 0.28, 0.42),
    "SHOW": (0.36, 0.22, 0.38),
}
PREVIEW_SCALE = 9.0


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
        forget_result(self)

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
        icon = preview(self)
        if icon is not None:
            layout.template_icon(icon_value=icon, scale=PREVIEW_SCALE)
        if shown.errors:
            layout.label(text="relMSE against Cycles", icon="SPLIT_HORIZONTAL")
        for line in shown.errors:
            layout.label(text=line)

    def draw_settings(self, context, layout):
        pass


def _lines(sentence: str, width: int = 36) -> list[str]:
    import textwrap

    return textwrap.wrap(sentence, width)


def category_of(technique) -> str:
    """What a technique is for, as colours of nodes tell it."""
    if technique().only_shows:
        return "SHOW"
    written = {write.name for write in technique.writes}
    if technique.name in ("film", "denoise") or any(name.startswith("film.") for name in written):
        return "FILM"
    if any(name.startswith("surface.") for name in written):
        return "SURFACE"
    return "LIGHT" if any(name.startswith("radiance.") for name in written) else "SERVICE"


def _technique_node(technique) -> type:
    """The node class of a technique, with its sockets and parameters."""
    inputs, outputs = sockets(technique, REGISTRY)
    shown = [name for socket in outputs if socket.kind != SERVICE for name in socket.images]

    def init(self, context):
        for made, wanted in ((self.inputs, inputs), (self.outputs, outputs)):
            for socket in wanted:
                new = made.new(f"CandelaSocket{socket.kind.capitalize()}", socket.label, identifier=socket.name)
                new.description = socket.description
        self.use_custom_color, self.color = True, _NODE_COLORS[category_of(technique)]

    def draw_settings(self, context, layout):
        column = layout.column()
        for param in technique.params_of(*OF_A_PICTURE):
            block = block_of(param.scope, context.scene)
            if block is not None and not param.many:
                column.prop(block.candela, identifier(technique.name, param.name))
        if shown:
            column.prop(self, "shown")

    body = {
        "__doc__": (__import__(technique.__module__, fromlist=["_"]).__doc__ or technique.label).split("\n")[0],
        "__module__": __name__,
        "__annotations__": {},
        "bl_idname": f"CandelaPass_{technique.name}",
        "bl_label": titled(technique.label),
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
            source, output = origin(socket.links[0]) if socket.links else (None, None)
            found.append(of_socket(source, output) if source is not None else (None, None))
        if found and all(picture is not None for picture, _ in found):
            made[node.name] = node.picture([picture for picture, _ in found], found[0][1])
        return made[node.name]

    # The fourth channel of light, normals and so on is no opacity: as one it would hide the picture.
    images, truth = (
        {name: image if name in SHOWN else opaque(image) for name, image in found.items()} for found in (images, truth)
    )
    for node in tree.nodes:
        if node.bl_idname.startswith("CandelaPass"):
            of_node(node)
    return {name: picture for name, picture in made.items() if picture is not None}


def opaque(image: np.ndarray) -> np.ndarray:
    """The image with an alpha of 1, if it has four channels."""
    if image.shape[-1] != 4:
        return image
    return np.concatenate([image[..., :3], np.ones_like(image[..., :1])], axis=-1)


def _technique(node):
    return next(technique for technique in REGISTRY if technique.name == node.technique)


NODES = (*(_technique_node(technique) for technique in REGISTRY), *SHOWING)
_CLASSES = (*(_socket_class(kind) for kind in _KINDS), *NODES)


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
    for made in (*_CLASSES, NODE_MT_candela_passes):
        bpy.utils.register_class(made)
    bpy.types.NODE_MT_add.append(_draw_add_menu)


def unregister() -> None:
    bpy.types.NODE_MT_add.remove(_draw_add_menu)
    for made in reversed((*_CLASSES, NODE_MT_candela_passes)):
        bpy.utils.unregister_class(made)
