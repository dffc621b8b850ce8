// Which candidates are kept (1) and how many each stands for. Marks at equal steps of the importance run along the curve;
// they start anew in every cell of an octree of each side that holds no more than `most_of_cell` of them.
#include "lib/math.glsl"

vec2 before(int index)
{
  return sums_before_fetch(ivec2(index % LIST_COLUMNS, index / LIST_COLUMNS)).xy;
}

// How many are expected of all that stand before a place of the list.
float expected(int index, vec2 all)
{
  float floor_part = FLOOR_SHARE * all.x / float(candidate_count);
  vec2 passed = before(index);
  return (passed.x + floor_part * passed.y) * (float(wanted) / (all.x + floor_part * all.y));
}

// The first entry from `low` on, before `high`, whose key is not below this one.
int first_from(uint key, int low, int high)
{
  while (low < high) {
    int middle = (low + high) / 2;
    bool below = sorted_keys_fetch(ivec2(middle % LIST_COLUMNS, middle / LIST_COLUMNS)).x < key;
    low = below ? middle + 1 : low;
    high = below ? high : middle;
  }
  return low;
}

void main()
{
  out_kept = vec2(0.0);
  ivec2 place = ivec2(gl_FragCoord.xy);
  int index = place.y * LIST_COLUMNS + place.x;
  vec2 all = before(candidate_count);
  if (index >= candidate_count || !(all.x > 0.0)) {
    return;
  }
  float from = expected(index, all);
  float to = expected(index + 1, all);
  if (!(to > from)) {
    return;
  }
  uint key = sorted_keys_fetch(place).x;
  uint cell = 0u;
  int low = 0;
  int high = candidate_count;
  for (int shift = 27; shift >= 0; shift -= 3) {
    if (expected(high, all) - expected(low, all) <= most_of_cell) {
      break;
    }
    cell = key >> uint(shift);
    low = first_from(cell << uint(shift), low, high);
    high = first_from((cell + 1u) << uint(shift), low, high);
  }
  float start = 0.0;  // another one in the cell beside it makes up for what this one keeps too much or too little
  for (int bit = 0; bit < 12; bit++) {
    start += float((cell >> uint(bit)) & 1u) * exp2(-float(bit + 1));
  }
  start = fract(start + first_mark);
  float base = expected(low, all);
  float times = floor(start + (to - base)) - floor(start + (from - base));
  out_kept = (times > 0.0) ? vec2(1.0, times / (to - from)) : vec2(0.0);
}
