// Depth in the series from a distance in the range of the map, 0..1: its period leaves room at both ends.
float cluster_depth(float share)
{
  return 0.05 + 0.9 * clamp(share, 0.0, 1.0);
}

float cluster_share(float depth)
{
  return clamp((depth - 0.05) / 0.9, 0.0, 1.0);
}
