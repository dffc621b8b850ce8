"""The words in which the node table is written: one `Entry` per node type and variant.

An entry says which GLSL function draws a node and what its arguments are, in order; the compiler does the rest
(constants become values, links become variables, kinds are converted). Adding a node is one entry and one function.

Value nodes:    `void function(arguments…, out outputs…)`
Shader leaves:  `void function(inout Closures closures, SurfacePoint point, vec3 weight, arguments…)`
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from ..estimate import Estimate, Summary

Number = float | tuple[float, ...]


@dataclass(frozen=True)
class Socket:
    """An input socket. Unlinked it is a constant of the material, or `implicit` where Blender means the surface's own.

    `default` stands in where the node's Blender version has no such socket.
    """

    identifier: str
    kind: str  # FLOAT, VECTOR, COLOR
    default: Number = 0.0
    implicit: str = ""  # GLSL expression; "@UV", "@GENERATED": that attribute; "@RADIAL": around Generated's z
    only_with: str = ""  # another socket: while it is unlinked and 0, nobody asks for the implicit value, which is 0
    clamp: str = ""  # name of a boolean property of the node: when true the argument is clamped to 0..1
    layer: bool = False  # the weight of a layer: at 0 the shader skips what it computes of it


@dataclass(frozen=True)
class Setting:
    """A numeric property of the node that an artist slides: a constant of the material, like a socket."""

    property: str
    default: float = 0.0


@dataclass(frozen=True)
class Choice:
    """An enum or boolean property as a literal; changing it makes another program. A property that a Blender version
    lacks is `missing`."""

    property: str
    items: dict[object, int | str]
    missing: int | str = 0


@dataclass(frozen=True)
class Attribute:
    """A vec4 attribute of the mesh; `property` holds its name ("" or no property: the active one).

    With `output`, it is only asked for where somebody reads that output, and else is zero.
    """

    kind: str  # UV, COLOR, TANGENT, GENERATED, NAMED
    property: str = ""
    output: str = ""
    name: str = ""  # always this one
    slopes: bool = False  # handed on with its changes along point.position_dx and _dy


@dataclass(frozen=True)
class Heights:
    """What feeds a socket, as three floats: at the point, and `width` pixels away on the surface in both directions."""

    identifier: str
    width: Socket


@dataclass(frozen=True)
class Used:
    """`true` where somebody reads this output of the node."""

    output: str


@dataclass(frozen=True)
class ImageFlags:
    """How the pixels of the node's image are stored, see IMAGE_* in texture/levels.glsl; a constant of the material."""


@dataclass(frozen=True)
class Rows:
    """A table out of a property, such as the stops of a colour ramp, as rows that `material_row` reads.

    Gives two int literals, the first row and the number of rows; their number is topology, their content is not, unless
    they have to stand in the program's text.
    """

    property: str
    rows: Callable[[object], list[tuple[float, float, float, float]]]


@dataclass(frozen=True)
class Expression:
    """A GLSL expression as it stands, such as `point`."""

    glsl: str


@dataclass(frozen=True)
class Approximation:
    """What is drawn otherwise than Cycles would, while `socket` is linked or not at its harmless value."""

    socket: str
    harmless: float | str  # "whole": any whole number
    sentence: str
    unless_linked: str = ""  # another socket that settles the matter


Argument = Socket | Setting | Choice | Attribute | Heights | Used | ImageFlags | Rows | Expression

POINT = Expression("point")


@dataclass(frozen=True)
class Entry:
    """How one node type, or one variant of it, is drawn.

    The first entry of a type that matches the node's properties is taken; without one, the node falls back. It matches
    if `when` holds and each property of `choices` has one of the values that stand there. `function` may name
    properties of `choices` in braces, which are replaced by the property's lower-case value.
    """

    type: str  # bl_idname
    function: str = ""
    arguments: tuple[Argument, ...] = ()
    outputs: tuple[tuple[str, str], ...] = ()  # identifier, kind; in the order of the out parameters
    include: str = ""
    when: dict[str, object] = field(default_factory=dict)
    choices: dict[str, tuple[str, ...]] = field(default_factory=dict)
    clamp_result: str = ""  # name of a boolean property: when true the outputs are clamped to 0..1
    image: bool = False  # reads Node.image; the function's name may contain {image}, the sampler's index
    approximations: tuple[Approximation, ...] = ()
    # The same for settings: property, the values for which the sentence holds, sentence.
    setting_approximations: tuple[tuple[str, tuple[object, ...], str], ...] = ()
    # Outputs that are given otherwise than in Cycles: name, sentence for where somebody reads it.
    output_approximations: tuple[tuple[str, str], ...] = ()
    note: str = ""  # the whole node is a stand-in: the sentence that says so
    # Bounds of the outputs from bounds of the sockets; None: nothing is known about them.
    estimate: Callable[[dict[str, Estimate]], dict[str, Estimate]] | None = None
    # Shader leaves: which closures there are, from bounds of the sockets.
    summary: Callable[[dict[str, Estimate]], Summary] | None = None
    # Shader nodes that hand their weight on: "MIX" or "ADD".
    combine: str = ""

    def matches(self, properties: dict[str, object]) -> bool:
        """A property that is not there counts as the first of its choices."""
        return all(properties.get(name) == value for name, value in self.when.items()) and all(
            properties.get(name, allowed[0]) in allowed for name, allowed in self.choices.items()
        )
