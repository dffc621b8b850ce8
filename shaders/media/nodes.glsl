// Volume shaders: what each adds to the medium at a point. Coefficients per metre, as Cycles' closures have them.
#include "lib/math.glsl"
#include "material/curves.glsl"

#define STEFAN_BOLTZMANN 1.8049e-14  // W / (m2 K4) / pi, times 1e-6: Cycles' scale of the glow of volumes

struct VolumePoint {
  vec3 scattering;
  vec3 absorption;
  vec3 emission;
  float anisotropy;  // sum weighted by scattering
};

void volume_scattering_add(inout VolumePoint volume, vec3 scattering, float anisotropy)
{
  volume.scattering += scattering;
  volume.anisotropy += anisotropy * dot(scattering, vec3(1.0));
}

void volume_absorption(inout VolumePoint volume, float weight, vec3 color, float density)
{
  volume.absorption += weight * max(vec3(1.0) - color, vec3(0.0)) * max(density, 0.0);
}

void volume_scatter(inout VolumePoint volume, float weight, vec3 color, float density, float anisotropy)
{
  volume_scattering_add(volume, weight * max(color, vec3(0.0)) * max(density, 0.0), anisotropy);
}

void volume_coefficients(inout VolumePoint volume, float weight, vec3 absorbed, vec3 scattered, vec3 emitted,
                         float anisotropy)
{
  volume.absorption += weight * max(absorbed, vec3(0.0));
  volume.emission += weight * max(emitted, vec3(0.0));
  volume_scattering_add(volume, weight * max(scattered, vec3(0.0)), anisotropy);
}

void volume_emission(inout VolumePoint volume, float weight, vec3 color, float strength)
{
  volume.emission += weight * color * strength;
}

// Grids have w = 1; where there is none of that name, w is 0.
void volume_principled(inout VolumePoint volume, float weight, vec3 color, vec4 color_grid, float density,
                       vec4 density_grid, float anisotropy, vec3 absorbed_color, float emission_strength,
                       vec3 emission_color, float glow, vec3 tint, float temperature, vec4 temperature_grid,
                       float start, float extent, int first, int rows)
{
  float amount = max(density, 0.0) * ((density_grid.w > 0.5) ? max(density_grid.x, 0.0) : 1.0);
  vec3 albedo = max(color, vec3(0.0)) * ((color_grid.w > 0.5) ? max(color_grid.xyz, vec3(0.0)) : vec3(1.0));
  vec3 dark = max(vec3(1.0) - sqrt(max(absorbed_color, vec3(0.0))), vec3(0.0));
  volume.absorption += weight * amount * max(vec3(1.0) - albedo, vec3(0.0)) * dark;
  volume_scattering_add(volume, weight * amount * albedo, anisotropy);
  volume.emission += weight * emission_strength * emission_color;
  if (glow > 0.0) {
    float kelvin = max(temperature, 0.0) * ((temperature_grid.w > 0.5) ? max(temperature_grid.x, 0.0) : 1.0);
    float squared = kelvin * kelvin;
    float strength = STEFAN_BOLTZMANN * mix(1.0, squared * squared, glow);
    vec3 shown;
    blackbody_table(kelvin, start, extent, first, rows, shown);
    volume.emission += weight * strength * tint * shown;
  }
}
