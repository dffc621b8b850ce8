"""A node tree as plain data: what the reader makes of Blender's tree and what the compiler turns into GLSL."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class Input:
    """A node's input socket: either linked to (node key, output identifier), or a constant value."""

    kind: str  # FLOAT, VECTOR, COLOR, SHADER, INT, BOOLEAN, OTHER
    value: tuple[float, ...] | float | None = None
    link: tuple[str, str] | None = None
    given: bool = False  # the value stands where an unlinked socket would take the surface's own vector


@dataclass(frozen=True)
class Node:
    """One node after groups, reroutes and muted nodes are dissolved."""

    key: str  # unique in the graph: group path and node name
    label: str  # what the artist reads: node label or name, with the group it stands in
    type: str  # bl_idname
    inputs: dict[str, Input]  # by socket identifier
    outputs: dict[str, str] = field(default_factory=dict)  # identifier -> kind
    properties: dict[str, object] = field(default_factory=dict)  # plain values of the node's own settings
    image: str = ""  # Image.key of an image node


@dataclass(frozen=True)
class Graph:
    """A material's or world's tree, flat, in no particular order; links never form a cycle."""

    nodes: dict[str, Node] = field(default_factory=dict)
    surface: tuple[str, str] | None = None  # what is linked to the output node: (node key, output identifier)
    volume: tuple[str, str] | None = None
    displacement: tuple[str, str] | None = None
    displacement_method: str = "BUMP"  # BUMP, DISPLACEMENT or BOTH: what it moves, the normal, the surface or both
    # What AOV Output nodes give: name, kind (COLOR, VALUE), socket; UV has no name.
    aovs: tuple[tuple[str, str, Input], ...] = ()
    transparent_shadow: bool = True  # light on its way to a surface passes where the surface is transparent

    @property
    def read(self) -> set[tuple[str, str] | None]:
        """The links that nodes and AOVs read."""
        return {socket.link for node in self.nodes.values() for socket in node.inputs.values()} | {
            socket.link for _, _, socket in self.aovs
        }
