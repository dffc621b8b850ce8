// For points in clear solid glass, as of milk that touches its glass: by how much more or less light enters there than straight
// rays bring. Rays of the cosine's density follow the glass's faces, mirrored by Fresnel's reflectance: of light from all
// sides the share `leaves` that they leave by is what comes in (as in Cycles radiance is the same in glass as outside; straight
// rays bring what a face lets pass, of the whole hemisphere), and what they bring `back` of what is sent enters once
// more, as often as it leaves again:
//
//   leaves / (1 - F) * sum over bounces k of (albedo back)^k;     of a flat layer leaves = (1 - F) / n2, back = 1 - leaves
//
// Bent glass brings light of a lamp elsewhere than a straight ray. So of light straight from sources, which arrives at the cosine c
// to the point's normal, enters (a + b c) in place of c; a and b are those with which the directions in which rays leave have the
// mean and the mean cosine that they have (out_bent.xy, without the sum over bounces). These are of rays that leave by the first
// face, above the point's horizon; others see sources where they leave (exit.frag.glsl), for which out_bent.z is the number of rays
// over those that are not lost.
// What the glass mirrors back of it comes from where it left: out_landed has the cells of four of the rays, drawn by what each
// brings, out_again what of the light there enters here (echo.frag.glsl).
//
// Rays of indirect light that begin at such points bring none of what their glass mirrors (trace_vertex of
// indirect/path.glsl).
//
// out_coat  rgb: the factor; w: 1 in glass, else 0, and the factor is 1
#include "lib/gbuffer.glsl"
#include "lib/random.glsl"
#include "subsurface/walks.glsl"
#include "subsurface/again.glsl"
#include "subsurface/objects.glsl"

#define WAYS 64

vec3 point_face;
float point_instance;
float within;
float glass;  // its index of refraction
float leaves;
float straight;  // of that, along straight rays from above the horizon, and
float ahead;     // by the cosine between their direction outside and the normal
float back;
float landing;  // of that, on points of the instance
vec4 landed;
uvec3 ray_roll;

// The cell of the instance where a ray has met it; -1 of other instances.
int cell_met(ivec2 hit, vec3 met, vec3 direction, float instance)
{
  if (instance_of(hit) != instance) {
    return -1;
  }
  vec3 normal = triangle_normal(hit);
  bool behind = dot(normal, direction) > 0.0;
  int listed = first_object + OBJECT_TEXELS * (object_behind(instance, behind) - 1);
  return (listed < first_object)
         ? -1 : cell_near(met, behind ? -normal : normal, object_texel(listed + 1), object_texel(listed + 2));
}

void ray_leaves(float share, vec3 place, vec3 outwards, vec3 direction, float index, int faces)
{
  within += (faces == 0) ? 1.0 : 0.0;
  glass = index;
  leaves += share;
  float cosine = dot(direction, point_face);
  if (faces == 0 && cosine > 0.0) {
    straight += share;
    ahead += share * cosine;
  }
}

void ray_stays(float share, ivec2 hit, vec3 met, vec3 direction, int faces)
{
  int cell = (hit.x >= 0 && faces > 0) ? cell_met(hit, met, direction, point_instance) : -1;
  back += (faces > 0) ? share : 0.0;
  if (cell >= 0) {
    landing += share;
    vec4 drawn = vec4(to_unit(ray_roll.x), to_unit(ray_roll.y), to_unit(ray_roll.z), to_unit(hash3(ray_roll).x));
    landed = mix(landed, vec4(float(cell)), vec4(lessThan(drawn * landing, vec4(share))));
  }
}

#include "subsurface/in_glass.glsl"

void main()
{
  ivec2 texel = ivec2(gl_FragCoord.xy);
  vec4 place = point_position_fetch(texel);
  point_face = octahedral_decode(point_normal_fetch(texel).zw);
  uvec3 roll = hash3(uvec3(uvec2(texel), 7u));
  within = leaves = straight = ahead = back = landing = 0.0;
  glass = 1.0;
  landed = vec4(float(texel.y * ROW + texel.x));
  int instance = int(point_instances_fetch(texel).z + 0.5);
  point_instance = float(instance);
  bool may_be_within = place.w > 0.0 && glass_indices_fetch(ivec2(instance & 2047, instance >> 11)).y > 0.0;
  for (int k = 0; k < WAYS && may_be_within; k++) {
    vec2 u = fract(vec2(to_unit(roll.x), to_unit(roll.y)) + vec2(float(k) / float(WAYS), to_unit(reverse_bits(uint(k)))));
    ray_roll = hash3(roll + uvec3(uint(k), 1u, 2u));
    follow_in_glass(ray_origin(place.xyz, point_face), cosine_direction(point_face, u), roll.z + uint(k));
  }
  out_coat = vec4(1.0, 1.0, 1.0, 0.0);
  out_bent = vec4(0.0, 1.0, 0.0, 0.0);
  out_again = vec4(0.0);
  out_landed = landed;
  if (2.0 * within > float(WAYS)) {
    int material = int(point_instances_fetch(texel).w + 0.5);
    vec3 color = scatter_means_fetch(ivec2(material & 15, (material >> 4) + scatter_means_size().y / 3)).rgb;
    float whole = max(leaves + back, 1e-6);
    // Of even light a face from outside (Kulla and Conty 2017).
    float passes = 1.0 - fresnel_average_dielectric(glass);
    float returned = min(back / whole, 0.99);
    vec3 again = clamp(color, vec3(0.0), vec3(1.0)) * returned;
    out_coat = vec4(leaves / (whole * passes) * echoes(again, bounces), 1.0);
    out_again.rgb = again;
    // Rays to sources pass a face as half of a pane (pane_passing of materials/energy.py).
    float face_reflects = fresnel_dielectric(sqrt(0.5), glass);
    float of_lamps = sqrt((1.0 - face_reflects) / (1.0 + face_reflects));
    float slope = 6.0 * (ahead / max(straight, 1e-6) - 0.5);
    out_bent.xy = straight / (whole * of_lamps) * vec2(0.5 * (1.0 - slope), slope);
    out_bent.z = float(WAYS) / whole;
  }
}
