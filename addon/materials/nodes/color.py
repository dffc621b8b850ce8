"""Nodes that mix and change colours, and that make them out of numbers."""

from __future__ import annotations

from ..estimate import average, between
from ..spectra import BLACKBODY, WAVELENGTH, Spectrum
from .entry import Choice, Entry, Expression, Rows, Setting, Socket

SOURCE = "material/converter.glsl"
TABLES = "material/curves.glsl"

BLEND_MODES = (
    *("MIX", "DARKEN", "MULTIPLY", "BURN", "LIGHTEN", "SCREEN", "DODGE", "ADD", "OVERLAY", "SOFT_LIGHT"),
    *("LINEAR_LIGHT", "DIFFERENCE", "EXCLUSION", "SUBTRACT", "DIVIDE", "HUE", "SATURATION", "COLOR", "VALUE"),
)


def _mix(node_type: str, factor: str, a: str, b: str, output: str, clamp_factor: str, clamp_result: str, when: dict):
    """Blend of two colours; plain mixing has bounds, other modes do not."""
    arguments = (
        Socket(factor, "FLOAT", 0.5, clamp=clamp_factor),
        Socket(a, "COLOR", (0.5, 0.5, 0.5)),
        Socket(b, "COLOR", (0.5, 0.5, 0.5)),
    )
    outputs = ((output, "COLOR"),)
    bounds = between(factor, a, b, output)
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
            estimate=average(a, b),
        ),
    )


def _stops(stops) -> list[tuple[float, float, float, float]]:
    """Two rows per stop of a colour ramp: its colour, then its position."""
    stops = stops or ((0.0, 0.0, 0.0, 0.0, 1.0), (1.0, 1.0, 1.0, 1.0, 1.0))
    return [row for position, *color in stops for row in (tuple(color), (position, 0.0, 0.0, 0.0))]


def _table(rows) -> list[tuple[float, float, float, float]]:
    """Rows of a table as the reader made it; without one, the identity."""
    return list(rows or ((0.0, 0.0, 0.0, 0.0), (1.0, 1.0, 1.0, 1.0)))


CURVE_TABLE = (
    Setting("mapping_start"),
    Setting("mapping_extent", 1.0),
    Choice("mapping_onwards", {True: "true", False: "false"}, missing="false"),
    Rows("mapping_table", _table),
)


def _spectrum(spectrum: Spectrum) -> tuple:
    """Arguments that hand a spectrum's table to the shader: start, extent, rows."""
    bounds = (Expression(repr(spectrum.start)), Expression(repr(spectrum.extent)))
    return (*bounds, Rows("", lambda _: spectrum.rows()))


ENTRIES = (
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
        "ShaderNodeInvert",
        "invert",
        (Socket("Fac", "FLOAT", 1.0), Socket("Color", "COLOR")),
        (("Color", "COLOR"),),
        SOURCE,
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
        estimate=average("Color"),
    ),
    Entry(
        "ShaderNodeBrightContrast",
        "bright_contrast",
        (Socket("Color", "COLOR", (1.0, 1.0, 1.0)), Socket("Bright", "FLOAT"), Socket("Contrast", "FLOAT")),
        (("Color", "COLOR"),),
        SOURCE,
        estimate=average("Color"),
    ),
    Entry(
        "ShaderNodeHueSaturation",
        "hue_saturation",
        (
            Socket("Hue", "FLOAT", 0.5),
            Socket("Saturation", "FLOAT", 1.0),
            Socket("Value", "FLOAT", 1.0),
            Socket("Fac", "FLOAT", 1.0),
            Socket("Color", "COLOR", (0.8, 0.8, 0.8)),
        ),
        (("Color", "COLOR"),),
        SOURCE,
        estimate=average("Color"),
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
        "color_ramp_table",
        (Socket("Fac", "FLOAT", 0.5), Rows("color_ramp_table", _table)),
        (("Color", "COLOR"), ("Alpha", "FLOAT")),
        TABLES,
    ),
    Entry(
        "ShaderNodeFloatCurve",
        "float_curve",
        (Socket("Factor", "FLOAT", 1.0), Socket("Value", "FLOAT", 1.0), *CURVE_TABLE),
        (("Value", "FLOAT"),),
        TABLES,
    ),
    Entry(
        "ShaderNodeVectorCurve",
        "vector_curves",
        (Socket("Fac", "FLOAT", 1.0), Socket("Vector", "VECTOR"), *CURVE_TABLE),
        (("Vector", "VECTOR"),),
        TABLES,
    ),
    Entry(
        "ShaderNodeRGBCurve",
        "vector_curves",
        (Socket("Fac", "FLOAT", 1.0), Socket("Color", "COLOR"), *CURVE_TABLE),
        (("Color", "COLOR"),),
        TABLES,
        estimate=average("Color"),
    ),
    Entry(
        "ShaderNodeBlackbody",
        "blackbody_table",
        (Socket("Temperature", "FLOAT", 1500.0), *_spectrum(BLACKBODY)),
        (("Color", "COLOR"),),
        TABLES,
    ),
    Entry(
        "ShaderNodeWavelength",
        "wavelength_table",
        (Socket("Wavelength", "FLOAT", 500.0), *_spectrum(WAVELENGTH)),
        (("Color", "COLOR"),),
        TABLES,
    ),
)
