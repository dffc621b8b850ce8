// Light that media scatter after other bounces, and that they bring to surfaces: `walks` of up to `bounces` steps.
//
// FROM_SURFACES: walks start at the surface that a pixel shows, whose irradiance they find: of paths that media scatter, up
// to `scatters` times; light that has met surfaces alone is not their matter. FROM_FROXELS: they start anywhere in a cell of the grid along the view (froxels.glsl),
// and find the light that a medium there would send to the eye for each unit of its scattering coefficient. Else they start
// at a place on a pixel's view ray. ONE_SCATTER: `scatters` is 1, so
// that walks go on over surfaces alone. Each asks one row of lights, drawn evenly. At each stop it looks once
// for a place in media that the row lights: drawn along rays of the lamp (media/from_lamps.glsl) or by the phase function or
// cosine and around the lamp, weighted by the balance heuristic. Then it goes on by phase function or cosine, to a place in
// media drawn by what they let pass, or to a surface, where the row is asked. STRAIGHT_ALONE: `out_found` is what comes
// straight from media that shine, and no lights are asked. AT_HITS: view rays are those that mirrors and glass send on.
#include "lib/gbuffer.glsl"
#include "indirect/bands.glsl"
#include "media/arriving.glsl"
#include "media/from_lamps.glsl"
#ifdef AT_HITS
#include "media/lobe_ray.glsl"
#else
#include "media/view_ray.glsl"
#endif
#include "ask/leaving.glsl"
#ifdef FROM_SURFACES
#include "media/wide_lobe.glsl"
#endif
#ifdef FROM_FROXELS
#include "media/froxels.glsl"
#endif

#if defined(ONE_SCATTER) || defined(STRAIGHT_ALONE)
#define SCATTERS_ON false
#else
#define SCATTERS_ON true
#endif

// `through`: what of it leaves on the other side.
vec3 mean_albedo(ivec2 hit, out vec3 through)
{
  int material = triangle_material(hit);
  ivec2 place = ivec2(material & 15, material >> 4);
  vec3 albedo = reflectance_fetch(place).rgb;
  through = min(reflectance_fetch(place + ivec2(0, 8 * reflectance_rows())).rgb, albedo);
  return albedo;
}

// Light of row `number` on a surface of albedo 1, as radiance.
Asked ask_surface(int number, vec3 position, vec3 normal, vec2 u)
{
  Asked asked;
#ifdef WORLD_LIT
  if (number >= light_count) {
    if ((light_read(light_count - 1).flags & LIGHT_DIFFUSE) == 0) {
      return ask_nothing();
    }
    asked.direction = cosine_direction(normal, u);
    asked.reach = 1e29;
    asked.shadow = true;
    asked.glass_stops = false;
    float lobe = max(dot(asked.direction, normal), 0.0) / PI;
    float rows = world_rows * environment_density(asked.direction);
    asked.found = environment_radiance(asked.direction) * lobe / max(rows + lobe, 1e-30);
    return asked;
  }
#endif
  Light light = light_read(number);
  if ((light.flags & LIGHT_DIFFUSE) == 0) {
    return ask_nothing();
  }
  float density;
  asked = ask_light(light, position, u, density);
  float lobe = max(dot(normal, asked.direction), 0.0) / PI;
  asked.found *= lobe;
#ifdef WORLD_LIT
  if (LIGHT_IS(light, LIGHT_DIRECTION)) {
    asked.found *= world_rows * density / max(world_rows * density + lobe, 1e-30);
  }
#endif
  return asked;
}

// What a walk does, one after the other: find a surface that the lamp lights, once; and at each stop look for a place in media
// that it lights, look at that surface, and go on to the next stop.
#define FIND_LIT 0
#define LOOK 1
#define LOOK_AT_LIT 2
#define GO_ON 3
#define SEEN_DEPTH 5.0  // optical depth up to which places on the view ray are drawn around the lamp
#define AIMED 0.25  // of steps that go on to places by the rays of the lamp

