// Where light is added that comes along a pixel's ray of a lobe: to what mirrors show, or (TRANSMISSION) to what glass lets
// through. With DIRECT_PATHS light may be that of the first surface, straight from a source.
#include "hits/path.glsl"

void show_nothing()
{
#ifdef DIRECT_PATHS
  out_glossy_direct = vec4(0.0);
#endif
  out_glossy_indirect = vec4(0.0);
#ifdef TRANSMISSION
#ifdef DIRECT_PATHS
  out_transmission_direct = vec4(0.0);
#endif
  out_transmission_indirect = vec4(0.0);
#endif
}

// `code`: of the ray's path.
void show_light(int code, vec4 direct, vec4 indirect)
{
  if (path_is_glossy(code)) {
#ifdef DIRECT_PATHS
    out_glossy_direct = direct;
#endif
    out_glossy_indirect = indirect;
  }
#ifdef TRANSMISSION
  else {
#ifdef DIRECT_PATHS
    out_transmission_direct = direct;
#endif
    out_transmission_indirect = indirect;
  }
#endif
}
