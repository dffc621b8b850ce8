// Guards that stand where the singularities are, and small geometry.
#define PI 3.14159265358979
#define DARK 1e-30  // light below this is none: what shares it out would leave the range of float32

vec3 safe_normalize(vec3 v)
{
  return v * inversesqrt(max(dot(v, v), 1e-30));
}

// Finite test on bits: comparisons with NaN are undefined in GLSL.
bool is_finite(float x)
{
  return (floatBitsToUint(x) & 0x7f800000u) != 0x7f800000u;
}

float luminance(vec3 color)
{
  return dot(color, vec3(0.2126, 0.7152, 0.0722));
}

float max_component(vec3 v)
{
  return max(max(v.x, v.y), v.z);
}

// Two unit vectors that complete unit `n` to a right-handed frame (Duff et al. 2017, branch on the sign of z).
void orthonormal_basis(vec3 n, out vec3 tangent, out vec3 bitangent)
{
  float sign_z = (n.z >= 0.0) ? 1.0 : -1.0;
  float a = -1.0 / (sign_z + n.z);
  float b = n.x * n.y * a;
  tangent = vec3(1.0 + sign_z * n.x * n.x * a, sign_z * b, -sign_z * n.x);
  bitangent = vec3(b, sign_z + n.y * n.y * a, -n.y);
}

// Cosine-distributed around a unit normal (Malley); density cos / pi per steradian.
vec3 cosine_direction(vec3 normal, vec2 u)
{
  vec3 tangent;
  vec3 bitangent;
  orthonormal_basis(normal, tangent, bitangent);
  float radius = sqrt(u.x);
  float turn = 2.0 * PI * u.y;
  return safe_normalize(radius * cos(turn) * tangent + radius * sin(turn) * bitangent + sqrt(max(1.0 - u.x, 0.0)) * normal);
}

// Unit vector <-> two numbers in [-1, 1] (octahedral map).
vec2 octahedral_encode(vec3 n)
{
  n /= max(abs(n.x) + abs(n.y) + abs(n.z), 1e-30);
  vec2 folded = (vec2(1.0) - abs(n.yx)) * vec2(n.x >= 0.0 ? 1.0 : -1.0, n.y >= 0.0 ? 1.0 : -1.0);
  return (n.z >= 0.0) ? n.xy : folded;
}

vec3 octahedral_decode(vec2 e)
{
  vec3 n = vec3(e, 1.0 - abs(e.x) - abs(e.y));
  if (n.z < 0.0) {
    n.xy = (vec2(1.0) - abs(n.yx)) * vec2(n.x >= 0.0 ? 1.0 : -1.0, n.y >= 0.0 ? 1.0 : -1.0);
  }
  return safe_normalize(n);
}

// A unit vector in one number that is exact in a float: two octahedral coordinates in 4096 steps each.
float pack_normal(vec3 n)
{
  vec2 steps = floor((octahedral_encode(n) * 0.5 + 0.5) * 4095.0 + 0.5);
  return steps.x + 4096.0 * steps.y;
}

vec3 unpack_normal(float packed_normal)
{
  float y = floor(packed_normal / 4096.0);
  return octahedral_decode(vec2(packed_normal - 4096.0 * y, y) * (2.0 / 4095.0) - 1.0);
}
