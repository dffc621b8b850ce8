"""Nodes that compute with numbers and vectors, and take colours apart."""

from __future__ import annotations

from ..estimate import between
from .entry import Choice, Entry, Socket

SOURCE = "material/converter.glsl"

MATH_OPERATIONS = (
    *("ADD", "SUBTRACT", "MULTIPLY", "DIVIDE", "MULTIPLY_ADD", "POWER", "LOGARITHM", "SQRT", "INVERSE_SQRT"),
    *("ABSOLUTE", "EXPONENT", "MINIMUM", "MAXIMUM", "LESS_THAN", "GREATER_THAN", "SIGN", "COMPARE", "SMOOTH_MIN"),
    *("SMOOTH_MAX", "ROUND", "FLOOR", "CEIL", "TRUNC", "FRACT", "MODULO", "FLOORED_MODULO", "WRAP", "SNAP"),
    *("PINGPONG", "SINE", "COSINE", "TANGENT", "ARCSINE", "ARCCOSINE", "ARCTANGENT", "ARCTAN2", "SINH", "COSH"),
    *("TANH", "RADIANS", "DEGREES"),
)

VECTOR_OPERATIONS = (
    *("ADD", "SUBTRACT", "MULTIPLY", "DIVIDE", "MULTIPLY_ADD", "CROSS_PRODUCT", "PROJECT", "REFLECT", "REFRACT"),
    *("FACEFORWARD", "SCALE", "NORMALIZE", "ABSOLUTE", "POWER", "SIGN", "MINIMUM", "MAXIMUM", "ROUND", "FLOOR"),
    *("CEIL", "FRACTION", "MODULO", "WRAP", "SNAP", "SINE", "COSINE", "TANGENT"),
)
VECTORS = (Socket("Vector", "VECTOR"), Socket("Vector_001", "VECTOR"))
BOUNDED = Choice("clamp", {True: "true", False: "false"}, missing="true")
RANGES = ("LINEAR", "STEPPED", "SMOOTHSTEP", "SMOOTHERSTEP")

COLOR_MODELS = ("RGB", "HSV", "HSL")


