// Where rays begin that leave a surface. A program that includes this binds `film_view` and has the constant `offset_size`.

// How far beside a surface rays begin: what float32 positions of this size cannot tell apart.
float ray_offset(vec3 position)
{
  // Where an orthographic eye stands says nothing: what it sees is as wide as the picture.
  float away = (film_view.eye.w > 0.5) ? film_view.frame.y - film_view.frame.x : length(position - film_view.eye.xyz);
  return max(offset_size, 2e-5 * away);
}

vec3 ray_origin(vec3 position, vec3 normal)
{
  return position + normal * ray_offset(position);
}