// A place that a walk has come to: in media, or on a surface of albedo 1.
struct Stop {
  vec3 position;
  vec3 onwards;  // where its light goes to
  uint inside;   // media; 0: on a surface
  float lobe;    // anisotropy
  vec3 normal;
  vec3 face;     // geometric normal
  bool by_unit;  // what it sends is for each unit of scattering
};

float stop_density(Stop stop, vec3 way)
{
  if (stop.inside == 0u) {
    return (dot(way, stop.face) > 0.0) ? max(dot(way, stop.normal), 0.0) / PI : 0.0;
  }
  return phase_henyey_greenstein(stop.lobe, -dot(way, stop.onwards));
}

vec3 stop_draw(Stop stop, vec2 u)
{
  return (stop.inside == 0u) ? cosine_direction(stop.normal, u) : -phase_direction(stop.lobe, stop.onwards, u);
}

// What light it sends on of what comes along -way.
vec3 stop_sends(Stop stop, vec3 way, float density, uint seed)
{
  if (stop.inside == 0u) {
    return vec3(density);
  }
#ifdef FROM_FROXELS
  if (stop.by_unit) {
    return media_scattered_by_unit(stop.inside, stop.position, -way, stop.onwards, seed);
  }
#endif
  return media_scattered(stop.inside, stop.position, -way, stop.onwards, seed);
}

// A walk asks one row, drawn evenly, but that the world counts as few of them, however many it has: its rows come last.
#ifdef WORLD_LIT
#define OTHER_ROWS (light_count - int(world_rows + 0.5))
#define WORLD_COUNTS 3
#endif

int draw_row(float u)
{
#ifdef WORLD_LIT
  return min(int(u * float(OTHER_ROWS + WORLD_COUNTS)), ROWS_ASKED - 1);
#else
  return min(int(u * float(ROWS_ASKED)), ROWS_ASKED - 1);
#endif
}

// One over the chance that it asks this one.
float rows_stood_for(int number)
{
#ifdef WORLD_LIT
  float share = (number >= OTHER_ROWS) ? float(ROWS_ASKED - OTHER_ROWS) / float(WORLD_COUNTS) : 1.0;
  return share * float(OTHER_ROWS + WORLD_COUNTS);
#else
  return float(ROWS_ASKED);
#endif
}

