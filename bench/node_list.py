"""The settings in which every node is compared with Cycles: data for `node_cases.compare`."""

from __future__ import annotations

from itertools import product

from addon.materials.nodes.color import BLEND_MODES
from addon.materials.nodes.converter import COLOR_MODELS, MATH_OPERATIONS, RANGES, VECTOR_OPERATIONS
from addon.materials.nodes.texture import GRADIENTS, METRICS, NOISE_TYPES

from .node_cases import CELLS, Case

DIMENSIONS = ("1D", "2D", "3D", "4D")
RED, GREEN, BLUE = (0.7, 0.3, 0.6, 1.0), (0.2, 0.6, 0.9, 1.0), (0.1, 0.2, 0.8, 1.0)
STOPS = ((0.1, (0.9, 0.2, 0.1, 1.0)), (0.6, (0.1, 0.5, 0.8, 0.3)), (0.8, (0.8, 0.8, 0.1, 0.9)))
BENT = ((0.0, 0.1), (0.4, 0.7), (1.0, 0.9))


def _across(dimensions: str) -> str:
    """The socket that takes the coordinate of a texture of so many dimensions."""
    return "W" if dimensions == "1D" else "Vector"


def _noise() -> list[Case]:
    values = {"Scale": 4.0, "Detail": 2.5, "Roughness": 0.6, "Lacunarity": 2.1, "Offset": 0.3, "Gain": 1.5, "W": 1.3}
    cases = []
    for dimensions, kind in product(DIMENSIONS, NOISE_TYPES):
        settings = {"noise_dimensions": dimensions, "noise_type": kind}
        cases.append(
            Case(f"Noise {dimensions} {kind.lower()}", "TexNoise", "Fac", settings, values, "Object",
                 _across(dimensions), procedural=True)
        )  # fmt: skip
    for dimensions in DIMENSIONS:
        settings = {"noise_dimensions": dimensions, "normalize": dimensions != "2D"}
        warped = {**values, "Distortion": 0.7}
        cases.append(
            Case(f"Noise {dimensions} colour, distorted", "TexNoise", "Color", settings, warped, "Object",
                 _across(dimensions), procedural=True)
        )  # fmt: skip
        for output in ("Value", "Color"):
            settings = {"noise_dimensions": dimensions}
            cases.append(
                Case(f"White Noise {dimensions} {output.lower()}", "TexWhiteNoise", output, settings, {"W": 1.3},
                     CELLS, _across(dimensions), procedural=True)
            )  # fmt: skip
    return cases


def _voronoi() -> list[Case]:
    values = {"Scale": 4.0, "W": 1.3, "Randomness": 0.9, "Smoothness": 0.7, "Exponent": 0.7}
    shown = (
        *(("F1", output) for output in ("Distance", "Color", "Position")),
        *(("F2", output) for output in ("Distance", "Color")),
        *(("SMOOTH_F1", output) for output in ("Distance", "Color")),
        *(("DISTANCE_TO_EDGE", "Distance"), ("N_SPHERE_RADIUS", "Radius")),
    )
    cases = []
    for dimensions, (feature, output) in product(DIMENSIONS, shown):
        output = "W" if (dimensions, output) == ("1D", "Position") else output
        settings = {"voronoi_dimensions": dimensions, "feature": feature}
        cases.append(
            Case(f"Voronoi {dimensions} {feature.lower()} {output.lower()}", "TexVoronoi", output, settings, values,
                 "Object", _across(dimensions), signed=output in ("Position", "W"), procedural=True)
        )  # fmt: skip
    for feature, normalized in product(("F1", "F2", "DISTANCE_TO_EDGE"), (False, True)):
        settings = {"feature": feature, "normalize": normalized}
        octaves = {**values, "Detail": 2.5, "Roughness": 0.6}
        name = f"Voronoi {feature.lower()} octaves{', normalised' if normalized else ''}"
        cases.append(Case(name, "TexVoronoi", "Distance", settings, octaves, "Object", procedural=True))
    for metric in METRICS[1:]:
        settings = {"distance": metric, "normalize": True, "feature": "F2"}
        cases.append(
            Case(f"Voronoi {metric.lower()}", "TexVoronoi", "Distance", settings, values, "Object", procedural=True)
        )
    return cases


