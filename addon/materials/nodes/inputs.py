"""Nodes that read the surface, its object, its attributes or a constant."""

from __future__ import annotations

from .entry import POINT, Attribute, Choice, Entry, Rows, Setting, Socket

SURFACE = "material/input.glsl"
STRAND, WAY, PLACE, MARK = ".strand", ".strand_way", ".point", ".point_mark"  # and snapshot/strands.py
ROUND = ".strand_round"
POINTINESS, ISLAND = ".pointiness", ".island"  # attributes that snapshot/shape.py makes
CORNER = ".corner"  # which corner of its triangle, made by snapshot/meshes.py
FLAT = ".flat"  # 1 at corners of faces that are not smooth, read where a material displaces

GENERATED = Attribute("GENERATED", output="Generated")
UV = Attribute("UV", output="UV")
COORDINATES = tuple(
    (name, "VECTOR") for name in ("Generated", "Normal", "UV", "Object", "Camera", "Window", "Reflection")
)
NORMAL = Socket("Normal", "VECTOR", implicit="point.normal")

LIGHT_PATH = (
    *("Is Camera Ray", "Is Shadow Ray", "Is Diffuse Ray", "Is Glossy Ray", "Is Singular Ray", "Is Reflection Ray"),
    *("Is Transmission Ray", "Is Volume Scatter Ray", "Ray Length", "Ray Depth", "Diffuse Depth", "Glossy Depth"),
    *("Transparent Depth", "Transmission Depth", "Portal Depth"),
)
# Light samples ask casters as shadow rays, the world as no ray of the camera; traced rays take a material's means.
ONLY_TWO_RAYS = "Node trees are asked by camera and shadow rays alone; for other rays, materials count at their mean."
NO_PARAMETRIC = "Where a point lies in its triangle is not known; Parametric is 0."


