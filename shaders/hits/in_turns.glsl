// Entry point of the passes that light what rays have met (hits/receiver.glsl): the mean of `light_of_turn(r, roll)` over
// `repeats` turns. BOUNCED: of light from other surfaces, else straight from sources, with what leaves from below.
void main()
{
  show_nothing();
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  Receiver r;
  if (!receiver_at(pixel, r)) {
    return;
  }
#ifdef BOUNCED
  if (r.mirrored >= bounces) {
    return;
  }
#endif
  uvec3 roll = receiver_roll(pixel);
  vec3 straight;
  vec3 onward;
  vec3 left = light_left(r, roll.y, straight, onward);
#ifdef BOUNCED
  r.surface.diffuse = onward;
  left = vec3(0.0);
#else
  r.surface.diffuse = straight;
#endif
  vec3 sum = vec3(0.0);
  for (int k = 0; k < repeats; k++) {
    roll = hash3(roll);
    sum += light_of_turn(r, roll);
  }
  show_sent(r, left + sum / float(repeats));
}
