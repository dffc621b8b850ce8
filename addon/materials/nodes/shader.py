"""Shader nodes: closures and the nodes that mix them.

Principled in Cycles' order, top layer first: alpha, sheen, coat, emission, metal, transmission, specular, diffuse.
Each layer takes weight * albedo and leaves weight * (1 - largest channel of its albedo) to the next; albedos come from
the tables of `materials/energy.py`.

Glass is two lobes: what it mirrors and what it lets through (Walter et al. 2007), which the technique of the
transmission slot follows. For light that asks a caster, and where that technique does not run, what passes goes
straight on with the amount and colour that Cycles lets through. Thin walls are drawn like that everywhere: what is
behind them is seen at its place, not blurred.

Sources: Cycles' Principled closure; Blender manual, "Principled BSDF" (4.5, 5.2).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..energy import pane_passing, thin_wall_passing
from ..estimate import Estimate, Interface, Summary, constant
from .entry import Approximation, Attribute, Choice, Entry, Expression, Socket
from .inputs import ROUND, STRAND, WAY

WHITE = (1.0, 1.0, 1.0)
GREY = (0.8, 0.8, 0.8)

DISTRIBUTION = Choice("distribution", {"GGX": 0, "MULTI_GGX": 1, "BECKMANN": 2, "ASHIKHMIN_SHIRLEY": 3}, missing=1)
BECKMANN_GLASS = (("distribution", ("BECKMANN",), "Glass of Beckmann's distribution of microfacets is drawn as GGX."),)
HUANG_SENTENCE = (
    "Principled Hair of Huang's model is drawn by Chiang's: brighter from front and back, darker from the side. "
    "With Chiang in the node Cycles shows the same."
)
HUANG_HAIR = (("model", ("HUANG",), HUANG_SENTENCE),)
NORMAL = Socket("Normal", "VECTOR", implicit="point.normal")
TANGENT = Socket("Tangent", "VECTOR", implicit="@RADIAL", only_with="Anisotropy")

# METHOD_* of shaders/subsurface/closure.glsl.
SUBSURFACE_METHODS = {"BURLEY": 0, "RANDOM_WALK": 1, "RANDOM_WALK_SKIN": 2, "RANDOM_WALK_LEGACY": 3}
# About the longest scale of the profile over the radius: by these the points of light below surfaces are spread.
SUBSURFACE_REACH = {"BURLEY": 0.24, "RANDOM_WALK": 3.0, "RANDOM_WALK_SKIN": 0.6, "RANDOM_WALK_LEGACY": 0.24}
THIN_FILM = (Socket("Thin Film Thickness", "FLOAT", layer=True), Socket("Thin Film IOR", "FLOAT", 1.33))

THIN = 0.5  # from where Thin Wall is on, as in shaders/material/shader.glsl

# Of red, green and blue: how far the index lies above that of yellow, in (ior - 1) / Abbe number.
DISPERSION = (-0.1139, 0.2207, 0.9154)


def _passing(sockets: dict[str, Estimate]) -> Estimate:
    """What a face of glass lets pass of light from lamps that goes straight on."""
    return constant(pane_passing(float(sockets["IOR"].mean[0]))[0])


def _colored(name: str):
    """The input's colour as it acts on light: never negative."""
    return lambda sockets: sockets[name].map(lambda value: value.clip(0.0))


def _diffuse(sockets: dict[str, Estimate]) -> Summary:
    return Summary(diffuse=True)


def _soft_diffuse(sockets: dict[str, Estimate]) -> Summary:
    return Summary(diffuse=True, soft=True)


def _soft_glossy(sockets: dict[str, Estimate]) -> Summary:
    return Summary(glossy=True, soft=True)


def _glossy(sockets: dict[str, Estimate]) -> Summary:
    return Summary(glossy=True)


def _emission(sockets: dict[str, Estimate]) -> Summary:
    return Summary(emission=sockets["Color"] * sockets["Strength"])


def _transparent(sockets: dict[str, Estimate]) -> Summary:
    color = _colored("Color")(sockets)
    return Summary(transparency=color, tinted=not color.grey)


def _glass(sockets: dict[str, Estimate]) -> Summary:
    color = _colored("Color")(sockets)
    return Summary(
        transparency=color * _passing(sockets), glossy=True, tinted=not color.grey,
        glass=_interface(sockets, color, mirrors_color=True),
    )  # fmt: skip


def _refraction(sockets: dict[str, Estimate]) -> Summary:
    color = _colored("Color")(sockets)
    return Summary(transparency=color, tinted=not color.grey, glass=_interface(sockets, color, fresnel=False))


