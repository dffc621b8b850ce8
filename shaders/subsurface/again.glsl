// How much enters in all where the share `again` of it enters once more, up to `times` times.
vec3 echoes(vec3 again, int times)
{
  return (vec3(1.0) - pow(again, vec3(float(times + 1)))) / (vec3(1.0) - again);
}
