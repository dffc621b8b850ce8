"""Procedural textures: patterns that are computed from a coordinate, Generated unless another is linked."""

from __future__ import annotations

import numpy as np

from ..estimate import Estimate
from .entry import Choice, Entry, Setting, Socket, Used

NOISE = "material/noise.glsl"
VORONOI = "material/voronoi.glsl"
PATTERN = "material/pattern.glsl"

VECTOR = Socket("Vector", "VECTOR", implicit="@GENERATED")
W = Socket("W", "FLOAT")
SCALE = Socket("Scale", "FLOAT", 5.0)
WHITE = (1.0, 1.0, 1.0)
BLACK = (0.0, 0.0, 0.0)

NOISE_TYPES = ("FBM", "MULTIFRACTAL", "HYBRID_MULTIFRACTAL", "RIDGED_MULTIFRACTAL", "HETERO_TERRAIN")
METRICS = ("EUCLIDEAN", "MANHATTAN", "CHEBYCHEV", "MINKOWSKI")
GRADIENTS = ("LINEAR", "QUADRATIC", "EASING", "DIAGONAL", "SPHERICAL", "QUADRATIC_SPHERE", "RADIAL")

COLOR_AND_FAC = (("Color", "COLOR"), ("Fac", "FLOAT"))
FAC_AND_COLOR = (("Fac", "FLOAT"), ("Color", "COLOR"))


def _numbered(names: tuple[str, ...]) -> dict[object, int]:
    return {name: number for number, name in enumerate(names)}


def _switch(name: str, missing: bool = False) -> Choice:
    return Choice(name, {True: "true", False: "false"}, missing=str(missing).lower())


def _dimensions(name: str) -> Choice:
    return Choice(name, {f"{count}D": count for count in range(1, 5)}, missing=3)


def _within_unit(sockets: dict[str, Estimate]) -> dict[str, Estimate]:
    """A pattern between 0 and 1, on average half way."""
    return {"*": Estimate(np.zeros(3), np.full(3, 0.5), np.ones(3))}


def _between_colors(first: str, second: str):
    """A mosaic of two colours; its other output is a share."""

    def estimate(sockets: dict[str, Estimate]) -> dict[str, Estimate]:
        a, b = sockets[first], sockets[second]
        low, high = np.minimum(a.low, b.low), np.maximum(a.high, b.high)
        return {**_within_unit(sockets), "Color": Estimate(low, 0.5 * (a.mean + b.mean), high)}

    return estimate


VORONOI_COMMON = (
    SCALE,
    Socket("Detail", "FLOAT"),
    Socket("Roughness", "FLOAT", 0.5),
    Socket("Lacunarity", "FLOAT", 2.0),
)
RANDOMNESS = Socket("Randomness", "FLOAT", 1.0)
# How many dimensions, and by which hash: Blender 5.0 changed it.
VORONOI_SPACE = (_dimensions("voronoi_dimensions"), Choice("cell_hash", {"PCG": "true", "LOOKUP3": "false"}, "true"))

