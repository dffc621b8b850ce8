"""Which image lookups of a tree may be averaged over what a pixel sees, so that a sample shows what many would on average.

The mean of what a surface shows is that of a lookup only where the way from the image to the picture is affine: through
nodes that add, scale and blend, to a colour or a weight of a shader. EXACT lookups are such, in trees that read no second
image whose product with the first would have another mean than the product of both means. Of n samples, each averages
over its n-th of the pixel's area, so that many samples show the same as without. Where alpha covers, colour counts as far
as it does: mean of alpha times colour is exact, a crown of leaves keeps its density.

FIRST lookups come to shaders through such nodes, too, but as roughness, as a normal, or beside other images. Their mean
is close, not exact: the first sample alone averages, so that drafts are smooth; in a picture of n samples that is 1/n.

All others (through ramps, thresholds, curves, as heights, with coordinates that jump, by Closest or Cubic, by rays of
shadows, in views of lights, of the world and of lamps) show what they did.
"""

from __future__ import annotations

from . import nodes
from .graph import Graph, Node

EXACT, FIRST = "EXACT", "FIRST"
MOST_COORDINATE_NODES = 8  # that are evaluated at two points beside

COLOR_SINKS = {"Color", "Base Color", "Emission Color"}
WEIGHT_SINKS = {"Alpha", "Fac"}

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


def averaged_lookups(graph: Graph, opaque) -> dict[str, str]:
    """By image node: EXACT or FIRST; nodes that are not in it show what stands at the point. `opaque` of a node: whether
    its image has no alpha below 1, or none that covers."""
    shown = _before(graph, graph.surface)
    read = [graph.nodes[key] for key in shown if graph.nodes[key].image]
    uses: dict[str, list[tuple[str, str, str]]] = {}  # by node: its output, and who reads that
    for key in shown:
        for socket, given in graph.nodes[key].inputs.items():
            if given.link is not None:
                uses.setdefault(given.link[0], []).append((given.link[1], key, socket))
    found = {}
    for node in read:
        if not _may_average(graph, node):
            continue
        sinks = _sinks(graph, node, uses)
        if sinks is None or not sinks:
            continue
        if any(output == "Color" for output, *_ in sinks) and not any(output == "Alpha" for output, *_ in sinks):
            if not opaque(node):
                continue  # stored colours are multiplied by alpha before they are decoded: no mean is that of others
        found[node.key] = EXACT if len(read) == 1 and _exact(sinks) else FIRST
    return found


def _exact(sinks: set[tuple[str, str, bool]]) -> bool:
    colors = {socket for output, socket, _ in sinks if output == "Color"}
    alphas = {socket for output, socket, _ in sinks if output == "Alpha"}
    if any(product for *_, product in sinks):
        return False
    if colors <= COLOR_SINKS and alphas <= WEIGHT_SINKS:
        return True
    return colors <= WEIGHT_SINKS and not alphas


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


def _sinks(graph: Graph, image: Node, uses: dict) -> set[tuple[str, str, bool]] | None:
    """Sockets of shaders that an image's outputs reach through affine nodes: output, socket, whether it is multiplied
    by the image once more on the way. None where some way leads elsewhere."""
    found: set[tuple[str, str, bool]] = set()
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
                    found.add((output, socket, product))
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
