// Light that enters points in glass, with what their glass mirrors back of what leaves others: straight from sources and, of what
// entered before at the cells where rays of the point have landed (coat.frag.glsl), what is sent back once more. First of all
// that is what is `left` of echoes as if all came back to where it left.
#include "lib/math.glsl"
#include "subsurface/image.glsl"
#include "subsurface/again.glsl"

void main()
{
  ivec2 texel = ivec2(gl_FragCoord.xy);
  vec4 landed = cell_landed_fetch(texel);
  vec3 sum = vec3(0.0);
  for (int k = 0; k < 4; k++) {
    int cell = int(landed[k] + 0.5);
    ivec2 other = ivec2(cell & (ROW - 1), cell / ROW);
    sum += cell_entered_fetch(other).rgb * ((first != 0) ? echoes(cell_again_fetch(other).rgb, left) : vec3(1.0));
  }
  out_direct = vec4(cell_direct_fetch(texel).rgb + 0.25 * cell_again_fetch(texel).rgb * sum, 0.0);
}
