// A ray from a point in clear solid glass through its faces, mirrored by Fresnel's reflectance. A program that includes this binds
// the hierarchy and `glass_indices`, has `offset_size`, and defines before:
//
//   ray_leaves(share, place, outwards, direction, index, faces)  the share leaves at `place` of a face along `direction`, after
//                                                      the ray has been mirrored by `faces` others
//   ray_stays(share, hit, met, direction, faces)       that share meets what stands in the glass; with no faces before, the
//                                                      glass is not around the point
#define FACES 12  // that a ray is mirrored by

// Index of refraction of a material that is clear glass and nothing else; 0 of others, and of a single sheet: of light below
// that its own code lets pass what comes in.
float glass_index(ivec2 hit)
{
  if (triangle_is_sheet(hit)) {
    return 0.0;
  }
  int material = triangle_material(hit);
  return glass_indices_fetch(ivec2(material & 2047, material >> 11)).x;
}

void follow_in_glass(vec3 origin, vec3 direction, uint salt)
{
  float left = 1.0;
  for (int faces = 0; faces < FACES; faces++) {
    ivec2 hit;
    float t = trace_layers(origin, direction, 1e29, 0.0, salt, true, false, hit);
    vec3 met = origin + t * direction;
    float n = (hit.x >= 0) ? glass_index(hit) : 0.0;
    vec3 normal = (hit.x >= 0) ? triangle_shading_normal(hit, met) : direction;
    float cosine = dot(normal, direction);
    if (n <= 0.0 || cosine <= 0.0) {
      ray_stays(left, hit, met, direction, faces);
      return;
    }
    float mirrored = fresnel_dielectric(cosine, 1.0 / n);
    ray_leaves(left * (1.0 - mirrored), met, normal, refract(direction, -normal, n), n, faces);
    left *= mirrored;
    direction = safe_normalize(direction - 2.0 * cosine * normal);
    origin = met - ray_offset(met) * normal;
    if (left < 1e-3) {
      return;
    }
  }
}
