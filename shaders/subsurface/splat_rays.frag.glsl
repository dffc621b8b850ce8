// What a lamp's view sees of objects below which light scatters: where the light of a texel enters, and how much
// (subsurface/flux.glsl). `film_view` is the lamp's view of the box `group_seen` of objects: others have views of their own. A ray
// to a texel takes the place of a raster, so that all that blocks light does, or colours it.
#include "ask/view.glsl"
#include "lib/gbuffer.glsl"
#include "light/sources.glsl"
#include "subsurface/walks.glsl"
#include "subsurface/flux.glsl"
#include "caustics/emission.glsl"

void main()
{
  out_point = vec4(0.0);
  out_flux = vec4(0.0);
  vec3 origin = view_origin(gl_FragCoord.xy);
  vec3 way = view_direction(gl_FragCoord.xy);
  ivec2 hit;
  uint salt = hash3(uvec3(uvec2(gl_FragCoord.xy), uint(film_view.sample_index))).x;
  float t = trace_layers(origin, way, 1e29, 0.0, salt, opaque_glass != 0, true, hit);
  if (t >= 1e29) {
    return;
  }
  vec3 normal = triangle_normal(hit);
  bool behind = dot(normal, way) > 0.0;
  int object = object_behind(instance_of(hit), behind);
  if (object == 0 || int(box_of(object)) != group_seen) {
    return;
  }
  normal = behind ? -normal : normal;
  vec3 place = origin + t * way;
  vec3 direction;
  float away;
  float area;
  vec3 flux = texel_flux(place, direction, away, area) * layers_color(t);
  int listed = first_object + OBJECT_TEXELS * (object - 1);
  int cell = cell_near(place, normal, object_texel(listed + 1), object_texel(listed + 2));
  vec4 painted = (cell >= 0) ? point_entry_fetch(ivec2(cell & (ROW - 1), cell / ROW)) : vec4(1.0);
  enters(place, flux * painted.rgb, clamp(-dot(normal, way), 0.0, 1.0), object, triangle_material(hit), painted);
}
