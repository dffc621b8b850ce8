// How densely cosine-distributed directions of a surface fall on a point of another, per m2. `outer` is the normal of the
// surface's triangle, on the side of `origin`; a point that the surface's own ray has met is `known` to be seen.
float direction_density(vec3 origin, vec3 normal, vec3 outer, vec3 point, vec3 normal_there, bool known, uvec3 salt)
{
  // What a ray has met is where that ray saw it: in a corner the offset of a ray's start may lie beyond the ray's own.
  vec3 path = (known ? point : ray_origin(point, normal_there)) - origin;
  float squared = max(dot(path, path), 1e-30);
  vec3 direction = path * inversesqrt(squared);
  float cosines = max(dot(normal, direction), 0.0) * max(-dot(normal_there, direction), 0.0);
  if (cosines <= 0.0 || dot(direction, outer) <= 0.0) {
    return 0.0;
  }
  float visible = known ? 1.0 : clear_path(origin, direction, sqrt(squared), hash3(salt).x);
  return visible * cosines / (PI * squared);
}
