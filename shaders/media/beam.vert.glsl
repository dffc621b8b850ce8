// A stretch of a light ray as a quad on the screen, wide enough for its kernel. Empty ones are clipped.
#include "ask/view.glsl"
#include "media/beam_width.glsl"

vec4 beam_clip(vec3 position)
{
  vec4 place = vec4(position, 1.0);
  return vec4(dot(film_view.row_x, place), dot(film_view.row_y, place), 0.0, dot(film_view.row_w, place));
}

void main()
{
  ivec2 texel = ivec2(gl_InstanceID % ray_side, gl_InstanceID / ray_side);
  beam_start = beam_starts_fetch(texel);
  beam_end = beam_ends_fetch(texel);
  beam_flux = beam_fluxes_fetch(texel);
  gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
  if (beam_start.w > 0.0 && any(notEqual(beam_flux.rgb, vec3(0.0)))) {
    vec4 a = beam_clip(beam_start.xyz);
    vec4 b = beam_clip(beam_end.xyz);
    float near = view_is_parallel(film_view.eye) ? -1e30 : max(film_view.film.z, 1e-20);  // clipped before it is divided
    bool seen = max(a.w, b.w) > near;
    if (seen) {
      vec4 first = (a.w < near) ? mix(a, b, (near - a.w) / (b.w - a.w)) : a;
      vec4 last = (b.w < near) ? mix(b, a, (near - b.w) / (a.w - b.w)) : b;
      vec2 p = first.xy / first.w;
      vec2 q = last.xy / last.w;
      vec2 pixels = film_view.film.xy;
      vec2 along = (q - p) * 0.5 * pixels;
      float length_ = length(along);
      vec2 unit = (length_ > 1e-6) ? along / length_ : vec2(1.0, 0.0);
      vec2 across = vec2(-unit.y, unit.x);
      // Half a pixel more than the kernel. A beam that spreads is a trapezoid; of others the wider end counts for both.
      float scale = pixels.x / max(abs(film_view.frame.y - film_view.frame.x), 1e-20);
      bool parallel = view_is_parallel(film_view.eye);
      float reach = length(beam_end.xyz - beam_start.xyz);
      float from = (a.w < near) ? (near - a.w) / (b.w - a.w) : 0.0;
      float to = (b.w < near) ? 1.0 - (near - b.w) / (a.w - b.w) : 1.0;
      float nearest = parallel ? 1.0 : max(min(first.w, last.w), 1e-6);
      float own = parallel ? 1.0 : max((corner.x < 0.0) ? first.w : last.w, 1e-6);
      float size = ((beam_end.w > 0.0) ? own : nearest) / scale;
      // Where the kernel has become as wide as it may before the far end, straight edges from end to end would cut it.
      bool bounded = beam_flux.w + beam_end.w * to * reach > beam_most_pixels * SPREAD_WIDER * size;
      float wide = beam_half_width(((corner.x < 0.0 && !bounded) ? from : to) * reach, size) / size + 1.0;
      vec2 place = (corner.x < 0.0) ? p - unit * wide * 2.0 / pixels : q + unit * wide * 2.0 / pixels;
      place += corner.y * across * wide * 2.0 / pixels;
      gl_Position = vec4(place, 0.5, 1.0);
    }
  }
}
