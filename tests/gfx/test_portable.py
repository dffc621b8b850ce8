"""What some drivers let pass and others refuse: laws of shaders/README.md, checked by reading the sources."""

import re

import pytest

from addon.gfx.library import GENERATED, SHADER_ROOT, resolve
from tests.gfx.declared import programs

FILES = sorted(path.relative_to(SHADER_ROOT).as_posix() for path in SHADER_ROOT.rglob("*.glsl"))
TYPES = "float|int|uint|bool|[biu]?vec[234]|mat[234]"
STRUCT = re.compile(r"\bstruct\s+(\w+)")
METAL_WORDS = (  # of C++ and Metal, which are plain names in GLSL
    "alignas|auto|class|compute|constant|constexpr|delete|device|enum|explicit|extern|fragment|friend|half|"
    "inline|kernel|long|mutable|namespace|new|operator|private|protected|public|register|short|signed|sizeof|"
    "static_cast|template|texture|this|thread|threadgroup|typedef|typename|uchar|ulong|union|unsigned|ushort|"
    "using|vertex|virtual"
)


def code_of(text):
    return re.sub(r"//[^\n]*|/\*.*?\*/", "", text, flags=re.DOTALL)


def sources(program):
    snippets = dict(program.snippets)
    return "\n".join(
        code_of(resolve(file, snippets)[0]) for file in (program.vertex, program.fragment, program.compute) if file
    )


TEXTS = (*((SHADER_ROOT / file).read_text(encoding="utf-8") for file in FILES), *GENERATED.values())
STRUCTS = {name for text in TEXTS for name in STRUCT.findall(code_of(text))}


@pytest.mark.parametrize("file", FILES)
def test_structs_are_filled_field_by_field_and_names_are_no_words_of_metal(file):
    code = code_of((SHADER_ROOT / file).read_text(encoding="utf-8"))
    assert not re.findall(rf"\b(?:{'|'.join(STRUCTS)})\s*\(", code)
    assert not re.findall(rf"\b(?:{METAL_WORDS})\b", re.sub(r'#include\s+"[^"]*"', "", code))
    assert "##" not in code


@pytest.mark.parametrize("file", FILES)
def test_globals_have_no_value_from_the_start(file):
    """What stands outside of all braces is a function, a struct, a constant, or a variable that functions set. On Metal
    Blender makes such variables members of a class (EEVEE's own node trees have them), and a member needs no value."""
    code, depth, outside = code_of((SHADER_ROOT / file).read_text(encoding="utf-8")), 0, ""
    for character in re.sub(r"^\s*#.*(?:\\\n.*)*$", "", code, flags=re.MULTILINE):
        depth += {"{": 1, "}": -1}.get(character, 0)
        outside += character if depth == 0 else ""
    assert not re.findall(rf"(?m)^\s*(?:{TYPES}|{'|'.join(STRUCTS)})\s+\w+(?:\[[^;]*\])?\s*=[^;]*;", outside)


@pytest.mark.parametrize("program", programs(), ids=lambda program: program.name)
def test_nothing_has_the_name_of_what_is_bound(program):
    """Blenders make those names macros: a parameter, local or member of that name would be replaced, too."""
    bound = [name for _, name in (*program.textures, *program.constants, *program.blocks)]
    bound += [image[0] for image in program.images]
    code = sources(program)
    declared = set(re.findall(rf"\b(?:{TYPES}|{'|'.join(STRUCTS)})\s+(\w+)", code))
    members = set(re.findall(r"\.\s*(\w+)", code))
    assert not {name for name in bound if name in declared | members}
