// Places at which a material's displacement is asked, one a texel of a list (addon/scene/displacement.py).
#include "lib/instance.glsl"
#include "generated/attributes"

void main()
{
  Instance instance = instance_read(0);
  world_position = instance_position(instance, position);
  world_normal = instance_normal(instance, normal);
  normal_heights = vec3(0.0);
  instance_flat = ivec2(0, instance.mirrored ? 1 : 0);
  copy_attributes();
  vec2 texel = vec2(float(number & 2047), float(number >> 11)) + 0.5;
  gl_Position = vec4(texel / list_size * 2.0 - 1.0, 0.5, 1.0);
  gl_PointSize = 1.0;
}