def _patterns() -> list[Case]:
    cases = []
    for kind, profile in product(("BANDS", "RINGS"), ("SIN", "SAW", "TRI")):
        settings = {"wave_type": kind, "wave_profile": profile, "bands_direction": "DIAGONAL"}
        settings["rings_direction"] = "SPHERICAL"
        values = {"Scale": 0.7, "Distortion": 2.0, "Detail": 1.5, "Phase Offset": 0.4}
        name = f"Wave {kind.lower()} {profile.lower()}"
        cases.append(Case(name, "TexWave", "Color", settings, values, "Object", procedural=True))
    for kind, isotropic in product(("2D", "3D"), (False, True)):
        values = {"Scale": 3.0, "Frequency": 1.7, "Anisotropy": 0.3 if isotropic else 1.0}
        name = f"Gabor {kind}{' turned at random' if isotropic else ''}"
        cases += [
            Case(
                f"{name} {output.lower()}", "TexGabor", output, {"gabor_type": kind}, values, "Object", procedural=True
            )
            for output in ("Value", "Phase", "Intensity")
        ]
    for direction in "XYZ":
        settings = {"wave_type": "RINGS", "bands_direction": direction, "rings_direction": direction}
        cases.append(Case(f"Wave rings {direction}", "TexWave", "Fac", settings, {"Scale": 0.7}, "Object", sphere=True))
        settings = {**settings, "wave_type": "BANDS"}
        cases.append(Case(f"Wave bands {direction}", "TexWave", "Fac", settings, {"Scale": 0.7}, "Object", sphere=True))
    colors = {"Color1": RED, "Color2": GREEN, "Scale": 4.3}
    # Narrower slopes than these move by the rasteriser's subpixel grid, which is a 256th of a pixel.
    brick = {**colors, "Mortar": BLUE, "Mortar Size": 0.08, "Mortar Smooth": 1.0, "Bias": 0.1}
    cases += [
        *(Case(f"Checker {output.lower()}", "TexChecker", output, {}, colors, "Object") for output in ("Color", "Fac")),
        *(Case(f"Brick {output.lower()}", "TexBrick", output, {}, brick, "Object") for output in ("Color", "Fac")),
        Case("Brick squashed", "TexBrick", "Color", {"squash": 0.7, "offset": 0.3, "squash_frequency": 3,
                                                     "offset_frequency": 3}, brick, "Object"),
        *(Case(f"Magic depth {depth}", "TexMagic", "Color", {"turbulence_depth": depth},
               {"Scale": 3.0, "Distortion": 0.8}, "Object") for depth in (0, 1, 2, 5, 10)),
        Case("Magic fac", "TexMagic", "Fac", {}, {"Scale": 4.3}, "Object"),
        *(Case(f"Gradient {kind.lower()}", "TexGradient", "Color", {"gradient_type": kind}, {}, "Object")
          for kind in GRADIENTS),
        Case("Gradient generated", "TexGradient", "Fac", {}, {}, sphere=True),
    ]  # fmt: skip
    return cases


