"""Packed records: numpy writes where the GLSL that is made from the same declaration reads."""

import numpy as np
import pytest

from addon.gfx import images, passes
from addon.gfx.library import GENERATED
from addon.gfx.records import Record
from addon.sources.lights import LIGHT

TRIED = Record(
    "Tried",
    fetch="tried_list_fetch(ivec2({}, 0))",
    texels=(("int kind:3 group:4 rest", "vec3 place"), ("vec2 size", "int flags", "float share")),
    asked=(("vec3 far", "float last"),),
    kinds=("ROUND", "FLAT"),
    flags=("LIT", "SEEN"),
    constants={"MOST": 9},
)
READ = """#include "record/tried.glsl"
void main()
{
  Tried t = tried_read(1);
  bool flags = t.kind == TRIED_FLAT && (t.flags & TRIED_SEEN) != 0 && (t.flags & TRIED_LIT) == 0 && TRIED_MOST == 9;
  out_first = vec4(t.place, float(t.group));
  out_second = vec4(t.size, t.share, flags ? float(t.rest) : -1.0);
  out_third = vec4(tried_far(t), tried_last(t));
}
"""


def test_the_reader_finds_what_numpy_wrote(gpu_context):
    kind = TRIED.kinds["FLAT"] + (5 << 3) + (300 << 7)
    one = TRIED.rows(
        kind=kind, place=(1, 2, 3), size=(4, 5), flags=TRIED.flags["SEEN"], share=6, far=(7, 8, 9), last=10
    )
    listed = np.concatenate([np.full((TRIED.texels, 4), -7.0), one])[None]
    program = passes.fullscreen_program(
        "records read", "generated/main", textures=(("RGBA32F", "tried_list"),),
        outputs=tuple(("VEC4", f"out_{name}") for name in ("first", "second", "third")),
        snippets=(("generated/main", READ),),
    )  # fmt: skip
    target = images.Target(tuple(images.create(1, 1, "RGBA32F") for _ in range(3)))
    passes.fullscreen(program, target, textures={"tried_list": images.upload(listed)})
    found = [images.read(image)[0, 0].tolist() for image in target.colors]
    assert found == [[1, 2, 3, 5], [4, 5, 6, 300], [7, 8, 9, 10]]


def test_rows_of_several_records_and_of_fields_by_their_names():
    rows = LIGHT.rows(3, radius=np.arange(3), centre=np.ones((3, 3)))
    assert rows.shape == (3, LIGHT.texels, 4)
    assert rows[2][LIGHT.at.radius] == 2 and rows[1][LIGHT.at.centre].tolist() == [1, 1, 1]
    assert rows.sum() == 9 + 3


def test_a_texel_holds_four_numbers_and_a_number_24_bits():
    with pytest.raises(ValueError, match="texel 0 holds more than four"):
        Record("Full", "{}", (("vec3 a", "vec2 b"),))
    with pytest.raises(ValueError, match="not exact"):
        Record("Long", "{}", (("int a:20 b:6",),))
    assert not {"record/full.glsl", "record/long.glsl"} & GENERATED.keys()