ENTRIES = (
    Entry(
        "ShaderNodeMath",
        "math_{operation}",
        (
            Socket("Value", "FLOAT", 0.5),
            Socket("Value_001", "FLOAT", 0.5),
            Socket("Value_002", "FLOAT", 0.5),
        ),
        (("Value", "FLOAT"),),
        "material/math.glsl",
        choices={"operation": MATH_OPERATIONS},
        clamp_result="use_clamp",
    ),
    Entry(
        "ShaderNodeVectorMath",
        "vector_{operation}",
        (*VECTORS, Socket("Vector_002", "VECTOR"), Socket("Scale", "FLOAT", 1.0)),
        (("Vector", "VECTOR"),),
        "material/vector_math.glsl",
        choices={"operation": VECTOR_OPERATIONS},
    ),
    Entry(
        "ShaderNodeVectorMath",
        "vector_{operation}",
        VECTORS,
        (("Value", "FLOAT"),),
        "material/vector_math.glsl",
        choices={"operation": ("DOT_PRODUCT", "DISTANCE", "LENGTH")},
    ),
    Entry(
        "ShaderNodeMapRange",
        "map_range_vector_{interpolation_type}",
        (
            Socket("Vector", "VECTOR"),
            Socket("From_Min_FLOAT3", "VECTOR"),
            Socket("From_Max_FLOAT3", "VECTOR", (1.0, 1.0, 1.0)),
            Socket("To_Min_FLOAT3", "VECTOR"),
            Socket("To_Max_FLOAT3", "VECTOR", (1.0, 1.0, 1.0)),
            Socket("Steps_FLOAT3", "VECTOR", (4.0, 4.0, 4.0)),
            BOUNDED,
        ),
        (("Vector", "VECTOR"),),
        "material/map_range.glsl",
        when={"data_type": "FLOAT_VECTOR"},
        choices={"interpolation_type": RANGES},
    ),
    Entry(
        "ShaderNodeMapRange",
        "map_range_{interpolation_type}",
        (
            Socket("Value", "FLOAT", 1.0),
            Socket("From Min", "FLOAT"),
            Socket("From Max", "FLOAT", 1.0),
            Socket("To Min", "FLOAT"),
            Socket("To Max", "FLOAT", 1.0),
            Socket("Steps", "FLOAT", 4.0),
            BOUNDED,
        ),
        (("Result", "FLOAT"),),
        "material/map_range.glsl",
        choices={"interpolation_type": RANGES},
    ),
    Entry(
        "ShaderNodeMix",
        "mix_float",
        (
            Socket("Factor_Float", "FLOAT", 0.5, clamp="clamp_factor"),
            Socket("A_Float", "FLOAT"),
            Socket("B_Float", "FLOAT"),
        ),
        (("Result_Float", "FLOAT"),),
        SOURCE,
        when={"data_type": "FLOAT"},
        estimate=between("Factor_Float", "A_Float", "B_Float", "Result_Float"),
    ),
    Entry(
        "ShaderNodeMix",
        "mix_vector",
        (
            Socket("Factor_Float", "FLOAT", 0.5, clamp="clamp_factor"),
            Socket("A_Vector", "VECTOR"),
            Socket("B_Vector", "VECTOR"),
        ),
        (("Result_Vector", "VECTOR"),),
        SOURCE,
        when={"data_type": "VECTOR", "factor_mode": "UNIFORM"},
    ),
    Entry(
        "ShaderNodeMix",
        "mix_vector_non_uniform",
        (
            Socket("Factor_Vector", "VECTOR", (0.5, 0.5, 0.5), clamp="clamp_factor"),
            Socket("A_Vector", "VECTOR"),
            Socket("B_Vector", "VECTOR"),
        ),
        (("Result_Vector", "VECTOR"),),
        SOURCE,
        when={"data_type": "VECTOR"},
    ),
    Entry(
        "ShaderNodeSeparateColor",
        "separate_{mode}",
        (Socket("Color", "COLOR", (0.8, 0.8, 0.8)),),
        (("Red", "FLOAT"), ("Green", "FLOAT"), ("Blue", "FLOAT")),
        SOURCE,
        choices={"mode": COLOR_MODELS},
    ),
    Entry(
        "ShaderNodeCombineColor",
        "combine_{mode}",
        (Socket("Red", "FLOAT"), Socket("Green", "FLOAT"), Socket("Blue", "FLOAT")),
        (("Color", "COLOR"),),
        SOURCE,
        choices={"mode": COLOR_MODELS},
    ),
    Entry(
        "ShaderNodeSeparateXYZ",
        "separate_rgb",
        (Socket("Vector", "VECTOR"),),
        (("X", "FLOAT"), ("Y", "FLOAT"), ("Z", "FLOAT")),
        SOURCE,
    ),
    Entry(
        "ShaderNodeCombineXYZ",
        "combine_rgb",
        (Socket("X", "FLOAT"), Socket("Y", "FLOAT"), Socket("Z", "FLOAT")),
        (("Vector", "VECTOR"),),
        SOURCE,
    ),
    # Nodes of files before Blender 3.3, which 4.5 still has.
    *(
        Entry(
            f"ShaderNode{way}{model}",
            f"{way.lower()}_{model.lower()}",
            (Socket("Color" if model == "HSV" else "Image", "COLOR", (0.8, 0.8, 0.8)),),
            tuple((channel, "FLOAT") for channel in model),
            SOURCE,
        )
        if way == "Separate"
        else Entry(
            f"ShaderNode{way}{model}",
            f"{way.lower()}_{model.lower()}",
            tuple(Socket(channel, "FLOAT") for channel in model),
            (("Color" if model == "HSV" else "Image", "COLOR"),),
            SOURCE,
        )
        for way in ("Separate", "Combine")
        for model in ("RGB", "HSV")
    ),
    Entry(
        "ShaderNodeClamp",
        "clamp_{clamp_type}",
        (Socket("Value", "FLOAT", 1.0), Socket("Min", "FLOAT"), Socket("Max", "FLOAT", 1.0)),
        (("Result", "FLOAT"),),
        SOURCE,
        choices={"clamp_type": ("MINMAX", "RANGE")},
    ),
    # Made by the reader where a group's socket changes the kind of what passes through it.
    Entry("Convert", "convert_float", (Socket("Value", "FLOAT"),), (("Value", "FLOAT"),), SOURCE, {"kind": "FLOAT"}),
    Entry(
        "Convert",
        "convert_vector",
        (Socket("Value", "VECTOR"),),
        (("Value", "VECTOR"),),
        SOURCE,
        {"kind": "VECTOR"},
    ),
    Entry("Convert", "convert_vector", (Socket("Value", "COLOR"),), (("Value", "COLOR"),), SOURCE, {"kind": "COLOR"}),
)
