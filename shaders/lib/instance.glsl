// Transforms from the instance image: three rows of the matrix, then random number, pass index, flags, orientation.

#define FLAG_CAMERA 1
#define FLAG_SHADOW 2
#define FLAG_HOLDOUT 16

struct Instance {
  vec4 row0;
  vec4 row1;
  vec4 row2;
  float random;
  int flags;
  bool mirrored;  // negative scale turns the winding around
};

Instance instance_read(int id)
{
  // 512 instances a row: integer division is slow on every GPU.
  ivec2 place = ivec2((id & 511) << 2, id >> 9);
  Instance instance;
  instance.row0 = texelFetch(instances, place, 0);
  instance.row1 = texelFetch(instances, place + ivec2(1, 0), 0);
  instance.row2 = texelFetch(instances, place + ivec2(2, 0), 0);
  vec4 rest = texelFetch(instances, place + ivec2(3, 0), 0);
  instance.random = rest.x;
  instance.flags = int(rest.z);
  instance.mirrored = rest.w < 0.0;
  return instance;
}

vec3 instance_position(Instance instance, vec3 local)
{
  vec4 p = vec4(local, 1.0);
  return vec3(dot(instance.row0, p), dot(instance.row1, p), dot(instance.row2, p));
}

// Inverse transpose by cofactors: right for any scale, and finite for a flattened one.
vec3 instance_normal(Instance instance, vec3 local)
{
  vec3 a = instance.row0.xyz;
  vec3 b = instance.row1.xyz;
  vec3 c = instance.row2.xyz;
  vec3 n = vec3(dot(cross(b, c), local), dot(cross(c, a), local), dot(cross(a, b), local));
  return instance.mirrored ? -n : n;
}

bool instance_seen(Instance instance)
{
  return (instance.flags & VISIBILITY_FLAG) != 0;
}
