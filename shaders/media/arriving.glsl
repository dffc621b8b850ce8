// Light that reaches a place in media, or a surface, from a point of a row of lights or from the world, and goes on.
//
// First what would arrive if nothing were in the way (Asked), then one ray through surfaces and media for whatever was
// asked: rays are most of a program, so that it holds them once.
#include "trace/rays.glsl"
#include "media/asking.glsl"

// What of it comes through surfaces and media.
vec3 asked_arriving(Asked asked, vec3 position, uint salt)
{
  if (!(max_component(abs(asked.found)) > 0.0)) {
    return vec3(0.0);
  }
  vec3 clear = vec3(1.0);
  if (asked.shadow) {
    ivec2 hit;
    float until = asked.reach * 0.9999;
    bool passes = trace_layers(position, asked.direction, until, until, salt, asked.glass_stops, true, hit) >= until;
    clear = passes ? layers_color(until) : vec3(0.0);
  }
  if (max_component(clear) <= 0.0) {
    return vec3(0.0);
  }
  return asked.found * clear * media_transmittance(position, asked.direction, min(asked.reach, FARTHEST_MEDIUM), salt + 7u);
}
