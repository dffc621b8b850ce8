// w of a texel of a depth map where a layer (grass) is nearest to the light: this, and the layer's depth measure.
#define LAYER_CASTER 4.0
