"""Nodes that transform vectors."""

from __future__ import annotations

from .entry import POINT, Attribute, Entry, Socket

SOURCE = "material/vector.glsl"

ENTRIES = (
    Entry(
        "ShaderNodeMapping",
        "mapping_{vector_type}",
        (
            Socket("Vector", "VECTOR"),
            Socket("Location", "VECTOR"),
            Socket("Rotation", "VECTOR"),
            Socket("Scale", "VECTOR", (1.0, 1.0, 1.0)),
        ),
        (("Vector", "VECTOR"),),
        SOURCE,
        choices={"vector_type": ("POINT", "TEXTURE", "VECTOR", "NORMAL")},
    ),
    Entry(
        "ShaderNodeNormalMap",
        "normal_map_tangent",
        (
            POINT,
            Attribute("TANGENT", "uv_map"),
            Socket("Strength", "FLOAT", 1.0),
            Socket("Color", "COLOR", (0.5, 0.5, 1.0)),
        ),
        (("Normal", "VECTOR"),),
        SOURCE,
        when={"space": "TANGENT"},
        setting_approximations=(
            ("convention", ("DIRECTX",), "The DirectX convention is not read; invert the green channel of the map."),
        ),
    ),
    Entry(
        "ShaderNodeNormalMap",
        "normal_map_world",
        (POINT, Socket("Strength", "FLOAT", 1.0), Socket("Color", "COLOR", (0.5, 0.5, 1.0))),
        (("Normal", "VECTOR"),),
        SOURCE,
        when={"space": "WORLD"},
    ),
)
