// Light of the picture before, where that shows the same surface: joined with the fresh light of this sample.
//
// Both without the surface's colour. The picture before is looked up where the camera and the object were then, in four
// pixels, of which those count that lie on the same surface: on its tangent plane, near the place, facing alike.
// Texels of `before_table`:
//   3  rows x, y, w of its view
//   1  its render origin from this one's; w: how many objects have moved
//   1  how many lamps; y: 1 where there is other light than theirs; z: pictures that light counts for at most, since
//      lamps have moved; w: 1 where their shadows may have moved by more than they are blurred
//   11 of each object: from where it is to where it was; to its box, within -1..1, now and then; the middle and radius of
//      the sphere around it; how far it has moved, y: 1 where it emits
//   1  of each lamp: place and reach, or the way to a sun and -1 - tangent of its radius
#include "lib/gbuffer.glsl"
#include "neighbours/pixel_size.glsl"

#define OBJECTS 5  // texel of the first one
#define TEXELS 11  // of each
#define LEAST_NOISE 1e-4  // relative variance of a mean over pixels; look-ups between pixels change it by about so much

struct Found {
  vec3 direct;
  vec3 indirect;
  vec2 counts;  // samples that stand behind both; in parts, where only a part of the place shows the surface
  float weight;
  ivec2 pixel;  // the nearest, of the picture before
};

vec4 table(int texel)
{
  return before_table_fetch(ivec2(texel, 0));
}

vec3 moved_by(int row, vec3 position)
{
  vec4 p = vec4(position, 1.0);
  return vec3(dot(table(row), p), dot(table(row + 1), p), dot(table(row + 2), p));
}

// What the picture before shows of a place, given as that had it.
Found recall(vec3 position, vec3 normal, float tolerance)
{
  Found found;
  found.direct = found.indirect = vec3(0.0);
  found.counts = vec2(0.0);
  found.weight = 0.0;
  vec4 p = vec4(position, 1.0);
  float w = dot(table(2), p);
  if (w <= 0.0) {
    return found;
  }
  ivec2 size = before_place_size();
  vec2 place = (vec2(dot(table(0), p), dot(table(1), p)) / w * 0.5 + 0.5) * vec2(size) - 0.5;
  if (any(lessThan(place, vec2(-1.0))) || any(greaterThan(place, vec2(size)))) {
    return found;
  }
  ivec2 low = ivec2(floor(place));
  vec2 share = place - vec2(low);
  found.pixel = ivec2(round(place));
  for (int k = 0; k < 4; k++) {
    ivec2 pixel = low + ivec2(k & 1, k >> 1);
    if (any(lessThan(pixel, ivec2(0))) || any(greaterThanEqual(pixel, size))) {
      continue;
    }
    vec4 then = before_place_fetch(pixel);
    vec4 facing = before_facing_fetch(pixel);
    vec3 path = then.xyz - position;
    bool same = then.w > 0.0 && dot(octahedral_decode(facing.xy), normal) > 0.9
                && abs(dot(path, normal)) < tolerance && length(path) < 4.0 * tolerance;
    if (same) {
      vec2 sides = mix(1.0 - share, share, vec2(k & 1, k >> 1));
      float weight = sides.x * sides.y;
      found.direct += weight * before_direct_fetch(pixel).rgb;
      found.indirect += weight * before_indirect_fetch(pixel).rgb;
      found.counts += weight * vec2(then.w, facing.z);
      found.weight += weight;
    }
  }
  if (found.weight > 0.05) {
    found.direct /= found.weight;
    found.indirect /= found.weight;
  }
  else {
    found.weight = 0.0;
  }
  return found;
}

// Light without the surface's colour; where it has none there is nothing to be divided.
vec3 arriving(vec3 light, vec3 color)
{
  return vec3((color.r > 1e-3) ? light.r / color.r : 0.0, (color.g > 1e-3) ? light.g / color.g : 0.0,
              (color.b > 1e-3) ? light.b / color.b : 0.0);
}

