// Group of receivers of the object that each pixel shows, of instance numbers in NUMBER (x … w) of `surface_object`.
#include "lib/instance.glsl"

void main()
{
  int id = int(surface_object_fetch(ivec2(gl_FragCoord.xy)).NUMBER + 0.5);
  out_group = instance_receiver_group(id);
}
