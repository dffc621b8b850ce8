// How far edits turn what each pixel mirrors or bends, as colours over the darkened picture: blue from 0 degrees, green
// 30, yellow 60, red 120, from where edits fold over; white at 180.
#include "lib/math.glsl"

vec3 heat(float degrees)
{
  vec3 cold = mix(vec3(0.02, 0.05, 0.6), vec3(0.0, 0.5, 0.1), clamp(degrees / 30.0, 0.0, 1.0));
  vec3 warm = mix(vec3(0.9, 0.7, 0.0), vec3(0.8, 0.0, 0.0), clamp((degrees - 60.0) / 60.0, 0.0, 1.0));
  vec3 found = mix(cold, warm, clamp((degrees - 30.0) / 30.0, 0.0, 1.0));
  return mix(found, vec3(1.0), clamp((degrees - 120.0) / 60.0, 0.0, 1.0));
}

// Degrees; -1 where there is no edit.
float turn_at(ivec2 pixel)
{
  vec4 q = edit_fetch(pixel);
  return (dot(q, q) == 0.0) ? -1.0 : 2.0 * atan(length(q.xyz), abs(q.w)) * (180.0 / PI);
}

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec4 seen = picture_fetch(pixel);
  float grey = max(dot(seen.rgb, vec3(0.2126, 0.7152, 0.0722)), 0.0);
  grey = grey / (1.0 + grey);
  float degrees = turn_at(pixel);
  if (degrees < 0.0) {  // the last sample has another lobe here: what most of the pixels beside show
    int beside = 0;
    float sum = 0.0;
    for (int k = 0; k < 9; k++) {
      float other = turn_at(clamp(pixel + ivec2(k % 3, k / 3) - 1, ivec2(0), edit_size() - 1));
      beside += int(other >= 0.0);
      sum += max(other, 0.0);
    }
    degrees = (beside > 4) ? sum / float(beside) : -1.0;
  }
  if (degrees < 0.0) {
    out_turned = vec4(vec3(0.5 * grey), seen.a);
    return;
  }
  out_turned = vec4((0.5 + grey) * heat(degrees), 1.0);
}