def _matrix(rows) -> list[tuple[float, float, float, float]]:
    """The three rows of a matrix from world to an object's space."""
    return [tuple(row) for row in rows or ((1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0))]


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
    Entry(
        "ShaderNodeUVMap",
        "input_instancer_uv",
        (POINT,),
        (("UV", "VECTOR"),),
        SURFACE,
        when={"from_instancer": True},
    ),
    Entry("ShaderNodeUVMap", "input_uv", (Attribute("UV", "uv_map"),), (("UV", "VECTOR"),), SURFACE),
    Entry(
        "ShaderNodeTexCoord",
        "input_texture_coordinate_instancer",
        (POINT,),
        COORDINATES,
        SURFACE,
        when={"from_instancer": True},
    ),
    Entry(
        "ShaderNodeTexCoord",
        "input_texture_coordinate_object",
        (POINT, GENERATED, UV, Rows("object_matrix", _matrix)),
        COORDINATES,
        SURFACE,
        when={"of_another_object": True},
    ),
    Entry("ShaderNodeTexCoord", "input_texture_coordinate", (POINT, GENERATED, UV), COORDINATES, SURFACE),
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
        (Attribute("NAMED", "attribute_name"),),
        (("Color", "COLOR"), ("Vector", "VECTOR"), ("Fac", "FLOAT"), ("Alpha", "FLOAT")),
        SURFACE,
        when={"attribute_type": "GEOMETRY"},
    ),
    Entry(
        "ShaderNodeAttribute",
        "input_instance_attribute",
        (POINT, Setting("attribute_column")),
        (("Color", "COLOR"), ("Vector", "VECTOR"), ("Fac", "FLOAT"), ("Alpha", "FLOAT")),
        SURFACE,
        when={"of_instance": True},
    ),
    Entry(
        "ShaderNodeAttribute",
        "input_layer_attribute",
        (Rows("layer_value", lambda value: [tuple(value or (0.0,) * 4)]),),
        (("Color", "COLOR"), ("Vector", "VECTOR"), ("Fac", "FLOAT"), ("Alpha", "FLOAT")),
        SURFACE,
        when={"attribute_type": "VIEW_LAYER"},
    ),
    Entry(
        "ShaderNodeWireframe",
        "input_wireframe",
        (
            POINT,
            Attribute("NAMED", name=CORNER, slopes=True),
            Socket("Size", "FLOAT", 0.01),
            Choice("use_pixel_size", {False: "false", True: "true"}, "false"),
        ),
        (("Fac", "FLOAT"),),
        SURFACE,
    ),
    Entry(
        "ShaderNodeHairInfo",
        "input_strand",
        (POINT, Attribute("NAMED", name=STRAND), Attribute("NAMED", name=WAY)),
        (
            ("Is Strand", "FLOAT"),
            ("Intercept", "FLOAT"),
            ("Length", "FLOAT"),
            ("Thickness", "FLOAT"),
            ("Tangent Normal", "VECTOR"),
            ("Random", "FLOAT"),
        ),
        SURFACE,
    ),
    Entry(
        "ShaderNodePointInfo",
        "input_point",
        (POINT, Attribute("NAMED", name=PLACE), Attribute("NAMED", name=MARK)),
        (("Position", "VECTOR"), ("Radius", "FLOAT"), ("Random", "FLOAT")),
        SURFACE,
    ),
    Entry(
        "ShaderNodeNewGeometry",
        "input_geometry",
        (
            POINT,
            Attribute("GENERATED", output="Tangent"),
            Attribute("NAMED", output="Pointiness", name=POINTINESS),
            Attribute("NAMED", output="Random Per Island", name=ISLAND),
        ),
        (
            ("Position", "VECTOR"),
            ("Normal", "VECTOR"),
            ("Tangent", "VECTOR"),
            ("True Normal", "VECTOR"),
            ("Incoming", "VECTOR"),
            ("Parametric", "VECTOR"),
            ("Backfacing", "FLOAT"),
            ("Pointiness", "FLOAT"),
            ("Random Per Island", "FLOAT"),
        ),
        SURFACE,
        output_approximations=(("Parametric", NO_PARAMETRIC),),
    ),
    Entry(
        "ShaderNodeObjectInfo",
        "input_object_info",
        (POINT, Setting("material_index")),
        (
            ("Location", "VECTOR"),
            ("Color", "COLOR"),
            ("Alpha", "FLOAT"),
            ("Object Index", "FLOAT"),
            ("Material Index", "FLOAT"),
            ("Random", "FLOAT"),
        ),
        SURFACE,
    ),
    Entry(
        "ShaderNodeCameraData",
        "input_camera",
        (POINT,),
        (("View Vector", "VECTOR"), ("View Z Depth", "FLOAT"), ("View Distance", "FLOAT")),
        SURFACE,
    ),
    Entry(
        "ShaderNodeLightPath",
        "input_light_path",
        (POINT,),
        tuple((name, "FLOAT") for name in LIGHT_PATH),
        SURFACE,
        output_approximations=tuple((name, ONLY_TWO_RAYS) for name in LIGHT_PATH[2:] if name != "Ray Length"),
    ),
    Entry(
        "ShaderNodeLightFalloff",
        "input_light_falloff",
        (POINT, Socket("Strength", "FLOAT", 100.0), Socket("Smooth", "FLOAT", 0.0)),
        (("Quadratic", "FLOAT"), ("Linear", "FLOAT"), ("Constant", "FLOAT")),
        SURFACE,
    ),
    Entry(
        "ShaderNodeTangent",
        "input_tangent",
        (POINT, Attribute("TANGENT", "uv_map")),
        (("Tangent", "VECTOR"),),
        SURFACE,
        when={"direction_type": "UV_MAP"},
    ),
    Entry(
        "ShaderNodeTangent",
        "input_tangent_{axis}",
        (POINT, Attribute("GENERATED")),
        (("Tangent", "VECTOR"),),
        SURFACE,
        choices={"axis": ("Z", "X", "Y")},
    ),
    Entry(
        "ShaderNodeFresnel", "input_fresnel", (POINT, Socket("IOR", "FLOAT", 1.5), NORMAL), (("Fac", "FLOAT"),), SURFACE
    ),
    Entry(
        "ShaderNodeLayerWeight",
        "input_layer_weight",
        (POINT, Socket("Blend", "FLOAT", 0.5), NORMAL),
        (("Fresnel", "FLOAT"), ("Facing", "FLOAT")),
        SURFACE,
    ),
)
