// What of a surface's diffuse light enters it elsewhere, of the surfaces that the surface images show (subsurface/image.glsl).
#include "lib/math.glsl"
#include "lib/closure.glsl"
#include "lib/instance.glsl"
#include "generated/material"
#include "surface/fragment.glsl"
#include "subsurface/image.glsl"

// Three numbers in 0..1 in one float, as in lib/gbuffer.glsl.
float pack_albedo(vec3 albedo)
{
  vec3 level = floor(clamp(albedo, vec3(0.0), vec3(1.0)) * 255.0 + 0.5);
  return level.x + 256.0 * (level.y + 256.0 * level.z);
}

void main()
{
  vec4 hit = surface_position_fetch(ivec2(gl_FragCoord.xy));
  Instance instance;
  SurfacePoint point = fragment_point(instance);
  // Interpolated positions of one point differ by some units of the last place between two programs.
  float tolerance = 2e-6 * (length(hit.xyz - film_view.eye.xyz) + length(hit.xyz));
  // Where means over a material are drawn, all that it has is shown: w is below 0, as that of no surface (bump_encode).
  if (hit.w == 0.0 || (hit.w > 0.0 && distance(hit.xyz, point.position) > tolerance)) {
    discard;
  }
  point.refracts = glass_bends != 0;
  Closures c = closures_begin(point.normal, 0.5, 0.0);
  evaluate_material(point, c);
  closures_end(c);
  vec4 sides = scatter_objects_fetch(ivec2(instance_flat.x & 2047, instance_flat.x >> 11));
  int object = int((point.backfacing ? sides.y : sides.x) + 0.5);
  float most = max_component(c.scatter);
  if (object == 0 || !(most > 0.0)) {
    discard;
  }
  vec3 weight = max(c.scatter, vec3(1e-20));
  vec3 part = c.scatter / max(c.diffuse, vec3(1e-20));
  out_length = vec4(c.scatter_length / weight * c.map_length, pack_albedo(c.scatter_color / weight));
  out_share = vec4(clamp(part, vec3(0.0), vec3(1.0)), scatter_code(object, c.scatter_method, c.scatter_entry));
  bool finite = is_finite(c.map_entry.x + c.map_entry.y + c.map_entry.z + c.map_entry.w);
  out_walk = vec4(c.scatter_alpha, c.scatter_ior, 0.0, 0.0);
  out_entry = finite ? c.map_entry : vec4(1.0);
}
