"""Nodes that compute with numbers and colours."""

from __future__ import annotations

import numpy as np

from ..estimate import Estimate, unknown
from .entry import Entry, Rows, Socket

SOURCE = "material/converter.glsl"

MATH_OPERATIONS = (
    *("ADD", "SUBTRACT", "MULTIPLY", "DIVIDE", "MULTIPLY_ADD", "POWER", "LOGARITHM", "SQRT", "INVERSE_SQRT"),
    *("ABSOLUTE", "EXPONENT", "MINIMUM", "MAXIMUM", "LESS_THAN", "GREATER_THAN", "SIGN", "COMPARE", "SMOOTH_MIN"),
    *("SMOOTH_MAX", "ROUND", "FLOOR", "CEIL", "TRUNC", "FRACT", "MODULO", "FLOORED_MODULO", "WRAP", "SNAP"),
    *("PINGPONG", "SINE", "COSINE", "TANGENT", "ARCSINE", "ARCCOSINE", "ARCTANGENT", "ARCTAN2", "SINH", "COSH"),
    *("TANH", "RADIANS", "DEGREES"),
)

BLEND_MODES = (
    *("MIX", "DARKEN", "MULTIPLY", "BURN", "LIGHTEN", "SCREEN", "DODGE", "ADD", "OVERLAY", "SOFT_LIGHT"),
    *("LINEAR_LIGHT", "DIFFERENCE", "EXCLUSION", "SUBTRACT", "DIVIDE", "HUE", "SATURATION", "COLOR", "VALUE"),
)

COLOR_MODELS = ("RGB", "HSV", "HSL")


def _between(factor: str, a: str, b: str, output: str):
    """Bounds of a blend, which lies between its two ends if the factor stays within 0..1."""

    def estimate(sockets: dict[str, Estimate]) -> dict[str, Estimate]:
        share = sockets[factor].clipped()
        first, second = sockets[a], sockets[b]
        if share.constant:
            return {output: first * share.complement() + second * share}
        mean = first.mean * (1.0 - share.mean) + second.mean * share.mean
        low, high = np.minimum(first.low, second.low), np.maximum(first.high, second.high)
        return {output: Estimate(low, mean, high)}

    return estimate


def _average(*names: str):
    """No bounds, but the mean of the inputs as a better guess than a constant."""

    def estimate(sockets: dict[str, Estimate]) -> dict[str, Estimate]:
        guess = unknown()
        return {"*": Estimate(guess.low, np.mean([sockets[name].mean for name in names], axis=0), guess.high)}

    return estimate


def _mix(node_type: str, factor: str, a: str, b: str, output: str, clamp_factor: str, clamp_result: str, when: dict):
    """Blend of two colours; plain mixing has bounds, other modes do not."""
    arguments = (
        Socket(factor, "FLOAT", 0.5, clamp=clamp_factor),
        Socket(a, "COLOR", (0.5, 0.5, 0.5)),
        Socket(b, "COLOR", (0.5, 0.5, 0.5)),
    )
    outputs = ((output, "COLOR"),)
    bounds = _between(factor, a, b, output)
    return (
        Entry(
            node_type,
            "blend_mix",
            arguments,
            outputs,
            "material/blend.glsl",
            {**when, "blend_type": "MIX"},
            clamp_result=clamp_result,
            estimate=bounds,
        ),
        Entry(
            node_type,
            "blend_{blend_type}",
            arguments,
            outputs,
            "material/blend.glsl",
            when,
            {"blend_type": BLEND_MODES},
            clamp_result=clamp_result,
            estimate=_average(a, b),
        ),
    )


def _stops(stops) -> list[tuple[float, float, float, float]]:
    """Two rows per stop of a colour ramp: its colour, then its position."""
    stops = stops or ((0.0, 0.0, 0.0, 0.0, 1.0), (1.0, 1.0, 1.0, 1.0, 1.0))
    return [row for position, *color in stops for row in (tuple(color), (position, 0.0, 0.0, 0.0))]


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
    *_mix(
        "ShaderNodeMix",
        "Factor_Float",
        "A_Color",
        "B_Color",
        "Result_Color",
        "clamp_factor",
        "clamp_result",
        {"data_type": "RGBA"},
    ),
    *_mix("ShaderNodeMixRGB", "Fac", "Color1", "Color2", "Color", "*", "use_clamp", {}),
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
        estimate=_between("Factor_Float", "A_Float", "B_Float", "Result_Float"),
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
        "ShaderNodeInvert",
        "invert",
        (Socket("Fac", "FLOAT", 1.0), Socket("Color", "COLOR")),
        (("Color", "COLOR"),),
        SOURCE,
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
    Entry(
        "ShaderNodeClamp",
        "clamp_{clamp_type}",
        (Socket("Value", "FLOAT", 1.0), Socket("Min", "FLOAT"), Socket("Max", "FLOAT", 1.0)),
        (("Result", "FLOAT"),),
        SOURCE,
        choices={"clamp_type": ("MINMAX", "RANGE")},
    ),
    Entry(
        "ShaderNodeRGBToBW",
        "rgb_to_bw",
        (Socket("Color", "COLOR", (0.5, 0.5, 0.5)),),
        (("Val", "FLOAT"),),
        SOURCE,
        estimate=lambda sockets: {"Val": sockets["Color"].luminance()},
    ),
    Entry(
        "ShaderNodeGamma",
        "gamma_color",
        (Socket("Color", "COLOR", (1.0, 1.0, 1.0)), Socket("Gamma", "FLOAT", 1.0)),
        (("Color", "COLOR"),),
        SOURCE,
        estimate=_average("Color"),
    ),
    Entry(
        "ShaderNodeBrightContrast",
        "bright_contrast",
        (Socket("Color", "COLOR", (1.0, 1.0, 1.0)), Socket("Bright", "FLOAT"), Socket("Contrast", "FLOAT")),
        (("Color", "COLOR"),),
        SOURCE,
        estimate=_average("Color"),
    ),
    Entry(
        "ShaderNodeValToRGB",
        "color_ramp_{color_ramp_interpolation}",
        (Socket("Fac", "FLOAT", 0.5), Rows("color_ramp", _stops)),
        (("Color", "COLOR"), ("Alpha", "FLOAT")),
        "material/color_ramp.glsl",
        choices={"color_ramp_interpolation": ("LINEAR", "EASE", "CONSTANT"), "color_ramp_mode": ("RGB",)},
    ),
    Entry(
        "ShaderNodeValToRGB",
        "color_ramp_linear",
        (Socket("Fac", "FLOAT", 0.5), Rows("color_ramp", _stops)),
        (("Color", "COLOR"), ("Alpha", "FLOAT")),
        "material/color_ramp.glsl",
        note="This interpolation of the colour ramp is drawn as linear RGB.",
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
