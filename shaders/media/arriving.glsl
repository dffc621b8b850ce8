// Light that reaches a place in media, or a surface, from a point of a row of lights or from the world, and goes on.
//
// First what would arrive if nothing were in the way (Asked), then one ray through surfaces and media for whatever was
// asked: rays are most of a program, so that it holds them once.
#include "trace/rays.glsl"
#include "media/bins.glsl"
#include "light/sources.glsl"
#ifdef WORLD_LIT
#include "lib/environment.glsl"
#define ROWS_ASKED (light_count + 1)  // the last one is the world, by rays along the phase function
#else
#define ROWS_ASKED light_count
#endif

struct Asked {
  vec3 direction;
  float reach;
  bool shadow;
  bool glass_stops;  // what glass lets pass of it arrives as beams
  vec3 found;
};

Asked ask_nothing()
{
  Asked asked;
  asked.direction = vec3(0.0, 0.0, 1.0);
  asked.reach = 0.0;
  asked.shadow = false;
  asked.glass_stops = false;
  asked.found = vec3(0.0);
  return asked;
}

// A row of lights, before any phase function or cosine. `density`: per steradian.
Asked ask_light(Light light, vec3 position, out float density)
{
  Asked asked;
  asked.found = light_sample(light, position, asked.direction, density);
  asked.reach = light_distance(light, position, asked.direction);
  asked.shadow = (light.flags & LIGHT_SHADOW) != 0;
  asked.glass_stops = glass_blocks != 0 && light.kind < LIGHT_DIRECTION;
  return asked;
}

// Light of row `number` that media at a place scatter on along `onwards`, per metre.
Asked ask_scattered(int number, uint inside, vec3 position, vec3 onwards, vec2 u, uint salt)
{
#ifdef WORLD_LIT
  float g = media_lobe(inside, position, salt);
  if (number >= light_count) {
    Asked asked;
    asked.direction = -phase_direction(g, onwards, u);
    asked.reach = 1e29;
    asked.shadow = true;
    asked.glass_stops = false;
    float lobe = phase_henyey_greenstein(g, dot(-asked.direction, onwards));
    float rows = world_rows * environment_density(asked.direction);
    asked.found = environment_radiance(asked.direction) / max(rows + lobe, 1e-30);  // balance heuristic
    asked.found *= media_scattered(inside, position, -asked.direction, onwards, salt);
    return asked;
  }
#endif
  Light light = light_read(number);
  float density;
  Asked asked = ask_light(light, position, density);
  asked.found *= media_scattered(inside, position, -asked.direction, onwards, salt);
#ifdef WORLD_LIT
  if (LIGHT_IS(light, LIGHT_DIRECTION)) {
    float lobe = phase_henyey_greenstein(g, dot(-asked.direction, onwards));
    asked.found *= world_rows * density / max(world_rows * density + lobe, 1e-30);
  }
#endif
  return asked;
}

// What of it comes through surfaces and media.
vec3 asked_arriving(Asked asked, vec3 position, uint salt)
{
  if (!(max_component(abs(asked.found)) > 0.0)) {
    return vec3(0.0);
  }
  float clear = 1.0;
  if (asked.shadow) {
    ivec2 hit;
    float until = asked.reach * 0.9999;
    clear = (trace_layers(position, asked.direction, until, until, salt, asked.glass_stops, true, hit) >= until) ? 1.0 : 0.0;
  }
  if (clear <= 0.0) {
    return vec3(0.0);
  }
  return asked.found * media_transmittance(position, asked.direction, min(asked.reach, FARTHEST_MEDIUM), salt + 7u);
}
