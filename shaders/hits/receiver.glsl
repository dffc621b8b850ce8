// What a ray of a pixel has met, which light is to reach that is sent on along the ray, and where that light is added.
#include "indirect/path.glsl"
#ifdef TRANSMISSION
#include "lib/refraction.glsl"
#endif
#include "hits/shown.glsl"
#include "hits/onward.glsl"

struct Receiver {
  Surface surface;
  vec3 viewer;
  bool shines;     // has a lobe of microfacets that light samples can find
  bool bends;
  bool within;     // glass mirrors, whose rays bend where light samples would pass straight
  bool followed;   // by a ray
  bool turned;     // by an edit where it leaves glass: rays alone find what is there
  bool ended;      // would be, but for the number of bounces: shows nothing
  int group;       // of receivers
  int mirrored;    // by so many surfaces on the way to the camera
  vec3 passed;     // what the way to the camera leaves of what it sends
  int code;        // of the ray's path
  bool in_glass;   // light_left counts what glass around mirrors back of what it sends
  Lobe lobe;
#ifdef TRANSMISSION
  Interface glass;
#endif
};

// False where the pixel's ray has met nothing.
bool receiver_at(ivec2 pixel, out Receiver r)
{
  vec4 path = met_path_fetch(pixel);
  int code = int(path.w + 0.5);
  if (code == 0 || surface_position_fetch(pixel).w == 0.0) {
    return false;
  }
  r.passed = path.rgb * hit_passed_fetch(pixel).rgb;
  r.code = code;
  r.surface = SURFACE_READ(pixel);
  r.viewer = -ray_direction_fetch(pixel).xyz;
#ifdef HAS_RECEIVER_GROUPS
  r.group = int(receiver_groups_fetch(pixel).x + 0.5);
#endif
  bool has_lobe = max_component(r.surface.glossy_weight) > 0.0;
#ifdef TRANSMISSION
  r.bends = has_lobe && r.surface.kind == LOBE_REFRACTION;
#else
  r.bends = false;
#endif
  r.shines = has_lobe && r.surface.kind <= FRESNEL_F82;
  r.mirrored = path_mirrors(code);
  bool goes_on = lobe_goes_on(r.surface);
  r.in_glass = false;
  r.within = mirrors_within(r.surface);
  r.followed = has_lobe && goes_on && ray_number + 1 < rays
               && (r.bends ? ray_number < interfaces : r.mirrored < mirrors);
  r.turned = path_is_edited(code) && r.bends && r.surface.glossy_ior <= 1.0;
  r.ended = has_lobe && goes_on && !r.followed;
  r.lobe = lobe_begin(r.surface, r.viewer);
  r.shines = r.shines && !lobe_is_mirror(r.lobe);
#ifdef TRANSMISSION
  r.glass = interface_met(r.surface, r.viewer, r.mirrored < mirrors);
#endif
  return true;
}

uvec3 receiver_roll(ivec2 pixel)
{
  return roll_of(pixel, film_view.sample_index, film_view.seed, 101 + ray_number);
}

// Light from below the surface, which takes the place of what a diffuse one would send: what is sent, and the colours by
// which light straight from sources, and that of other surfaces, is reflected.
vec3 light_left(inout Receiver r, uint salt, out vec3 straight, out vec3 onward)
{
  vec3 diffuse = r.surface.diffuse;
  vec3 sent;
  vec3 part;
  vec3 same;
  bool leaves = max_component(diffuse) > 0.0
                && light_leaves(-1, r.surface.position, r.surface.geometric_normal, r.viewer, salt, sent, part, same, r.in_glass);
  straight = leaves ? diffuse * (vec3(1.0) - part) : diffuse;
  onward = leaves ? diffuse * (vec3(1.0) - part * (vec3(1.0) - same)) : diffuse;
  return leaves ? diffuse * part * sent : vec3(0.0);
}

void show_sent(Receiver r, vec3 sent)
{
  vec3 light = r.passed * sent;
  show_light(r.code, vec4(0.0), vec4(is_finite(max_component(abs(light))) ? light : vec3(0.0), 0.0));
}
