"""Images. Lookups filter by texelFetch (material/image.glsl); the compiler generates each image's own function.

Linear, closest and cubic interpolation, all four extensions, alpha and colour as Cycles treats them: colour is
premultiplied before interpolation, stays so unless the Alpha output is used, and is decoded from sRGB after
interpolation.
"""

from __future__ import annotations

from collections.abc import Sequence

from .entry import POINT, Choice, Entry, Expression, ImageFlags, Setting, Socket, Used

# One image's own functions; {k} is the index of its sampler. Texels outside of a clipped image are transparent black.
IMAGE_FUNCTIONS = """\
vec4 material_image{k}_texel(ivec2 size, ivec2 texel, int extension, int flags)
{{
  ivec2 at = ivec2(image_wrap(texel.x, size.x, extension), image_wrap(texel.y, size.y, extension));
  if (at.x < 0 || at.y < 0) {{
    return vec4(0.0);
  }}
  return image_associate(material_image{k}_fetch(at), flags);
}}

vec4 material_image{k}_filtered(vec2 coordinate, int interpolation, int extension, int flags)
{{
  ivec2 size = material_image{k}_size();
  vec2 position = image_position(coordinate, size, extension);
  if (interpolation == INTERPOLATION_CLOSEST) {{
    return material_image{k}_texel(size, ivec2(floor(position)), extension, flags);
  }}
  position -= vec2(0.5);
  vec2 lower = floor(position);
  vec2 share = position - lower;
  ivec2 texel = ivec2(lower);
  if (interpolation == INTERPOLATION_CUBIC) {{
    vec4 weights_x = image_cubic_weights(share.x);
    vec4 weights_y = image_cubic_weights(share.y);
    vec4 sum = vec4(0.0);
    for (int j = 0; j < 4; j++) {{
      for (int i = 0; i < 4; i++) {{
        sum += weights_x[i] * weights_y[j]
               * material_image{k}_texel(size, texel + ivec2(i - 1, j - 1), extension, flags);
      }}
    }}
    return sum;
  }}
  vec4 low = mix(material_image{k}_texel(size, texel, extension, flags),
                 material_image{k}_texel(size, texel + ivec2(1, 0), extension, flags), share.x);
  vec4 high = mix(material_image{k}_texel(size, texel + ivec2(0, 1), extension, flags),
                  material_image{k}_texel(size, texel + ivec2(1, 1), extension, flags), share.x);
  return mix(low, high, share.y);
}}

vec4 material_image{k}_at(vec2 coordinate, int interpolation, int extension, int flags, bool alpha_used)
{{
  return image_finish(material_image{k}_filtered(coordinate, interpolation, extension, flags), flags, alpha_used);
}}

void material_image{k}_flat(vec3 coordinate, int interpolation, int extension, float storage, bool alpha_used,
                            out vec3 color, out float alpha)
{{
  vec4 found = material_image{k}_at(coordinate.xy, interpolation, extension, int(storage + 0.5), alpha_used);
  color = found.rgb;
  alpha = found.a;
}}

void material_image{k}_sphere(vec3 coordinate, int interpolation, int extension, float storage, bool alpha_used,
                              out vec3 color, out float alpha)
{{
  material_image{k}_flat(vec3(image_on_sphere(coordinate), 0.0), interpolation, extension, storage, alpha_used, color,
                         alpha);
}}

void material_image{k}_tube(vec3 coordinate, int interpolation, int extension, float storage, bool alpha_used,
                            out vec3 color, out float alpha)
{{
  material_image{k}_flat(vec3(image_on_tube(coordinate), 0.0), interpolation, extension, storage, alpha_used, color,
                         alpha);
}}

void material_image{k}_box(vec3 coordinate, int interpolation, int extension, float storage, bool alpha_used,
                           SurfacePoint point, float blend, out vec3 color, out float alpha)
{{
  int flags = int(storage + 0.5);
  vec3 normal = object_from_world_normal(point, point.normal);
  vec3 weights = image_box_weights(normal, blend);
  vec4 sum = vec4(0.0);
  for (int side = 0; side < 3; side++) {{
    if (weights[side] > 0.0) {{
      vec2 place = image_on_box(coordinate, normal, side);
      sum += weights[side] * material_image{k}_at(place, interpolation, extension, flags, alpha_used);
    }}
  }}
  color = sum.rgb;
  alpha = sum.a;
}}

void material_image{k}_equirectangular(vec3 direction, int interpolation, float storage, bool alpha_used,
                                       out vec3 color, out float alpha)
{{
  material_image{k}_flat(vec3(image_around(direction), 0.0), interpolation, EXTENSION_REPEAT, storage, alpha_used,
                         color, alpha);
}}

void material_image{k}_mirror_ball(vec3 direction, int interpolation, float storage, bool alpha_used, out vec3 color,
                                   out float alpha)
{{
  material_image{k}_flat(vec3(image_on_mirror_ball(direction), 0.0), interpolation, EXTENSION_REPEAT, storage,
                         alpha_used, color, alpha);
}}
"""

