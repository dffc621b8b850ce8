"""Reads a Blender shader tree into a `Graph`: the only module of materials that sees bpy.

Only what the surface, volume or displacement needs is read, from the active output backwards. Groups are dissolved
(nested, with the interface's own values), reroutes and muted nodes are followed through, muted and invalid links are
treated as if nothing were linked. Node settings are read generically, so that a new node needs no change here.
"""

from __future__ import annotations

import contextlib
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import bpy

from .graph import Graph, Input, Node
from .ies import Profile
from .sky import sky_of
from .values import to_kind

Notes = tuple[tuple[str, str], ...]
Aovs = tuple[tuple[str, str], ...]
# (bpy Image or Sky, ImageUser or None) or (Profile, label of its node) -> Image.key
ImageKey = Callable[[object, object], str]

KINDS = {
    "VALUE": "FLOAT",
    "VECTOR": "VECTOR",
    "RGBA": "COLOR",
    "SHADER": "SHADER",
    "INT": "INT",
    "BOOLEAN": "BOOLEAN",
    "ROTATION": "VECTOR",
}

# Nodes whose value stands in their output socket; it becomes an unlinked input of the same name.
# An output's constant may go by another name.
CONSTANT_NODES = {"ShaderNodeRGB": {}, "ShaderNodeValue": {}, "ShaderNodeNormal": {"Normal": "Direction"}}

OF_INLINED = re.compile(r"^\d+_")  # before the names of nodes that Blender dissolved from groups and zones
MOST_OF_PROFILE = 1 << 22  # bytes of an IES file: they have some kilobytes
TABLE_ROWS = 129  # points at which curves, and colour ramps that are no plain blends, are tabulated

SUBSURFACE_SETTINGS = {"subsurface_method", "falloff"}
_BASE_SETTINGS = {prop.identifier for prop in bpy.types.Node.bl_rna.properties}
_settings_of_type: dict[str, tuple] = {}


WHITE = Input("COLOR", (1.0, 1.0, 1.0, 1.0))


FINE_LAYERS = bpy.app.version >= (5, 3, 0)  # finer tables (energy.py), and rough diffuse (shaders/lib/brdf.glsl)
DEPTH_FROM_CAMERA = bpy.app.version >= (5, 3, 0)  # Denoising Depth, before from where the camera begins to see
NUMBERS = {"FLOAT", "VECTOR", "COLOR"}
INLINES = bpy.app.version >= (5, 0, 0)  # Blender dissolves groups itself before Cycles sees the tree


@dataclass(frozen=True)
class _Place:
    """Where a node stands: its tree and the chain of group nodes that lead there."""

    tree: object
    group: object = None  # the group node in `parent.tree` whose inside this is
    parent: _Place | None = None

    @property
    def path(self) -> tuple[str, ...]:
        return () if self.parent is None else (*self.parent.path, self.group.name)


