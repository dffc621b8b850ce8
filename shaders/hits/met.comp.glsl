// Which materials rays have met: a flag for each; and in the second half of the image one for each program.
#include "hits/shared.glsl"

void main()
{
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  ivec2 size = hit_place_size();
  if (pixel.x >= size.x || pixel.y >= size.y) {
    return;
  }
  vec4 ray = rays_fetch(pixel);
  if (dot(ray, ray) == 0.0 || hit_place_fetch(pixel).w == 0.0) {
    return;
  }
  int material_index = int(hit_material_fetch(pixel).r + 0.5);
  imageStore(met, ivec2(material_index & 255, material_index >> 8), uvec4(1u));
  int leader = shared_leader(material_index);
  imageStore(met, ivec2(leader & 255, (leader >> 8) + imageSize(met).y / 2), uvec4(1u));
}
