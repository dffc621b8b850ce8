"""What shaders ask of a scene that not every scene has: the same functions without it, and the budget of textures."""

import re
from collections import Counter
from dataclasses import replace
from itertools import chain, combinations

import pytest

from addon.gfx.interface import Interface, answered, asked_by
from addon.gfx.library import FULLSCREEN_VERTEX, MOST_TEXTURES, SHADER_ROOT, get, resolve
from addon.lighting.asked import SHAPES
from addon.lighting.linked import LINKS
from addon.lighting.loop import RAYS_WHERE_NEAR, lighting
from addon.lighting.media import MEDIA
from addon.lighting.visibility import Lookup
from addon.scene.panorama import ANSWERS
from addon.sources.lights import SOURCES
from tests.gfx.declared import _found, programs

INTERFACES = (*SHAPES, LINKS)
LEAVES_OUT = re.compile(r"^// Leaves out (\w+): \w.+\.$", re.MULTILINE)
FUNCTION = re.compile(r"^(?:void|bool|int|float|vec[234]|Grass\w+) (\w+)\(", re.MULTILINE)


def lit_programs():
    """The pass of direct light with every lookup that is declared anywhere."""
    lookups = {one.name: one for one in (*_found(Lookup), RAYS_WHERE_NEAR)}
    return [lighting(lookups[name], soft) for name in sorted(lookups) for soft in (False, True)]


def asks(program):
    return [one for one in INTERFACES if one.asked in asked_by(program)]


def subsets(program):
    there = asks(program)
    return chain.from_iterable(combinations(there, count) for count in range(len(there) + 1))


@pytest.mark.parametrize("interface", INTERFACES, ids=lambda one: one.name)
def test_a_scene_without_it_has_the_same_functions(interface: Interface):
    neutral = FUNCTION.findall((SHADER_ROOT / interface.asked).read_text(encoding="utf-8"))
    own = FUNCTION.findall(resolve(interface.glsl, {})[0])
    assert neutral
    assert set(neutral) <= set(own)


def test_every_answer_of_every_program_keeps_to_the_textures_that_metal_allows():
    """`answered` refuses more; the counts are printed by -s."""
    made = [answered(one, some) for one in (*programs(), *lit_programs()) for some in subsets(one)]
    counts = Counter(len(one.textures) for one in made)
    most = max(counts)
    names = sorted({one.name for one in made if len(one.textures) == most})
    print(f"\n{len(made)} programs; at most {most} textures, in {len(names)}: {'; '.join(names)}")
    assert most <= MOST_TEXTURES


def test_a_program_that_reads_lights_asks_what_dims_them_or_says_why_not():
    """In a line of the shader, `// Leaves out media: …`, or in Program.leaves_out."""
    silent = []
    for one in (*programs(), *lit_programs()):
        if any(struct is SOURCES for struct, _ in one.blocks):
            found = [resolve(file, dict(one.snippets)) for file in (one.vertex, one.fragment, one.compute) if file]
            files = {file for _, origin in found for file, _ in origin}
            said = {name for name, _ in one.leaves_out}.union(*(LEAVES_OUT.findall(text) for text, _ in found))
            silent += [
                f"{one.name}: {kind.name}" for kind in (MEDIA, LINKS)
                if kind.name not in said and not files & {kind.asked, kind.glsl}
            ]  # fmt: skip
    assert not silent


@pytest.mark.slow
@pytest.mark.parametrize("file", sorted({one.fragment or one.compute for one in programs() if asks(one)}))
def test_a_shader_compiles_without_and_with_all_that_it_asks(file, gpu_context):
    """One program of each shader that asks: a file that forgets an include finds it in the other's."""
    program = next(one for one in programs() if file in (one.fragment, one.compute) and asks(one))
    *_, everything = subsets(program)
    for present in ((), everything):
        get(answered(program, present))


def asks_view(program):
    if "ask/view.glsl" not in asked_by(program) or program.vertex not in ("", FULLSCREEN_VERTEX):
        return False
    return "panoramas" not in LEAVES_OUT.findall(
        resolve(program.fragment or program.compute, dict(program.snippets))[0]
    )


@pytest.mark.slow
@pytest.mark.parametrize("file", sorted({one.fragment or one.compute for one in programs() if asks_view(one)}))
def test_a_shader_that_asks_the_view_compiles_for_a_panoramic_camera(file, gpu_context):
    program = next(one for one in programs() if file in (one.fragment, one.compute) and asks_view(one))
    get(replace(program, snippets=(*program.snippets, *ANSWERS)))
