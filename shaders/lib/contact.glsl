// What stands closer to a receiver than a depth map can tell, by short rays to points of the light.
//
// A texel knows one plane: along the line where two surfaces meet it holds either the receiver or the blocker, and of two
// wires that touch the light's middle sees one. Rays see both. They end where blockers cast penumbrae that the map
// resolves, so that they meet few boxes of the hierarchy, and their noise stays within some texels of a contact.
// Casters with alpha are left to the map, which chose at random for them.
#include "trace/bundle.glsl"
#include "trace/rays.glsl"

#define CONTACT_SHARE 0.06  // length of the rays beside what the map spans at the receiver

// A point of what the map stands for: all of the light or a part around the map's point. `place` in [0, 1)^2.
Light contact_point(Light light, vec2 place, float share, vec3 position)
{
  vec2 square = 2.0 * place - 1.0;
  float turn = 2.0 * PI * place.x;
  vec2 disc = sqrt(place.y) * vec2(cos(turn), sin(turn));
  if (LIGHT_IS(light, LIGHT_RECTANGLE) || LIGHT_IS(light, LIGHT_ELLIPSE) || LIGHT_IS(light, LIGHT_SURFACE)) {
    vec2 within = (LIGHT_IS(light, LIGHT_RECTANGLE) ? square : disc) * share;
    light.point += within.x * light_u(light) + within.y * light_v(light);
    return light;
  }
  bool sun = LIGHT_IS(light, LIGHT_SUN);
  vec3 axis = sun ? light.point : safe_normalize(light.centre - position);
  vec3 u;
  vec3 v;
  orthonormal_basis(axis, u, v);
  vec3 offset = (disc.x * u + disc.y * v) * share;
  light.point = sun ? safe_normalize(axis + offset * tan(min(light.radius, 1.5))) : light.point + offset * light.radius;
  return light;
}

float contact_reach(ShadowReceiver r)
{
  float across = length(sources.view[r.view * VIEW_TEXELS].xyz);
  float along = length(sources.view[r.view * VIEW_TEXELS + 1].xyz);
  return CONTACT_SHARE * 2.0 * r.w / max(min(across, along), 1e-30);
}

// Visibility past what the map sees (`lit`) and what `rays` rays see (`near`); `same`: both see the same blockers. Of few
// rays the share that passes is noise around the truth, which the map's answer moderates; where none passes, the map
// missed what hides the light. Single rays are as many as the samples: their mean has no noise to speak of.
#define CONTACT_PULL 0.5  // rays that the map's answer stands for
#define CONTACT_APART 0.4  // share of near blockers beside the light that farther ones hide, not within it

float contact_combined(float lit, float near, float rays, bool same)
{
  if (near <= 0.0) {
    return 0.0;
  }
  float told = (contact_rays > 1) ? mix(lit, near, rays / (rays + CONTACT_PULL)) : near;
  // Different blockers hide min(lit, near) of the light where one lies within the other, and lit * near by chance.
  return same ? told : mix(min(lit, told), lit * near, CONTACT_APART);
}

// What passes of the share `lit` that reaches the receiver past blockers at the mean height `blocker` (in q, 0 = none were
// found): up to contact_rays rays look for casters near it, more than four only where those disagree. `towards`: the
// direction to the map's point.
float contact_visibility(Light light, ShadowReceiver r, ivec2 pixel, vec3 position, vec3 normal, vec3 towards, float lit,
                         float blocker)
{
  float reach = contact_reach(r);
  if (ray_offset(position) > 0.1 * reach) {
    return lit;  // beside so large a scene rays would start beyond what they look for
  }
  vec3 origin = ray_origin(position, normal);
  // The same random numbers for all lights, so that two half lights are one.
  uvec3 salt = roll_of(pixel, film_view.sample_index, film_view.seed, 19);
  float open = 0.0;
  float all = 0.0;
  int sent = 0;
  while (sent < contact_rays) {
    mat4 rays = mat4(0.0);
    vec4 weights = vec4(0.0);
    uint asked = 0u;
    for (int j = 0; j < 4; j++) {  // also of the single ray: a number of turns that is not known costs more
      vec2 place = vec2(scrambled(int(reverse_bits(uint(sent))), salt.x), scrambled(int(second_bits(uint(sent))), salt.y));
      Light source = contact_point(light, place, r.rectangle.w, position);
      vec3 direction;
      float density;
      vec3 arriving = light_sample(source, position, direction, density);
      float weight = max_component(abs(arriving)) * dot(direction, normal);
      if (weight > 0.0 && sent < contact_rays) {
        weights[j] = weight;
        rays[j] = vec4(direction, min(reach, 0.9999 * light_distance(source, origin, direction)));
        asked |= 1u << uint(j);
      }
      sent++;
    }
    uint clear = clear_bundle(origin, rays, asked);
    all += dot(weights, vec4(1.0));
    open += dot(weights, vec4((uvec4(clear) >> uvec4(0u, 1u, 2u, 3u)) & 1u));
    if (open <= 0.0 || open >= all) {
      break;
    }
  }
  if (all <= 0.0) {
    return lit;
  }
  bool same = blocker > 0.0 && shadow_distance(r.view, position, towards, r.q + blocker) < reach;
  return contact_combined(lit, open / all, float(sent), same);
}
