"""Functions of shaders by themselves, for tests against closed forms."""

import numpy as np

from addon.gfx import images, passes


def evaluated(
    include: str, expression: str, count: int = 64, bound=None, before: str = "", constants=None, blocks=None, **given
) -> np.ndarray:
    """(count, 4) a GLSL expression of `k`, 0 to 1 over the pixels, with functions of a shader file, or of some that
    spaces part. `before`: statements that it needs. `bound`: images of declared `textures`; `constants`: values by
    (type, name); `blocks`: those of structs by name."""
    includes = "\n".join(f'#include "{name}"' for name in include.split())
    source = f"""{includes}
void main()
{{
  float k = (gl_FragCoord.x - 0.5) / {count - 1}.0;
  {before}
  out_value = {expression};
}}"""
    blocks = blocks or {}
    program = passes.fullscreen_program(
        f"probe of {include}", "generated/main", outputs=(("VEC4", "out_value"),), constants=tuple(constants or ()),
        snippets=(("generated/main", source),), blocks=tuple((one.struct, name) for name, one in blocks.items()),
        **given,
    )  # fmt: skip
    with images.borrowed(count, 1, "RGBA32F") as target:
        values = {name: value for (_, name), value in (constants or {}).items()}
        passes.fullscreen(program, target, textures=bound or {}, constants=values, blocks=blocks)
        return images.read(target.colors[0])[0].astype(np.float64)
