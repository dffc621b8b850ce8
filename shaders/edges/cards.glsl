// Soft textured shadow volumes: which points of a light a card hides from a receiver, by the places on the card that the
// ways to them go through.
//
// A projection from the receiver onto the card's plane, J, takes directions to (x, y, z) with x / z and y / z along the
// card's edges and 1 / z the distance of the card as a share of the way. A place's opacity stands in the card's tile of
// addon/scene/opacity_maps.py; what is half opaque hides a point at random.
//
// Source: Forest, Barthe, Paulin, "Soft textured shadow volume", CGF 28(4), 2009; its projection corrected in three places
// (J acts on s - p; the last row of W is (0, 0, 1 / e); z > 1, as the card lies before the light).
#include "edges/card_record.glsl"
#include "lib/random.glsl"

struct Card {
  vec3 row0;
  vec3 row1;
  vec3 row2;
  vec3 corner;
  vec4 opacity;  // first texel of the tile or -1; half the cells of a row, negative: mirrored; of front and back
  vec4 ball;
  int number;
};

struct CardView {
  vec3 j0;
  vec3 j1;
  vec3 j2;
  bool front;
  bool valid;
};

vec4 card_texel(int index)
{
  return card_records_fetch(ivec2(index & 2047, index >> 11));
}

Card card_read(int number)
{
  Card card;
  vec4 a = card_texel(CARD_TEXELS * number);
  vec4 b = card_texel(CARD_TEXELS * number + 1);
  vec4 c = card_texel(CARD_TEXELS * number + 2);
  card.row0 = a.xyz;
  card.row1 = b.xyz;
  card.row2 = c.xyz;
  card.corner = vec3(a.w, b.w, c.w);
  card.opacity = card_texel(CARD_TEXELS * number + 3);
  card.ball = card_texel(CARD_TEXELS * number + 4);
  card.number = number;
  return card;
}

bool card_may_hide(Card card, vec3 p, vec3 to_centre)
{
  return cone_meets_ball(card.ball.xyz - p, card.ball.w, to_centre, edge_light.size.x);
}

CardView card_view(Card card, vec3 p)
{
  CardView view;
  vec3 to_corner = card.corner - p;
  vec3 k = vec3(dot(card.row0, to_corner), dot(card.row1, to_corner), dot(card.row2, to_corner));
  view.valid = abs(k.z) > 1e-7 * length(to_corner);  // else it is seen edge on, and hides nothing
  float inverse = view.valid ? 1.0 / k.z : 0.0;
  view.j0 = card.row0 - (k.x * inverse) * card.row2;
  view.j1 = card.row1 - (k.y * inverse) * card.row2;
  view.j2 = card.row2 * inverse;
  view.front = k.z > 0.0;
  return view;
}

// Opacity of the card at a place along its two edges.
float card_opacity(Card card, vec2 place, bool front)
{
  if (card.opacity.x < 0.0) {
    return front ? card.opacity.z : card.opacity.w;
  }
  float row = abs(card.opacity.y);
  float cells = 2.0 * row;
  int x = int(clamp(place.x * cells, 0.0, cells - 1.0));
  int y = int(clamp(place.y * cells, 0.0, cells - 1.0 - float(x)));
  int texel = int(card.opacity.x) + (y >> 1) * int(row) + (x >> 1);
  float both = card_tiles_fetch(ivec2(texel & 2047, texel >> 11))[2 * (y & 1) + (x & 1)];
  float level = floor(both / 256.0);
  return ((front == (card.opacity.y >= 0.0)) ? level : both - 256.0 * level) / 255.0;
}

// Whether it hides point `k`, along `ray` from the receiver.
bool card_hides(Card card, CardView view, vec3 ray, ivec2 pixel, int k)
{
  vec3 h = vec3(dot(view.j0, ray), dot(view.j1, ray), dot(view.j2, ray));
  float least = light_at_infinity() ? 0.0 : 1.0;
  if (h.x < 0.0 || h.y < 0.0 || h.z - h.x - h.y < 0.0 || h.z <= least) {
    return false;
  }
  float opacity = card_opacity(card, h.xy / h.z, view.front);
  if (opacity <= 0.0 || opacity >= 1.0) {
    return opacity >= 1.0;
  }
  uint place = uint(pixel.x) + 65536u * uint(pixel.y);
  uvec3 roll = hash3(uvec3(place, uint(64 * card.number + k), uint(edge_light.salt)));
  return to_unit(roll.x) < opacity;
}
