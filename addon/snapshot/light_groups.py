"""Light groups: one snapshot as several, each lit by a group of its lights alone.

Light adds up: what a picture shows is the sum of what it shows lit by each part of its lights. A part has the lamps,
objects that emit and the world of one group that the view layer lists; lights of no such group are a part, too, so
that all parts together are the picture. Objects of other groups keep their surfaces and media but do not shine: what
emits in their trees is set to black.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from ..materials.graph import Graph, Input, Node
from .scene import Material, Snapshot

REST = ""  # the part of lights of no group

_DARK = Input("FLOAT", 0.0)
# Sockets that are 0 in a tree that does not shine, by type of node.
_SHINING = {
    "ShaderNodeEmission": ("Strength",),
    "ShaderNodeBackground": ("Strength",),
    "ShaderNodeBsdfPrincipled": ("Emission Strength",),
    "ShaderNodeEeveeSpecular": ("Emissive Color",),
    "ShaderNodeVolumePrincipled": ("Emission Strength", "Blackbody Intensity"),
    "ShaderNodeVolumeCoefficients": ("Emission Coefficients",),
}
_BLACK = "No light"  # a node that takes the place of a colour where a shader belongs, which is an emission


def groups_of(snapshots: Sequence[Snapshot]) -> list[str]:
    """Groups, REST among them, that together light the picture at all of these moments: REST alone where the view layer
    lists none. Those in which nothing shines at any of them are left out."""
    groups = snapshots[0].film.light_groups
    found = [group for group in (*groups, REST) if groups and any(_gives_light(one, group) for one in snapshots)]
    return found or [REST]


def lit_by(snapshot: Snapshot, group: str) -> Snapshot:
    """The same scene, lit by a group alone; itself where the view layer lists none."""
    if not snapshot.film.light_groups:
        return snapshot
    dark = _Dark(snapshot.materials)
    instances = tuple(
        one if is_of(one, group, snapshot) else dark.instance(one, tuple(dark.material(k) for k in one.materials))
        for one in snapshot.instances
    )
    volumes = tuple(
        one if is_of(one, group, snapshot) else replace(one, material=dark.material(one.material))
        for one in snapshot.volumes
    )
    lit = snapshot.world
    if not is_of(lit, group, snapshot):
        volume = None if lit.volume is None else without_light(lit.volume)
        medium = lit.medium and replace(lit.medium, emission=np.zeros(3), glow=0.0)
        lit = replace(
            lit, color=np.zeros(3), image=None, mapping=np.eye(3, 4), graph=None, volume=volume, medium=medium
        )
    lights = tuple(light for light in snapshot.lights if is_of(light, group, snapshot))
    return replace(
        snapshot, lights=lights, world=lit, instances=instances, volumes=volumes, materials=tuple(dark.materials)
    )


def is_of(one, group: str, snapshot: Snapshot) -> bool:
    """Whether a lamp, an object, a volume or the world is of a group; REST: of none that the view layer lists."""
    return (one.group if one.group in snapshot.film.light_groups else REST) == group


def _gives_light(snapshot: Snapshot, group: str) -> bool:
    """Whether anything of a group shines."""
    if any(is_of(light, group, snapshot) for light in snapshot.lights):
        return True
    if is_of(snapshot.world, group, snapshot) and _shines(snapshot):
        return True
    shown = {k for one in snapshot.instances if is_of(one, group, snapshot) for k in one.materials}
    shown |= {one.material for one in snapshot.volumes if is_of(one, group, snapshot)}
    graphs = [snapshot.materials[k].graph for k in shown]
    return any(without_light(graph) is not graph for graph in graphs)


def _shines(snapshot: Snapshot) -> bool:
    world = snapshot.world
    medium = world.medium is not None and (world.volume is None or without_light(world.volume) is not world.volume)
    return medium or world.graph is not None or bool(np.any(world.color))


class _Dark:
    """A scene's materials, and behind them those of them that shine, without their light."""

    def __init__(self, materials: Iterable[Material]):
        self.materials = list(materials)
        self._own = len(self.materials)
        self._dark: dict[int, int] = {}

    def material(self, k: int) -> int:
        """The number of material `k` without its light."""
        if k not in self._dark:
            material = self.materials[k]
            graph = without_light(material.graph)
            self._dark[k] = k if graph is material.graph else len(self.materials)
            if graph is not material.graph:
                self.materials.append(replace(material, key=f"{material.key} dark", graph=graph))
        return self._dark[k]

    @staticmethod
    def instance(one, materials: tuple[int, ...]):
        return one if materials == one.materials else replace(one, materials=materials)


def without_light(graph: Graph) -> Graph:
    """The same tree without what it emits; the very same where nothing does."""
    nodes = {node.key: _dark_node(node, graph) for node in graph.nodes.values()}
    ends = {name: getattr(graph, name) for name in ("surface", "volume")}
    ends = {name: _dark_link(link, graph) for name, link in ends.items()}
    kept = all(nodes[key] is node for key, node in graph.nodes.items())
    if kept and ends == {name: getattr(graph, name) for name in ends}:
        return graph
    black = Node(_BLACK, _BLACK, "ShaderNodeEmission", {"Strength": _DARK}, {"Emission": "SHADER"})
    return replace(graph, nodes={**nodes, _BLACK: black}, **ends)


def _dark_node(node: Node, graph: Graph) -> Node:
    changed = {}
    names = _SHINING.get(node.type, ())
    sockets = [node.inputs.get(name) for name in names]
    if names and not all(_is_zero(socket, node.type) for socket in sockets):
        changed = {name: Input("COLOR", (0.0, 0.0, 0.0, 1.0)) if "Color" in name else _DARK for name in names}
        changed |= {name: Input("VECTOR", (0.0, 0.0, 0.0)) for name in names if "Coefficients" in name}
    for name, socket in node.inputs.items():
        if socket.kind == "SHADER" and socket.link != _dark_link(socket.link, graph):
            changed[name] = replace(socket, link=_dark_link(socket.link, graph))
    return replace(node, inputs={**node.inputs, **changed}) if changed else node


def _is_zero(socket: Input | None, kind: str) -> bool:
    if socket is None:  # a node that has no such socket in this Blender; emission's default is 1
        return kind not in ("ShaderNodeEmission", "ShaderNodeBackground")
    if socket.link is not None or socket.value is None:
        return socket.link is None
    value = socket.value
    return not any(value[:3]) if isinstance(value, tuple) else value == 0.0


def _dark_link(link, graph: Graph):
    """A colour or number where a shader belongs is an emission."""
    if link is None or link[0] not in graph.nodes or graph.nodes[link[0]].outputs.get(link[1]) == "SHADER":
        return link
    return _BLACK, "Emission"
