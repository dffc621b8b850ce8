// Strands of hair. All pixels look at the same place of their filters in a sample, so that strands thinner than a pixel, in step
// with the grid, would be met by all samples of a row or by none. So each pixel looks elsewhere within a pixel around that place:
// strands are drawn wider by as much, and a fragment is kept where the pixel's ray meets the strand (surface/point.glsl), and
// shaded there as a round strand. One ray for all strands of a pixel: what hides a strand is what shades it from the viewer's
// side. Were each kept by a chance of its own, the camera would see places that others shade (2 to 4 % of a tuft's light).
// `envelope` of its vertices: radius in local metres; minus (sides x steps + x) x steps + y, with x and y the strand's
// direction on an octahedron (addon/snapshot/strands.py, strand_shape). Vertices lie about the axis along their normals.
#include "lib/math.glsl"
#include "lib/view.glsl"

#define AXIS_STEPS 1024
// Pixels: strands as wide are met at the pixels' own places, those a pixel thinner and less anywhere within a pixel.
#define AS_IT_IS 1.65
#define MOST_ALONG 4.0  // how far along a strand a pixel beside may meet it, in widths of a pixel (strands seen end on)

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

// How a strand's vertex is drawn. Lengths are in metres, which between vertices run evenly.
struct StrandVertex {
  vec3 drawn;        // where
  float half_width;  // of the strand as it is seen; 0: drawn as it is
  vec4 across;       // how far the tube's corner lies beside its axis, and before it; how far beside it it is drawn; the tube's
                     // radius out to its corners
  vec3 along;        // the strand's direction
  vec4 looks;        // how far beside the axis (xy) and along it (zw) what lies half a pixel aside in the picture's x and y is
};

StrandVertex strand_vertex(Instance instance, vec3 place, vec3 local_normal)
{
  StrandVertex found;
  found.drawn = place;
  found.half_width = 0.0;
  found.across = vec4(0.0);
  found.along = vec3(0.0);
  found.looks = vec4(0.0);
  int code = int(-envelope.y);
  vec3 axis = strand_axis(code);
  vec3 off = local_normal - axis * dot(local_normal, axis);
  if (dot(off, off) < 0.25) {
    return found;
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
    return found;
  }
  side = normalize(side);
  along = normalize(along);
  vec3 before = cross(side, along);
  vec2 running = pixels_of(along, clip);
  vec2 beside = pixels_of(side, clip);
  // Half the width in metres, by the radius.
  float grown = length(vec2(dot(out_one, side), dot(out_other, side)));
  float turned = running.x * beside.y - running.y * beside.x;
  if (grown * envelope.x <= 0.0 || turned == 0.0) {
    return found;
  }
  float sides = float(code / (AXIS_STEPS * AXIS_STEPS));
  float wider = PI / (sides * sin(PI / sides));  // of the tube's corners than of the strand
  vec2 corner = wider * envelope.x * vec2(dot(out_one, side), dot(out_one, before));
  found.half_width = grown * envelope.x;
  vec2 aside = vec2(-running.y, running.x) * (0.5 / turned);
  vec2 ahead = vec2(beside.y, -beside.x) * (0.5 / turned);
  float half_pixel = length(aside);
  float share = clamp(AS_IT_IS - found.half_width / half_pixel, 0.0, 1.0);
  found.looks = share * vec4(aside, ahead * min(1.0, MOST_ALONG * half_pixel / max(length(ahead), 1e-30)));
  float looks = abs(found.looks.x) + abs(found.looks.y);
  // The middle of a facet, too, lies as far out as the strand's rim.
  float rim = (found.half_width + looks) / (found.half_width * wider * cos(PI / sides));
  found.across = vec4(corner, corner.x * rim, wider * found.half_width);
  found.along = along;
  found.drawn = place + side * (found.across.z - corner.x);
  return found;
}
