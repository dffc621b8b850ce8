// Follows rays to the first surface that each meets, and leaves records of what that is (addon/surfaces/hits.py):
//
//   place      position; w: width of the ray's footprint there, m, 0 where nothing is met
//   triangle   row of the instance, number of the triangle among those of its material, barycentric coordinates of the
//              second and third corner
//   normals    octahedral normal of the triangle by its winding (xy) and shading normal outwards (zw)
//   passed     what the inside of a solid that the ray was in has let pass; w: the density per steradian at which points are
//              drawn on it if it emits, times the power of all (emissive_density)
//   material   its number
//
// Depth: as it was, 0, where there is no ray, as is all else there; 0.5 where one meets nothing, above where one does, by program.
#include "trace/hierarchy.glsl"
#include "trace/own_solid.glsl"
#include "hits/shared.glsl"
#ifdef ABSORBING
vec3 solid_absorbs(int material)
{
  return hit_materials_fetch(ivec2(material & 255, material >> 8)).rgb;
}
#include "trace/solid.glsl"
#endif

vec4 owner_texel(int index)
{
  return trace_owners_fetch(ivec2(index & 2047, index >> 11));
}

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  out_place = vec4(0.0);
  out_triangle = vec4(0.0);
  out_normals = vec4(0.0);
  out_passed = vec4(1.0, 1.0, 1.0, 0.0);
  out_material = 0.0;
  gl_FragDepth = 0.0;
  vec3 direction = ray_direction_fetch(pixel).xyz;
  if (dot(direction, direction) == 0.0) {
    discard;  // after some mirrors most pixels have no ray, and what is not written costs nothing
  }
  vec4 start = ray_origin_fetch(pixel);
  gl_FragDepth = 0.5;
  uvec3 roll = roll_of(pixel, film_view.sample_index, film_view.seed, 61 + ray_number);
  if (start.w < 0.0) {
    start = vec4(beyond_solid(start.xyz, direction, roll.x), -start.w);
  }
  ivec2 hit;
  float t = trace_layers(start.xyz, direction, 1e29, 0.0, roll.x, glass_bends != 0, false, hit);
  out_passed.rgb = layers_color(t);
  if (t >= 1e29) {
    return;
  }
  vec2 along = triangle_place(hit, start.xyz + t * direction);
  vec3 corner;
  vec3 e1;
  vec3 e2;
  triangle_edges(hit, corner, e1, e2);
  // By the plane of the triangle: a long ray's own end lies beside it.
  vec3 position = corner + along.x * e1 + along.y * e2;
  vec3 normal = safe_normalize(cross(e1, e2));
  vec3 shading = triangle_shading_normal(hit, position);
  int material_index = triangle_material(hit);
  vec4 owner = owner_texel((hit.x - first_leaf) * 4 + HIT_SLOT(hit));
#ifdef INSTANCED
  if (HIT_RECORD(hit) != 0) {  // of trees that copies share: the list begins with the rows of all instances
    owner.x = owner_texel(int(node_texel(HIT_RECORD(hit) * NODE_TEXELS + 3).y)).x;
  }
#endif
  out_place = vec4(position, max(start.w + spread * t, 1e-30));
  out_triangle = vec4(owner.xy, along);
  out_normals = vec4(octahedral_encode(normal), octahedral_encode(shading));
  vec3 ignored;
  vec3 emission = triangle_emission(hit, direction, ignored);
  out_passed.w = emissive_density(emission, emissive_level) * t * t / max(abs(dot(normal, direction)), 1e-6);
  vec3 outwards = (dot(normal, shading) < 0.0) ? -normal : normal;
#ifdef ABSORBING
  bool leaves = dot(outwards, direction) > 0.0;
  float offset = max(offset_size, 2e-5 * distance(start.xyz, film_view.eye.xyz));
  out_passed.rgb *= exp(-t * solid_absorption(start.xyz, direction, t, hit, leaves, offset, roll.x));
#endif
  out_material = float(material_index);
  gl_FragDepth = shared_depth(material_index);
}