def read_graph(owner, image_key: ImageKey, aovs: Aovs = ()) -> tuple[Graph, Notes]:
    """The node tree of a material, world or light as a flat graph, and sentences about what could not be read. Of a
    material with what its AOV Output nodes give for `aovs`, the names and kinds that are wanted.

    `image_key(image, image_user)` names the pixels of an image node. An ID without a usable tree gives the graph that
    Blender means by it: diffuse in the viewport colour for a material, the plain colour for a world.
    """
    tree = getattr(owner, "node_tree", None)
    if not isinstance(owner, bpy.types.Material):
        aovs = ()
    uv = tuple((name, kind, Input("VECTOR")) for name, kind in aovs if not name)
    if tree is None or not _uses_nodes(owner):
        return replace(_graph_without_nodes(owner), aovs=uv), ()
    inlined = _inlined(owner, tree)  # holds the tree that is read
    tree = tree if inlined is None else inlined.node_tree
    output = _active_output(tree)
    if output is None:
        return Graph(aovs=uv), ((owner.name, "The node tree has no output node; nothing of it is drawn."),)
    reading = _Reading(image_key, getattr(owner, "pass_index", 0))
    place = _Place(tree)
    links = {}
    for name in ("Surface", "Volume", "Displacement"):
        socket = output.inputs.get(name)
        links[name.lower()] = None if socket is None else reading.source(place, output, socket).link
    given = reading.aovs(place, {name: kind for name, kind in aovs if name}) if aovs else ()
    reading.read_pending()
    roots = {**links, **{f"AOV {name}": socket.link for name, _, socket in given}}
    found = reading.cut_cycles(roots)
    if isinstance(owner, bpy.types.Material) and links["volume"] is not None and links["surface"] is None:
        # A volume alone has no surface; only a tree without either is black.
        clear = Node("No surface", owner.name, "ShaderNodeBsdfTransparent", {"Color": WHITE}, {"BSDF": "SHADER"})
        found[clear.key], links["surface"] = clear, (clear.key, "BSDF")
    shadow = bool(getattr(owner, "use_transparent_shadow", True))
    method = getattr(owner, "displacement_method", "BUMP")
    return (
        Graph(found, **links, displacement_method=method, transparent_shadow=shadow, aovs=(*uv, *given)),
        tuple(dict.fromkeys(reading.notes)),
    )


# What only Blender dissolves, as it does before Cycles sees the tree: zones, closures, bundles, switches by menu.
DISSOLVED = {
    "GeometryNodeRepeatOutput", "NodeClosureOutput", "NodeEvaluateClosure", "NodeCombineBundle", "NodeSeparateBundle",
    "NodeJoinBundle", "GeometryNodeMenuSwitch", "FunctionNodeInputBool", "FunctionNodeInputInt",
}  # fmt: skip


def _inlined(owner, tree):
    """Blender's own flat copy of a tree, which lives as long as what comes back; None where the tree can be read as it
    is, in which nodes keep their names."""
    makers = getattr(bpy.types, "InlineShaderNodes", None)
    if makers is None or not _has_dissolved(tree, set()):
        return None
    if isinstance(owner, bpy.types.Material):
        return makers.from_material(owner)
    return makers.from_world(owner) if isinstance(owner, bpy.types.World) else makers.from_light(owner)


def _has_dissolved(tree, seen: set) -> bool:
    """Whether some node of the tree, or of a group in it, is one that Blender dissolves."""
    if tree is None or tree.as_pointer() in seen:
        return False
    seen.add(tree.as_pointer())
    return any(
        node.bl_idname in DISSOLVED or (node.bl_idname == "ShaderNodeGroup" and _has_dissolved(node.node_tree, seen))
        for node in tree.nodes
    )


def _uses_nodes(owner) -> bool:
    """From 5.0 on every material uses its nodes and the property only warns that it will go."""
    return bpy.app.version >= (5, 0, 0) or bool(getattr(owner, "use_nodes", True))


def _graph_without_nodes(owner) -> Graph:
    if isinstance(owner, bpy.types.Material):
        inputs = {"Color": Input("COLOR", tuple(owner.diffuse_color))}
        node = Node("Viewport", owner.name, "ShaderNodeBsdfDiffuse", inputs, {"BSDF": "SHADER"})
        return Graph({node.key: node}, (node.key, "BSDF"))
    if isinstance(owner, bpy.types.World):
        inputs = {"Color": Input("COLOR", (*owner.color, 1.0)), "Strength": Input("FLOAT", 1.0)}
        node = Node("World", owner.name, "ShaderNodeBackground", inputs, {"Background": "SHADER"})
        return Graph({node.key: node}, (node.key, "Background"))
    inputs = {"Color": WHITE, "Strength": Input("FLOAT", 1.0)}
    node = Node("Light", owner.name, "ShaderNodeEmission", inputs, {"Emission": "SHADER"})
    return Graph({node.key: node}, (node.key, "Emission"))


