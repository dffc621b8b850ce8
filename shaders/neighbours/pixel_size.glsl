// Width of a pixel at a point that is seen, in the scene's units.
float pixel_size_at(vec3 position)
{
  float depth = (film_view.eye.w > 0.5) ? 1.0 : distance(position, film_view.eye.xyz);
  return (film_view.frame.y - film_view.frame.x) / film_view.film.x * depth;
}
