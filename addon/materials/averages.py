"""Which image lookups of a tree may be averaged over what a pixel sees, so that one sample shows the mean of many.

The mean of what a surface shows is that of a lookup only where the way from the image to the picture is affine: through
nodes that add, scale and blend, to a colour or a weight of a shader. EXACT lookups are such, in trees that read no
second image, since the mean of a product is not the product of means. All samples of a picture share what the pixel
filter covers (Frame.look), so that many show the same as without.

What decides whether a surface is passed stays that of the point: a layer is drawn with the probability of its opacity,
and a mean of alpha has as much noise as alpha itself, or more, since samples are spread evenly over the pixel but not
over pixel and probability at once (three layers of leaves, 64 samples: ten times the error). Colour then counts as far
as alpha covers: alpha at the point times that mean is exact, and a crown of leaves keeps its density.

FIRST lookups come to shaders through such nodes, too, but as roughness, as a normal, or beside other images. Their mean
is close, not exact: the first sample alone averages, so that drafts are smooth; of n samples the bias is 1/n of that.

All others (through ramps, thresholds, curves, as heights, at coordinates that jump, by Closest or Cubic, on boxes,
spheres and tubes) show what stands at the point. So do all for shadows, in views of lights, of worlds and of lamps.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from . import nodes
from .graph import Graph, Node

EXACT, FIRST = "EXACT", "FIRST"
MOST_COORDINATE_NODES = 8  # that are evaluated at two points beside

COLOR_SINKS = {"Color", "Base Color", "Emission Color"}
WEIGHT_SINKS = {"Alpha", "Fac"}

_TRANSPARENT = "ShaderNodeBsdfTransparent"
_BLENDS = ("MIX", "ADD", "SUBTRACT", "MULTIPLY")
_SUMS = ("ADD", "SUBTRACT", "MULTIPLY", "MULTIPLY_ADD", "SCALE")
_APART = {
    "ShaderNodeCombineColor", "ShaderNodeCombineRGB", "ShaderNodeCombineXYZ", "ShaderNodeSeparateColor",
    "ShaderNodeSeparateRGB", "ShaderNodeSeparateXYZ", "ShaderNodeRGBToBW",
}  # fmt: skip
_SMOOTH = {
    "ShaderNodeAttribute", "ShaderNodeCombineXYZ", "ShaderNodeMapping", "ShaderNodeNewGeometry", "ShaderNodeObjectInfo",
    "ShaderNodeRGB", "ShaderNodeSeparateXYZ", "ShaderNodeTexCoord", "ShaderNodeUVMap", "ShaderNodeValue",
    "ShaderNodeVectorRotate", "ShaderNodeVectorTransform",
}  # fmt: skip
_ELSEWHERE = {"ShaderNodeDisplacement", "ShaderNodeVectorDisplacement", "ShaderNodeOutputAOV"}  # never averaged


@dataclass(frozen=True)
class Averaged:
    """How a lookup may be averaged."""

    kind: str  # EXACT or FIRST
    alpha: bool  # alpha, too; else that is the point's


@dataclass(frozen=True)
class _Sink:
    """A socket of a shader that an output of an image reaches through affine nodes."""

    output: str
    shader: str
    socket: str
    product: bool  # multiplied by the image once more on the way

    def lets_pass(self, dithered: bool) -> bool:
        """Whether it decides if a surface is passed; `dithered`: some surface of the tree may be."""
        return self.socket == "Alpha" or self.shader == _TRANSPARENT or (dithered and self.socket == "Fac")


def averaged_lookups(graph: Graph, opaque: Callable[[Node], bool]) -> dict[str, Averaged]:
    """By image node; those that are not in it show what stands at the point. `opaque` of a node: whether its image has
    no alpha below 1, or none that covers."""
    shown = _before(graph, graph.surface)
    read = [graph.nodes[key] for key in shown if graph.nodes[key].image]
    dithered = any(_may_be_passed(graph.nodes[key]) for key in shown)
    uses: dict[str, list[tuple[str, str, str]]] = {}  # by node: its output, and who reads that
    for key in shown:
        for socket, given in graph.nodes[key].inputs.items():
            if given.link is not None:
                uses.setdefault(given.link[0], []).append((given.link[1], key, socket))
    found = {}
    for node in read:
        sinks = _sinks(graph, node, uses) if _may_average(graph, node) else None
        if not sinks:
            continue
        colors, alphas = ({one for one in sinks if one.output == output} for output in ("Color", "Alpha"))
        # Where nobody reads alpha, stored colours are multiplied by it and then decoded, which no mean allows for.
        if any(one.lets_pass(dithered) for one in colors) or (not alphas and not opaque(node)):
            continue
        alpha = not any(one.lets_pass(dithered) for one in alphas)
        if colors or alpha:
            found[node.key] = Averaged(EXACT if len(read) == 1 and _exact(colors, alphas) else FIRST, alpha)
    return found


def _exact(colors: set[_Sink], alphas: set[_Sink]) -> bool:
    if any(one.product for one in colors | alphas):
        return False
    color_sockets, alpha_sockets = {one.socket for one in colors}, {one.socket for one in alphas}
    if color_sockets <= COLOR_SINKS and alpha_sockets <= WEIGHT_SINKS:
        return True
    return color_sockets <= WEIGHT_SINKS and not alphas


def _may_be_passed(node: Node) -> bool:
    alpha = node.inputs.get("Alpha") if node.type == "ShaderNodeBsdfPrincipled" else None
    return node.type == _TRANSPARENT or (alpha is not None and (alpha.link is not None or alpha.value != 1.0))


def _before(graph: Graph, link: tuple[str, str] | None) -> list[str]:
    """Keys of the nodes that lead to a link."""
    found: dict[str, None] = {}
    waiting = [link[0]] if link is not None and link[0] in graph.nodes else []
    while waiting:
        key = waiting.pop()
        if key not in found:
            found[key] = None
            links = (given.link for given in graph.nodes[key].inputs.values())
            waiting += [one[0] for one in links if one is not None and one[0] in graph.nodes]
    return list(found)


def _may_average(graph: Graph, node: Node) -> bool:
    """Whether the lookup interpolates linearly, at coordinates that are smooth."""
    plain = node.type == "ShaderNodeTexImage" and node.properties.get("interpolation", "Linear") == "Linear"
    if not plain or node.properties.get("projection", "FLAT") != "FLAT":
        return False
    given = node.inputs.get("Vector")
    if given is None or given.link is None:
        return True
    before = [graph.nodes[key] for key in _before(graph, given.link)]
    return len(before) <= MOST_COORDINATE_NODES and all(map(_is_smooth, before))


def _is_smooth(node: Node) -> bool:
    if node.type in ("ShaderNodeMath", "ShaderNodeVectorMath"):
        return node.properties.get("operation", "ADD") in _SUMS and not node.properties.get("use_clamp")
    return node.type in _SMOOTH


def _sinks(graph: Graph, image: Node, uses: dict) -> set[_Sink] | None:
    """Where an image's outputs are read; None where some way leads through what is not affine."""
    found: set[_Sink] = set()
    for output in ("Color", "Alpha"):
        waiting, seen = [(image.key, output, False)], set()
        while waiting:
            key, link, product = waiting.pop()
            for own, reader, socket in uses.get(key, ()):
                if key == image.key and own != link:
                    continue
                node = graph.nodes[reader]
                if node.type in _ELSEWHERE:
                    continue
                entry = nodes.find(node.type, node.properties)
                if entry is None:
                    return None
                if entry.summary or entry.combine:
                    found.add(_Sink(output, node.type, socket, product))
                    continue
                if not _is_affine(node, socket):
                    return None
                twice = product or sum(_depends(graph, image, given.link) for given in node.inputs.values()) > 1
                if (reader, twice) not in seen:
                    seen.add((reader, twice))
                    waiting.append((reader, "", twice))
    return found


def _depends(graph: Graph, image: Node, link: tuple[str, str] | None) -> bool:
    return image.key in _before(graph, link)


def _is_affine(node: Node, socket: str) -> bool:
    """Whether what a node gives is affine in this socket."""
    properties = node.properties
    if properties.get("use_clamp") or properties.get("clamp_result"):
        return False
    if node.type in ("ShaderNodeMix", "ShaderNodeMixRGB"):
        return properties.get("blend_type", "MIX") in _BLENDS and properties.get("data_type", "RGBA") in (
            "RGBA",
            "FLOAT",
        )
    if node.type in ("ShaderNodeMath", "ShaderNodeVectorMath"):
        return properties.get("operation", "ADD") in _SUMS
    if node.type in _APART:
        return properties.get("mode", "RGB") == "RGB"
    return node.type in ("ShaderNodeInvert", "ShaderNodeNormalMap")
