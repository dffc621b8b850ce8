// Edges between a floor and a lamp, asked for 64 points of the lamp as edges/depth_complexity.comp.glsl asks them, for the time
// that it takes (addon/frame/device_probe.py). `side`: pixels along each side.
bool lies_before(float n_centre, vec2 normal, vec2 k0, vec2 k1, vec2 place)
{
  return ((n_centre + dot(normal, place) >= 0.0) != (n_centre >= 0.0))
         && ((dot(k0, place) >= 0.0) != (dot(k1, place) >= 0.0));
}

void main()
{
  vec3 p = vec3(gl_FragCoord.xy / float(side), 0.0);
  vec3 c = vec3(0.5, 0.5, 1.0) - p;
  vec3 half_u = vec3(0.1, 0.0, 0.0);
  vec3 half_v = vec3(0.0, 0.1, 0.0);
  uvec2 hidden = uvec2(0u);
  for (int k = 0; k < EDGES; k++) {
    vec3 a = edge_records_fetch(ivec2(2 * k, 0)).xyz - p;
    vec3 b = edge_records_fetch(ivec2(2 * k + 1, 0)).xyz - p;
    vec3 n = cross(a, b);
    float n_centre = dot(n, c);
    if (abs(n_centre) > 0.141 * length(n)) {
      continue;
    }
    vec3 first = cross(a, c);
    vec3 second = cross(b, c);
    vec2 normal = vec2(dot(n, half_u), dot(n, half_v));
    vec2 k0 = vec2(dot(first, half_u), dot(first, half_v));
    vec2 k1 = vec2(dot(second, half_u), dot(second, half_v));
    for (int j = 0; j < 32; j++) {
      vec4 pair = light_pattern_fetch(ivec2(j, 0));
      uint found = (lies_before(n_centre, normal, k0, k1, pair.xy) ? 1u : 0u)
                   | (lies_before(n_centre, normal, k0, k1, pair.zw) ? 2u : 0u);
      found <<= uint((2 * j) & 31);
      hidden ^= (j < 16) ? uvec2(found, 0u) : uvec2(0u, found);
    }
  }
  out_color = vec4(float(bitCount(hidden.x) + bitCount(hidden.y)) / 64.0, 0.0, 0.0, 1.0);
}
