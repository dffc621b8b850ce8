"""Sources without what a program does not use."""

import pytest

from addon.gfx.library import resolve
from addon.gfx.stripping import without_unused

SOURCE = """\
// A comment.
#define CALLS(x) by_macro(x)
#define UNUSED(x) by_unused_macro(x)
const float START = first_value;
float by_macro(float x)
{
  return x;  // says nothing
}

float by_unused_macro(float x)
{
  return x;
}

#ifdef SOME
float split(float x)
#else
float split(vec2 x)
#endif
{
  return 1.0;
}

float deeper(float x) { return x; }
float called(float x,
             float y)
{
#ifdef SOME
  return deeper(x);
#else
  return y;
#endif
}

vec3 never_called(vec3 v)
{
  if (v.x > 0.0) {
    return never_called(v);
  }
  return v;
}
void main()
{
  result = CALLS(called(1.0, 2.0));
}
"""


@pytest.mark.parametrize(("function", "stays"), [
    ("by_macro", True), ("deeper", True), ("called", True), ("split", True),
    ("never_called", False), ("by_unused_macro(float", False),
])  # fmt: skip
def test_functions_that_nothing_calls_go(function, stays):
    text, origin = without_unused(*resolve("own", {"own": SOURCE}))
    assert (f"{function}" in text.replace("#define UNUSED(x) by_unused_macro(x)", "")) == stays
    assert text.count("#if") == text.count("#endif") and "comment" not in text and "says" not in text
    assert text.count("\n") == len(origin)


def test_lines_keep_their_places():
    text, origin = without_unused(*resolve("own", {"own": SOURCE}))
    lines = SOURCE.split("\n")
    assert all(lines[number - 1].startswith(line) for line, (_, number) in zip(text.split("\n"), origin))


def test_names_that_defines_call_stay():
    text, _ = without_unused(*resolve("own", {"own": SOURCE}), frozenset({"never_called"}))
    assert "never_called" in text


def test_light_paths_program_is_half_as_long():
    whole = resolve("indirect/candidates.frag.glsl", {})
    assert len(without_unused(*whole)[0]) < 0.6 * len(whole[0])
