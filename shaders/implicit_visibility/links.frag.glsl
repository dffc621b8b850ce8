// For each direction bin of each receiver the link to the nearest surfel, or group of surfels no larger than the bin:
// who is nearest is who is seen, so linking is depth testing (Dong, Kautz, Theobalt and Seidel 2007).
//
// The half ball over a receiver is a square of bins x bins by a map that keeps projected area (Shirley and Chiu 1997):
// all bins bring equal shares of irradiance. It is turned about the normal, and the directions that stand for bins are
// shifted within them, differently for each receiver and solution.
//
// A node is opened until the ball about it looks no larger than the bin, seen from the receiver (the rule of the thesis,
// with a ball for A cos / r^2); a leaf never is. A bin links what the direction that stands for it meets the disc of, be
// it larger than the bin or smaller (footprint rule): bins of a large leaf have no holes between them.
//
// Pixel: receiver x / (bins * bins) + COLUMNS y, bin x % (bins * bins).
#include "lib/math.glsl"
#include "lib/random.glsl"
#include "implicit_visibility/surfels.glsl"

#define BESIDE 1e-3   // radii of a surfel that rays begin above it
#define TOUCHING 1.5  // radii within which a disc that bends away from the receiver's surface is its own surface
#define ALIKE 0.5
#define EDGE 0.02     // radii that a disc reaches beyond the edge of its surface: no slit between two

// From the unit square to the unit disc.
vec2 concentric(vec2 u)
{
  vec2 v = 2.0 * u - 1.0;
  if (v.x == 0.0 && v.y == 0.0) {
    return vec2(0.0);
  }
  bool wide = abs(v.x) > abs(v.y);
  float r = wide ? v.x : v.y;
  float turn = wide ? (PI / 4.0) * (v.y / v.x) : PI / 2.0 - (PI / 4.0) * (v.x / v.y);
  return r * vec2(cos(turn), sin(turn));
}

void main()
{
  out_link = 0.0;
  ivec2 pixel = ivec2(gl_FragCoord.xy);
  int count = bins * bins;
  int column = pixel.x / count;
  int bin = pixel.x - column * count;
  int receiver = pixel.y * COLUMNS + column;
  if (receiver >= receiver_count) {
    return;
  }
  int i = receiver * RECEIVER_TEXELS;
  vec4 place = receivers_fetch(ivec2(i & 2047, i >> 11));
  vec4 facing = receivers_fetch(ivec2((i + 1) & 2047, (i + 1) >> 11));
  vec3 normal = facing.xyz;
  int own = int(facing.w);

  // Multiples of irrational numbers, each receiver beginning elsewhere: even over solutions.
  uvec3 roll = hash3(uvec3(uint(receiver), 173u, uint(link_seed)));
  vec3 shift = vec3(to_unit(roll.x), to_unit(roll.y), to_unit(roll.z));
  shift = fract(shift + float(solution) * vec3(0.8191725134, 0.6710436067, 0.5497004779));
  vec2 cell = (vec2(float(bin % bins), float(bin / bins)) + shift.xy) / float(bins);
  vec2 flat_place = concentric(cell);
  float turn = 2.0 * PI * shift.z;
  flat_place = vec2(cos(turn) * flat_place.x - sin(turn) * flat_place.y, sin(turn) * flat_place.x + cos(turn) * flat_place.y);
  float up = sqrt(max(1.0 - dot(flat_place, flat_place), 1e-6));
  vec3 tangent;
  vec3 bitangent;
  orthonormal_basis(normal, tangent, bitangent);
  vec3 direction = safe_normalize(flat_place.x * tangent + flat_place.y * bitangent + up * normal);
  vec3 origin = place.xyz + BESIDE * place.w * normal;
  // A disc of radius r looks as large as the bin, PI / (bins^2 cos), at this distance: r^2 * per_area.
  float per_area = refine * float(count) * up;

  float nearest = 1e30;
  for (int node = 0; node < node_count;) {
    vec4 ball = surfel_node(node, 0);
    vec4 disc = surfel_node(node, 1);
    vec3 off = ball.xyz - origin;
    float along = dot(off, direction);
    float square = dot(off, off);
    float beside = square - along * along;
    float radius_square = ball.w * ball.w;
    vec3 disc_normal = octahedral_decode(disc.xy);
    float slope = dot(disc_normal, direction);
    float steep = max(abs(slope), 1e-4);
    float t = dot(off, disc_normal) / ((slope < 0.0) ? -steep : steep);
    vec3 away = t * direction - off;
    // Flat nodes by their slab: a ray along a wall passes through many balls on it.
    float slab = ball.w + abs(disc.z) / steep;
    bool missed = beside > radius_square || along + ball.w < 0.0 || along - ball.w > nearest || dot(away, away) > slab * slab;
    bool leaf = int(disc.w) == node + 1;
    bool links = disc.z > 0.0 && (leaf || radius_square * per_area < square);
    if (!missed && !links) {
      node += 1;
      continue;
    }
    int here = node;
    node = int(disc.w);
    if (missed || t <= 0.0 || t >= nearest || dot(away, away) > radius_square) {
      continue;
    }
    vec4 edge = surfel_node(here, 3);
    vec4 other_edge = surfel_node(here, 4);
    float slack = EDGE * ball.w;
    if (dot(away, edge.xyz) > edge.w + slack || dot(away, other_edge.xyz) > other_edge.w + slack) {
      continue;
    }
    vec4 leaves = surfel_node(here, 2);
    bool front = slope < 0.0;
    bool own_surface = int(leaves.x) == own && int(leaves.y) == 1;
    bool bends = !front && t < TOUCHING * ball.w && dot(disc_normal, normal) > ALIKE;
    bool bends_back = front && t < TOUCHING * ball.w && dot(disc_normal, normal) < -ALIKE && leaves.z < 0.5;
    bends = bends || (bends_back && dot(off, normal) < 0.0);
    // Nothing sees the back of a sheet that sees nothing: what meets it has slipped between two discs.
    if (own_surface || bends || (!front && leaves.z > 1.5)) {
      continue;
    }
    if (leaves.w < 1.0) {
      if (!front && leaves.z > 0.5) {
        continue;  // a ray that passed beside a thing smaller than its discs meets no back of it
      }
      uvec3 chance = hash3(uvec3(uint(here), uint(bin), roll.x + uint(solution)));
      if (to_unit(chance.x) >= leaves.w) {
        continue;
      }
    }
    nearest = t;
    out_link = (!front && leaves.z > 0.5) ? 0.0 : link_of(here, front);  // inside a solid it is dark
  }
}
