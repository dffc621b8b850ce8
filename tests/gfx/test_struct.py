"""One declaration, two readers: what numpy packs is what a shader reads, for every struct in the code base."""

import numpy as np
import pytest

from addon.gfx.struct import Struct
from tests.gfx.declared import structs

WIDTH = 64
COLUMNS = {"float": 1, "int": 1, "vec2": 2, "vec4": 4, "mat4": 16}

ALL_KINDS = Struct(  # orders that make padding necessary before, between and after
    "AllKinds",
    ("float", "first"),
    ("vec2", "pair"),
    ("int", "whole"),
    ("vec4", "four"),
    ("int", "negative"),
    ("mat4", "turn"),
    ("float", "after"),
    ("mat4", "turns[2]"),
    ("vec4", "list[3]"),
    ("float", "last"),
)


def numbered(struct):
    """Values for all fields such that no two scalars of the struct are equal; exact in float32."""
    values, first = {}, 1
    for field, (kind, length) in struct.fields.items():
        shape = (length,) if length else ()
        shape += {"mat4": (4, 4), "vec4": (4,), "vec2": (2,)}.get(kind, ())
        count = int(np.prod(shape, dtype=int))
        numbers = np.arange(first, first + count).reshape(shape) + (0 if kind == "int" else 0.25)
        values[field] = -numbers if field == "negative" else numbers
        first += count
    return values


def stores(struct):
    """GLSL that writes every scalar of `data` in the order of declaration, matrices row by row."""
    lines = []
    for field, (kind, length) in struct.fields.items():
        element = f"data.{field}[i]" if length else f"data.{field}"
        if kind == "mat4":
            body = f"for (int row = 0; row < 4; row++) for (int c = 0; c < 4; c++) store({element}[c][row]);"
        elif kind in ("vec2", "vec4"):
            body = f"for (int c = 0; c < {COLUMNS[kind]}; c++) store({element}[c]);"
        else:
            body = f"store(float({element}));"
        lines.append(f"for (int i = 0; i < {max(length, 1)}; i++) {{ {body} }}")
    return "\n  ".join(lines)


def read_back(struct, values):
    from addon.gfx import images, passes
    from addon.gfx.library import Program
    from addon.gfx.struct import Block

    source = f"""
    int place = 0;
    void store(float x)
    {{
      imageStore(seen, ivec2(place % {WIDTH}, place / {WIDTH}), vec4(x));
      place++;
    }}
    void main()
    {{
      {stores(struct)}
    }}
    """
    program = Program(
        name=f"probe of {struct.name}",
        compute="generated/probe",
        snippets=(("generated/probe", source),),
        blocks=((struct, "data"),),
        images=(("seen", "R32F", "FLOAT_2D", "WRITE"),),
        group=(1, 1, 1),
    )
    scalars = sum(COLUMNS[kind] * max(length, 1) for kind, length in struct.fields.values())
    seen = images.create(WIDTH, -(-scalars // WIDTH), "R32F")
    passes.compute(program, (1, 1), images={"seen": seen}, blocks={"data": Block(struct, **values)})
    return images.read(seen).reshape(-1)[:scalars]


@pytest.mark.parametrize("struct", [ALL_KINDS, *structs()], ids=lambda s: f"{s.name}-{s.dtype.itemsize}")
def test_a_shader_reads_every_scalar_that_numpy_packs(struct, gpu_context):
    values = numbered(struct)
    expected = np.concatenate([np.ravel(value) for value in values.values()])
    np.testing.assert_array_equal(read_back(struct, values), expected)


def test_the_structs_of_the_code_base_are_found():
    assert {"View", "World", "Sources", "MaterialValues"} <= {struct.name for struct in structs()}


def test_updating_a_block_replaces_what_the_shader_reads(gpu_context):
    from addon.gfx import images, passes
    from addon.gfx.library import Program
    from addon.gfx.struct import Block

    pair = Struct("Pair", ("vec4", "color"), ("float", "factor"))
    program = Program(
        name="updated block",
        compute="generated/main",
        snippets=(("generated/main", "void main() { imageStore(seen, ivec2(0), pair.color * pair.factor); }"),),
        blocks=((pair, "pair"),),
        images=(("seen", "RGBA32F", "FLOAT_2D", "WRITE"),),
        group=(1, 1, 1),
    )
    block, seen = Block(pair, color=(1, 2, 3, 4), factor=2.0), images.create(1, 1, "RGBA32F")
    for factor in (2.0, -0.5):
        block.update(color=(1, 2, 3, 4), factor=factor)
        passes.compute(program, (1, 1), images={"seen": seen}, blocks={"pair": block})
        np.testing.assert_array_equal(images.read(seen)[0, 0], np.array([1, 2, 3, 4]) * factor)


@pytest.mark.parametrize("struct", structs(), ids=lambda s: f"{s.name}-{s.dtype.itemsize}")
def test_every_block_fits_what_all_gpus_grant(struct):
    assert struct.dtype.itemsize % 16 == 0
    assert struct.dtype.itemsize <= 16384


def test_a_vec3_is_refused_with_the_types_that_are_not():
    with pytest.raises(ValueError, match=r"Struct Light: 'vec3' cannot stand in a struct; use one of float"):
        Struct("Light", ("vec3", "position"))


def test_an_array_of_small_types_is_refused():
    with pytest.raises(ValueError, match=r"array 'weights' must hold vec4 or mat4, not float"):
        Struct("Kernel", ("float", "weights[8]"))


def test_a_field_declared_twice_is_refused():
    with pytest.raises(ValueError, match=r"field 'size' is declared twice"):
        Struct("Film", ("vec4", "size"), ("int", "size"))


@pytest.mark.parametrize("values", [{"size": 1.0}, {"size": 1.0, "scale": 1.0, "colour": 0.0}])
def test_packing_names_what_is_missing_or_unknown(values):
    with pytest.raises(KeyError, match="scale" if len(values) == 1 else "colour"):
        Struct("Film", ("float", "size"), ("float", "scale")).pack(**values)