def _interface(sockets: dict[str, Estimate], color: Estimate, share: float = 1.0, **kind) -> Interface:
    ior, roughness = (float(sockets[name].mean[0]) for name in ("IOR", "Roughness"))
    multiple = sockets.properties.get("distribution", "MULTI_GGX") == "MULTI_GGX"
    return Interface(tuple(color.mean), max(ior, 1e-5), min(max(roughness, 0.0), 1.0), share, multiple=multiple, **kind)


def _dispersed(sockets: dict[str, Estimate], glass: Interface) -> Interface:
    """One interface for each colour where glass has an Abbe number: `dispersed_index` of material/shader.glsl."""
    scale, abbe = (float(sockets[f"Transmission Dispersion {name}"].mean[0]) for name in ("Scale", "Abbe Number"))
    if not scale > 0.0:
        return glass
    found = None
    for channel, shift in enumerate(DISPERSION):
        color = tuple(value if k == channel else 0.0 for k, value in enumerate(glass.color))
        ior = max(glass.ior + (glass.ior - 1.0) * scale / max(abbe, 1e-3) * shift, 1e-5)
        found = replace(glass, color=color, ior=ior, mirrors_color=True).beside(found)
    return found


def _principled(sockets: dict[str, Estimate]) -> Summary:
    alpha = sockets["Alpha"].clipped()
    metallic = sockets["Metallic"].clipped()
    transmission = sockets["Transmission Weight"].clipped()
    thin = bool((sockets["Thin Wall"].high > THIN).any())
    transparency = alpha.complement()
    tinted, glass = False, None
    if transmission.high.any():
        through = alpha * metallic.complement() * transmission
        root = _colored("Base Color")(sockets).map(lambda value: value**0.5)
        tinted = not root.grey
        if (sockets["Thin Wall"].low > THIN).all():
            ior = max(float(sockets["IOR"].mean[0]), 1e-5)
            transparency += through * sockets["Base Color"].clipped().map(lambda base: thin_wall_passing(base, ior))
        else:
            transparency += through * root * _passing(sockets)
            glass = _dispersed(sockets, _interface(sockets, root, float(through.mean.mean())))
    emission = alpha * sockets["Emission Strength"]
    # Images are only looked at where they matter.
    if emission.high.any() or emission.low.any():
        emission *= sockets["Emission Color"]
    return Summary(
        transparency=transparency,
        emission=emission,
        diffuse=bool((metallic.low < 1.0).any() and (transmission.low < 1.0).any() and (alpha.high > 0.0).any()),
        glossy=bool((alpha.high > 0.0).any()),
        soft=any(
            bool((sockets[name].high > 0.0).any())
            for name in (("Sheen Weight", "Subsurface Weight") if thin else ("Sheen Weight",))
        ),
        tinted=tinted,
        glass=glass,
        scatter=0.0
        if thin or not (sockets["Subsurface Weight"].high > 0.0).any()
        else _reach(sockets, "Subsurface Radius", "Subsurface Scale", "subsurface_method"),
    )


def _reach(sockets: dict[str, Estimate], radius: str, scale: str, method: str) -> float:
    """About how far light spreads below the surface, m: the widest channel's longest scale."""
    widest = float(np.abs(sockets[radius].mean * sockets[scale].mean).max())
    reach = SUBSURFACE_REACH.get(sockets.properties.get(method, "RANDOM_WALK"), 0.2) * widest
    return reach if np.isfinite(reach) else 0.0


def _subsurface(sockets: dict[str, Estimate]) -> Summary:
    return Summary(diffuse=True, scatter=_reach(sockets, "Radius", "Scale", "falloff"))


PRINCIPLED = Entry(
    "ShaderNodeBsdfPrincipled",
    "shader_principled",
    (
        Socket("Base Color", "COLOR", GREY),
        Socket("Metallic", "FLOAT", layer=True),
        Socket("Roughness", "FLOAT", 0.5),
        Socket("IOR", "FLOAT", 1.5),
        Socket("Alpha", "FLOAT", 1.0),
        NORMAL,
        Socket("Diffuse Roughness", "FLOAT"),
        Socket("Specular IOR Level", "FLOAT", 0.5),
        Socket("Specular Tint", "COLOR", WHITE),
        Socket("Anisotropic", "FLOAT", layer=True),
        Socket("Anisotropic Rotation", "FLOAT"),
        Socket("Tangent", "VECTOR", implicit="@RADIAL", only_with="Anisotropic"),
        Socket("Transmission Weight", "FLOAT", layer=True),
        Socket("Transmission Dispersion Scale", "FLOAT", layer=True),
        Socket("Transmission Dispersion Abbe Number", "FLOAT", 20.0),
        Socket("Thin Wall", "FLOAT", layer=True),
        Socket("Subsurface Weight", "FLOAT", layer=True),
        Socket("Subsurface Radius", "VECTOR", (1.0, 0.2, 0.1)),
        Socket("Subsurface Scale", "FLOAT", 0.05),
        Socket("Subsurface IOR", "FLOAT", 1.4),
        Socket("Subsurface Anisotropy", "FLOAT"),
        Choice("subsurface_method", SUBSURFACE_METHODS, missing=1),
        Socket("Coat Weight", "FLOAT", layer=True),
        Socket("Coat Roughness", "FLOAT", 0.03),
        Socket("Coat IOR", "FLOAT", 1.5),
        Socket("Coat Tint", "COLOR", WHITE),
        Socket("Coat Normal", "VECTOR", implicit="vec3(0.0)"),
        Socket("Sheen Weight", "FLOAT", layer=True),
        Socket("Sheen Roughness", "FLOAT", 0.5),
        Socket("Sheen Tint", "COLOR", WHITE),
        Socket("Emission Color", "COLOR", WHITE),
        Socket("Emission Strength", "FLOAT", layer=True),
        DISTRIBUTION,
        *THIN_FILM,
    ),
    include="material/shader.glsl",
    approximations=(Approximation("Thin Wall", 0.0, "Light passes thin walls straight on, without roughness."),),
    summary=_principled,
)

