// Nothing reaches the eye by pixels that a lens shows nothing by.
#include "ask/view.glsl"

void main()
{
  if (view_sees(gl_FragCoord.xy)) {
    discard;
  }
  out_emission = vec4(0.0);
}