def _images() -> list[Case]:
    cases = []
    for projection in ("FLAT", "BOX", "SPHERE", "TUBE"):
        settings = {"image": "Picture", "projection": projection, "projection_blend": 0.3}
        cases.append(
            Case(f"Image {projection.lower()}", "TexImage", "Color", settings, {}, "Generated", sphere=True,
                 procedural=True)
        )  # fmt: skip
    for interpolation in ("Linear", "Closest", "Cubic", "Smart"):
        settings = {"image": "Picture", "interpolation": interpolation}
        cases.append(Case(f"Image {interpolation.lower()}", "TexImage", "Color", settings, procedural=True))
    for projection in ("EQUIRECTANGULAR", "MIRROR_BALL"):
        settings = {"image": "Picture", "projection": projection}
        cases.append(
            Case(f"Environment {projection.lower()}", "TexEnvironment", "Color", settings, {}, "Normal", sphere=True,
                 procedural=True)
        )  # fmt: skip
    sun = (0.3, 0.5, 0.7)
    for kind, settings, since in (
        ("Preetham", {"sky_type": "PREETHAM", "sun_direction": sun, "turbidity": 3.0}, (4, 5)),
        ("multiple scattering", {"sky_type": "MULTIPLE_SCATTERING", "sun_disc": False, "sun_rotation": 0.7}, (5, 0)),
    ):
        cases.append(
            Case(f"Sky {kind}", "TexSky", "Color", settings, {}, "Normal", sphere=True, scale=0.1, procedural=True,
                 since=since)
        )  # fmt: skip
    cases.append(Case("Image alpha", "TexImage", "Alpha", {"image": "Picture"}, procedural=True))
    return cases


def _inputs() -> list[Case]:
    def shown(node: str, outputs, settings=None, values=None, name="") -> list[Case]:
        label = name or node
        return [
            Case(f"{label} {output.lower()}", node, output, settings or {}, values or {}, signed=True, sphere=True,
                 scale=0.03 if output in far else 1.0)
            for output in outputs
        ]  # fmt: skip

    far = ("Position", "Location", "Camera")  # places in a scene that is some twenty metres wide

    coordinates = ("Generated", "Normal", "UV", "Object", "Camera", "Window", "Reflection")
    layers = ("Color", "Vector", "Fac", "Alpha")
    return [
        *shown("TexCoord", coordinates, name="Texture Coordinate"),
        *(Case(f"Radial Tiling {sides} {output.lower()}{', normalised' * normalize}", "RadialTiling", output,
               {"normalize": normalize}, {"Sides": float(sides)}, "Object", "Vector", procedural=True, since=(5, 2))
          for sides in (3, 6) for normalize in (False, True)
          for output in ("Segment Coordinates", "Segment ID", "Segment Width", "Segment Rotation")),
        *shown("TexCoord", ("Object",), {"object": "Guide"}, name="Texture Coordinate of another object:"),
        *shown("TexCoord", ("Generated", "UV"), {"from_instancer": True}, name="Texture Coordinate of the instancer:"),
        *shown("UVMap", ("UV",), {"uv_map": "UVMap"}, name="UV Map"),
        *shown(
            "NewGeometry",
            (
                *("Position", "Normal", "Tangent", "True Normal", "Incoming", "Backfacing"),
                *("Pointiness", "Random Per Island"),
            ),
            name="Geometry",
        ),
        *shown(
            "ObjectInfo",
            ("Location", "Color", "Alpha", "Object Index", "Material Index", "Random"),
            name="Object Info",
        ),
        *shown("CameraData", ("View Vector",), name="Camera Data"),
        *(Case(f"Camera Data {name.lower()}", "CameraData", name, scale=0.05, sphere=True)
          for name in ("View Z Depth", "View Distance")),
        *shown("LightPath", ("Is Camera Ray", "Is Shadow Ray", "Is Diffuse Ray", "Ray Depth"), name="Light Path"),
        *(case for layer in ("Paint", "Number", "UVMap", "absent")
          for case in shown("Attribute", layers, {"attribute_name": layer}, name=f"Attribute {layer}")),
        *shown("VertexColor", ("Color", "Alpha"), {"layer_name": "Paint"}, name="Color Attribute"),
        *shown("Fresnel", ("Fac",), {}, {"IOR": 1.6}),
        *shown("Fresnel", ("Fac",), {}, {"IOR": 0.7}, name="Fresnel below 1"),
        *(case for blend in (0.2, 0.5, 0.8)
          for case in shown("LayerWeight", ("Fresnel", "Facing"), {}, {"Blend": blend}, f"Layer Weight {blend}")),
        *(case for axis in "XYZ" for case in shown("Tangent", ("Tangent",), {"axis": axis}, name=f"Tangent {axis}")),
        *shown("Tangent", ("Tangent",), {"direction_type": "UV_MAP"}, name="Tangent UV"),
        *shown("HairInfo", ("Is Strand",), name="Hair Info"),
        Case("Wireframe", "Wireframe", "Fac", {}, {"Size": 0.1}, procedural=True),
        Case("Wireframe in pixels", "Wireframe", "Fac", {"use_pixel_size": True}, {"Size": 2.0}, procedural=True),
        Case("Value", "Value", "Value"),
        Case("RGB", "RGB", "Color"),
    ]  # fmt: skip