ENTRIES = (
    Entry(
        "ShaderNodeTexGabor",
        "texture_gabor_{gabor_type}",
        (
            VECTOR,
            SCALE,
            Socket("Frequency", "FLOAT", 2.0),
            Socket("Anisotropy", "FLOAT", 1.0),
            Socket("Orientation 2D", "FLOAT", 0.7853982),
            Socket("Orientation 3D", "VECTOR", (1.4142136, 1.4142136, 0.0)),
        ),
        (("Value", "FLOAT"), ("Phase", "FLOAT"), ("Intensity", "FLOAT")),
        "material/gabor.glsl",
        choices={"gabor_type": ("2D", "3D")},
        estimate=_within_unit,
    ),
    Entry(
        "ShaderNodeTexNoise",
        "noise_texture",
        (
            VECTOR,
            W,
            SCALE,
            Socket("Detail", "FLOAT", 2.0),
            Socket("Roughness", "FLOAT", 0.5),
            Socket("Lacunarity", "FLOAT", 2.0),
            Socket("Offset", "FLOAT"),
            Socket("Gain", "FLOAT", 1.0),
            Socket("Distortion", "FLOAT"),
            _dimensions("noise_dimensions"),
            Choice("noise_type", _numbered(NOISE_TYPES)),
            _switch("normalize", True),
            Used("Color"),
        ),
        FAC_AND_COLOR,
        NOISE,
    ),
    Entry(
        "ShaderNodeTexWhiteNoise",
        "white_noise_texture",
        (Socket("Vector", "VECTOR"), W, _dimensions("noise_dimensions")),
        (("Value", "FLOAT"), ("Color", "COLOR")),
        NOISE,
        estimate=_within_unit,
    ),
    Entry(
        "ShaderNodeTexWave",
        "wave_texture",
        (
            VECTOR,
            SCALE,
            Socket("Distortion", "FLOAT"),
            Socket("Detail", "FLOAT", 2.0),
            Socket("Detail Scale", "FLOAT", 1.0),
            Socket("Detail Roughness", "FLOAT", 0.5),
            Socket("Phase Offset", "FLOAT"),
            Choice("wave_type", _numbered(("BANDS", "RINGS"))),
            Choice("bands_direction", _numbered(("X", "Y", "Z", "DIAGONAL"))),
            Choice("rings_direction", _numbered(("X", "Y", "Z", "SPHERICAL"))),
            Choice("wave_profile", _numbered(("SIN", "SAW", "TRI"))),
        ),
        COLOR_AND_FAC,
        NOISE,
        estimate=_within_unit,
    ),
    Entry(
        "ShaderNodeTexVoronoi",
        "voronoi_edge_texture",
        (VECTOR, W, *VORONOI_COMMON, RANDOMNESS, *VORONOI_SPACE, _switch("normalize")),
        (("Distance", "FLOAT"),),
        VORONOI,
        when={"feature": "DISTANCE_TO_EDGE"},
    ),
    Entry(
        "ShaderNodeTexVoronoi",
        "voronoi_radius_texture",
        (VECTOR, W, SCALE, RANDOMNESS, *VORONOI_SPACE),
        (("Radius", "FLOAT"),),
        VORONOI,
        when={"feature": "N_SPHERE_RADIUS"},
    ),
    Entry(
        "ShaderNodeTexVoronoi",
        "voronoi_texture",
        (
            VECTOR,
            W,
            *VORONOI_COMMON,
            Socket("Smoothness", "FLOAT", 1.0),
            Socket("Exponent", "FLOAT", 0.5),
            RANDOMNESS,
            *VORONOI_SPACE,
            Choice("feature", _numbered(("F1", "F2", "SMOOTH_F1"))),
            Choice("distance", _numbered(METRICS)),
            _switch("normalize"),
        ),
        (("Distance", "FLOAT"), ("Color", "COLOR"), ("Position", "VECTOR"), ("W", "FLOAT")),
        VORONOI,
    ),
    Entry(
        "ShaderNodeTexChecker",
        "checker_texture",
        (VECTOR, Socket("Color1", "COLOR", WHITE), Socket("Color2", "COLOR", (0.2, 0.2, 0.2)), SCALE),
        COLOR_AND_FAC,
        PATTERN,
        estimate=_between_colors("Color1", "Color2"),
    ),
    Entry(
        "ShaderNodeTexBrick",
        "brick_texture",
        (
            VECTOR,
            Socket("Color1", "COLOR", (0.8, 0.8, 0.8)),
            Socket("Color2", "COLOR", (0.2, 0.2, 0.2)),
            Socket("Mortar", "COLOR", BLACK),
            SCALE,
            Socket("Mortar Size", "FLOAT", 0.02),
            Socket("Mortar Smooth", "FLOAT", 0.1),
            Socket("Bias", "FLOAT"),
            Socket("Brick Width", "FLOAT", 0.5),
            Socket("Row Height", "FLOAT", 0.25),
            Setting("offset", 0.5),
            Setting("offset_frequency", 2.0),
            Setting("squash", 1.0),
            Setting("squash_frequency", 2.0),
        ),
        COLOR_AND_FAC,
        PATTERN,
    ),
    Entry(
        "ShaderNodeTexGradient",
        "gradient_{gradient_type}",
        (VECTOR,),
        COLOR_AND_FAC,
        PATTERN,
        choices={"gradient_type": GRADIENTS},
        estimate=_within_unit,
    ),
    Entry(
        "ShaderNodeTexMagic",
        "magic_texture",
        (VECTOR, SCALE, Socket("Distortion", "FLOAT", 1.0), Choice("turbulence_depth", {n: n for n in range(11)}, 2)),
        COLOR_AND_FAC,
        PATTERN,
    ),
)
