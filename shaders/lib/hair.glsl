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

// Of the lobes R, TT, TRT and the rest: tilt, variance along the fibre.
vec4 hair_tilts(float tilt)
{
  return tilt * vec4(2.0, -1.0, -4.0, 0.0);
}

vec4 hair_variances(float roughness, float narrowing)
{
  return vec4(hair_variance(roughness * narrowing), hair_variance(roughness) * vec3(0.25, 4.0, 4.0));
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
  vec4 wide = hair_variances(roughness.x, narrowing);
  vec4 tilts = hair_tilts(tilt);
  float scale = hair_scale(roughness.y);
  return lobes.mirrored * (hair_along(hair_tilted(lit, tilts.x), seen, wide.x) * hair_around(turn, 0.0, scale, lobes))
         + lobes.through * (hair_along(hair_tilted(lit, tilts.y), seen, wide.y) * hair_around(turn, 1.0, scale, lobes))
         + lobes.returned * (hair_along(hair_tilted(lit, tilts.z), seen, wide.z) * hair_around(turn, 2.0, scale, lobes))
         + lobes.rest * (hair_along(lit, seen, wide.w) / (2.0 * PI));
}

// A direction that light comes from, about as often as hair_scattering is large: `u` along the fibre (two numbers), around
// it, and which lobe. `weight`: f * cos over the density.
vec3 hair_sample(HairLobes lobes, vec3 tangent, vec3 view, vec2 roughness, float tilt, float narrowing, vec4 u,
                 out vec3 weight)
{
  vec4 shares = vec4(max_component(lobes.mirrored), max_component(lobes.through), max_component(lobes.returned),
                     max_component(lobes.rest));
  shares /= max(shares.x + shares.y + shares.z + shares.w, 1e-20);
  vec4 sums = vec4(shares.x, shares.x + shares.y, shares.x + shares.y + shares.z, 1.0);
  int lobe = (u.w < sums.x) ? 0 : ((u.w < sums.y) ? 1 : ((u.w < sums.z) ? 2 : 3));
  vec4 wide = hair_variances(roughness.x, narrowing);
  vec4 tilts = hair_tilts(tilt);
  float scale = hair_scale(roughness.y);
  float v = wide[lobe];
  float sine_view = clamp(dot(tangent, view), -1.0, 1.0);
  vec2 seen = vec2(sine_view, sqrt(max(1.0 - sine_view * sine_view, 0.0)));
  float cosine = clamp(1.0 + v * log(max(u.x + (1.0 - u.x) * exp(-2.0 / v), 1e-30)), -1.0, 1.0);
  float sine = -cosine * seen.x + sqrt(max(1.0 - cosine * cosine, 0.0)) * cos(2.0 * PI * u.y) * seen.y;
  float angle = asin(clamp(sine, -1.0, 1.0)) - tilts[lobe];
  vec2 lit = vec2(sin(angle), abs(cos(angle)));
  float turn = 2.0 * PI * u.z;
  if (lobe < 3) {
    float edge = 1.0 / (1.0 + exp(PI / scale));
    float below = clamp(mix(edge, 1.0 - edge, u.z), 1e-6, 1.0 - 1e-6);
    turn = scale * log(below / (1.0 - below)) + float(lobe) * (2.0 * lobes.inside + PI) - 2.0 * lobes.entry;
  }
  vec3 across = safe_normalize(cross(tangent, view));
  vec3 away = cross(tangent, across);
  float around = turn - 0.5 * PI;
  vec3 light = lit.x * tangent + lit.y * (cos(around) * across + sin(around) * away);
  float density = shares.w * hair_along(lit, seen, wide.w) / (2.0 * PI);
  vec3 sum = lobes.rest * (hair_along(lit, seen, wide.w) / (2.0 * PI));
  for (int k = 0; k < 3; k++) {
    vec2 tilted = hair_tilted(lit, tilts[k]);
    float value = hair_along(tilted, seen, wide[k]) * hair_around(turn, float(k), scale, lobes);
    density += shares[k] * value * tilted.y / max(lit.y, 1e-4);
    sum += ((k == 0) ? lobes.mirrored : ((k == 1) ? lobes.through : lobes.returned)) * value;
  }
  weight = (density > 0.0) ? sum / density : vec3(0.0);
  return light;
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

// Radius of a fibre, m, from its lobe's edge; below HAIR_FLAT it is a triangle of a mesh.
#define HAIR_FLAT 1e-12

float hair_radius(vec3 edge)
{
  float code = floor(edge.y * 127.0 + 0.5) * 128.0 + floor(edge.z * 127.0 + 0.5);
  return 0.5 * exp2(code / HAIR_STEPS - HAIR_THINNEST);
}

// Of what a fibre sends on of even light, the part that shines through. `stored`: what hair_pack returned.
float hair_through(float stored)
{
  vec3 passing = pow(hair_unpack(stored), vec3(1.57));  // half the mean chord
  vec3 through = 0.85 * passing;
  return luminance(through) / luminance(vec3(0.08) + through + 0.08 * through * passing);
}
