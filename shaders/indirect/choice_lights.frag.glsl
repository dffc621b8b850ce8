// Virtual lights as shaders/indirect/lights.glsl reads them, of the candidates that were kept. Those beyond have no light.
#include "indirect/choice.glsl"

void main()
{
  ivec2 place = ivec2(gl_FragCoord.xy);
  out_light = (place.y == 1) ? vec4(0.0, 0.0, 1.0, 0.0) : vec4(0.0);
  vec4 slot = slots_fetch(ivec2(place.x, 0));
  if (slot.w == 0.0) {
    return;
  }
  ivec2 candidate = candidate_place(int(slot.y));
  int index = int(slot.x);
  vec4 radiance = radiances_fetch(ivec2(index % LIST_COLUMNS, index / LIST_COLUMNS));
  float whole = luminance(abs(radiance.xyz));
  if (place.y == 1) {
    out_light = vec4(candidate_normal_fetch(candidate).xyz, radiance.w / max(whole, 1e-30));
    return;
  }
  float density = 0.0;
  for (int probe = 0; probe < probe_count; probe++) {
    density += densities_fetch(ivec2(place.x, probe)).x;
  }
  float area = (density > 0.0) ? slot.z / density : 0.0;
  out_light = (place.y == 0) ? vec4(candidate_point_fetch(candidate).xyz, whole * area)
                             : vec4(radiance.xyz * area, area / (PI * total_samples));
}
