// Which part of a pixel's light below its surface random walks find, and where places lie in the picture. A program that includes
// this binds `film_view`, `scatter_objects` and `surface_position`.
#include "ask/view.glsl"
#include "subsurface/objects.glsl"

#define DEEP 4.0
#define DEEPER 12.0
#define FINE 0.5
#define COARSEST 0.1

float pixel_width_at(vec3 position)
{
  return view_pixel() * view_growth_ahead(position);
}

bool pixel_seen(vec3 place, out ivec2 pixel)
{
  vec2 share;
  pixel = ivec2(0);
  if (!view_place(place, share)) {
    return false;
  }
  ivec2 size = surface_position_size();
  pixel = ivec2(floor(share * vec2(size)));
  return all(greaterThanEqual(pixel, ivec2(0))) && all(lessThan(pixel, size));
}

// Whether points of the object know more of the light than pixels do.
bool points_tell(float reach, vec4 object, float width, bool lit)
{
  return reach > max(RANGE * object.z, 2.0 * width) && object.y > 0.5 && lit;
}

// Up to where pixels tell the light that walks leave by, m: few pixels' widths at least, in which no cell is known better.
float window_of_walks(vec4 object, float width)
{
  return max(RANGE * object.z, 3.0 * width);
}

// All of it where the object is less deep than DEEP times the mean distance at which light leaves, none where it is DEEPER: there
// a plane's profile errs by less than walks do (docs/subsurface.md). None either where little of the profile, at most a
// hundredth, lies beyond the window of pixels and the object.
float walked_part(Profile profile, vec4 object, float width, float depth)
{
  if (!points_tell(profile_reach(profile), object, width, true)) {
    return 0.0;
  }
  vec3 away = profile.share1 * profile.scale1 + profile.share2 * profile.scale2 + profile.share3 * profile.scale3;
  float beyond = smoothstep(0.0, 0.01, max_component(vec3(1.0) - profile_near(profile, min(window_of_walks(object, width), depth))));
  float fine = clamp(FINE * max_component(away) / object.z, COARSEST, 1.0);
  return beyond * (1.0 - smoothstep(DEEP * fine, DEEPER * fine, depth / max_component(away)));
}

// Whether what leaves a surface that faces along `facing` counts as on the side on which a walk entered, of which pixels tell the
// light: what faces away from the viewer behind a rim is seen in none.
float side_of_walk(vec3 facing, vec3 entered, vec3 to_viewer)
{
  return smoothstep(0.4, 0.9, dot(facing, entered)) * smoothstep(0.0, 0.4, dot(facing, to_viewer));
}

// Walks of a pixel in a sample, `least` to `most`: `dense` or more a square free path, of half of which walks are averaged around
// (smooth.frag.glsl), in small pictures as in large ones. A power of two, so that a pixel has as many in each sample.
int walks_of_pixel(int least, int most, float dense, float width, vec3 free_path)
{
  float across = width / max(max_component(free_path), 1e-20);
  return clamp(1 << int(clamp(ceil(log2(max(dense * across * across, 1e-6))), 0.0, 16.0)), least, most);
}