# Lookups that average over what a pixel sees (averages.py), put before those above; {k} as there. One loop over probes
# and their two levels, since drivers write every call out: then lookups are there once (13 images: 5.6 s, not 12.9).
AVERAGING_FUNCTIONS = """\
vec4 material_image{k}_of_level(ivec3 extent, int mip, ivec2 texel, int extension, int flags)
{{
  ivec2 at = ivec2(image_wrap(texel.x, extent.x, extension), image_wrap(texel.y, extent.y, extension));
  if (at.x < 0 || at.y < 0) {{
    return vec4(0.0);
  }}
  return image_from_level(material_image{k}_fetch(image_level_texel(extent, mip, at)), flags);
}}

vec4 material_image{k}_between(vec2 coordinate, int mip, int extension, int flags)
{{
  ivec3 extent = image_level(material_image{k}_size(), mip);
  vec2 position = image_position(coordinate, extent.xy, extension) - vec2(0.5);
  vec2 lower = floor(position);
  vec2 share = position - lower;
  ivec2 texel = ivec2(lower);
  vec4 low = mix(material_image{k}_of_level(extent, mip, texel, extension, flags),
                 material_image{k}_of_level(extent, mip, texel + ivec2(1, 0), extension, flags), share.x);
  vec4 high = mix(material_image{k}_of_level(extent, mip, texel + ivec2(0, 1), extension, flags),
                  material_image{k}_of_level(extent, mip, texel + ivec2(1, 1), extension, flags), share.x);
  return mix(low, high, share.y);
}}

vec4 material_image{k}_mean(vec2 coordinate, mat2 footprint, int extension, int flags, bool alpha_used)
{{
  ImageProbes probes = image_probes(footprint, material_image{k}_size(), flags);
  int finer = int(probes.mip);
  float share = probes.mip - float(finer);
  vec4 sum = vec4(0.0);
  for (int i = 0; i < 2 * probes.count; i++) {{  // two levels a probe
    int mip = finer + (i & 1);
    float weight = ((i & 1) == 0) ? 1.0 - share : share;
    if (weight <= 0.0) {{
      continue;
    }}
    vec2 place = coordinate + ((float(i >> 1) + 0.5) / float(probes.count) - 0.5) * probes.axis;
    vec4 found;
    if (mip == 0) {{
      found = material_image{k}_at(place, INTERPOLATION_LINEAR, extension, flags, alpha_used);
      found = image_covered(found, flags, alpha_used);
    }}
    else {{
      found = material_image{k}_between(place, mip, extension, flags);
    }}
    sum += weight * found;
  }}
  return image_uncovered(sum / float(probes.count), flags, alpha_used);
}}

"""
AVERAGED_FUNCTION = """\
void material_image{k}_flat_mean(vec3 coordinate, int interpolation, int extension, float storage, bool alpha_used,
                                 mat2 footprint, out vec3 color, out float alpha)
{{
  vec4 found = material_image{k}_mean(coordinate.xy, footprint, extension, int(storage + 0.5), alpha_used);
  color = found.rgb;
  alpha = found.a;
}}

"""