def _vectors() -> list[Case]:
    cases = []
    for space in ("TANGENT", "OBJECT", "WORLD", "BLENDER_OBJECT", "BLENDER_WORLD"):
        values = {"Strength": 0.7, "Color": (0.7, 0.4, 0.9, 1.0)}
        name = f"Normal Map {space.lower()}"
        cases.append(Case(name, "NormalMap", "Normal", {"space": space}, values, sphere=True, signed=True))
    settings = {"space": "TANGENT", "convention": "DIRECTX"}
    cases.append(
        Case("Normal Map directx", "NormalMap", "Normal", settings, {"Color": (0.7, 0.3, 0.9, 1.0)}, sphere=True,
             signed=True, since=(5, 1))
    )  # fmt: skip
    for coordinate, sphere in product(("Object", "UV", "Generated"), (False, True)):
        cases.append(
            Case(f"Bump {coordinate.lower()}{' sphere' if sphere else ''}", "TexNoise", "Fac", {}, {"Scale": 4.0},
                 coordinate, procedural=True, sphere=sphere, through="Bump")
        )  # fmt: skip
    cases.append(Case("Bump camera", "TexNoise", "Fac", {}, {"Scale": 4.0}, "Camera", procedural=True, through="Bump"))
    for sphere in (False, True):
        cases.append(
            Case(f"Displacement{' sphere' if sphere else ''}", "TexNoise", "Fac", {}, {"Scale": 4.0}, "Object",
                 procedural=True, sphere=sphere, through="Displacement")
        )  # fmt: skip
    for kind in ("POINT", "TEXTURE", "VECTOR", "NORMAL"):
        values = {"Location": (0.1, 0.2, 0.3), "Rotation": (0.3, 0.5, 0.7), "Scale": (1.5, 0.8, 2.0)}
        name = f"Mapping {kind.lower()}"
        cases.append(Case(name, "Mapping", "Vector", {"vector_type": kind}, values, "Object", signed=True, sphere=True))
    spaces = ("WORLD", "OBJECT", "CAMERA")
    for kind, start, end in product(("POINT", "VECTOR", "NORMAL"), spaces, spaces):
        if start == end:
            continue
        settings = {"vector_type": kind, "convert_from": start, "convert_to": end}
        name = f"Vector Transform {kind.lower()} {start.lower()} to {end.lower()}"
        cases.append(
            Case(name, "VectorTransform", "Vector", settings, {}, "Object", signed=True, sphere=True, scale=0.1)
        )
    for kind, invert in product(("AXIS_ANGLE", "X_AXIS", "Y_AXIS", "Z_AXIS", "EULER_XYZ"), (False, True)):
        values = {"Center": (0.1, 0.2, 0.3), "Axis": (0.3, 0.5, 0.7), "Angle": 0.8, "Rotation": (0.3, 0.5, 0.7)}
        settings = {"rotation_type": kind, "invert": invert}
        name = f"Vector Rotate {kind.lower()}{', inverted' if invert else ''}"
        cases.append(Case(name, "VectorRotate", "Vector", settings, values, "Object", signed=True, sphere=True))
    for output in ("Normal", "Dot"):
        settings = {"direction": (0.3, 0.5, 0.8)}
        cases.append(
            Case(
                f"Normal {output.lower()}", "Normal", output, settings, {}, "Normal", "Normal", signed=True, sphere=True
            )
        )
    return cases


