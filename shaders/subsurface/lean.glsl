// A vector with components in -4..4, to a 32nd, in one float.
#define LEAN_MOST 4.0
#define LEAN_LEVELS 254.0  // even: 0 stays 0

float pack_lean(vec3 lean)
{
  vec3 level = floor(clamp(0.5 + 0.5 / LEAN_MOST * lean, vec3(0.0), vec3(1.0)) * LEAN_LEVELS + 0.5);
  return level.x + 256.0 * (level.y + 256.0 * level.z);
}

vec3 unpack_lean(float packed_lean)
{
  float z = floor(packed_lean / 65536.0);
  float y = floor((packed_lean - 65536.0 * z) / 256.0);
  vec3 level = vec3(packed_lean - 65536.0 * z - 256.0 * y, y, z);
  return 2.0 * LEAN_MOST * (level / LEAN_LEVELS - vec3(0.5));
}