# The lookup in the table of a Sky Texture, made by materials/sky.py.
SKY_FUNCTIONS = """\
void material_image{k}_sky(vec3 direction, SurfacePoint point, float sun_is_lamp, out vec3 color)
{{
  ivec2 size = material_image{k}_size() - ivec2(0, 1);
  vec3 d = safe_normalize(direction);
  vec3 turn = material_image{k}_fetch(ivec2(3, size.y)).rgb;
  vec2 position = sky_place(d, turn.x) * vec2(size) - vec2(0.5);
  vec2 lower = floor(position);
  vec2 share = position - lower;
  ivec4 at = sky_texels(ivec2(lower), size);
  vec3 low = mix(material_image{k}_fetch(at.xy).rgb, material_image{k}_fetch(at.zy).rgb, share.x);
  vec3 high = mix(material_image{k}_fetch(at.xw).rgb, material_image{k}_fetch(at.zw).rgb, share.x);
  color = mix(low, high, share.y);
  if (sun_is_lamp < 0.5 || point.ray == RAY_CAMERA) {{
    color += sky_sun(d, turn, material_image{k}_fetch(ivec2(0, size.y)).rgb,
                     material_image{k}_fetch(ivec2(1, size.y)).rgb,
                     material_image{k}_fetch(ivec2(2, size.y)).rgb,
                     material_image{k}_fetch(ivec2(4, size.y)).r);
  }}
}}
"""


# The lookup in the table of an IES Texture, made by materials/ies.py: by the angle from -Z, and around it.
PROFILE_FUNCTIONS = """\
void material_image{k}_profile(vec3 direction, float strength, out float share)
{{
  vec3 d = safe_normalize(direction);
  ivec2 last = material_image{k}_size() - ivec2(1);
  float turn = (d.x == 0.0 && d.y == 0.0) ? PI : atan(d.x, d.y) + PI;
  vec2 at = clamp(vec2(turn / (2.0 * PI), acos(clamp(-d.z, -1.0, 1.0)) / PI), 0.0, 1.0) * vec2(last);
  ivec2 texel = min(ivec2(at), last - ivec2(1));
  vec2 part = at - vec2(texel);
  float low = mix(material_image{k}_fetch(texel).r, material_image{k}_fetch(texel + ivec2(1, 0)).r, part.x);
  texel.y += 1;
  float high = mix(material_image{k}_fetch(texel).r, material_image{k}_fetch(texel + ivec2(1, 0)).r, part.x);
  share = strength * mix(low, high, part.y);
}}
"""


def image_functions(k: int | str, size: str, corner: tuple[int, int] | None = None, averages: bool = False) -> str:
    """The functions of sampler `k`, whose image has a size, as GLSL, or of a part of it, which stands at a corner;
    `averages`: with those that average."""
    own = IMAGE_FUNCTIONS
    if averages:
        split = own.index("void material_image{k}_flat")
        own = own[:split] + AVERAGING_FUNCTIONS + AVERAGED_FUNCTION + own[split:]
    text = own.format(k=k).replace(f"material_image{k}_size()", size)
    if corner is None:
        return text
    place = f"ivec2({corner[0]}, {corner[1]})"
    sampler = str(k).partition("_")[0]
    return text.replace(f"material_image{k}_fetch(", f"material_image{sampler}_fetch({place} + ")


