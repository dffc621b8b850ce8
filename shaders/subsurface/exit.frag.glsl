// Where light enters the glass around points that no straight ray brings: from below a point's horizon, or mirrored by the glass.
// `exits` rays of each point, one below the other in blocks as high as the image of points, leave so at places that face where they
// go; sources light these by a lobe about that (IN_LOBES of light/direct.frag.glsl). A ray that leaves at several faces has one of
// them, drawn by the share that does. Of the place: out_position, w 0 where there is none, out_normal as of surfaces, out_entry what
// a point there reflects, out_instance that of the point.
#include "ask/view.glsl"
#include "lib/gbuffer.glsl"
#include "lib/random.glsl"
#include "subsurface/walks.glsl"

vec3 point_face;
float leaving;
vec3 left_at;
vec3 left_along;
float pick;

void ray_leaves(float share, vec3 place, vec3 outwards, vec3 direction, float index, int faces)
{
  if (share > 0.0 && (faces > 0 || dot(direction, point_face) <= 0.0)) {
    leaving += share;
    float chance = share / leaving;
    bool taken = pick < chance;
    pick = taken ? pick / chance : (pick - chance) / (1.0 - chance);
    left_at = taken ? place + ray_offset(place) * outwards : left_at;
    left_along = taken ? direction : left_along;
  }
}

void ray_stays(float share, ivec2 hit, vec3 met, vec3 direction, int faces)
{
}

#include "subsurface/in_glass.glsl"

void main()
{
  ivec2 texel = ivec2(gl_FragCoord.xy);
  int rows = point_position_size().y;
  int number = texel.y / rows;
  texel.y -= number * rows;
  out_instance = point_instances_fetch(texel);
  out_position = vec4(0.0);
  out_normal = vec4(0.0);
  out_entry = vec4(0.0);
  vec4 place = point_position_fetch(texel);
  if (number >= exits || place.w == 0.0 || cell_coat_fetch(texel).w == 0.0) {
    return;
  }
  point_face = octahedral_decode(point_normal_fetch(texel).zw);
  uvec3 roll = roll_of(texel, film_view.sample_index, film_view.seed, 251);
  leaving = 0.0;
  pick = to_unit(hash3(roll + uvec3(uint(number), 1u, 2u)).x);
  vec2 u = fract(vec2(to_unit(roll.x), to_unit(roll.y)) + vec2(float(number) / float(exits), to_unit(reverse_bits(uint(number)))));
  follow_in_glass(ray_origin(place.xyz, point_face), cosine_direction(point_face, u), roll.z + uint(number));
  if (leaving > 0.0) {
    vec2 facing = octahedral_encode(left_along);
    out_position = vec4(left_at, 1.0);
    out_normal = vec4(facing, lift_encode(facing, 0.0));
    out_entry = point_entry_fetch(texel) * vec4(vec3(leaving * cell_bent_fetch(texel).z), 1.0);
  }
}
