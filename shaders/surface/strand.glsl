// Strands of hair that are thinner than a pixel. All pixels look at the same place of their filters in a sample, so that
// thin ones in step with the grid would be met by all samples of a row or by none. Those below WIDENED are drawn so wide
// instead that each row of pixels (each column, of strands that lie flat) meets them once, and a fragment is kept with the
// share of that width that the strand has (surface.frag.glsl): what is seen of it is the same in the mean.
// `envelope` of its vertices: radius in local metres; minus (sides x steps + x) x steps + y, with x and y the strand's
// direction on an octahedron (addon/snapshot/strands.py, strand_shape). Vertices lie about the axis along their normals.
#include "lib/math.glsl"
#include "lib/view.glsl"

#define AXIS_STEPS 1024
#define WIDENED 0.7  // of a pixel: thicker strands are met as they are, and shaded where they are seen

vec3 strand_axis(int code)
{
  vec2 flat_axis = vec2((code / AXIS_STEPS) % AXIS_STEPS, code % AXIS_STEPS) * (2.0 / float(AXIS_STEPS - 1)) - 1.0;
  vec3 axis = vec3(flat_axis, 1.0 - abs(flat_axis.x) - abs(flat_axis.y));
  if (axis.z < 0.0) {
    axis.xy = (1.0 - abs(flat_axis.yx)) * vec2(flat_axis.x < 0.0 ? -1.0 : 1.0, flat_axis.y < 0.0 ? -1.0 : 1.0);
  }
  return normalize(axis);
}

vec3 of_instance(Instance instance, vec3 local)
{
  return vec3(dot(instance.row0.xyz, local), dot(instance.row1.xyz, local), dot(instance.row2.xyz, local));
}

// By how many pixels a place moves in the picture as it moves by `step`; `clip`: the place's clip coordinates.
vec2 pixels_of(vec3 step, vec3 clip)
{
  vec2 moved = vec2(dot(film_view.row_x.xyz, step), dot(film_view.row_y.xyz, step))
               - clip.xy * (dot(film_view.row_w.xyz, step) / clip.z);
  return moved / clip.z * (0.5 * film_view.film.xy);
}

// Where a strand's vertex is drawn; `share`: of its width there, what the strand has of it.
vec3 strand_vertex(Instance instance, vec3 place, vec3 local_normal, out float share)
{
  share = 1.0;
  int code = int(-envelope.y);
  vec3 axis = strand_axis(code);
  vec3 off = local_normal - axis * dot(local_normal, axis);
  if (dot(off, off) < 0.25) {
    return place;
  }
  off = normalize(off);
  vec3 out_one = of_instance(instance, off);
  vec3 out_other = of_instance(instance, cross(axis, off));
  vec3 along = of_instance(instance, axis);
  vec4 h = vec4(place, 1.0);
  vec3 clip = vec3(dot(film_view.row_x, h), dot(film_view.row_y, h), dot(film_view.row_w, h));
  vec3 to_eye = view_is_parallel(film_view.eye) ? film_view.backward.xyz : film_view.eye.xyz - place;
  vec3 side = cross(along, to_eye);
  if (clip.z <= 0.0 || dot(side, side) < 1e-6 * dot(along, along) * dot(to_eye, to_eye)) {
    return place;
  }
  side = normalize(side);
  vec2 running = pixels_of(along, clip);
  vec2 beside = pixels_of(side, clip);
  // Half the width in metres, by the radius, and that in pixels for each metre.
  float grown = length(vec2(dot(out_one, side), dot(out_other, side)));
  float per_metre = abs(running.x * beside.y - running.y * beside.x) / max(length(running), 1e-30);
  // A pixel along the axis of the picture that the strand crosses more steeply.
  float wanted = 0.5 * max(abs(running.x), abs(running.y)) / max(length(running), 1e-30) / max(per_metre, 1e-30);
  float own = grown * envelope.x;
  if (own >= WIDENED * wanted || grown <= 0.0) {
    return place;
  }
  share = own / wanted;
  float sides = float(code / (AXIS_STEPS * AXIS_STEPS));
  float wider = PI / (sides * sin(PI / sides));
  return place + out_one * (wider * (wanted / grown - envelope.x));
}
