// Where a surface is seen a frame before and after. The motion table holds the rows x, y, w of the projections now, before
// and after, and from MOTION_FIRST on for each instance two maps: from where a point is now to where it was (three rows),
// the same of differences in its object's space, and both for where it will be.
#define MOTION_FIRST 9
#define MOTION_STRIDE 12

vec4 motion_texel(int k)
{
  return motion_table_fetch(ivec2(k & 2047, k >> 11));
}

vec3 motion_mapped(int first, vec4 point)
{
  return vec3(dot(motion_texel(first), point), dot(motion_texel(first + 1), point), dot(motion_texel(first + 2), point));
}

// Place in the picture, in pixels; w 0 where it lies behind the camera.
vec3 motion_seen(int camera, vec3 position)
{
  vec4 point = vec4(position, 1.0);
  float w = dot(motion_texel(3 * camera + 2), point);
  vec2 place = vec2(dot(motion_texel(3 * camera), point), dot(motion_texel(3 * camera + 1), point));
  return (w > 1e-12) ? vec3(0.5 * film_view.film.xy * place / w, 1.0) : vec3(0.0);
}

// From the place now to that before, and from that after to the place now, in pixels: Cycles' convention. `before`,
// `after`: how much farther in the object's space the point was and will be.
vec4 motion_vector(vec3 position, int instance, vec3 before, vec3 after)
{
  int first = MOTION_FIRST + MOTION_STRIDE * instance;
  vec3 was = motion_mapped(first, vec4(position, 1.0)) + motion_mapped(first + 3, vec4(before, 0.0));
  vec3 will_be = motion_mapped(first + 6, vec4(position, 1.0)) + motion_mapped(first + 9, vec4(after, 0.0));
  vec3 now = motion_seen(0, position);
  vec3 seen_before = motion_seen(1, was);
  vec3 seen_after = motion_seen(2, will_be);
  return vec4((seen_before.xy - now.xy) * (now.z * seen_before.z), (now.xy - seen_after.xy) * (now.z * seen_after.z));
}