// What a walk brings back that sets out from a stop with this weight, of row `number` of lights. `media_only`: of paths that meet a
// medium. `straight`: what comes straight from media that shine, as light of lamps does.
vec3 walk(Stop stop, vec3 weight, int number, vec2 ask_turn, bool media_only, vec2 first_turn, inout uint seed,
          out vec3 straight)
{
  vec3 sum = vec3(0.0);
  straight = vec3(0.0);
  LampRays rays = lamp_rays(number, ask_turn);
  bool lit_exists = false;
  vec3 lit = vec3(0.0);  // the surface where a ray of the lamp ends
  vec3 lit_color = vec3(1.0);  // of layers that it has passed
#ifdef STRAIGHT_ALONE
  int task = GO_ON;
#else
  int task = (SCATTERS_ON && rays.shadow) ? FIND_LIT : LOOK;
#endif
  int scattered_times = 0;
  int bounce = 0;
  for (int i = 0; i < 3 * bounces + 1 && bounce < bounces; i++) {
    int doing = task;
    bool after_media = !media_only || scattered_times > 0;
    task = (doing == FIND_LIT) ? LOOK : ((doing == LOOK) ? (lit_exists && after_media ? LOOK_AT_LIT : GO_ON)
                                                        : ((doing == LOOK_AT_LIT) ? GO_ON : LOOK));
    vec2 turn = vec2(media_random(seed), media_random(seed));
#ifdef WORLD_LIT
    // Of the world another row at each stop: its rows are the last ones.
    float choice = media_random(seed);
    if (number >= OTHER_ROWS) {
      number = min(OTHER_ROWS + int(choice * float(ROWS_ASKED - OTHER_ROWS)), ROWS_ASKED - 1);
      ask_turn = vec2(media_random(seed), media_random(seed));
    }
#endif
    vec3 from = stop.position;
    float wanted = -1.0;
    vec3 way;
    bool more = SCATTERS_ON && doing == GO_ON && bounce + 1 < bounces;
    LampRays aiming = rays;
    aiming.wide = (doing == GO_ON) ? 0.5 : 0.0;
    float aimed = !rays.exist ? 0.0 : ((doing == LOOK) ? 0.5 : (more ? AIMED : 0.0));  // share along rays of the lamp
    if (SCATTERS_ON && doing == FIND_LIT) {
      way = lamp_rays_way(rays, turn);
      from = ray_origin(rays.source, (dot(way, rays.face) < 0.0) ? -rays.face : rays.face);
    }
    else if ((SCATTERS_ON && doing == LOOK_AT_LIT) || media_random(seed) < aimed) {
      vec3 offset = (doing == LOOK_AT_LIT) ? lit - from : lamp_rays_draw(aiming, from, vec3(turn, media_random(seed)));
      wanted = length(offset);
      way = offset / max(wanted, 1e-30);
    }
    else {
      way = stop_draw(stop, (doing == GO_ON && bounce == 0) ? first_turn : turn);
    }
    float lobe = (doing == FIND_LIT) ? 1.0 : stop_density(stop, way);
    if (!(lobe > 0.0) || wanted == 0.0) {
      if (doing == GO_ON) {
        break;
      }
      continue;
    }
    ivec2 hit;
    bool from_source = SCATTERS_ON && doing == FIND_LIT;  // this ray is the shadow ray of what it finds
    float limit = trace_layers(from, way, 1e29, 0.0, seed, from_source && glass_blocks != 0, from_source, hit);
    if (from_source) {
      lit_exists = hit.x >= 0;
      lit = from + limit * way;
      lit_color = layers_color(limit);
      continue;
    }
    vec3 passed = weight * stop_sends(stop, way, lobe, seed);
    media_asked_by((stop.inside == 0u) ? MEDIA_OF_DIFFUSE : MEDIA_OF_VOLUME);
    media_bins(from, way, limit, seed);
    bool in_media = bins.total > 0.0 && bins.count > 0;
    bool at_surface = hit.x >= 0;
    float chance = !in_media ? 0.0 : (at_surface ? clamp(1.0 - dot(bins.end, vec3(1.0 / 3.0)), 0.1, 0.9) : 1.0);
    chance = (doing == LOOK) ? 1.0 : (SCATTERS_ON ? chance : 0.0);
    bool found_aim = doing != LOOK_AT_LIT && wanted > 0.0;
    bool scattered = (doing == LOOK || found_aim) ? in_media : (doing == GO_ON && media_random(seed) < chance);
    Asked asked = ask_nothing();
    vec3 position = from;
    vec3 arrives = vec3(0.0);
    int k = -1;
    float t = wanted;
    if (doing == GO_ON) {
      vec3 shines = found_aim ? vec3(0.0) : passed / (lobe * (1.0 - aimed)) * bins.emitted;
      straight += (bounce == 0) ? shines : vec3(0.0);
      sum += (bounce == 0) ? vec3(0.0) : shines;
#ifdef STRAIGHT_ALONE
      break;
#endif
      if (!scattered && (found_aim || !at_surface)) {
        break;
      }
    }
    if (scattered) {
      Around around = around_row(number, ask_turn, from, way, bins.from[0], bins.to[bins.count - 1]);
      around.exists = around.exists && doing == LOOK;
      float v = media_random(seed);
      if (wanted > 0.0 || (around.exists && v < 0.5)) {
        t = (wanted > 0.0) ? wanted : around_draw(around, 2.0 * v);
        k = bins_find(t);
      }
      else {
        t = bins_draw(around.exists ? 2.0 * v - 1.0 : v, k);
      }
      if (k < 0) {  // between media, or behind a surface
        if (doing == LOOK) {
          continue;
        }
        break;
      }
      float density = bins_density(k, t);
      density = lobe * chance * (around.exists ? 0.5 * (density + around_density(around, t)) : density);
      density = (aimed > 0.0) ? mix(density, lamp_rays_density(aiming, from, way, t), aimed) : density;
      position += t * way;
      arrives = passed * layers_color(t) * bin_passing(k, t) / max(density, 1e-30);
      if (doing == LOOK && number >= 0) {
        asked = ask_scattered(number, bins.media[k], position, -way, ask_turn, seed);
      }
      else if (SCATTERS_ON && doing != LOOK) {
        scattered_times++;
        weight = arrives;
        arrives = vec3(0.0);
        stop.inside = bins.media[k];
        stop.lobe = media_lobe(stop.inside, position, seed);
        stop.onwards = -way;
        stop.by_unit = false;
      }
    }
    else if (doing != LOOK && at_surface && (doing == GO_ON || abs(limit - wanted) < 1e-3 * wanted)) {
      vec3 normal = triangle_normal(hit);
      normal = (dot(normal, way) > 0.0) ? -normal : normal;
      vec3 met = position + limit * way;
      position = ray_origin(met, normal);
      vec3 through;
      vec3 albedo = mean_albedo(hit, through);
      // Of leaves, paper, cloth one of both sides is looked at, at random.
      float far_chance = luminance(through) / max(luminance(albedo), 1e-30);
      bool far = far_chance > 0.0 && media_random(seed) < far_chance;
      albedo = far ? through / far_chance : (albedo - through) / max(1.0 - far_chance, 1e-6);
      vec3 bounced = passed * layers_color(limit) * bins.end * albedo;
      // Light from below the surface takes the place of what a diffuse one would send.
      vec3 sent;
      vec3 part;
      vec3 same;
      bool in_glass;
      bool leaves = light_leaves(triangle_material(hit), position, normal, -way, seed, sent, part, same, in_glass);
      vec3 straight_on = leaves ? bounced * (vec3(1.0) - part) : bounced;
      if (far) {
        normal = -normal;
        position = ray_origin(met, normal);
      }
      // As GO_ON draws from this stop, whichever of the two has come here.
      float by_lamp = (SCATTERS_ON && rays.exist && bounce + 1 < bounces) ? AIMED : 0.0;
      float going = lobe * (1.0 - chance) * (1.0 - by_lamp);
      if (SCATTERS_ON && number >= 0 && after_media) {
        asked = ask_surface(number, position, normal, ask_turn);
        float from_lamp = 0.0;
        if (rays.shadow) {
          vec3 offset = position - rays.source;
          float squared = max(dot(offset, offset), 1e-30);
          vec3 arriving = offset * inversesqrt(squared);
          asked.direction = -arriving;
          asked.reach = sqrt(squared);
          asked.found *= (doing == GO_ON) ? vec3(1.0) : lit_color;
          asked.shadow = asked.shadow && doing == GO_ON;  // the lamp's own ray has come here
          from_lamp = lamp_rays_share(rays, arriving) * abs(dot(normal, arriving)) / squared;
          from_lamp *= limit * limit / max(abs(dot(normal, way)), 1e-6);
        }
        arrives = straight_on / max(going + from_lamp, 1e-30);  // balance heuristic
      }
      if (doing == GO_ON) {
        weight = bounced / going;
        if (leaves) {
          sum += after_media ? weight * part * sent : vec3(0.0);
          weight *= vec3(1.0) - part * (vec3(1.0) - same);
        }
        stop.inside = 0u;
        stop.normal = normal;
        stop.face = normal;
        stop.by_unit = false;
      }
    }
    sum += arrives * rows_stood_for(number) * asked_arriving(asked, position, seed);
    if (doing == GO_ON) {
      if (scattered_times >= scatters) {
        break;
      }
      stop.position = position;
      bounce++;
      // Faint walks end at random (Russian roulette).
      float left = max_component(weight);
      float survives = (bounce <= 2) ? 1.0 : clamp(left, 0.0, 1.0);
      if (!(left > 0.0) || media_random(seed) >= survives) {
        break;
      }
      weight /= survives;
    }
  }
  return sum;
}

