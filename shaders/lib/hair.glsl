// Light that a fibre scatters: mirrored by its surface (R), let through (TT), mirrored inside once (TRT) and more often, each
// lobe a product of a factor along the fibre and one around it, of the widths that Cycles gives them.
//
// d'Eon et al., "An energy-conserving hair reflectance model", 2011; Chiang, Bitterli, Tappan & Burley, "A practical and
// controllable hair and fur model for production path tracing", 2016.
#include "lib/math.glsl"
#include "lib/closure.glsl"

// A fibre is kept as a LOBE_TOON whose tint is below 1 in z. Its tint holds, as square roots of 8 bits, the index of
// refraction, the tilt of the scales, and in z how much narrower R is than the others (7 bits) and which way the tangent
// points; ior what a path of one radius lets pass, as three square roots of 8 bits; roughness and anisotropy the widths along
// and around the fibre; the edge's last two numbers its thickness.
#define HAIR_IORS 2.0       // above 1
#define HAIR_TILTS 1.6      // radians
#define HAIR_NARROWING 63.0
#define HAIR_THINNEST 40.0  // octaves below 1 m
#define HAIR_STEPS (16383.0 / 64.0)

struct HairLobes {
  vec3 mirrored;
  vec3 through;
  vec3 returned;
  vec3 rest;
  float entry;  // angle around the fibre at which the view's ray enters, and that inside
  float inside;
};

// What the lobes take of light that goes towards the viewer: `along`, sine of the angle from the fibre's cross-section;
// `beside`, how far off the axis the fibre is met, in radii. Their sum is the albedo.
HairLobes hair_lobes(float along, float beside, float ior, vec3 absorption)
{
  HairLobes found;
  float cosine = sqrt(max(1.0 - along * along, 0.0));
  float h = clamp(beside, -1.0, 1.0);
  float bent = along / ior;
  float sine_inside = clamp(h * cosine / sqrt(max(ior * ior - along * along, 1e-6)), -1.0, 1.0);
  float way = 2.0 * sqrt(1.0 - sine_inside * sine_inside) / sqrt(max(1.0 - bent * bent, 1e-6));
  vec3 passing = exp(-absorption * way);
  float f = fresnel_dielectric(cosine * sqrt(1.0 - h * h), ior);
  found.entry = asin(h);
  found.inside = asin(sine_inside);
  found.mirrored = vec3(f);
  found.through = (1.0 - f) * (1.0 - f) * passing;
  found.returned = found.through * passing * f;
  found.rest = found.returned * passing * f / max(vec3(1.0) - passing * f, vec3(1e-6));
  return found;
}

vec3 hair_albedo(HairLobes lobes)
{
  return lobes.mirrored + lobes.through + lobes.returned + lobes.rest;
}

// Variance along the fibre, and scale of the logistic curve around it, of a roughness.
float hair_variance(float roughness)
{
  float r = clamp(roughness, 1e-3, 1.0);
  float root = 0.726 * r + 0.812 * r * r + 3.7 * pow(r, 20.0);
  return max(root * root, 1e-5);
}

float hair_scale(float roughness)
{
  float r = clamp(roughness, 1e-3, 1.0);
  return max(0.6266571 * (0.265 * r + 1.194 * r * r + 5.372 * pow(r, 22.0)), 1e-3);
}

float log_bessel(float x)
{
  if (x > 12.0) {
    return x + 0.5 * (0.125 / x - log(2.0 * PI * x));
  }
  float quarter = 0.25 * x * x;
  float term = 1.0;
  float sum = 1.0;
  for (int k = 1; k < 24; k++) {
    term *= quarter / float(k * k);
    sum += term;
  }
  return log(sum);
}

// Along the fibre: of light at `light` (sine, cosine), seen at `view`.
float hair_along(vec2 light, vec2 view, float variance)
{
  float exponent = log_bessel(light.y * view.y / variance) - (light.x * view.x + 1.0) / variance;
  return exp(exponent) / (variance * max(1.0 - exp(-2.0 / variance), 1e-6));
}

// Around it: `turn` between view and light, less that of the lobe of `inner` paths inside.
float hair_around(float turn, float inner, float scale, HairLobes lobes)
{
  float off = turn - (2.0 * inner * lobes.inside - 2.0 * lobes.entry + inner * PI);
  off -= 2.0 * PI * floor(off / (2.0 * PI) + 0.5);
  float falling = exp(-abs(off) / scale);
  float edge = exp(-PI / scale);
  return falling / (scale * (1.0 + falling) * (1.0 + falling)) * (1.0 + edge) / max(1.0 - edge, 1e-6);
}

// Light's (sine, cosine) along the fibre, turned by an angle.
vec2 hair_tilted(vec2 light, float angle)
{
  float c = cos(angle);
  float s = sin(angle);
  return vec2(light.x * c + light.y * s, abs(light.y * c - light.x * s));
}

// f * cos towards a viewer from `light`, both unit; `tilt` of the scales, `narrowing` of R's roughness.
vec3 hair_scattering(HairLobes lobes, vec3 tangent, vec3 view, vec3 light, vec2 roughness, float tilt, float narrowing)
{
  float sine_view = dot(tangent, view);
  vec2 seen = vec2(sine_view, sqrt(max(1.0 - sine_view * sine_view, 0.0)));
  float sine_light = dot(tangent, light);
  vec2 lit = vec2(sine_light, sqrt(max(1.0 - sine_light * sine_light, 0.0)));
  vec3 across = safe_normalize(cross(tangent, view));
  vec3 away = cross(tangent, across);
  float turn = atan(dot(light, away), dot(light, across)) + 0.5 * PI;
  float variance = hair_variance(roughness.x);
  float scale = hair_scale(roughness.y);
  float narrow = hair_variance(roughness.x * narrowing);
  return lobes.mirrored * (hair_along(hair_tilted(lit, 2.0 * tilt), seen, narrow) * hair_around(turn, 0.0, scale, lobes))
         + lobes.through * (hair_along(hair_tilted(lit, -tilt), seen, 0.25 * variance) * hair_around(turn, 1.0, scale, lobes))
         + lobes.returned * (hair_along(hair_tilted(lit, -4.0 * tilt), seen, 4.0 * variance) * hair_around(turn, 2.0, scale, lobes))
         + lobes.rest * (hair_along(lit, seen, 4.0 * variance) / (2.0 * PI));
}

// How far off its axis a view meets a fibre, in radii.
float hair_beside(vec3 tangent, vec3 normal, vec3 view)
{
  vec3 across = safe_normalize(cross(tangent, view));
  return dot(cross(normal, tangent), cross(tangent, across));
}

// Three shares of 8 bits in one number above 0.
float hair_pack(vec3 shares)
{
  vec3 level = floor(sqrt(clamp(shares, vec3(0.0), vec3(1.0))) * 255.0 + 0.5);
  return 1.0 + level.x + 256.0 * (level.y + 256.0 * level.z);
}

vec3 hair_unpack(float stored)
{
  float z = floor((stored - 1.0) / 65536.0);
  float y = floor((stored - 1.0 - 65536.0 * z) / 256.0);
  vec3 root = vec3(stored - 1.0 - 256.0 * (y + 256.0 * z), y, z) / 255.0;
  return root * root;
}
