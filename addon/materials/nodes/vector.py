"""Nodes that transform vectors, bend normals and move the surface."""

from __future__ import annotations

from .entry import POINT, Approximation, Attribute, Choice, Entry, Heights, Socket

SOURCE = "material/vector.glsl"
BUMP = "material/bump.glsl"

NORMAL = Socket("Normal", "VECTOR", implicit="point.normal")
FILTER_WIDTH = Socket("Filter Width", "FLOAT", 0.1)
INVERT = Choice("invert", {True: "true", False: "false"}, missing="false")
DIRECTX = Choice("convention", {"OPENGL": "false", "DIRECTX": "true"}, missing="false")
SPACES = {"WORLD": 0, "OBJECT": 1, "CAMERA": 2}  # SPACE_* in material/vector_transform.glsl

MAP_STRENGTH = Socket("Strength", "FLOAT", 1.0)
MAP_COLOR = Socket("Color", "COLOR", (0.5, 0.5, 1.0))
ROTATED = (Socket("Vector", "VECTOR"), Socket("Center", "VECTOR"))
ANGLE = Socket("Angle", "FLOAT")
LIFT = (
    Socket("Height", "FLOAT"),
    Socket("Midlevel", "FLOAT", 0.5),
    Socket("Scale", "FLOAT", 1.0),
    NORMAL,
)
SHIFT = (Socket("Vector", "COLOR"), Socket("Midlevel", "FLOAT"), Socket("Scale", "FLOAT", 1.0))
DISPLACEMENT = (("Displacement", "VECTOR"),)

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
        (POINT, Attribute("TANGENT", "uv_map"), MAP_STRENGTH, MAP_COLOR, DIRECTX),
        (("Normal", "VECTOR"),),
        SOURCE,
        when={"space": "TANGENT"},
    ),
    Entry(
        "ShaderNodeNormalMap",
        "normal_map_{space}",
        (POINT, MAP_STRENGTH, MAP_COLOR, DIRECTX),
        (("Normal", "VECTOR"),),
        SOURCE,
        choices={"space": ("WORLD", "OBJECT", "BLENDER_WORLD", "BLENDER_OBJECT")},
    ),
    Entry(
        "ShaderNodeBump",
        "bump",
        (
            POINT,
            Socket("Strength", "FLOAT", 1.0),
            Socket("Distance", "FLOAT", 1.0),
            FILTER_WIDTH,
            INVERT,
            Heights("Height", FILTER_WIDTH),
            NORMAL,
        ),
        (("Normal", "VECTOR"),),
        BUMP,
    ),
    Entry(
        "ShaderNodeDisplacement",
        "displacement_along_normal",
        LIFT,
        DISPLACEMENT,
        BUMP,
        when={"space": "WORLD"},
    ),
    Entry("ShaderNodeDisplacement", "displacement_along_normal_of_object", (POINT, *LIFT), DISPLACEMENT, BUMP),
    Entry(
        "ShaderNodeVectorDisplacement",
        "vector_displacement_world",
        SHIFT,
        DISPLACEMENT,
        BUMP,
        when={"space": "WORLD"},
    ),
    Entry(
        "ShaderNodeVectorDisplacement",
        "vector_displacement_object",
        (POINT, *SHIFT),
        DISPLACEMENT,
        BUMP,
        when={"space": "OBJECT"},
    ),
    Entry(
        "ShaderNodeVectorDisplacement",
        "vector_displacement_tangent",
        (POINT, Attribute("TANGENT"), *SHIFT),
        DISPLACEMENT,
        BUMP,
    ),
    Entry(
        "ShaderNodeNormal",
        "normal_node",
        (Socket("Direction", "VECTOR", (0.0, 0.0, 1.0)), Socket("Normal", "VECTOR", (0.0, 0.0, 1.0))),
        (("Normal", "VECTOR"), ("Dot", "FLOAT")),
        SOURCE,
    ),
    Entry(
        "ShaderNodeVectorRotate",
        "rotate_axis_angle",
        (*ROTATED, Socket("Axis", "VECTOR", (0.0, 0.0, 1.0)), ANGLE, INVERT),
        (("Vector", "VECTOR"),),
        SOURCE,
        when={"rotation_type": "AXIS_ANGLE"},
    ),
    Entry(
        "ShaderNodeVectorRotate",
        "rotate_euler_xyz",
        (*ROTATED, Socket("Rotation", "VECTOR"), INVERT),
        (("Vector", "VECTOR"),),
        SOURCE,
        when={"rotation_type": "EULER_XYZ"},
    ),
    Entry(
        "ShaderNodeVectorRotate",
        "rotate_{rotation_type}",
        (*ROTATED, ANGLE, INVERT),
        (("Vector", "VECTOR"),),
        SOURCE,
        choices={"rotation_type": ("X_AXIS", "Y_AXIS", "Z_AXIS")},
    ),
    Entry(
        "ShaderNodeVectorTransform",
        "transform_{vector_type}",
        (POINT, Socket("Vector", "VECTOR"), Choice("convert_from", SPACES), Choice("convert_to", SPACES)),
        (("Vector", "VECTOR"),),
        "material/vector_transform.glsl",
        choices={"vector_type": ("VECTOR", "POINT", "NORMAL")},
    ),
    Entry(
        "ShaderNodeRadialTiling",
        "radial_tiling",
        (
            Socket("Vector", "VECTOR"),
            Socket("Sides", "FLOAT", 5.0),
            Choice("normalize", {True: "true", False: "false"}, missing="false"),
        ),
        (
            ("Segment Coordinates", "VECTOR"),
            ("Segment ID", "FLOAT"),
            ("Segment Width", "FLOAT"),
            ("Segment Rotation", "FLOAT"),
        ),
        SOURCE,
        approximations=(
            Approximation("Roundness", 0.0, "Corners are not rounded."),
            Approximation("Sides", "whole", "A side that is not whole is drawn as part of a regular one."),
        ),
    ),
)
