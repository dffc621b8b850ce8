// The rotation of what an edited object mirrors or bends, where rays have met it: triangles of one of its materials.
// `hit_layers` holds the distances of the corners of these triangles, in their order, four to a texel.
// `outward`: of a closed object 1 where its triangles' normals point out of it, -1 where into it; 0: it is open.
#include "lib/gbuffer.glsl"
#include "hits/path.glsl"

float distance_layer(int k)
{
#ifdef LAYER_TEXELS
  vec4 record = hit_triangle_fetch(ivec2(gl_FragCoord.xy));
  int first = (int(record.y) - first_number) * (3 * LAYER_TEXELS) + k / 4;
  vec3 corners;
  for (int corner = 0; corner < 3; corner++) {
    int index = first + corner * LAYER_TEXELS;
    corners[corner] = hit_layers_fetch(ivec2(index & 2047, index >> 11))[k & 3];
  }
  return corners.x + record.z * (corners.y - corners.x) + record.w * (corners.z - corners.x);
#else
  return 0.0;
#endif
}

#include "edit/solve.glsl"
#include "edit/lobe.glsl"

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  if (int(hit_triangle_fetch(pixel).x) != instance_row || int(hit_material_fetch(pixel).r + 0.5) != material_number
      || path_is_edited(int(met_path_fetch(pixel).w + 0.5)) || max_component(surface_tint_fetch(pixel).rgb) <= 0.0) {
    discard;  // inside an edited solid its edit is for what leaves
  }
  vec3 towards = -ray_direction_fetch(pixel).xyz;
  if (outward * dot(octahedral_decode(hit_normals_fetch(pixel).xy), towards) < 0.0) {
    discard;
  }
  vec4 q = edit_of_surface(SURFACE_READ(pixel), towards);
  if (dot(q, q) == 0.0) {
    discard;
  }
  out_edit = q;
}
