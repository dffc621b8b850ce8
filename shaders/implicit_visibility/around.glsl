// Around receivers: eight sides in the frame of orthonormal_basis(normal).
#define AROUND_SIDES 8
#define AROUND 3.0  // radii that are looked at
#define RISE 0.35   // slope of the rays: what is lower hides nothing
#define LIFTED 0.02

// How much of what a receiver knows holds at a place that lies `off` from it: 0 where something stands in between.
float seen_around(vec4 sides_a, vec4 sides_b, vec3 normal, vec3 off, float radius)
{
  vec3 tangent;
  vec3 bitangent;
  orthonormal_basis(normal, tangent, bitangent);
  vec2 along = vec2(dot(off, tangent), dot(off, bitangent));
  float range = length(along);
  float place = ((range > 0.0) ? atan(along.y, along.x) : 0.0) * (float(AROUND_SIDES) / (2.0 * PI)) + float(AROUND_SIDES);
  int side = int(floor(place));
  float share = place - floor(place);
  int first = side & (AROUND_SIDES - 1);
  int second = (side + 1) & (AROUND_SIDES - 1);
  float one = (first < 4) ? sides_a[first] : sides_b[first - 4];
  float two = (second < 4) ? sides_a[second] : sides_b[second - 4];
  float inverse = mix(one, two, share);
  return clamp((1.0 - range * inverse) * 10.0, 0.0, 1.0);
}
