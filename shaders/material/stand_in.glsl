// What stands in for nodes that ask more than a surface point can answer.

#include "lib/color.glsl"
#include "lib/math.glsl"

void unbent_normal(vec3 normal, out vec3 result)
{
  result = normal;
}

void open_occlusion(vec3 color, out vec3 shown, out float open)
{
  shown = color;
  open = 1.0;
}

void no_volume(out vec3 color, out float density, out float flame, out float temperature)
{
  color = vec3(0.0);
  density = 0.0;
  flame = 0.0;
  temperature = 0.0;
}

void no_particle(out float index, out float random, out float age, out float lifetime, out vec3 place,
                 out float size, out vec3 velocity, out vec3 angular_velocity)
{
  index = 0.0;
  random = 0.0;
  age = 0.0;
  lifetime = 0.0;
  place = vec3(0.0);
  size = 0.0;
  velocity = vec3(0.0);
  angular_velocity = vec3(0.0);
}

void no_hit(float reach, out float hit, out float own, out float distance, out vec3 position, out vec3 normal)
{
  hit = 0.0;
  own = 0.0;
  distance = reach;
  position = vec3(0.0);
  normal = vec3(0.0);
}

void absent_attribute(out vec3 color, out vec3 vector, out float average, out float alpha)
{
  color = vec3(0.0);
  vector = vec3(0.0);
  average = 0.0;
  alpha = 0.0;
}
