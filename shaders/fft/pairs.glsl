// Transforms of two real images that went through one complex transform as its real and imaginary part.

// `here` is the transform at a frequency, `opposite` at its negative.
vec2 of_real_part(vec2 here, vec2 opposite)
{
  return 0.5 * vec2(here.x + opposite.x, here.y - opposite.y);
}

vec2 of_imaginary_part(vec2 here, vec2 opposite)
{
  return 0.5 * vec2(here.y + opposite.y, opposite.x - here.x);
}

vec2 complex_product(vec2 a, vec2 b)
{
  return vec2(a.x * b.x - a.y * b.y, a.x * b.y + a.y * b.x);
}

// The transform of a real pair times those of another: each with its own.
vec2 pair_product(vec2 here, vec2 opposite, vec2 factor, vec2 opposite_factor)
{
  vec2 real = complex_product(of_real_part(here, opposite), of_real_part(factor, opposite_factor));
  vec2 imaginary = complex_product(of_imaginary_part(here, opposite), of_imaginary_part(factor, opposite_factor));
  return vec2(real.x - imaginary.y, real.y + imaginary.x);
}