def _active_output(tree):
    """The output that Cycles renders, or the one for any other engine where a file has only that."""
    for target in ("CYCLES", "EEVEE"):
        output = tree.get_output_node(target)
        if output is not None:
            return output
    return None


class _Reading:
    """State of one reading: nodes found so far, those still to be read, and the links of each tree."""

    def __init__(self, image_key: ImageKey, material_index: int) -> None:
        self.image_key, self.material_index = image_key, material_index
        self.nodes: dict[str, Node] = {}
        self.pending: list[tuple[str, _Place, object]] = []
        self.seen: set[str] = set()
        self.notes: list[tuple[str, str]] = []
        self._links: dict[int, dict[int, object]] = {}

    def _link_into(self, tree, socket):
        """The link that feeds an input socket, or None."""
        return self._links_of(tree).get(socket.as_pointer())

    def _links_of(self, tree) -> dict[int, object]:
        """Links by the address of the input that each feeds: asking a socket searches the whole tree."""
        links = self._links.get(tree.as_pointer())
        if links is None:
            links = {}
            for link in tree.links:
                if link.is_muted or not link.from_socket.enabled or not link.to_socket.enabled:
                    continue
                if not link.is_valid:
                    self.notes.append(
                        (link.to_node.name, f"The link into '{link.to_socket.name}' is not valid and was cut.")
                    )
                    continue
                links[link.to_socket.as_pointer()] = link
            self._links[tree.as_pointer()] = links
        return links

    def source(self, place: _Place, node, socket) -> Input:
        """What an input socket reads. Follows groups, reroutes, muted nodes.

        Where a chain ends at nothing, the value stands of the last group's socket on the way, or the socket's own. What
        a muted node holds counts for nothing, and before Blender 5.0 for zero.
        Where a group's socket has another kind than what is plugged in, the value is converted on the way; before
        Blender 5.0 links are, too, so a `Convert` node is put in between.
        """
        asked, conversions, held = socket, [], (socket, 0)
        passed: set[tuple] = set()
        while True:
            step = (place.path, socket.as_pointer())
            if step in passed:
                self.notes.append((node.name, "The links run in a circle and were cut."))
                return self._held(asked, *held, conversions)
            passed.add(step)
            link = self._link_into(place.tree, socket)
            if link is None:
                if socket.node.mute and not INLINES and _kind(asked) in NUMBERS:
                    return Input(_kind(asked), _converted(0.0, "FLOAT", _kind(asked)))
                if not (INLINES and (socket.node.mute or socket.node.bl_idname == "NodeReroute")):
                    held = (socket, len(conversions))
                return self._held(asked, *held, conversions)
            node, output = link.from_node, link.from_socket
            socket = None
            if node.mute:
                socket = next((i.from_socket for i in node.internal_links if i.to_socket == output), None)
            elif node.bl_idname == "NodeReroute":
                socket = node.inputs[0]
            elif node.bl_idname == "NodeGroupInput":
                if place.parent is not None:
                    node, place = place.group, place.parent
                    socket = _by_identifier(node.inputs, output.identifier)
                    if socket is not None:
                        _pass_through(conversions, _kind(socket))
                        held = (socket, len(conversions))
            elif isinstance(node, bpy.types.ShaderNodeGroup) or node.bl_idname == "ShaderNodeGroup":
                inside = self._inside(place, node)
                end = None if inside is None else _group_output(inside.tree)
                socket = None if end is None else _by_identifier(end.inputs, output.identifier)
                if socket is not None:
                    place = inside
                    _pass_through(conversions, _kind(socket))
            else:
                linked = self._plain_link(place, node, output, [] if INLINES else conversions)
                return Input(_kind(asked), _default(asked), linked)
            if socket is None:
                return self._held(asked, *held, conversions)

    def _held(self, asked, socket, count: int, conversions: list[str]) -> Input:
        """The value of a socket on the way, after the first `count` of the conversions backwards.

        Blender 5.0 takes what a group's socket shows for a value, also where the socket that asks would take the
        surface's own vector; what it hides it does not, except for the vectors of textures.
        """
        value, kind, wanted = _default(socket), _kind(socket), _kind(asked)
        if value is None:
            value, kind = _default(asked), wanted
        else:
            for passed in conversions[:count][::-1]:
                value, kind = _converted(value, kind, passed), passed
        texture = asked.node.bl_idname.startswith("ShaderNodeTex")
        given = INLINES and socket != asked and socket.node.bl_idname == "ShaderNodeGroup"
        return Input(wanted, _converted(value, kind, wanted), given=given and (texture or not socket.hide_value))

    def aovs(self, place: _Place, wanted: dict[str, str]) -> tuple[tuple[str, str, Input], ...]:
        """What AOV Output nodes of a tree and the groups in it give for the wanted names, of kinds COLOR and VALUE."""
        found: dict[str, tuple[str, str, Input]] = {}
        for node in place.tree.nodes:
            if node.mute:
                continue
            if node.bl_idname == "ShaderNodeOutputAOV" and node.aov_name in wanted:
                kind = wanted[node.aov_name]
                socket = node.inputs["Color" if kind == "COLOR" else "Value"]
                found[node.aov_name] = node.aov_name, kind, self.source(place, node, socket)
            elif node.bl_idname == "ShaderNodeGroup" and node.node_tree is not None:
                inside = self._inside(place, node)
                if inside is not None:
                    found = {entry[0]: entry for entry in self.aovs(inside, wanted)} | found
        return tuple(found.values())

    def _inside(self, place: _Place, group) -> _Place | None:
        """The tree of a group node; None, with a sentence, for a missing tree or one that contains itself."""
        if group.node_tree is None:
            self.notes.append((group.name, "The node group is missing; what it feeds keeps the value set there."))
            return None
        above = place
        while above is not None:
            if above.tree == group.node_tree:
                self.notes.append((group.name, "The node group contains itself and was left out."))
                return None
            above = above.parent
        return _Place(group.node_tree, group, place)

    def _plain_link(self, place: _Place, node, output, conversions: list[str]) -> tuple[str, str]:
        key = " / ".join((*place.path, node.name))
        if key not in self.seen:
            self.seen.add(key)
            self.pending.append((key, place, node))
        link, kind = (key, output.identifier), _kind(output)
        for wanted in conversions[::-1]:
            if wanted != kind and {wanted, kind} <= NUMBERS:
                converter = f"{link[0]} . {link[1]} > {wanted}"
                inputs = {"Value": Input(kind, None, link)}
                self.nodes[converter] = Node(
                    converter, node.name, "Convert", inputs, {"Value": wanted}, {"kind": wanted}
                )
                link, kind = (converter, "Value"), wanted
        return link

    def read_pending(self) -> None:
        while self.pending:
            key, place, node = self.pending.pop()
            self.nodes[key] = self._node(key, place, node)

    def _node(self, key: str, place: _Place, node) -> Node:
        inputs, links, kind = {}, self._links_of(place.tree), node.bl_idname
        for socket in node.inputs:
            if not socket.enabled:
                continue
            if socket.as_pointer() in links:
                inputs[socket.identifier] = self.source(place, node, socket)
                continue
            value = getattr(socket, "default_value", None)  # most: by hand, since a scene has thousands of them
            if type(value) is not float:
                value = _plain_default(socket, value)
            inputs[socket.identifier] = Input(KINDS.get(socket.type, "OTHER"), value)
        if kind in CONSTANT_NODES:
            for socket in node.outputs:
                # The Normal node has an input of the same name beside the direction in its output.
                name = CONSTANT_NODES[kind].get(socket.identifier, socket.identifier)
                if hasattr(socket, "default_value") and name not in inputs:
                    inputs[name] = Input(_kind(socket), _default(socket))
        outputs = {socket.identifier: _kind(socket) for socket in node.outputs}
        label = node.label or OF_INLINED.sub("", node.name)
        settings = _settings(node)
        image = sky_of(settings) if kind == "ShaderNodeTexSky" else getattr(node, "image", None)
        user = getattr(node, "image_user", None)
        if kind == "ShaderNodeTexIES":
            image, user = _profile(node), label
        return Node(
            key,
            " / ".join((*place.path, label)),
            kind,
            inputs,
            outputs,
            {**settings, **self._surroundings(node)},
            "" if image is None else self.image_key(image, user),
        )

    def _surroundings(self, node) -> dict[str, object]:
        """What a node says about something that is not in the tree."""
        if node.bl_idname == "ShaderNodeObjectInfo":
            return {"material_index": float(self.material_index)}
        if node.bl_idname == "ShaderNodeTexVoronoi":
            return {"cell_hash": "PCG" if bpy.app.version >= (5, 0, 0) else "LOOKUP3"}
        if node.bl_idname == "ShaderNodeTexCoord" and node.object is not None:
            inverse = node.object.matrix_world.inverted_safe()
            return {"of_another_object": True, "object_matrix": tuple(tuple(row) for row in inverse[:3])}
        return {}

    def cut_cycles(self, roots: dict) -> dict[str, Node]:
        """All nodes, with every link removed that closes a circle, seen from the outputs."""
        finished: set[str] = set()
        for root in (link[0] for link in roots.values() if link is not None):
            if root in finished:
                continue
            trail, waiting = {root}, [(root, list(self.nodes[root].inputs.items()))]
            while waiting:
                key, inputs = waiting[-1]
                if not inputs:
                    trail.discard(key)
                    finished.add(key)
                    waiting.pop()
                    continue
                identifier, socket = inputs.pop()
                target = None if socket.link is None else socket.link[0]
                if target in trail:
                    self._cut(key, identifier)
                elif target is not None and target not in finished:
                    trail.add(target)
                    waiting.append((target, list(self.nodes[target].inputs.items())))
        return self.nodes

    def _cut(self, key: str, identifier: str) -> None:
        node = self.nodes[key]
        old = node.inputs[identifier]
        self.nodes[key] = Node(
            node.key,
            node.label,
            node.type,
            {**node.inputs, identifier: Input(old.kind, old.value)},
            node.outputs,
            node.properties,
            node.image,
        )
        self.notes.append((node.label, f"The link into '{identifier}' closes a circle and was cut."))