def _math() -> list[Case]:
    cases = []
    for operation in MATH_OPERATIONS:
        values = {"Value_001": 0.41, "Value_002": 0.2}
        cases.append(
            Case(f"Math {operation.lower()}", "Math", "Value", {"operation": operation}, values, "Object", "Value",
                 signed=True)
        )  # fmt: skip
    for operation in VECTOR_OPERATIONS:
        values = {"Vector_001": (0.7, 0.3, 0.45), "Vector_002": (0.1, -0.3, 0.2), "Scale": 0.8}
        cases.append(
            Case(f"Vector Math {operation.lower()}", "VectorMath", "Vector", {"operation": operation}, values,
                 CELLS if operation == "ROUND" else "Object",  # no pixel may stand where the value jumps
                 signed=True, sphere=True, since=(5, 0) if operation == "ROUND" else (4, 5))
        )  # fmt: skip
    for operation in ("DOT_PRODUCT", "DISTANCE", "LENGTH"):
        values = {"Vector_001": (0.7, 0.3, 0.45)}
        name = f"Vector Math {operation.lower()}"
        cases.append(
            Case(name, "VectorMath", "Value", {"operation": operation}, values, "Object", signed=True, sphere=True)
        )
    for interpolation, bounded in product(RANGES, (False, True)):
        settings = {"interpolation_type": interpolation, "clamp": bounded}
        values = {"From Min": 0.2, "From Max": -0.3, "To Min": 0.1, "To Max": 0.8, "Steps": 3.0}
        name = f"Map Range {interpolation.lower()}{', clamped' if bounded else ''}"
        cases.append(Case(name, "MapRange", "Result", settings, values, "Object", "Value", signed=True))
        settings = {**settings, "data_type": "FLOAT_VECTOR"}
        values = {"From_Min_FLOAT3": (-0.2, 0.3, 0.0), "From_Max_FLOAT3": (0.4, -0.1, 0.0),
                  "To_Max_FLOAT3": (0.8, 0.5, 1.0), "Steps_FLOAT3": (3.0, 2.0, 4.0)}  # fmt: skip
        cases.append(
            Case(name.replace("Range", "Range vector"), "MapRange", "Vector", settings, values, "Object", signed=True)
        )
    for kind in ("MINMAX", "RANGE"):
        values = {"Min": 0.3, "Max": -0.2}
        name = f"Clamp {kind.lower()}"
        cases.append(Case(name, "Clamp", "Result", {"clamp_type": kind}, values, "Object", "Value", signed=True))
    for factor in (False, True):
        settings = {"data_type": "FLOAT", "clamp_factor": factor}
        values = {"Factor_Float": 1.3, "B_Float": 0.7}
        cases.append(Case(f"Mix float{', clamped' if factor else ''}", "Mix", "Result_Float", settings, values))
        settings = {"data_type": "VECTOR", "clamp_factor": factor}
        values = {"Factor_Float": 1.3, "B_Vector": (0.7, 0.2, 0.4)}
        cases.append(Case(f"Mix vector{', clamped' if factor else ''}", "Mix", "Result_Vector", settings, values))
    settings = {"data_type": "VECTOR", "factor_mode": "NON_UNIFORM"}
    values = {"Factor_Vector": (0.3, 0.6, 0.9), "B_Vector": (0.7, 0.2, 0.4)}
    cases.append(Case("Mix vector, channel by channel", "Mix", "Result_Vector", settings, values))
    values = {"X": 0.2, "Y": 0.4, "Z": 0.6}
    cases.append(Case("Combine XYZ", "CombineXYZ", "Vector", {}, values))
    cases += [Case(f"Separate XYZ {axis}", "SeparateXYZ", axis, {}, {}, "Object", signed=True) for axis in "XYZ"]
    return cases


