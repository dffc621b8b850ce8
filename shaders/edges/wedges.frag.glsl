// An edge adds its weight to the counters of the light's points that it hides from a pixel's receiver: predicates as in
// edges/depth_complexity.comp.glsl, counters in digits of base 64.
#include "lib/math.glsl"
#include "edges/light.glsl"
#include "edges/edge_record.glsl"
#include "edges/samples.glsl"

// Digits of points `first` to first + 3.
float hidden_digits(int first, bool side, float n_centre, vec2 normal, vec2 k0, vec2 k1, vec2 q, int own_pattern)
{
  float digits = 0.0;
  for (int j = 3; j >= 0; j--) {
    int k = first + j;
    vec4 pair = light_pattern_fetch(ivec2(k >> 1, own_pattern));
    vec2 place = ((k & 1) == 0) ? pair.xy : pair.zw;
    bool hidden = ((n_centre + dot(normal, place) >= 0.0) != side) && ((dot(k0, place) >= 0.0) != (dot(k1, place) >= 0.0))
                  && ((dot(q, place) >= 0.0) == side);
    digits = 64.0 * digits + (hidden ? 1.0 : 0.0);
  }
  return digits;
}

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec4 receiver = receivers_fetch(pixel);
  out_a = vec4(0.0);
  out_b = vec4(0.0);
  out_c = vec4(0.0);
  out_d = vec4(0.0);
  if (receiver.w == 0.0) {
    return;
  }
  int own_pattern = pattern_of(pixel);
  vec3 p = receiver.xyz;
  vec3 c = towards_centre(p);
  LightFrame f = light_frame(c);
  vec3 half_u;
  vec3 half_v;
  light_axes(f, half_u, half_v);
  int record = 4 * int(flat_edge + 0.5);
  vec4 v0 = edge_texel(record);
  vec4 v1 = edge_texel(record + 1);
  vec3 a = v0.xyz - p;
  vec3 b = v1.xyz - p;
  vec3 n = cross(a, b);
  float n_centre = centre_side(a, b, c);
  int weight = edge_weight(record, v0, v1, p);
  if (abs(n_centre) > edge_light.size.x * length(n) || weight == 0) {
    return;
  }
  vec3 end0 = cross(a, c);
  vec3 end1 = cross(b, c);
  vec3 across = cross(v1.xyz - v0.xyz, light_at_infinity() ? c : edge_light.centre.xyz - v0.xyz);
  vec2 normal = vec2(dot(n, half_u), dot(n, half_v));
  vec2 k0 = vec2(dot(end0, half_u), dot(end0, half_v));
  vec2 k1 = vec2(dot(end1, half_u), dot(end1, half_v));
  vec2 q = vec2(dot(across, half_u), dot(across, half_v));
  bool side = n_centre >= 0.0;
  float change = float(side ? weight : -weight);
  for (int k = 0; k < 64; k += 16) {
    vec4 digits = vec4(0.0);
    digits.x = hidden_digits(k, side, n_centre, normal, k0, k1, q, own_pattern);
    digits.y = hidden_digits(k + 4, side, n_centre, normal, k0, k1, q, own_pattern);
    digits.z = hidden_digits(k + 8, side, n_centre, normal, k0, k1, q, own_pattern);
    digits.w = hidden_digits(k + 12, side, n_centre, normal, k0, k1, q, own_pattern);
    digits *= change;
    if (k == 0) {
      out_a = digits;
    }
    else if (k == 16) {
      out_b = digits;
    }
    else if (k == 32) {
      out_c = digits;
    }
    else {
      out_d = digits;
    }
  }
}
