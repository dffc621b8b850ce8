// Instances from the instance image, eight texels each: three rows of the matrix; random number, pass index, flags,
// orientation; the object's colour; place on the instancer (generated, first of UV), second of UV, the object's offset
// against the shadow terminator, and whether others share its mesh; its group of receivers of light, and where behind
// all instances the attributes stand that nodes read of it and of its instancer.

#define INSTANCE_IMAGE

#define FLAG_CAMERA 1
#define FLAG_SHADOW 2
#define FLAG_HOLDOUT 16

struct Instance {
  vec4 row0;
  vec4 row1;
  vec4 row2;
  float random;
  float pass_index;
  int flags;
  bool mirrored;  // negative scale turns the winding around
};

// 256 instances a row: integer division is slow on every GPU.
ivec2 instance_place(int id)
{
  return ivec2((id & 255) << 3, id >> 8);
}

Instance instance_read(int id)
{
  ivec2 place = instance_place(id);
  Instance instance;
  instance.row0 = instances_fetch(place);
  instance.row1 = instances_fetch(place + ivec2(1, 0));
  instance.row2 = instances_fetch(place + ivec2(2, 0));
  vec4 rest = instances_fetch(place + ivec2(3, 0));
  instance.random = rest.x;
  instance.pass_index = rest.y;
  instance.flags = int(rest.z);
  instance.mirrored = rest.w < 0.0;
  return instance;
}

vec3 instance_position(Instance instance, vec3 local)
{
  vec4 p = vec4(local, 1.0);
  return vec3(dot(instance.row0, p), dot(instance.row1, p), dot(instance.row2, p));
}

vec3 instance_origin(Instance instance)
{
  return vec3(instance.row0.w, instance.row1.w, instance.row2.w);
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

// How many times a volume is as large in world space.
float instance_volume(Instance instance)
{
  return abs(dot(instance.row0.xyz, cross(instance.row1.xyz, instance.row2.xyz)));
}

// The object's colour, and where on its instancer an instance stands: generated coordinates and UV.
void instance_extras(int id, out vec4 color, out vec3 generated, out vec2 uv)
{
  ivec2 place = instance_place(id);
  color = instances_fetch(place + ivec2(4, 0));
  vec4 first = instances_fetch(place + ivec2(5, 0));
  generated = first.xyz;
  uv = vec2(first.w, instances_fetch(place + ivec2(6, 0)).x);
}

float instance_terminator(int id)
{
  return instances_fetch(instance_place(id) + ivec2(6, 0)).y;
}

bool instance_shares_mesh(int id)
{
  return instances_fetch(instance_place(id) + ivec2(6, 0)).z > 0.5;
}

float instance_receiver_group(int id)
{
  return instances_fetch(instance_place(id) + ivec2(7, 0)).x;
}

// Number of the texel of an instance's first attribute; 0 where it has none.
int instance_attributes(int id)
{
  return int(instances_fetch(instance_place(id) + ivec2(7, 0)).y + 0.5);
}

vec4 instance_attribute(int first, int column)
{
  int texel = first + column;
  return (first > 0) ? instances_fetch(ivec2(texel & 2047, texel >> 11)) : vec4(0.0);
}

bool instance_seen(Instance instance)
{
  return (instance.flags & VISIBILITY_FLAG) != 0;
}
