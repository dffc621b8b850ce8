// Light of media at every STRIDE-th pixel brought to all pixels: the mean over 4 x 4 of the known ones around, which have
// all 16 numbers of the dither among them, of those whose ray ends about as far away.
#define REACH 2.0

float overlap(float place, float middle)
{
  return clamp(min(place + 0.5, middle + REACH) - max(place - 0.5, middle - REACH), 0.0, 1.0);
}

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  ivec2 size = coarse_direct_size();
  vec4 seen = surface_position_fetch(pixel);
  vec3 away = seen.xyz - film_view.eye.xyz;
  float own = (seen.w == 0.0) ? 1e18 : (film_view.eye.w > 0.5) ? -dot(away, film_view.backward.xyz) : length(away);
  vec2 middle = (vec2(pixel) - vec2(shown_pixel)) / float(STRIDE);
  ivec2 corner = ivec2(floor(middle + 0.5));
  vec4 direct = vec4(0.0);
  vec4 emission = vec4(0.0);
  float total = 0.0;
  for (int y = -2; y <= 2; y++) {
    for (int x = -2; x <= 2; x++) {
      ivec2 known = corner + ivec2(x, y);
      ivec2 other = clamp(known, ivec2(0), size - 1);
      vec4 found = coarse_direct_fetch(other);
      float apart = abs(found.w - own) / max(max(found.w, own), 1e-30);
      float like = max(1.0 - 8.0 * apart, 0.0) + 1e-4;
      float weight = like * overlap(float(known.x), middle.x) * overlap(float(known.y), middle.y);
      direct += weight * found;
      emission += weight * coarse_emission_fetch(other);
      total += weight;
    }
  }
  float share = 1.0 / max(total, 1e-30);
  out_direct = vec4(direct.rgb * share, 0.0);
  out_emission = vec4(emission.rgb * share, 0.0);
#ifdef ON_SURFACES
  out_emission.rgb *= surface_diffuse_fetch(pixel).rgb;
#endif
}
