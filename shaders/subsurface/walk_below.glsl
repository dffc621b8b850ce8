// A random walk below a surface, from where a ray enters to where it leaves: walk.frag.glsl tells how. A program includes this after
// its own `walk_leaves(weight, place, facing, u)`: the share `weight` of light leaves at `place` of a surface that faces along
// `facing`; `u` are random numbers.
#define STEPS 256       // what is left then leaves where the walk has left so far
#define FIRST_CHANCE 3  // steps before chance ends walks
#define FARTHEST 12.0   // free paths that a ray looks ahead
#define LEAST_PATH 16.0  // offsets at which walks begin below the surface: where a free path is less than one, none would come out

// What a walk goes through.
struct Below {
  float instance;
  vec3 albedo;     // of one scattering
  vec3 free_path;  // m
};

Below below_of(float instance, vec3 color, vec3 length_m)
{
  Below below;
  below.instance = instance;
  vec3 s = walk_absorption(color);
  below.albedo = vec3(1.0) - s * s;
  below.free_path = max(length_m, vec3(LEAST_SCALE));
  return below;
}

// First numbers of walks.
struct Even {
  int index;
  uvec2 entry1;  // salts
  uvec2 entry2;
  uvec2 scattered;
  uvec2 polar;
  uvec2 azimuth;
  uvec3 more;
};

// Walk number `index` of a sequence.
Even even_in(int index, uvec3 salt)
{
  Even even;
  even.index = index;
  even.entry1 = salt.xy;
  salt = hash3(salt);
  even.entry2 = salt.xy;
  salt = hash3(salt);
  even.scattered = salt.xy;
  salt = hash3(salt);
  even.polar = salt.xy;
  salt = hash3(salt);
  even.azimuth = salt.xy;
  even.more = hash3(salt);
  return even;
}

// `number`: of the walk, among all of this texel's.
Even even_alone(ivec2 texel, int number, int stream)
{
  return even_in(number, roll_of(texel, 0, film_view.seed, stream));
}

// Texels of a block of four by four share a sequence, so that their mean is as even as that of one texel's walks; one alone
// has a sixteenth of each number's range. So neighbours in the image must be neighbours in space.
Even even_of_pixel(ivec2 pixel, int number, int stream)
{
  return even_in(number * 16 + (pixel.x & 3) + 4 * (pixel.y & 3), roll_of(pixel >> 2, 0, film_view.seed, stream));
}

vec2 even_entry(Even even)
{
  return vec2(shuffled(even.index, even.entry1), shuffled(even.index, even.entry2));
}

// Walks on from `origin` along `direction` and returns what is left of the light after STEPS.
vec3 walk_below(Below below, vec3 origin, vec3 direction, Even even, inout uvec3 roll)
{
  float offset = ray_offset(origin);
  below.free_path = mix(below.free_path, vec3(LEAST_PATH * offset), lessThan(below.free_path, vec3(offset)));
  vec3 per = vec3(1.0) / below.free_path;
  float limit = FARTHEST * max_component(below.free_path);
  vec3 through = vec3(1.0);
  for (int step = 0; step < STEPS; step++) {
    roll = hash3(roll);
    ivec2 hit;
    float d = own_surface(origin, direction, limit, below.instance, roll.z, hit);
    vec3 passed = (d < limit) ? exp(-d * per) : vec3(0.0);
    if (d < limit) {
      uvec3 moved = hash3(roll ^ uvec3(0x9E3779B9u));
      vec3 facing = triangle_normal(hit);
      facing = (dot(facing, direction) < 0.0) ? -facing : facing;
      walk_leaves(through * passed, origin + d * direction, facing, vec2(to_unit(moved.x), to_unit(moved.y)));
    }
    vec3 chance = through * below.albedo * (vec3(1.0) - passed);
    float whole = chance.x + chance.y + chance.z;
    if (!(whole > 1e-6)) {
      return vec3(0.0);
    }
    chance /= whole;
    float pick = to_unit(roll.x);
    int channel = (pick < chance.x) ? 0 : (pick < chance.x + chance.y) ? 1 : 2;
    float v = (step == 0) ? shuffled(even.index, even.scattered) : to_unit(roll.y);
    float t = -below.free_path[channel] * log(max(1.0 - v * (1.0 - passed[channel]), 1e-7));
    t = min(t, d);
    vec3 density = per * exp(-t * per);
    through *= below.albedo * density / max(dot(chance, density / max(vec3(1.0) - passed, vec3(1e-9))), 1e-30);
    origin += t * direction;
    if (step >= FIRST_CHANCE) {
      float stays = min(max_component(through), 1.0);
      if (to_unit(hash3(roll ^ uvec3(0x85EBCA6Bu)).x) >= stays) {
        return vec3(0.0);
      }
      through /= stays;
    }
    roll = hash3(roll);
    float z = 1.0 - 2.0 * ((step == 0) ? shuffled(even.index, even.polar) : to_unit(roll.x));
    float angle = 2.0 * PI * ((step == 0) ? shuffled(even.index, even.azimuth) : to_unit(roll.y));
    direction = vec3(sqrt(max(1.0 - z * z, 0.0)) * vec2(cos(angle), sin(angle)), z);
  }
  return through;
}

// Of what has not left after so many steps the share that diffusion brings out from where it then is, sqrt(2 STEPS / 3) free
// paths deep.
vec3 walk_rest(vec3 color)
{
  return exp(-sqrt(2.0 * float(STEPS)) * walk_absorption(color));
}
