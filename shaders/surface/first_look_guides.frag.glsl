// A coarse picture in finer pixels, by what a first look at the same view knows of them: each takes the light of the
// nearest coarse pixels that show the same surface, by its own colour and its own side towards the lamps. What has gloss
// alone (alpha of the look: 0) takes that of the 16 nearest as it is, of those brighter than white a smaller share: what
// curved metal mirrors in one pixel and not in the next stands out else, and highlights lose light by it. What the guide
// knows to emit is left out of coarse light and stands as the guide has it, so that small things that glow are whole.
#define MOST_CHANGE 4.0
#define SAME_DEPTH 0.05
#define LEAST_WEIGHT 1e-4
#define WHITE 0.02  // what is faint, by white
#define EVEN 0.75  // alpha of glow from which on its colour is known, not only the mean of its surface

float likeness(vec4 here, vec4 there)
{
  if (here.w <= 0.0 || there.w <= 0.0) {
    return here.w <= 0.0 && there.w <= 0.0 ? 1.0 : 0.0;
  }
  float apart = abs(here.w - there.w) / (SAME_DEPTH * max(here.w, there.w));
  float turned = max(dot(here.xyz, there.xyz), 0.0);
  turned *= turned;
  return turned * turned / (1.0 + apart * apart);
}

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  vec2 fine = vec2(guide_size());
  ivec2 size = coarse_size();
  vec2 place = gl_FragCoord.xy / fine * vec2(size) - 0.5;
  ivec2 corner = ivec2(floor(place));
  vec2 part = place - vec2(corner);
  vec4 guide_here = guide_fetch(pixel);
  vec4 look_here = look_fetch(pixel);
  vec4 glow_here = shows_glow > 0.0 ? glow_fetch(pixel) : vec4(0.0);
  vec4 sum = vec4(0.0);
  float weights = 0.0;
  vec3 emitted = LEAST_WEIGHT * glow_here.rgb * shows_glow;
  float emitting = LEAST_WEIGHT;
  bool mirrors = guide_here.w > 0.0 && look_here.w < 0.5;
  int side = mirrors ? 4 : 2;
  for (int k = 0; k < side * side; k++) {
    ivec2 step = ivec2(k % side, k / side) - (mirrors ? 1 : 0);
    ivec2 texel = clamp(corner + step, ivec2(0), size - 1);
    ivec2 middle = min(ivec2((vec2(texel) + 0.5) / vec2(size) * fine), ivec2(fine) - 1);
    vec4 guide_there = guide_fetch(middle);
    vec2 share = max(1.0 - abs(vec2(step) - part) / (mirrors ? 2.0 : 1.0), vec2(0.0));
    vec4 look_there = look_fetch(middle);
    vec4 light = coarse_fetch(texel);
    float weight = share.x * share.y * (likeness(guide_here, guide_there) + LEAST_WEIGHT);
    if (mirrors) {
      weight *= (look_there.w < 0.5 ? 1.0 : LEAST_WEIGHT) / (1.0 + WHITE * max(light.r, max(light.g, light.b)) / faint);
    }
    if (shows_glow > 0.0 && shines_fetch(texel).r > 0.5) {
      vec3 coarse_emission = emission_fetch(texel).rgb * emission_scale;
      light.rgb = max(light.rgb - coarse_emission, vec3(0.0));
      float alike = glow_fetch(middle).w > 0.0 ? weight : 0.0;
      emitted += alike * coarse_emission;
      emitting += alike;
    }
    if (guide_here.w > 0.0 && guide_there.w > 0.0 && min(look_here.w, look_there.w) > 0.5) {
      vec3 change = (look_here.rgb + vec3(faint)) / (look_there.rgb + vec3(faint));
      light.rgb *= clamp(change, vec3(1.0 / MOST_CHANGE), vec3(MOST_CHANGE));
    }
    sum += weight * light;
    weights += weight;
  }
  out_fine = sum / max(weights, 1e-20);
  if (glow_here.w > 0.0) {
    out_fine.rgb += glow_here.w > EVEN ? glow_here.rgb * shows_glow : emitted / emitting;
  }
}
