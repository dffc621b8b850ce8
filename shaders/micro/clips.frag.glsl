// Where light at a point holds on its piece of a triangle: up to two lines beyond which something stands between both, found
// by rays from the point to the corners, a little above the piece. So a floor's piece under the wall between two rooms is lit
// on one side of it alone. By point and side: angle of the line's normal in the piece's frame and its distance from the middle
// of the piece's longest edge, twice; NONE: no line. Beyond a line the piece has the light of another one beside it in the tree,
// whose point sees the corner there: its number is this one's with bits turned, and TURN times these bits are added to the
// angle; 0: dark.
#include "lib/math.glsl"
#include "trace/rays.glsl"

#define NONE 1e30
#define LIFT 0.03     // half lengths of the piece that rays run above it: what is lower hides nothing
#define UPRIGHT 0.3   // sine between the piece and what stands on it
#define APART 0.9     // cosine between two lines that count as one
#define BEYOND 0.2    // half lengths behind such a line, and
#define WIDE 0.4      // to both sides, where it must hide, too: posts and legs end no light
#define LEVEL 0.99    // cosine between planes that count as one
#define BESIDE 32     // pieces that are asked
#define INWARDS 0.1   // of the way from a corner to its piece's middle, where a place beyond the line is asked for

vec4 tree_texel(int index)
{
  return tree_nodes_fetch(ivec2(index & 2047, index >> 11));
}

bool hidden(vec3 origin, vec3 place)
{
  vec3 way = place - origin;
  float distance = length(way);
  ivec2 hit;
  return trace_until(origin, way / max(distance, 1e-30), distance, distance, 0u, hit) < distance;
}

// Bits to turn in the number of a leaf for one that lies in the same plane and sees `place`, from which on `normal` leads.
int lit_beside(int leaf, ivec2 pixel, vec3 place, vec3 normal, float lift)
{
  for (int k = 1; k < min(BESIDE, leaf_count); k++) {
    int other = (leaf - leaf_count) ^ k;
    int entry = 2 * other + (pixel.x & 1);
    ivec2 at = ivec2(entry % POINT_ROW, entry / POINT_ROW);
    vec3 point = point_place_fetch(at).xyz;
    bool level = dot(-point_facing_fetch(at).xyz, normal) > LEVEL && abs(dot(point - place, normal)) < lift;
    if (level && !hidden(point + lift * normal, place + lift * normal)) {
      return k;
    }
  }
  return 0;
}

void main()
{
  out_clips = vec4(0.0, NONE, 0.0, NONE);
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  int leaf = leaf_count + ((pixel.y * POINT_ROW + pixel.x) >> 1);
  vec4 ball = tree_texel(3 * leaf);
  vec4 shape = tree_texel(3 * leaf + 1);
  vec4 sides = tree_texel(3 * leaf + 2);
  if (sides.w <= 0.0 || shape.w <= 0.0) {
    return;
  }
  vec3 axis = octahedral_decode(shape.xy);
  vec3 along = octahedral_decode(sides.xy);
  vec3 across = cross(axis, along);
  vec3 normal = -point_facing_fetch(pixel).xyz;
  float lift = LIFT * shape.w + 8.0 * offset_size;
  vec3 middle = ball.xyz + (sides.z * along + sides.w * across) / 3.0;
  vec3 origin = point_place_fetch(pixel).xyz + lift * normal;
  vec3 beyond[2];
  beyond[0] = middle;
  beyond[1] = middle;
  vec2 nearest = vec2(NONE);
  for (int k = 0; k < 3; k++) {
    vec2 place = (k == 0) ? vec2(-shape.w, 0.0) : ((k == 1) ? vec2(shape.w, 0.0) : sides.zw);
    vec3 corner = ball.xyz + place.x * along + place.y * across;
    vec3 to_corner = corner + lift * normal - origin;
    float distance = length(to_corner);
    vec3 direction = to_corner / max(distance, 1e-30);
    ivec2 hit;
    float t = trace_until(origin, direction, distance, 0.0, 0u, hit);
    if (t >= distance) {
      continue;
    }
    vec3 stands = triangle_normal(hit);
    vec2 level = vec2(dot(stands, along), dot(stands, across));
    float upright = length(level);
    if (upright < UPRIGHT) {
      continue;
    }
    level *= ((dot(level, vec2(dot(direction, along), dot(direction, across))) < 0.0) ? -1.0 : 1.0) / upright;
    vec3 behind = origin + t * direction + BEYOND * shape.w * (level.x * along + level.y * across);
    vec3 beside = WIDE * shape.w * (level.y * along - level.x * across);
    if (!hidden(origin, behind + beside) || !hidden(origin, behind - beside)) {
      continue;
    }
    vec3 met = origin + t * direction - ball.xyz;
    float off = dot(level, vec2(dot(met, along), dot(met, across)));
    float angle = atan(level.y, level.x);
    vec2 first = vec2(cos(out_clips.x), sin(out_clips.x));
    if (out_clips.y == NONE || dot(first, level) > APART) {
      out_clips.xy = (t < nearest.x) ? vec2(angle, off) : out_clips.xy;
      beyond[0] = (t < nearest.x) ? mix(corner, middle, INWARDS) : beyond[0];
      nearest.x = min(nearest.x, t);
    }
    else {
      out_clips.zw = (t < nearest.y) ? vec2(angle, off) : out_clips.zw;
      beyond[1] = (t < nearest.y) ? mix(corner, middle, INWARDS) : beyond[1];
      nearest.y = min(nearest.y, t);
    }
  }
  for (int line = 0; line < 2; line++) {
    if (out_clips[2 * line + 1] != NONE) {
      out_clips[2 * line] += TURN * float(lit_beside(leaf, pixel, beyond[line], normal, lift));
    }
  }
}
