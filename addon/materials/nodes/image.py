"""Textures. Image lookups filter by texelFetch (material/image.glsl); the compiler generates each image's own function.

Linear and closest interpolation, all four extensions, alpha and colour as Cycles treats them: colour is premultiplied
before interpolation, stays so unless the Alpha output is used, and is decoded from sRGB after interpolation.
"""

from __future__ import annotations

from .entry import Choice, Entry, ImageFlags, Socket, Used

# One image's own functions; {k} is the index of its sampler. Texels outside of a clipped image are transparent black.
IMAGE_FUNCTIONS = """\
vec4 material_image{k}_texel(ivec2 size, ivec2 texel, int extension, int flags)
{{
  ivec2 at = ivec2(image_wrap(texel.x, size.x, extension), image_wrap(texel.y, size.y, extension));
  if (at.x < 0 || at.y < 0) {{
    return vec4(0.0);
  }}
  return image_associate(texelFetch(material_image{k}, at, 0), flags);
}}

void material_image{k}_sample(vec3 coordinate, int interpolation, int extension, float storage, bool alpha_used,
                           out vec3 color, out float alpha)
{{
  int flags = int(storage + 0.5);
  ivec2 size = textureSize(material_image{k}, 0);
  vec2 position = image_position(coordinate, size, extension);
  vec4 filtered;
  if (interpolation == 1) {{
    filtered = material_image{k}_texel(size, ivec2(floor(position)), extension, flags);
  }}
  else {{
    position -= vec2(0.5);
    vec2 lower = floor(position);
    vec2 share = position - lower;
    ivec2 texel = ivec2(lower);
    vec4 low = mix(material_image{k}_texel(size, texel, extension, flags),
                   material_image{k}_texel(size, texel + ivec2(1, 0), extension, flags), share.x);
    vec4 high = mix(material_image{k}_texel(size, texel + ivec2(0, 1), extension, flags),
                    material_image{k}_texel(size, texel + ivec2(1, 1), extension, flags), share.x);
    filtered = mix(low, high, share.y);
  }}
  filtered = image_finish(filtered, flags, alpha_used);
  color = filtered.rgb;
  alpha = filtered.a;
}}

void material_image{k}_environment(vec3 toward, int projection, int interpolation, float storage, out vec3 color)
{{
  float alpha;
  vec3 place = image_environment(toward, projection);
  material_image{k}_sample(place, interpolation, EXTENSION_REPEAT, storage, false, color, alpha);
}}
"""

INTERPOLATION = Choice("interpolation", {"Linear": 0, "Closest": 1, "Cubic": 0, "Smart": 0})
CUBIC = ("interpolation", ("Cubic", "Smart"), "Cubic interpolation is drawn as linear.")
MISSING_COLOR = (1.0, 0.0, 1.0)  # where an image cannot be read

ENTRIES = (
    Entry(
        "ShaderNodeTexImage",
        "material_image{image}_sample",
        (
            Socket("Vector", "VECTOR", implicit="@UV"),
            INTERPOLATION,
            Choice("extension", {"REPEAT": 0, "EXTEND": 1, "CLIP": 2, "MIRROR": 3}),
            ImageFlags(),
            Used("Alpha"),
        ),
        (("Color", "COLOR"), ("Alpha", "FLOAT")),
        include="material/image.glsl",
        image=True,
        setting_approximations=(
            CUBIC,
            ("projection", ("BOX", "SPHERE", "TUBE"), "This projection of the image is drawn as flat."),
        ),
    ),
    Entry(
        "ShaderNodeTexEnvironment",
        "material_image{image}_environment",
        (
            Socket("Vector", "VECTOR", implicit="(point.position + material_scene.origin.xyz)"),
            Choice("projection", {"EQUIRECTANGULAR": 0, "MIRROR_BALL": 1}),
            INTERPOLATION,
            ImageFlags(),
        ),
        (("Color", "COLOR"),),
        include="material/image.glsl",
        image=True,
        setting_approximations=(CUBIC,),
    ),
)