vec3 finite_sum(vec3 sum)
{
  return (is_finite(sum.x) && is_finite(sum.y) && is_finite(sum.z)) ? sum : vec3(0.0);
}

// Where a walk starts and how much of what it finds counts; none where that is 0.
struct Start {
  Stop stop;
  vec3 weight;
};

Start start_at(vec3 position, vec3 onwards)
{
  Start start;
  start.stop.position = position;
  start.stop.onwards = onwards;
  start.stop.inside = 0u;
  start.stop.lobe = 0.0;
  start.stop.normal = vec3(0.0, 0.0, 1.0);
  start.stop.face = vec3(0.0, 0.0, 1.0);
  start.stop.by_unit = false;
  start.weight = vec3(0.0);
  return start;
}

#if !defined(FROM_SURFACES) && !defined(FROM_FROXELS)
Start on_ray(ivec2 pixel, ViewRay ray, int asks, int number, vec2 ask_turn, float v, inout uint seed)
{
  media_asked_by(asks);
  media_bins(ray.origin, ray.direction, ray.limit, seed);
  Start start = start_at(ray.origin, -ray.direction);
  if (!(bins.total > 0.0) || bins.count == 0) {
    return start;
  }
  LampRays rays = lamp_rays(number, ask_turn);
  float deep = bins_deep(SEEN_DEPTH);  // in endless fog all but a few places lay beyond, where nothing is seen
  Near near = near_lamp(rays, number, ray.origin, ray.direction, bins.from[0], deep);
  int k;
  float t;
  if (near.exist && v < 0.5) {
    t = near_draw(near, 2.0 * v);
    k = bins_find(t);
  }
  else {
    t = bins_draw(near.exist ? 2.0 * v - 1.0 : v, k);
  }
  if (k >= 0) {
    float density = bins_density(k, t);
    density = near.exist ? 0.5 * (density + near_density(near, t)) : density;
    start.stop.position += t * ray.direction;
    start.stop.inside = bins.media[k];
    start.stop.lobe = media_lobe(start.stop.inside, start.stop.position, seed);
    start.weight = layers_before(pixel, t) * bin_passing(k, t) / max(density, 1e-30);
  }
  return start;
}
#endif

