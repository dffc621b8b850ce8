// A shadow ray of each pixel between towers to a lamp, for the time that it takes (addon/frame/device_probe.py).
#include "trace/hierarchy.glsl"

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  // From the ground of a town to a lamp above one corner, as pixels of a surface ask: neighbours stay together.
  vec3 origin = vec3(gl_FragCoord.xy / float(side), 0.001);
  vec3 lamp = vec3(0.2, 0.3, 1.5) - origin;
  float reach = length(lamp);
  ivec2 hit;
  float through = trace_shadow(origin, lamp / reach, reach, uint(pixel.x + pixel.y * 2048), hit);
  out_color = vec4(through, 0.0, 0.0, 1.0);
}