def _profile(node) -> Profile:
    """What an IES Texture reads, from a text in the file or from one beside it."""
    if node.mode == "INTERNAL":
        return Profile(node.ies.as_string() if node.ies is not None else "")
    path = Path(bpy.path.abspath(node.filepath, library=node.id_data.library))
    with contextlib.suppress(OSError, ValueError):
        if path.is_file():  # to open a pipe would wait
            with path.open("rb") as file:
                return Profile(file.read(MOST_OF_PROFILE).decode("latin-1"))
    return Profile("")


def _pass_through(conversions: list[str], kind: str) -> None:
    if not conversions or conversions[-1] != kind:
        conversions.append(kind)


def _group_output(tree):
    outputs = [node for node in tree.nodes if node.bl_idname == "NodeGroupOutput"]
    return next((node for node in outputs if node.is_active_output), outputs[0] if outputs else None)


def _by_identifier(sockets, identifier: str):
    return next((socket for socket in sockets if socket.identifier == identifier), None)


def _kind(socket) -> str:
    return KINDS.get(socket.type, "OTHER")


def _default(socket) -> tuple[float, ...] | float | None:
    """The constant of an unlinked socket; None for shaders and for kinds that are neither numbers nor names."""
    return _plain_default(socket, getattr(socket, "default_value", None))


