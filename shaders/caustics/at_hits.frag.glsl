// The caustics of lights on what rays have met: what diffuse closures there reflect of the irradiance that kept maps hold
// for their place, and, as if it came straight from the light, glossy lobes from which no ray goes on and with SOFT those
// without microfacets. Each map says which of them take it. Of the four texels around it those count whose surface lies on
// the hit's plane. The maps are cells of one image.
#include "lib/view.glsl"
#include "lib/gbuffer.glsl"
#include "lib/random.glsl"
#include "lib/brdf.glsl"
#ifdef TRANSMISSION
#include "lib/refraction.glsl"
#endif
#include "hits/shown.glsl"
#include "hits/onward.glsl"
#include "caustics/least_cosine.glsl"
#include "ask/leaving.glsl"
#ifdef SOFT
#include "lib/soft_lobe.glsl"
#endif

// What is asked of a light's view (VIEW).
struct KeptView {
  vec4 row_x;
  vec4 row_y;
  vec4 row_w;
  vec4 eye;
  vec4 right;
  vec4 up;
  vec4 backward;
  vec4 frame;
  vec4 film;
};

KeptView map_view;

#include "caustics/map_texels.glsl"

KeptView view_of_cell(int cell)
{
  KeptView view;
  view.row_x = kept_views.row_x[cell];
  view.row_y = kept_views.row_y[cell];
  view.row_w = kept_views.row_w[cell];
  view.eye = kept_views.eye[cell];
  view.right = kept_views.right[cell];
  view.up = kept_views.up[cell];
  view.backward = kept_views.backward[cell];
  view.frame = kept_views.frame[cell];
  view.film = vec4(float(map_side));
  return view;
}

// Place that a texel of the map shows, `depth` along the view's axis.
vec3 place_of(vec2 texel, vec2 size, float depth)
{
  vec2 window = mix(map_view.frame.xz, map_view.frame.yw, (texel + 0.5) / size);
  vec3 across = window.x * map_view.right.xyz + window.y * map_view.up.xyz;
  float spread = view_is_parallel(map_view.eye) ? 1.0 : depth;
  return map_view.eye.xyz + spread * across - depth * map_view.backward.xyz;
}

// Towards the light, whose view is `map_view`.
vec3 way_to_light(vec3 position)
{
  return view_is_parallel(map_view.eye) ? map_view.backward.xyz : map_view.eye.xyz - position;
}

// Of the map in the cell at `corner`, whose view is `map_view`.
vec3 irradiance_at(vec3 position, vec3 normal, ivec2 corner)
{
  ivec2 size = ivec2(map_side);
  MapPlace at = map_place(position, size);
  if (!at.inside) {
    return vec3(0.0);
  }
  // The light is on the side that the hit faces.
  if (dot(normal, way_to_light(position)) <= 0.0) {
    return vec3(0.0);
  }
  vec3 sum = vec3(0.0);
  float weights = 0.0;
  for (int k = 0; k < 4; k++) {
    ivec2 other = map_texel(at, k, size);
    vec4 kept = kept_maps_fetch(corner + other);
    vec3 offset = place_of(vec2(other), vec2(size), kept.w) - position;
    float weight = (kept.w > 0.0) ? map_weight(at, k, offset, normal) : 0.0;
    sum += weight * kept.rgb;
    weights += weight;
  }
  return (weights > 0.0) ? sum / weights : vec3(0.0);
}

void main()
{
  show_nothing();
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec4 path = met_path_fetch(pixel);
  int code = int(path.w + 0.5);
  vec4 place = surface_position_fetch(pixel);
  vec3 albedo = surface_diffuse_fetch(pixel).rgb;
  Surface s = SURFACE_READ(pixel);
  vec3 viewer = -ray_direction_fetch(pixel).xyz;
  bool shines = s.kind <= FRESNEL_F82 && max_component(s.glossy_weight) > 0.0 && !lobe_goes_on(s);
#ifdef SOFT
  SoftLobe soft = soft_lobe_begin(s, viewer);
  bool has_soft = soft.exists && !soft.fibre && soft.kind != LOBE_TRANSLUCENT;
#else
  const bool has_soft = false;
#endif
  if (code == 0 || place.w == 0.0 || (max_component(albedo) <= 0.0 && !shines && !has_soft)) {
    return;
  }
  Lobe lobe = lobe_begin(s, viewer);
  vec3 normal = octahedral_decode(surface_normal_fetch(pixel).zw);
  vec3 irradiance = vec3(0.0);
  vec3 by_lobe = vec3(0.0);
  for (int cell = 0; cell < map_count; cell++) {
    map_view = view_of_cell(cell);
    vec3 arriving = irradiance_at(place.xyz, normal, map_side * ivec2(cell % MAP_COLUMNS, cell / MAP_COLUMNS));
    irradiance += map_view.right.w * arriving;
    if ((shines || has_soft) && map_view.up.w > 0.0 && max_component(arriving) > 0.0) {
      vec3 to_light = safe_normalize(way_to_light(place.xyz));
      float density;
      vec3 reflected = shines ? lobe_reflection(lobe, to_light, density) : vec3(0.0);
#ifdef SOFT
      reflected += has_soft ? soft_reflection(soft, to_light) : vec3(0.0);
#endif
      by_lobe += arriving * reflected / max(dot(normal, to_light), LEAST_COSINE);
    }
  }
  // Light that enters surfaces elsewhere is known from their points, to which it comes straight.
  vec3 sent;
  vec3 part;
  vec3 same;
  bool in_glass;
  uint salt = uint(pixel.x + 4096 * pixel.y);
  bool leaves = light_leaves(-1, place.xyz, normal, normal, salt, sent, part, same, in_glass);
  vec3 reflected = (leaves ? vec3(1.0) - part : vec3(1.0)) * albedo / PI * irradiance + by_lobe;
  show_light(code, vec4(0.0), vec4(path.rgb * hit_passed_fetch(pixel).rgb * reflected, 0.0));
}
