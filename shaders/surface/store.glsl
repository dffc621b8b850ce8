// Writes closures into the surface images, laid out as lib/gbuffer.glsl reads them. `covered`: what weights are multiplied
// by because a sample that could have passed did not.
#include "lib/gbuffer.glsl"

void store_closures(Closures c, SurfacePoint point, float covered, float holdout, vec2 lift)
{
  vec3 tangent;
  vec3 bitangent;
  // Of the normal as it will be read: the basis jumps where z changes its sign, on upright walls by the last bit.
  orthonormal_basis(octahedral_decode(octahedral_encode(c.glossy_normal)), tangent, bitangent);
  float half_turns = 0.0;
  if (dot(c.glossy_tangent, c.glossy_tangent) > 0.0) {
    half_turns = fract(atan(dot(c.glossy_tangent, bitangent), dot(c.glossy_tangent, tangent)) / PI + 1.0);
  }
  // Of what is bumped the normal that it has without: displaced, or smooth on few triangles. Else the triangle's will do.
  bool displaced = dot(c.base_normal, point.mesh_normal) < 0.9999 || dot(c.base_normal, point.geometric_normal) < 0.99;
  out_position = vec4(point.position, bump_encode(holdout, c.base_normal, c.diffuse_normal, displaced));
  float rough = floor(clamp(c.diffuse_roughness, 0.0, 1.0) * 255.0 + 0.5) / 255.0;  // as it will be read
  out_normal = vec4(diffuse_normal_encode(c.diffuse_normal, c.diffuse_weight * covered, rough),
                    lift_encode(octahedral_encode(point.geometric_normal), lift.x));
  out_diffuse = vec4(c.diffuse * covered, pack_three(vec3(c.diffuse_roughness, c.glossy_anisotropy, half_turns), 255.0));
  out_tint = tint_encode(c.kind, c.glossy_weight * covered, c.glossy_tint, c.glossy_ior);
  float most = max(max(out_tint.x, out_tint.y), out_tint.z);  // as it will be read
  bool coated = c.coat.x > 0.0 && most > 0.0;
  vec3 edge = coated ? coat_encode(c.coat.x * covered / most, c.coat.y, c.coat.z) : c.glossy_edge;
  float kind = float(c.kind) * 2097152.0 + pack_three(edge, 127.0);
  out_lobe = vec4(octahedral_encode(c.glossy_normal), coated ? -kind - 1.0 : kind, ior_encode(c.glossy_ior, c.distribution));
#ifdef GLOWS
  // What a layer emits is there whether this sample passes it (surface/glow.frag.glsl) or not.
  covered = min(covered, 1.0);
#endif
  out_emission = vec4(c.emission * covered, (c.kind == LOBE_TRANSLUCENT) ? lift.y : c.glossy_roughness);
}