// Samples that history of direct light counts for, of those behind it, so that it does not lag: where its mean over 5x5
// pixels of the surface, now at `position` and then at `position_then`, differs from that of fresh light by d, and noise
// explains the variance v of that,
//   1 / counted = 1 / samples + max(0, d^2 / 4v - 1)
float in_time(ivec2 pixel, ivec2 pixel_then, vec3 position, vec3 position_then, vec3 normal, vec3 normal_then,
              float tolerance, float samples)
{
  vec3 fresh = vec3(0.0);
  vec3 squares = vec3(0.0);
  vec3 before = vec3(0.0);
  float count = 0.0;
  ivec2 size = surface_position_size();
  ivec2 size_then = before_place_size();
  for (int y = -2; y <= 2; y++) {
    for (int x = -2; x <= 2; x++) {
      ivec2 now = clamp(pixel + ivec2(x, y), ivec2(0), size - 1);
      ivec2 then = clamp(pixel_then + ivec2(x, y), ivec2(0), size_then - 1);
      vec4 place = surface_position_fetch(now);
      vec4 place_then = before_place_fetch(then);
      if (place.w != 0.0 && abs(dot(place.xyz - position, normal)) < 3.0 * tolerance && place_then.w > 0.0
          && abs(dot(place_then.xyz - position_then, normal_then)) < 3.0 * tolerance) {
        vec3 light = arriving(fresh_direct_fetch(now).rgb, surface_diffuse_fetch(now).rgb);
        fresh += light;
        squares += light * light;
        before += before_direct_fetch(then).rgb;
        count += 1.0;
      }
    }
  }
  vec3 mean = fresh / max(count, 1.0);
  vec3 variance = max(squares / max(count, 1.0) - mean * mean, vec3(0.0)) / max(count, 1.0);
  variance = (1.0 + 1.0 / max(samples, 0.1)) * (variance + LEAST_NOISE * mean * mean);
  vec3 apart = before / max(count, 1.0) - mean;
  float excess = max_component(apart * apart / max(4.0 * variance, vec3(1e-12))) - 1.0;
  return 1.0 / (1.0 / max(samples, 1e-3) + max(excess, 0.0));
}

// The part of 0..1 that is left where t * slope <= room.
void clip(float slope, float room, inout vec2 part)
{
  if (slope > 0.0) {
    part.y = min(part.y, room / slope);
  }
  else if (slope < 0.0) {
    part.x = max(part.x, room / slope);
  }
  else if (room < 0.0) {
    part.y = -1.0;
  }
}

// Whether an object's box is between a place and some point of a lamp: the way to its middle widens towards it.
bool is_between(int box, vec3 position, vec4 lamp)
{
  vec3 here = moved_by(box, position);
  vec3 there = lamp.xyz;
  float reach = lamp.w;
  if (lamp.w < 0.0) {
    float metre = length(moved_by(box, position + lamp.xyz) - here);
    float beyond = 2.0 * (length(here) + 2.0) / max(metre, 1e-20);
    there = position + beyond * lamp.xyz;
    reach = beyond * (-1.0 - lamp.w);
  }
  vec3 way = moved_by(box, there) - here;
  vec2 part = vec2(0.0, 1.0);
  for (int axis = 0; axis < 3; axis++) {
    float wider = reach * length(table(box + axis).xyz);
    clip(way[axis] - wider, 1.0 - here[axis], part);
    clip(-way[axis] - wider, 1.0 + here[axis], part);
  }
  return part.x <= part.y;
}

// Whether what moves may have changed the light that comes straight to a place: it stands or stood before a lamp.
bool may_have_changed(vec3 position, vec3 shift, int moved)
{
  int lamps = int(table(4).x);
  if (table(4).y > 0.0) {
    return true;
  }
  for (int k = 0; k < moved; k++) {
    int box = OBJECTS + TEXELS * k + 3;
    if (max_component(abs(moved_by(box, position))) < 1.0) {
      continue;  // its own shadows move along
    }
    for (int i = 0; i < lamps; i++) {
      vec4 lamp = table(OBJECTS + TEXELS * moved + i);
      vec4 then = (lamp.w < 0.0) ? lamp : vec4(lamp.xyz + shift, lamp.w);
      if (is_between(box, position, lamp) || is_between(box + 3, position + shift, then)) {
        return true;
      }
    }
  }
  return false;
}

