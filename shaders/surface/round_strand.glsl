// Whether a fragment is one of a strand that is round and drawn wider than it is (surface/strand.glsl).
bool strand_is_round()
{
  return normal_heights.z < 0.0;
}