void main()
{
#ifdef AT_HITS
  show_nothing();
#else
  out_found = vec4(0.0);
#if defined(SHINING) && !defined(STRAIGHT_ALONE)
  out_straight = vec4(0.0);
#endif
#endif
  ivec2 size = surface_position_size();
  int asks = MEDIA_OF_CAMERA;
  int ray_salt = 0;
#ifdef FROM_FROXELS
  ivec3 cell = froxel_of(ivec2(gl_FragCoord.xy));
  uint seed = roll_of(ivec2(gl_FragCoord.xy), film_view.sample_index, film_view.seed, 48).x;
  vec2 place = froxel_pixel(cell, vec2(media_random(seed), media_random(seed)));
  ivec2 pixel = clamp(ivec2(place), ivec2(0), size - 1);
  ViewRay ray = view_ray(surface_position_fetch(pixel), vec2(pixel) + 0.5);
  float away = froxel_distance(float(cell.z) + media_random(seed)) - ray.before;
  if (away < 0.0 || away >= ray.limit) {
    return;
  }
  Start start = start_at(ray.origin + away * ray.direction, -ray.direction);
  media_asked_by(MEDIA_OF_CAMERA);
  media_crossings(start.stop.position, ray.direction);
  start.stop.inside = media_at_start();
  if (start.stop.inside == 0u) {
    return;
  }
  start.stop.lobe = media_lobe(start.stop.inside, start.stop.position, seed);
  start.stop.by_unit = true;
  start.weight = vec3(1.0);
  out_found.w = 1.0;
#elif defined(AT_HITS)
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  ViewRay ray;
  if (!lobe_ray(pixel, ray, asks)) {
    return;
  }
  ray_salt = 1 + ray_number;
  uint seed = roll_of(pixel, film_view.sample_index, film_view.seed, 211 + ray_number).x;
#else
  ivec2 pixel = min(ivec2(gl_FragCoord.xy) * stride + shown_pixel, size - 1);
  ViewRay ray = view_ray(surface_position_fetch(pixel), vec2(pixel) + 0.5);
  uint seed = roll_of(pixel, film_view.sample_index, film_view.seed, 44).x;
#ifdef FROM_SURFACES
  Surface s = SURFACE_READ(pixel);
  Start start = start_at(ray_origin(s.position, s.geometric_normal), -ray.direction);
  start.stop.normal = s.normal;
  start.stop.face = s.geometric_normal;
  start.weight = vec3(1.0);
  // What a translucent lobe reflects comes from the far side: of both one is looked at, at random.
  float lobe_share = luminance(s.glossy_weight);
  float far_chance = (s.kind == LOBE_TRANSLUCENT) ? lobe_share / max(lobe_share + luminance(s.diffuse), 1e-30) : 0.0;
  // For what spreads this over the pixels around: light of nothing counts as nothing.
  bool takes = ray.hit && (max_component(s.diffuse) > 0.0 || has_wide_lobe(s, shaded_roughness));
  out_found.w = takes ? min(ray.limit, 1e18) : -1.0;
  if (!takes) {
    return;
  }
#endif
#endif
  uvec3 salt = hash3(uvec3(uvec2(gl_FragCoord.xy), uint(film_view.seed + 8192 * ray_salt) + 4711u));
  vec3 sum = vec3(0.0);
  vec3 straight_sum = vec3(0.0);
  for (int which = 0; which < walks; which++) {
    int turn = film_view.sample_index * walks + which;
    uvec2 moved = salt.xy + uint(which) * 0x9E3779B1u;
    vec2 u = vec2(scrambled(film_view.bits_x, moved.x), scrambled(film_view.bits_y, moved.y));
#ifdef STRAIGHT_ALONE
    int number = -1;
#else
    int number = draw_row(shuffled(turn, salt.zx));
#endif
    vec2 ask_turn = vec2(media_random(seed), media_random(seed));
#if !defined(FROM_SURFACES) && !defined(FROM_FROXELS)
    Start start = on_ray(pixel, ray, asks, number, ask_turn, shuffled(turn, salt.yz), seed);
#endif
    if (max_component(start.weight) > 0.0) {
      vec3 straight;
#ifdef FROM_SURFACES
      const bool media_only = true;
      float side = (far_chance > 0.0 && media_random(seed) < far_chance) ? -1.0 : 1.0;
      start.stop.position = ray_origin(s.position, side * s.geometric_normal);
      start.stop.normal = side * s.normal;
      start.stop.face = side * s.geometric_normal;
#else
      const bool media_only = false;
#endif
      sum += finite_sum(walk(start.stop, start.weight, number, ask_turn, media_only, u, seed, straight));
      straight_sum += finite_sum(straight);
    }
  }
#ifdef AT_HITS
  show(pixel, (sum + straight_sum) / float(walks), vec3(0.0));
#else
#ifdef STRAIGHT_ALONE
  sum = straight_sum;
#endif
  out_found.rgb = sum / float(walks);
#if defined(SHINING) && !defined(STRAIGHT_ALONE)
  out_straight = vec4(straight_sum / float(walks), out_found.w);
#endif
#endif
}
