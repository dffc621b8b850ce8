// A hit as a diffuse surface of one colour, for materials whose own program has no room for a record.
#include "lib/math.glsl"
#include "lib/random.glsl"
#include "lib/gbuffer.glsl"
#include "lib/instance.glsl"

void fill_attributes(inout SurfacePoint point, Instance instance, vec4 record)
{
}

#include "hits/point.glsl"
#include "surface/store.glsl"

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  int id = int(hit_triangle_fetch(pixel).x);
  SurfacePoint point = hit_point(pixel, instance_read(id), id);
  Closures c = closures_begin(point.normal, 0.5, 0.0);
  closure_diffuse(c, vec3(1.0), reflectance_fetch(ivec2(material_number & 15, material_number >> 4)).rgb, 0.0, point.normal);
  closures_end(c);
  store_closures(c, point, 1.0, 0.0, vec2(0.0));
}