SHEEN = (Socket("Color", "COLOR", GREY), Socket("Roughness", "FLOAT", 0.5), NORMAL)
TOON = (Socket("Color", "COLOR", GREY), Socket("Size", "FLOAT", 0.5), Socket("Smooth", "FLOAT"), NORMAL)
GLOSSY_SHAPE = (
    Socket("Roughness", "FLOAT", 0.5),
    Socket("Anisotropy", "FLOAT"),
    Socket("Rotation", "FLOAT"),
    NORMAL,
    TANGENT,
    DISTRIBUTION,
)

ENTRIES = (
    PRINCIPLED,
    Entry(
        "ShaderNodeBsdfDiffuse",
        "shader_diffuse",
        (Socket("Color", "COLOR", GREY), Socket("Roughness", "FLOAT"), NORMAL),
        include="material/shader.glsl",
        summary=_diffuse,
    ),
    Entry(
        "ShaderNodeBsdfAnisotropic",
        "shader_glossy",
        (Socket("Color", "COLOR", GREY), *GLOSSY_SHAPE),
        include="material/shader.glsl",
        summary=_glossy,
    ),
    Entry(
        "ShaderNodeBsdfMetallic",
        "shader_metallic",
        (Socket("Base Color", "COLOR", GREY), Socket("Edge Tint", "COLOR", WHITE), *GLOSSY_SHAPE, *THIN_FILM),
        include="material/shader.glsl",
        when={"fresnel_type": "F82"},
        summary=_glossy,
    ),
    Entry(
        "ShaderNodeBsdfMetallic",
        "shader_conductor",
        (Socket("IOR", "VECTOR", (2.757, 2.513, 2.231)), Socket("Extinction", "VECTOR", (3.867, 3.404, 3.009)))
        + GLOSSY_SHAPE
        + THIN_FILM,
        include="material/shader.glsl",
        note="The reflectance of the physical conductor is fitted by an F82 curve, unless it bears a thin film.",
        summary=_glossy,
    ),
    Entry(
        "ShaderNodeBsdfSheen",
        "shader_velvet",
        SHEEN,
        include="material/shader.glsl",
        when={"distribution": "ASHIKHMIN"},
        summary=_soft_glossy,
    ),
    Entry("ShaderNodeBsdfSheen", "shader_sheen", SHEEN, include="material/shader.glsl", summary=_soft_diffuse),
    Entry(
        "ShaderNodeBsdfTranslucent",
        "shader_translucent",
        (Socket("Color", "COLOR", GREY), NORMAL),
        include="material/shader.glsl",
        summary=_soft_diffuse,
    ),
    Entry(
        "ShaderNodeBsdfHairPrincipled",
        "shader_fibre",
        (
            Attribute("NAMED", name=STRAND),
            Attribute("NAMED", name=WAY),
            Attribute("NAMED", name=ROUND),
            Socket("Color", "COLOR", (0.017513, 0.005763, 0.002059)),
            Choice("parametrization", {"COLOR": 0, "MELANIN": 1, "ABSORPTION": 2}),
            Socket("Melanin", "FLOAT", 0.8),
            Socket("Melanin Redness", "FLOAT", 1.0),
            Socket("Tint", "COLOR", WHITE),
            Socket("Absorption Coefficient", "VECTOR", (0.245531, 0.52, 1.365)),
            Socket("Roughness", "FLOAT", 0.3),
            Socket("Radial Roughness", "FLOAT", 0.3),
            Socket("Coat", "FLOAT", 0.0),
            Socket("IOR", "FLOAT", 1.55),
            Socket("Offset", "FLOAT", 0.0349066),
            Socket("Random Color", "FLOAT"),
            Socket("Random Roughness", "FLOAT"),
            Socket("Random", "FLOAT", implicit="-1.0"),
            NORMAL,
        ),
        include="material/hair.glsl",
        setting_approximations=HUANG_HAIR,
        summary=_soft_diffuse,
    ),
    Entry(
        "ShaderNodeBsdfToon",
        "shader_toon",
        (*TOON, Expression("1.0")),
        include="material/shader.glsl",
        when={"component": "GLOSSY"},
        summary=_soft_glossy,
    ),
    Entry(
        "ShaderNodeBsdfToon",
        "shader_toon",
        (*TOON, Expression("0.0")),
        include="material/shader.glsl",
        summary=_soft_diffuse,
    ),
    Entry(
        "ShaderNodeEmission",
        "shader_emission",
        (Socket("Color", "COLOR", WHITE), Socket("Strength", "FLOAT", 1.0)),
        include="material/shader.glsl",
        summary=_emission,
    ),
    Entry(
        "ShaderNodeBackground",
        "shader_emission",
        (Socket("Color", "COLOR", GREY), Socket("Strength", "FLOAT", 1.0)),
        include="material/shader.glsl",
        summary=_emission,
    ),
    Entry(
        "ShaderNodeBsdfTransparent",
        "shader_transparent",
        (Socket("Color", "COLOR", WHITE),),
        include="material/shader.glsl",
        summary=_transparent,
    ),
    Entry("ShaderNodeHoldout", "shader_holdout", include="material/shader.glsl", summary=lambda sockets: Summary()),
    Entry("ShaderNodeMixShader", arguments=(Socket("Fac", "FLOAT", 0.5),), combine="MIX"),
    Entry("ShaderNodeAddShader", combine="ADD"),
    # Stand-ins: the nearest closure that can be drawn.
    Entry(
        "ShaderNodeBsdfGlass",
        "shader_glass",
        (
            Socket("Color", "COLOR", WHITE),
            Socket("Roughness", "FLOAT"),
            Socket("IOR", "FLOAT", 1.5),
            NORMAL,
            DISTRIBUTION,
            *THIN_FILM,
        ),
        include="material/shader.glsl",
        setting_approximations=BECKMANN_GLASS,
        summary=_glass,
    ),
    Entry(
        "ShaderNodeBsdfRefraction",
        "shader_refraction",
        (Socket("Color", "COLOR", WHITE), Socket("Roughness", "FLOAT"), Socket("IOR", "FLOAT", 1.45), NORMAL),
        include="material/shader.glsl",
        setting_approximations=BECKMANN_GLASS,
        summary=_refraction,
    ),
    Entry(
        "ShaderNodeBsdfRayPortal",
        "shader_transparent",
        (Socket("Color", "COLOR", WHITE),),
        include="material/shader.glsl",
        note="Ray Portal BSDF lets rays pass straight on instead of leaving elsewhere.",
        summary=_transparent,
    ),
    *(
        Entry(
            f"ShaderNode{name}",
            "shader_inside",
            include="material/shader.glsl",
            note="Drawn as a volume; in the place of a surface it is left out.",
            summary=lambda sockets: Summary(),
        )
        for name in ("VolumeAbsorption", "VolumeScatter", "VolumePrincipled", "VolumeCoefficients")
    ),
    Entry(
        "ShaderNodeSubsurfaceScattering",
        "shader_subsurface",
        (
            Socket("Color", "COLOR", GREY),
            Socket("Scale", "FLOAT", 0.05),
            Socket("Radius", "VECTOR", (1.0, 0.2, 0.1)),
            Socket("IOR", "FLOAT", 1.4),
            Socket("Roughness", "FLOAT", 1.0),
            Socket("Anisotropy", "FLOAT"),
            NORMAL,
            Choice("falloff", SUBSURFACE_METHODS, missing=1),
        ),
        include="material/shader.glsl",
        summary=_subsurface,
    ),
    # Painted translucency: not a node of Blender's, see materials/translucency.py.
    Entry(
        "CandelaTranslucency",
        "shader_translucency_maps",
        (Socket("Blur", "FLOAT", 0.5), Socket("Tint", "COLOR", WHITE), Socket("Translucency", "FLOAT", 1.0)),
        include="material/shader.glsl",
        summary=lambda sockets: Summary(),
    ),
)

# What any other shader node is drawn as: diffuse of its own colour, or grey where it has none.
UNKNOWN_SHADER = Entry(
    "",
    "shader_diffuse",
    (Socket("Color", "COLOR", GREY), Expression("0.0"), NORMAL),
    include="material/shader.glsl",
    summary=_diffuse,
)

# A colour or number that is plugged in where a shader belongs glows in that colour.
IMPLICIT_EMISSION = Entry(
    "",
    "shader_emission",
    (Socket("Color", "COLOR"), Socket("Strength", "FLOAT", 1.0)),
    include="material/shader.glsl",
    summary=_emission,
)