// Pictures that bounced light counts for at most beside what moves. n of them have the squared error (n c)^2 by their lag
// and noise / 2n, where c is the share of the hemisphere that a step changes: least at the n below. A sphere of radius r
// that moves by m at the distance d covers 2 r m of d^2 anew and uncovers as much; of its light half differs on average. What
// emits changes all light that others throw on, by any amount.
float most_beside(vec3 position, int moved)
{
  float change = 1e-6;
  for (int k = 0; k < moved; k++) {
    vec4 sphere = table(OBJECTS + TEXELS * k + 9);
    vec4 shifted = table(OBJECTS + TEXELS * k + 10);
    if (shifted.y > 0.5) {
      return most_moved;
    }
    vec3 way = position - sphere.xyz;
    float radius = max(sphere.w, 1e-6);
    change += radius * shifted.x / (PI * max(dot(way, way), radius * radius));
  }
  return pow(draft_noise / (4.0 * change * change), 1.0 / 3.0);
}

vec3 reflected(vec3 light, vec3 color, vec3 fresh)
{
  return vec3((color.r > 1e-3) ? light.r * color.r : fresh.r, (color.g > 1e-3) ? light.g * color.g : fresh.g,
              (color.b > 1e-3) ? light.b * color.b : fresh.b);
}

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec4 new_direct = fresh_direct_fetch(pixel);
  vec4 new_indirect = fresh_indirect_fetch(pixel);
  vec4 position = surface_position_fetch(pixel);
  out_place = out_facing = out_direct = out_indirect = vec4(0.0);
  out_direct_light = new_direct;
  out_indirect_light = new_indirect;
  vec3 color = surface_diffuse_fetch(pixel).rgb;
  if (position.w == 0.0 || !(max_component(color) > 1e-3)) {
    return;
  }
  vec3 normal = octahedral_decode(surface_normal_fetch(pixel).xy);
  float tolerance = 1.5 * pixel_size_at(position.xyz);
  vec3 shift = table(3).xyz;
  Found found;
  found.weight = 0.0;
  vec3 position_then = position.xyz + shift;
  vec3 normal_then = normal;
  int moved = int(table(3).w);
  bool within = false;
  for (int k = 0; k < moved && found.weight == 0.0; k++) {
    int row = OBJECTS + TEXELS * k;
    vec3 inside = moved_by(row + 3, position.xyz);
    if (max_component(abs(inside)) < 1.0) {
      position_then = moved_by(row, position.xyz);
      normal_then = safe_normalize(moved_by(row, position.xyz + normal * tolerance) - position_then);
      found = recall(position_then, normal_then, tolerance);
      within = true;
    }
  }
  if (found.weight == 0.0) {
    position_then = position.xyz + shift;
    normal_then = normal;
    found = recall(position_then, normal_then, tolerance);
  }
  vec3 direct = arriving(new_direct.rgb, color);
  vec3 indirect = arriving(new_indirect.rgb, color);
  vec2 counts = vec2(0.0);
  if (found.weight > 0.0) {
    counts = min(found.counts, vec2(within ? most_moved : most_still));
    counts.y = within ? counts.y : min(counts.y, most_beside(position.xyz, moved));
    counts = min(counts, vec2(table(4).z));
    if (table(4).w > 0.0 || (moved > 0 && may_have_changed(position.xyz, shift, moved))) {
      counts.x = in_time(pixel, found.pixel, position.xyz, position_then, normal, normal_then, tolerance,
                         min(counts.x, most_moved));
    }
    direct = mix(found.direct, direct, 1.0 / (1.0 + counts.x));
    indirect = mix(found.indirect, indirect, 1.0 / (1.0 + counts.y));
    out_direct_light.rgb = reflected(direct, color, new_direct.rgb);
    out_indirect_light.rgb = reflected(indirect, color, new_indirect.rgb);
  }
  counts += 1.0;
  out_place = vec4(position.xyz, counts.x);
  out_facing = vec4(octahedral_encode(normal), counts.y, 0.0);
  out_direct = vec4(direct, 0.0);
  out_indirect = vec4(indirect, 0.0);
}