def _plain_default(socket, value) -> tuple[float, ...] | float | str | None:
    """The same of what Blender says its default is."""
    if value is None or isinstance(value, str):
        return value
    if isinstance(value, (bool, int, float)):
        return float(value)
    return tuple(value) if socket.type in {"VECTOR", "RGBA", "ROTATION"} else None


def _converted(value, kind: str, wanted: str):
    if value is None or kind == wanted or wanted not in {"FLOAT", "VECTOR", "COLOR", "INT", "BOOLEAN"}:
        return value
    if wanted in {"VECTOR", "COLOR"}:
        triple = to_kind(value, kind, "VECTOR")
        return (*triple, 1.0) if wanted == "COLOR" else triple
    return to_kind(value, kind, "FLOAT")


def _settings(node) -> dict[str, object]:
    """The node's own properties as plain values; pointers to data-blocks as their names."""
    names = _settings_of_type.get(node.bl_idname)
    if names is None:
        properties = type(node).bl_rna.properties
        names = tuple((p.identifier, p.type) for p in properties if p.identifier not in _BASE_SETTINGS)
        _settings_of_type[node.bl_idname] = names
    settings = {}
    for name, type_name in names:
        value = getattr(node, name, None)
        if isinstance(value, bpy.types.ColorRamp):
            settings |= _color_ramp(name, value)
        elif isinstance(value, bpy.types.CurveMapping):
            settings |= _curves(name, value)
        else:
            value = _plain(value, type_name)
            if value is not None:
                settings[name] = value
    for name in SUBSURFACE_SETTINGS & settings.keys():
        known = type(node).bl_rna.properties[name].enum_items.keys()
        if settings[name] == "RANDOM_WALK" and "RANDOM_WALK_LEGACY" not in known:
            settings[name] = "RANDOM_WALK_LEGACY"  # before Blender 5.2 that is what it means
    return settings


