// The volume part of a node tree at the cells of a grid over its object: extinction and anisotropy, scattering, emission.
// `cell_to_world`: rows that take a cell's coordinates (0..size) to a place relative to the render origin.
#include "lib/math.glsl"
#include "media/nodes.glsl"
#include "generated/material"

bool finite_color(vec3 color)
{
  return is_finite(color.x) && is_finite(color.y) && is_finite(color.z);
}

void main()
{
  int index = (int(gl_FragCoord.y) - grid.w) * 2048 + int(gl_FragCoord.x);
  ivec3 size = grid.xyz;
  vec3 cell = vec3(index % size.x, (index / size.x) % size.y, index / (size.x * size.y)) + 0.5;
  vec3 place = cell / vec3(size);
  SurfacePoint point;
  vec4 at = vec4(cell, 1.0);
  point.position = vec3(dot(medium_place.cell_x, at), dot(medium_place.cell_y, at), dot(medium_place.cell_z, at));
  point.normal = vec3(0.0, 0.0, 1.0);
  point.mesh_normal = point.normal;
  point.geometric_normal = point.normal;
  point.incoming = safe_normalize(material_scene.camera_position.xyz - point.position);
  point.backfacing = false;
  point.ray = RAY_CAMERA;
  point.refracts = false;
  point.object_row0 = medium_place.object_x;
  point.object_row1 = medium_place.object_y;
  point.object_row2 = medium_place.object_z;
  point.object_color = medium_place.color;
  point.object_random = medium_place.facts.x;
  point.object_index = medium_place.facts.y;
  point.instancer_generated = vec3(0.0);
  point.instancer_uv = vec2(0.0);
  point.object_attributes = 0;
  point.position_dx = vec3(0.0);
  point.position_dy = vec3(0.0);
  for (int i = 0; i < 8; i++) {
    point.attributes[i] = vec4(0.0);
    point.attributes_dx[i] = vec4(0.0);
    point.attributes_dy[i] = vec4(0.0);
  }
  fill_attributes(point, place);
  VolumePoint volume;
  volume.scattering = vec3(0.0);
  volume.absorption = vec3(0.0);
  volume.emission = vec3(0.0);
  volume.anisotropy = 0.0;
  evaluate_volume(point, volume);
  float total = dot(volume.scattering, vec3(1.0));
  float g = (total > 0.0) ? clamp(volume.anisotropy / total, -0.999, 0.999) : 0.0;
  vec3 scattering = finite_color(volume.scattering) ? clamp(volume.scattering, vec3(0.0), vec3(1e10)) : vec3(0.0);
  vec3 absorption = finite_color(volume.absorption) ? clamp(volume.absorption, vec3(0.0), vec3(1e10)) : vec3(0.0);
  vec3 emission = finite_color(volume.emission) ? clamp(volume.emission, vec3(0.0), vec3(1e20)) : vec3(0.0);
  float density = medium_place.facts.z;
  out_extinction = vec4(density * (scattering + absorption), is_finite(g) ? g : 0.0);
  out_scattering = vec4(density * scattering, 0.0);
  out_emission = vec4(density * emission, 0.0);
}
