// Points of surfaces that are known beforehand, as records of hits (hits/trace.frag.glsl).
#include "hits/shared.glsl"

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec4 material = point_material_fetch(pixel);
  out_place = point_place_fetch(pixel);
  out_triangle = point_triangle_fetch(pixel);
  out_normals = point_normals_fetch(pixel);
  out_passed = vec4(1.0, 1.0, 1.0, 0.0);
  out_material = material.x;
  gl_FragDepth = (material.y > 0.5) ? shared_depth(int(material.x + 0.5)) : 0.0;
}
