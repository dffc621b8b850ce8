// A surface in one colour under the strongest lamps, without shadows (addon/surfaces/first_look.py).
#define NO_NORMAL 1e-12
#define MOST 60000.0  // of a half float

vec3 normal_seen(vec3 toward_eye)
{
  vec3 normal = world_normal;
  if (!(dot(normal, normal) > NO_NORMAL)) {  // shells of relief have none
    normal = cross(dFdx(world_position), dFdy(world_position));
  }
  normal = normalize(normal);
  return dot(normal, toward_eye) < 0.0 ? -normal : normal;
}

// Irradiance of a lamp.
vec3 lamp_irradiance(int k, vec3 normal)
{
  vec4 place = first_lamps.lamp[3 * k];
  vec4 axis = first_lamps.lamp[3 * k + 1];
  vec4 strength = first_lamps.lamp[3 * k + 2];
  vec3 to_lamp = place.w > 0.0 ? place.xyz - world_position : place.xyz;
  float squared = dot(to_lamp, to_lamp);
  to_lamp *= inversesqrt(max(squared, 1e-12));
  float falloff = place.w > 0.0 ? 1.0 / max(squared, strength.w) : 1.0;
  float along = dot(axis.xyz, -to_lamp);
  float shape = axis.w > 1.5 ? 1.0 : (axis.w < -1.5 ? max(along, 0.0) : smoothstep(axis.w, axis.w + 0.05, along));
  return strength.rgb * (falloff * shape * max(dot(normal, to_lamp), 0.0));
}

void main()
{
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  if (flat_color.w < 0.5 && ((pixel.x + pixel.y) & 1) == 0) {
    discard;  // what lets light pass hides every other pixel
  }
  vec3 toward_eye = first_lamps.eye.w > 0.5 ? first_lamps.eye.xyz : normalize(first_lamps.eye.xyz - world_position);
  vec3 normal = normal_seen(toward_eye);
  out_guide = vec4(normal, 1.0 / max(dot(film_view.eye.xyz - world_position, film_view.backward.xyz), 1e-6));
  vec3 glow = min(dot(world_normal, toward_eye) < 0.0 ? flat_glow_behind : flat_glow.rgb, vec3(MOST));
  if (flat_glow.w > 0.0) {  // it alone is drawn
    out_look = dot(glow, vec3(1.0)) > 0.0 ? vec4(glow, flat_glow.w) : vec4(0.0);
    return;
  }
  vec3 irradiance = first_lamps.ambient.rgb + vec3(first_lamps.ambient.w * dot(normal, toward_eye));
  int count = int(first_lamps.count.x);
  for (int k = 0; k < count; k++) {
    irradiance += lamp_irradiance(k, normal);
  }
  float follows = flat_color.w > 1.5 ? 0.0 : 1.0;  // its light is that of its side towards the lamps
  out_look = vec4(min(flat_color.rgb * irradiance * 0.31830989 + glow, vec3(MOST)), follows);
}
