// Which of 32 cards can hide a part of the light from the receivers of a tile, as words.comp.glsl has it for edges: by the
// ball around the card, and the ball around the tile's receivers.
#include "edges/light.glsl"
#include "edges/card_record.glsl"

void main()
{
  ivec2 place = ivec2(gl_GlobalInvocationID.xy);
  ivec2 tiles = low_of_tiles_size();
  int index = place.x + 2048 * place.y;
  int tile = index / edge_light.card_word_count;
  if (place.x >= 2048 || tile >= tiles.x * tiles.y) {
    return;
  }
  ivec2 where = ivec2(tile % tiles.x, tile / tiles.x);
  vec3 low = low_of_tiles_fetch(where).xyz;
  vec3 high = high_of_tiles_fetch(where).xyz;
  uint word = 0u;
  if (low.x <= high.x) {
    vec3 middle = 0.5 * (low + high);
    float reach = 0.5 * length(high - low);
    vec3 to_centre = towards_centre(middle);
    int first = (index % edge_light.card_word_count) * 32;
    int last = min(first + 32, edge_light.card_count);
    for (int card = first; card < last; card++) {
      int texel = CARD_TEXELS * card + 4;
      vec4 ball = card_records_fetch(ivec2(texel & 2047, texel >> 11));
      bool meets = cone_meets_ball(ball.xyz - middle, 1.0001 * (ball.w + reach), to_centre, edge_light.size.x - reach);
      word |= meets ? (1u << uint(card - first)) : 0u;
    }
  }
  imageStore(card_words, place, uvec4(word, 0u, 0u, 0u));
}
