// Places where light enters objects, as records of splats (lighting/splatted_light.py):
//
//   point  xyz; w: the object's number from 1 on, and as a fraction half of how translucent the surface is there; 0: none
//   flux   rgb, W, what enters there; w: radius within which it leaves, m
//
// A program that includes this binds `scatter_means`, `scatter_objects` and `splat_objects` and writes out_point and out_flux.
#include "lib/closure.glsl"
#include "subsurface/image.glsl"
#include "subsurface/dipole.glsl"
#include "subsurface/objects.glsl"

// Number of the box of objects that lamps see this one in; below 0: none, all its light is that of points.
float box_of(int object)
{
  return splat_objects_fetch(ivec2((object - 1) & 2047, (object - 1) >> 11)).y;
}

// `cosine`: of the light to the surface's normal; below 0: light from many sides, of which a dielectric reflects the mean.
void enters(vec3 place, vec3 flux, float cosine, int object, int material, vec4 painted)
{
  ivec2 at = ivec2(material & 15, material >> 4);
  int rows = scatter_means_size().y / 3;
  vec4 length_m = scatter_means_fetch(at);
  vec4 color = scatter_means_fetch(at + ivec2(0, rows));
  vec4 share = scatter_means_fetch(at + ivec2(0, 2 * rows));
  if (!(max_component(share.rgb) > 0.0)) {
    return;
  }
  vec4 voxels = object_texel(first_object + OBJECT_TEXELS * (object - 1) + 2);
  float size = object_texel(first_object + OBJECT_TEXELS * (object - 1) + 1).w * length(voxels.xyz);
  Dipole profile = dipole_of(length_m.w < 0.5, length_m.xyz, color.rgb, share.w);
  float enters = (cosine < 0.0) ? 1.0 - fresnel_average_dielectric(share.w) : 1.0 - fresnel_dielectric(cosine, share.w);
  out_point = vec4(place, float(object) + 0.5 * clamp(painted.w, 0.0, 1.0));
  out_flux = vec4(flux * enters, min(dipole_range(profile), size));
}