def _color_ramp(name: str, ramp) -> dict[str, object]:
    """The stops as (position, red, green, blue, alpha) in rising order, and how to go from one to the next; for ways
    that are no plain blend of two stops, a table of the ramp's colours."""
    plain = ramp.color_mode == "RGB" and ramp.interpolation in ("LINEAR", "EASE", "CONSTANT")
    steps = () if plain else range(TABLE_ROWS)
    return {
        f"{name}_table": tuple(tuple(ramp.evaluate(i / (TABLE_ROWS - 1))) for i in steps),
        name: tuple((stop.position, *stop.color) for stop in sorted(ramp.elements, key=lambda stop: stop.position)),
        f"{name}_interpolation": ramp.interpolation,
        f"{name}_mode": ramp.color_mode,
        f"{name}_hue": ramp.hue_interpolation,
    }


def _plain(value, type_name: str):
    if type_name in {"ENUM", "STRING", "BOOLEAN", "INT", "FLOAT"}:
        if isinstance(value, (str, bool, int, float)):
            return value
        if isinstance(value, (set, frozenset)):
            return tuple(sorted(value))
        try:
            return tuple(value)
        except TypeError:
            return None
    if isinstance(value, bpy.types.TexMapping):
        return (value.vector_type, tuple(value.translation), tuple(value.rotation), tuple(value.scale))
    if isinstance(value, bpy.types.ID):
        return value.name
    return None


def _curves(name: str, mapping) -> dict[str, object]:
    """A table of evenly spaced samples, as Blender evaluates the curves, where it begins, its extent, and whether it
    goes on beyond its ends. Of four curves the last is applied to all channels before their own."""
    mapping.initialize()
    points = [point.location[0] for curve in mapping.curves for point in curve.points]
    first, extent = min(points), max(points) - min(points)
    curves = list(mapping.curves)
    rows = []
    for i in range(TABLE_ROWS):
        x = first + extent * i / (TABLE_ROWS - 1)
        x = mapping.evaluate(curves[3], x) if len(curves) == 4 else x
        channels = [mapping.evaluate(curve, x) for curve in curves[:3]]
        rows.append((*channels, *(0.0,) * (4 - len(channels))))
    return {
        f"{name}_table": tuple(rows),
        f"{name}_start": first,
        f"{name}_extent": extent,
        f"{name}_onwards": mapping.extend == "EXTRAPOLATED",
    }