def _colors() -> list[Case]:
    cases = []
    for mode in BLEND_MODES:
        settings = {"data_type": "RGBA", "blend_type": mode}
        values = {"Factor_Float": 0.6, "B_Color": GREEN}
        cases.append(Case(f"Mix {mode.lower()}", "Mix", "Result_Color", settings, values, "UV", "A_Color"))
    for interpolation in ("LINEAR", "EASE", "CONSTANT", "CARDINAL", "B_SPLINE"):
        settings = {"stops": STOPS, "ramp_interpolation": interpolation}
        cases.append(
            Case(f"Color Ramp {interpolation.lower()}", "ValToRGB", "Color", settings, {}, "UV", "Fac",
                 procedural=True)
        )  # fmt: skip
    for mode, hue in product(("HSV", "HSL"), ("NEAR", "FAR", "CW", "CCW")):
        settings = {"stops": STOPS, "color_mode": mode, "hue_interpolation": hue}
        cases.append(
            Case(f"Color Ramp {mode} {hue.lower()}", "ValToRGB", "Color", settings, {}, "UV", "Fac", procedural=True)
        )
    cases.append(Case("Color Ramp alpha", "ValToRGB", "Alpha", {"stops": STOPS}, {}, "UV", "Fac", procedural=True))
    cases += [
        Case("Float Curve", "FloatCurve", "Value", {"curves": {0: BENT}}, {}, "UV", "Value"),
        Case("RGB Curves", "RGBCurve", "Color", {"curves": {0: BENT, 2: BENT, 3: ((0.0, 0.0), (0.6, 0.4), (1.0, 1.0))}},
             {}, "UV", "Color"),
        Case("Vector Curves", "VectorCurve", "Vector", {"curves": {0: ((-1.0, -0.6), (0.2, 0.5), (1.0, 0.8))}}, {},
             "Object", signed=True, sphere=True),
        Case("Hue/Saturation", "HueSaturation", "Color", {}, {"Hue": 0.7, "Saturation": 1.2, "Value": 0.9, "Fac": 0.8},
             "UV", "Color"),
        Case("Invert", "Invert", "Color", {}, {"Fac": 0.7}, "UV", "Color"),
        Case("Gamma", "Gamma", "Color", {}, {"Gamma": 1.7}, "UV", "Color"),
        Case("Bright/Contrast", "BrightContrast", "Color", {}, {"Bright": 0.1, "Contrast": 0.4}, "UV", "Color"),
        Case("RGB to BW", "RGBToBW", "Val", {}, {}, "UV", "Color"),
        *(Case(f"Blackbody {kelvin} K", "Blackbody", "Color", {}, {"Temperature": float(kelvin)}, scale=0.3)
          for kelvin in (500, 900, 1500, 2800, 4000, 6500, 9000, 20000)),
        *(Case(f"Wavelength {nanometres} nm", "Wavelength", "Color", {}, {"Wavelength": float(nanometres)})
          for nanometres in (370, 412, 467, 503, 551, 588, 633, 701, 790)),
    ]  # fmt: skip
    for model in COLOR_MODELS:
        values = {"Red": 0.6, "Green": 0.5, "Blue": 0.4}
        cases.append(Case(f"Combine Color {model}", "CombineColor", "Color", {"mode": model}, values))
        cases += [
            Case(f"Separate Color {model} {channel}", "SeparateColor", channel, {"mode": model}, {"Color": RED})
            for channel in ("Red", "Green", "Blue")
        ]
    return cases


CASES: tuple[Case, ...] = (
    *_noise(), *_voronoi(), *_patterns(), *_images(), *_inputs(), *_vectors(), *_math(), *_colors(),
)  # fmt: skip
