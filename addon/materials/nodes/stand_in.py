"""Stand-ins: nodes that ask more than a surface point can answer give a stated value, and the artist is told.

A node that only makes sense on hair, points or volumes gives what it gives on a mesh in Cycles; that needs no sentence.
"""

from __future__ import annotations

from .entry import Entry, Socket

SOURCE = "material/stand_in.glsl"
NORMAL = Socket("Normal", "VECTOR", implicit="point.normal")


def _floats(*names: str) -> tuple[tuple[str, str], ...]:
    return tuple((name, "FLOAT") for name in names)


ENTRIES = (
    Entry(
        "ShaderNodeBevel",
        "unbent_normal",
        (NORMAL,),
        (("Normal", "VECTOR"),),
        SOURCE,
        note="Edges are not rounded; the node hands on the surface's normal.",
    ),
    Entry(
        "ShaderNodeAmbientOcclusion",
        "open_occlusion",
        (Socket("Color", "COLOR", (1.0, 1.0, 1.0)),),
        (("Color", "COLOR"), ("AO", "FLOAT")),
        SOURCE,
        note="Occlusion is not measured; the node says that nothing is near.",
    ),
    Entry(
        "ShaderNodeRaycast",
        "no_hit",
        (Socket("Length", "FLOAT", 1.0),),
        (*_floats("Is Hit", "Self Hit", "Hit Distance"), ("Hit Position", "VECTOR"), ("Hit Normal", "VECTOR")),
        SOURCE,
        note="Rays are not cast from materials; the node says that nothing is hit.",
    ),
    Entry(
        "ShaderNodeParticleInfo",
        "no_particle",
        outputs=(
            *_floats("Index", "Random", "Age", "Lifetime"),
            ("Location", "VECTOR"),
            ("Size", "FLOAT"),
            ("Velocity", "VECTOR"),
            ("Angular Velocity", "VECTOR"),
        ),
        include=SOURCE,
        note="Particles are not told apart; all outputs are 0. Object Info gives a random number per instance.",
    ),
    Entry(
        "ShaderNodeAttribute",
        "absent_attribute",
        outputs=(("Color", "COLOR"), ("Vector", "VECTOR"), ("Fac", "FLOAT"), ("Alpha", "FLOAT")),
        include=SOURCE,
        note="Attributes of objects and instancers are read by materials' surfaces alone; all outputs are 0.",
    ),
    Entry(
        "ShaderNodeVolumeInfo",
        "no_volume",
        outputs=(("Color", "COLOR"), *_floats("Density", "Flame", "Temperature")),
        include=SOURCE,
    ),
)
