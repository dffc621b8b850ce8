// A square that faces the camera, around all that light leaves from which entered at one place (lighting/splatted_light.py).
#include "lib/projection.glsl"
#include "lib/math.glsl"
#include "lib/view.glsl"

#define NEARLY 1.05  // of the radius: nearer to the place than that, it may leave anywhere in the picture

void main()
{
  ivec2 place = ivec2(gl_InstanceID % splat_columns, gl_InstanceID / splat_columns);
  splat_point = splat_points_fetch(place);
  splat_flux = splat_fluxes_fetch(place);
  gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
  if (splat_point.w == 0.0 || !(max_component(splat_flux.rgb) > 0.0)) {
    return;
  }
  vec3 right = film_view.right.xyz;
  vec3 up = film_view.up.xyz;
  float half_width = splat_flux.w;
  if (!view_is_parallel(film_view.eye)) {
    vec3 way = splat_point.xyz - film_view.eye.xyz;
    float away = length(way);
    if (away < NEARLY * half_width) {
      gl_Position = vec4(corner, 0.0, 1.0);
      return;
    }
    orthonormal_basis(way / away, right, up);
    half_width *= inversesqrt(1.0 - (half_width / away) * (half_width / away));  // the ball's outline is wider than its middle
  }
  vec3 at = splat_point.xyz + half_width * (corner.x * right + corner.y * up);
  gl_Position = project(at, film_view.row_x, film_view.row_y, film_view.row_w, film_view.row_q, film_view.backward.w);
  gl_Position.z = 0.0;  // no plane cuts it
}
