// The list of the pixels that look a light's visibility up themselves (addon/frame/lists.py).
#include "light/looks_itself.glsl"
#include "lib/entry_list.glsl"

void main()
{
  ivec2 pixel = ivec2(gl_GlobalInvocationID.xy);
  if (all(lessThan(pixel, surface_position_size())) && looks_itself(pixel, light_index)) {
    int index = int(imageAtomicAdd(entry_count, ivec2(0), 1u));
    imageStore(entries, entry_place(index), uvec4(uint(pixel.x) | (uint(pixel.y) << 16)));
  }
}
