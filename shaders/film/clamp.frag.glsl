// Light of one point of the film, none of it above a limit (film/clamping.py).

// What is kept of light whose channels may sum to `allowed`.
float share_below(vec3 light, float allowed)
{
  float sum = dot(abs(light), vec3(1.0));
  return (sum > allowed) ? allowed / sum : 1.0;
}

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  float kept;
  CLAMP_ALL
}
