"""EEVEE's back face culling as part of a material's tree: a mix with what lets all light pass, on the far side."""

from __future__ import annotations

from dataclasses import replace

from .graph import Graph, Input, Node

PREFIX = "Backface Culling"


def culled(graph: Graph, camera: bool, shadow: bool) -> Graph:
    """The tree of a material whose back is not there, for whoever looks and for light on its way to a surface."""
    if graph.surface is None or not (camera or shadow):
        return graph

    def node(name: str, kind: str, inputs: dict, outputs: dict, **properties) -> Node:
        return Node(f"{PREFIX} {name}", PREFIX, kind, inputs, outputs, properties)

    side = node("Side", "ShaderNodeNewGeometry", {}, {"Backfacing": "FLOAT"})
    clear = node(
        "Clear", "ShaderNodeBsdfTransparent", {"Color": Input("COLOR", (1.0, 1.0, 1.0, 1.0))}, {"BSDF": "SHADER"}
    )
    made, share = [side, clear], (side.key, "Backfacing")
    if camera != shadow:
        ray = node("Ray", "ShaderNodeLightPath", {}, {"Is Shadow Ray": "FLOAT"})
        asked = (ray.key, "Is Shadow Ray")
        if camera:
            other = node(
                "Other", "ShaderNodeMath", {"Value": Input("FLOAT", 1.0), "Value_001": Input("FLOAT", link=asked)},
                {"Value": "FLOAT"}, operation="SUBTRACT",
            )  # fmt: skip
            made, asked = [*made, other], (other.key, "Value")
        both = node(
            "Share", "ShaderNodeMath", {"Value": Input("FLOAT", link=share), "Value_001": Input("FLOAT", link=asked)},
            {"Value": "FLOAT"}, operation="MULTIPLY",
        )  # fmt: skip
        made, share = [*made, ray, both], (both.key, "Value")
    mix = node(
        "Mix", "ShaderNodeMixShader",
        {
            "Fac": Input("FLOAT", link=share), "Shader": Input("SHADER", link=graph.surface),
            "Shader_001": Input("SHADER", link=(clear.key, "BSDF")),
        },
        {"Shader": "SHADER"},
    )  # fmt: skip
    return replace(graph, nodes={**graph.nodes, **{one.key: one for one in (*made, mix)}}, surface=(mix.key, "Shader"))
