"""Textures. Image lookups filter by texelFetch (material/image.glsl); the compiler generates each image's own function.

Linear and closest interpolation, all four extensions, alpha and colour as Cycles treats them: colour is premultiplied
before interpolation, stays so unless the Alpha output is used, and is decoded from sRGB after interpolation.
"""

from __future__ import annotations

from .entry import Choice, Entry, ImageFlags, Socket, Used

ENTRIES = (
    Entry(
        "ShaderNodeTexImage",
        "material_image{image}_sample",
        (
            Socket("Vector", "VECTOR", implicit="@UV"),
            Choice("interpolation", {"Linear": 0, "Closest": 1, "Cubic": 0, "Smart": 0}),
            Choice("extension", {"REPEAT": 0, "EXTEND": 1, "CLIP": 2, "MIRROR": 3}),
            ImageFlags(),
            Used("Alpha"),
        ),
        (("Color", "COLOR"), ("Alpha", "FLOAT")),
        include="material/image.glsl",
        image=True,
        setting_approximations=(
            ("interpolation", ("Cubic", "Smart"), "Cubic interpolation is drawn as linear."),
            ("projection", ("BOX", "SPHERE", "TUBE"), "This projection of the image is drawn as flat."),
        ),
    ),
)
