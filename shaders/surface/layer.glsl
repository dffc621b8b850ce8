// What a transparent layer does to what lies behind it: its closures, and its colour over the chance with which the surface
// pass lets a sample pass. False where it has no colour to speak of.
bool layer_color(SurfacePoint point, Instance instance, out Closures c, out vec3 color)
{
  point.refracts = glass_bends != 0;
  c = closures_begin(point.normal, 0.5, 0.0);
  evaluate_material(point, c);
  closures_end(c);
  float chance = layer_chance(c, transparent_mode < 0 && (instance.flags & FLAG_HOLDOUT) == 0);
  color = c.transparency / max(chance, 1e-20);
  return chance > 0.0 && min(color.x, min(color.y, color.z)) >= 0.0;
}
