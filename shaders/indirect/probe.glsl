// Probes: points of surfaces from whose view points are found that light the picture (probe_find.frag.glsl).

struct Probe {
  bool receives;
  uint id;  // of the cell of space that it stands for: the same in pictures of cameras that lie side by side
  vec3 position;
  vec3 normal;
  vec3 geometric_normal;
};

Probe probe_read(int index)
{
  vec4 place = probe_places_fetch(ivec2(index, 0));
  vec4 normals = probe_normals_fetch(ivec2(index, 0));
  Probe probe;
  probe.receives = place.w > 0.0;
  probe.id = uint(place.w);
  probe.position = place.xyz;
  probe.normal = octahedral_decode(normals.xy);
  probe.geometric_normal = octahedral_decode(normals.zw);
  return probe;
}
