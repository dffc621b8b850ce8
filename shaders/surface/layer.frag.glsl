// The farthest layer that this sample passes before what the surface images show: where it lies, its colour over what
// lies behind it (see tint.frag.glsl) and what it emits (see glow.frag.glsl). Drawn with the farthest depth kept, again
// and again before what was found last, it takes layers apart from back to front; w -1 says that none is left.
#include "lib/math.glsl"
#include "lib/closure.glsl"
#include "lib/instance.glsl"
#include "generated/material"
#include "surface/fragment.glsl"
#include "surface/layer.glsl"

void main()
{
  out_position = vec4(0.0, 0.0, 0.0, -1.0);
  out_tint = vec4(1.0);
  out_emission = vec4(0.0);
  Instance instance;
  SurfacePoint point = fragment_point(instance);
  if (surface_position_fetch(ivec2(gl_FragCoord.xy)).w < 0.0 || fragment_hidden(point.position, -1.0)) {
    discard;
  }
  Closures c;
  vec3 color;
  bool colored = layer_color(point, instance, c, color);
  out_position = vec4(point.position, 1.0);
  out_tint = vec4(colored ? color : vec3(1.0), 1.0);
  out_emission = vec4((instance.flags & FLAG_HOLDOUT) != 0 ? vec3(0.0) : c.emission, 0.0);
}
