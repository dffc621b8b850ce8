"""Nodes that read the surface, its attributes or a constant."""

from __future__ import annotations

from .entry import POINT, Attribute, Entry, Socket

SURFACE = "material/input.glsl"

ENTRIES = (
    Entry(
        "ShaderNodeRGB",
        "input_color",
        (Socket("Color", "COLOR"),),
        (("Color", "COLOR"),),
        SURFACE,
        estimate=lambda sockets: {"Color": sockets["Color"]},
    ),
    Entry(
        "ShaderNodeValue",
        "input_value",
        (Socket("Value", "FLOAT"),),
        (("Value", "FLOAT"),),
        SURFACE,
        estimate=lambda sockets: {"Value": sockets["Value"]},
    ),
    Entry("ShaderNodeUVMap", "input_uv", (Attribute("UV", "uv_map"),), (("UV", "VECTOR"),), SURFACE),
    Entry(
        "ShaderNodeTexCoord",
        "input_texture_coordinate",
        (POINT, Attribute("UV")),
        (("UV", "VECTOR"), ("Reflection", "VECTOR")),
        SURFACE,
    ),
    Entry(
        "ShaderNodeVertexColor",
        "input_color_attribute",
        (Attribute("COLOR", "layer_name"),),
        (("Color", "COLOR"), ("Alpha", "FLOAT")),
        SURFACE,
    ),
    Entry(
        "ShaderNodeAttribute",
        "input_attribute",
        (Attribute("COLOR", "attribute_name"),),
        (("Color", "COLOR"), ("Vector", "VECTOR"), ("Fac", "FLOAT"), ("Alpha", "FLOAT")),
        SURFACE,
        when={"attribute_type": "GEOMETRY"},
    ),
    Entry(
        "ShaderNodeNewGeometry",
        "input_geometry",
        (POINT,),
        (("Normal", "VECTOR"), ("True Normal", "VECTOR"), ("Incoming", "VECTOR"), ("Backfacing", "FLOAT")),
        SURFACE,
    ),
    Entry("ShaderNodeObjectInfo", "input_object_info", (POINT,), (("Random", "FLOAT"),), SURFACE),
    Entry(
        "ShaderNodeTangent",
        "input_tangent",
        (Attribute("TANGENT", "uv_map"),),
        (("Tangent", "VECTOR"),),
        SURFACE,
        when={"direction_type": "UV_MAP"},
    ),
)