def tiled_functions(
    k: int, tiles: Sequence[int], places: Sequence[tuple[int, int, int, int]], averages: bool = False
) -> str:
    """Of a UDIM image in sampler `k`, whose tiles of these numbers stand at places (x, y, width, height): coordinates
    say which is shown, and where in it."""
    parts = "\n".join(
        image_functions(f"{k}_{n}", f"ivec2({width}, {height})", (x, y), averages)
        for n, (x, y, width, height) in enumerate(places)
    )

    def chosen(function: str, given: str) -> str:
        return "".join(
            f"  if (tile == ivec2({(number - 1001) % 10}, {(number - 1001) // 10})) {{\n"
            f"    return material_image{k}_{n}_{function}(place, {given}extension, flags, alpha_used);\n  }}\n"
            for n, number in enumerate(tiles)
        )

    def function(name: str, parameter: str, given: str) -> str:
        return f"""\
vec4 material_image{k}_{name}(vec2 coordinate, {parameter}int extension, int flags, bool alpha_used)
{{
  ivec2 tile = ivec2(floor(clamp(coordinate, vec2(-8.0), vec2(64.0))));
  vec2 place = coordinate - floor(coordinate);
{chosen(name, given)}  return vec4(1.0, 0.0, 1.0, 1.0);
}}
"""

    own = parts + "\n" + function("at", "int interpolation, ", "interpolation, ")
    if averages:
        own += "\n" + function("mean", "mat2 footprint, ", "footprint, ") + "\n" + AVERAGED_FUNCTION.format(k=k)
    usual = IMAGE_FUNCTIONS.format(k=k)
    return own + "\n" + usual[usual.index(f"void material_image{k}_flat") :]


MISSING_COLOR = (1.0, 0.0, 1.0)  # where an image cannot be read

INTERPOLATION = Choice("interpolation", {"Linear": 0, "Closest": 1, "Cubic": 2, "Smart": 2})  # INTERPOLATION_*
LOOKUP = (
    INTERPOLATION,
    Choice("extension", {"REPEAT": 0, "EXTEND": 1, "CLIP": 2, "MIRROR": 3}),  # EXTENSION_*
    ImageFlags(),
    Used("Alpha"),
)
OUTPUTS = (("Color", "COLOR"), ("Alpha", "FLOAT"))
SOURCE = "material/image.glsl"
SKY_SOURCE = "material/sky.glsl"
PROFILE_SOURCE = "material/profile.glsl"
FUNCTIONS = {
    SOURCE: IMAGE_FUNCTIONS,
    SKY_SOURCE: SKY_FUNCTIONS,
    PROFILE_SOURCE: PROFILE_FUNCTIONS,
}  # by the file that they call

ENTRIES = (
    Entry(
        "ShaderNodeTexImage",
        "material_image{image}_box",
        (Socket("Vector", "VECTOR", implicit="@UV"), *LOOKUP, POINT, Setting("projection_blend")),
        OUTPUTS,
        SOURCE,
        when={"projection": "BOX"},
        image=True,
    ),
    Entry(
        "ShaderNodeTexImage",
        "material_image{image}_{projection}",
        (Socket("Vector", "VECTOR", implicit="@UV"), *LOOKUP),
        OUTPUTS,
        SOURCE,
        choices={"projection": ("FLAT", "SPHERE", "TUBE")},
        image=True,
    ),
    Entry(
        "ShaderNodeTexEnvironment",
        "material_image{image}_{projection}",
        (
            Socket("Vector", "VECTOR", implicit="(point.position + material_scene.origin.xyz)"),
            INTERPOLATION,
            ImageFlags(),
            Expression("false"),
        ),
        OUTPUTS,
        SOURCE,
        choices={"projection": ("EQUIRECTANGULAR", "MIRROR_BALL")},
        image=True,
    ),
    Entry(
        "ShaderNodeTexSky",
        "material_image{image}_sky",
        (Socket("Vector", "VECTOR", implicit="@GENERATED"), POINT, Setting("sun_is_lamp")),
        (("Color", "COLOR"),),
        SKY_SOURCE,
        image=True,
    ),
    Entry(
        "ShaderNodeTexIES",
        "material_image{image}_profile",
        (
            Socket("Vector", "VECTOR", implicit="object_from_world_normal(point, point.incoming)"),
            Socket("Strength", "FLOAT", 1.0),
        ),
        (("Fac", "FLOAT"),),
        PROFILE_SOURCE,
        image=True,
    ),
)
