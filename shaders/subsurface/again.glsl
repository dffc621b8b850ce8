// How much enters in all where the share `again` of it enters once more, up to `bounces` times.
vec3 echoes(vec3 again, int bounces)
{
  return (vec3(1.0) - pow(again, vec3(float(bounces + 1)))) / (vec3(1.0) - again);
}
