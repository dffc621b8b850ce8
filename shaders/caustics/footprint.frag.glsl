// Footprints of photons: the ellipse that a photon's neighbours on the grid span about it (addon/lighting/photons.py), as
// records of addon/kernels/splats.py, with 1 and where it came from in w of the centre, or .5 if glossy lobes do not take it.
// `film_view`: the view into which they will be drawn.
#include "ask/view.glsl"
#include "lib/math.glsl"

// Adds the ways to two neighbours along one axis of the grid to the ellipse; false where neither is of the same bundle.
bool add_neighbours(ivec2 texel, ivec2 step, vec3 centre, float path, vec3 normal, float spacing, vec3 tangent,
                    vec3 bitangent, inout vec3 ellipse)
{
  vec3 sum = vec3(0.0);
  float count = 0.0;
  ivec2 size = photon_points_size();
  for (int k = -1; k <= 1; k += 2) {
    ivec2 other = texel + k * step;
    if (any(lessThan(other, ivec2(0))) || any(greaterThanEqual(other, size))) {
      continue;
    }
    vec4 there = photon_points_fetch(other);
    vec3 way = there.xyz - centre;
    bool alike = there.w == path && dot(octahedral_decode(photon_normals_fetch(other).xy), normal) > 0.7;
    float reach = length(way);
    if (alike && reach < longest * spacing) {
      // On a curved receiver the way is as long as it is, not as the tangent plane shows it.
      vec2 flat_way = vec2(dot(way, tangent), dot(way, bitangent));
      flat_way *= reach / max(length(flat_way), 1e-30);
      sum += vec3(flat_way.x * flat_way.x, flat_way.x * flat_way.y, flat_way.y * flat_way.y);
      count += 1.0;
    }
  }
  ellipse += sum / max(count, 1.0);
  return count > 0.0;
}

void main()
{
  ivec2 texel = ivec2(gl_FragCoord.xy);
  vec4 point = photon_points_fetch(texel);
  vec4 facing = photon_normals_fetch(texel);
  vec3 normal = octahedral_decode(facing.xy);
  vec4 flux = photon_fluxes_fetch(texel);
  out_centre = vec4(0.0);
  out_first = vec4(0.0);
  out_second = vec4(0.0);
  out_value = vec4(0.0);
  if (point.w <= 0.0 || !is_finite(dot(flux, vec4(1.0))) || !is_finite(dot(point, vec4(1.0)))) {
    return;
  }
  vec3 tangent;
  vec3 bitangent;
  orthonormal_basis(normal, tangent, bitangent);
  vec3 ellipse = vec3(0.0);  // xx, xy, yy
  bool along_x = add_neighbours(texel, ivec2(1, 0), point.xyz, point.w, normal, flux.w, tangent, bitangent, ellipse);
  bool along_y = add_neighbours(texel, ivec2(0, 1), point.xyz, point.w, normal, flux.w, tangent, bitangent, ellipse);
  float alone = float(!along_x) + float(!along_y);
  ellipse += vec3(1.0, 0.0, 1.0) * (0.5 * alone * flux.w * flux.w);
  ellipse *= widening * widening;
  float pixel = view_pixel() * view_growth_ahead(point.xyz);
  // The biweight kernel of radius h has the variance h^2 / 8, a disc of radius r r^2 / 4.
  float least = least_pixels * least_pixels * pixel * pixel + 2.0 * facing.w * facing.w;
  ellipse += vec3(least, 0.0, least);

  // Half axes: the roots of the ellipse's eigenvalues along its eigenvectors.
  float middle = 0.5 * (ellipse.x + ellipse.z);
  float apart = sqrt(max(0.25 * (ellipse.x - ellipse.z) * (ellipse.x - ellipse.z) + ellipse.y * ellipse.y, 0.0));
  float larger = middle + apart;
  float smaller = max((ellipse.x * ellipse.z - ellipse.y * ellipse.y) / max(larger, 1e-37), 1e-6 * larger);
  vec2 main_axis = (abs(ellipse.y) > 1e-6 * larger) ? normalize(vec2(larger - ellipse.z, ellipse.y))
                 : ((ellipse.x >= ellipse.z) ? vec2(1.0, 0.0) : vec2(0.0, 1.0));
  vec3 first = main_axis.x * tangent + main_axis.y * bitangent;
  out_centre = vec4(point.xyz, (facing.z < 0.0) ? 0.5 : 1.0 + facing.z);
  out_first = vec4(first * sqrt(larger), normal.x);
  out_second = vec4(cross(normal, first) * sqrt(smaller), normal.y);
  out_value = vec4(flux.rgb, normal.z);
}
