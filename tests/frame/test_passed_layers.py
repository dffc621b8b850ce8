"""Light that passes slabs of what absorbs, by a ray's own count of their faces."""

import numpy as np
import pytest

from addon.gfx import images, passes
from addon.gfx.library import Program
from addon.scene import acceleration
from addon.scene.traced_triangles import STAINED

LIMITS = (0.5, 1.5, 2.5, 3.25, 4.5, 5.5, 1e30)
PASSING = 2048.0 + 1.0  # one step of opacity on either side
PER_METRE = np.array([0.2, 0.7, 1.5])
MAIN = """#include "trace/rays.glsl"
void main()
{
  ivec2 hit;
  trace_nearest(vec3(0.0), vec3(0.0, 0.0, 1.0), 1e30, 0u, hit);
  for (int k = 0; k < LIMITS; k++) {
    imageStore(found, ivec2(k, 0), vec4(layers_color(sent_fetch(ivec2(k, 0)).x), float(hit.x)));
  }
}
"""
PROGRAM = Program(
    name="layers that a ray passes",
    compute="generated/main",
    textures=(*acceleration.HIERARCHY_TEXTURES, ("RGBA32F", "sent")),
    images=(("found", "RGBA32F", "FLOAT_2D", "WRITE"),),
    snippets=(("generated/main", MAIN),),
    defines=(("LIMITS", str(len(LIMITS))),),
    group=(1, 1, 1),
)


def colors(count: int) -> np.ndarray:
    """(LIMITS, 3) of a ray that passes `count` faces at 1, 2, .. m, each second of which it leaves by."""
    order = np.random.default_rng(count).permutation(count)
    face = np.array([(-1, -1, 1), (3, -1, 1), (-1, 3, 1)], float)
    corners = np.array([face[:: 1 if k % 2 else -1] * (1, 1, k + 1) for k in order], np.float32)
    look = np.zeros((count, 8))
    look[:, 0] = -PASSING
    look[:, 1], look[:, 3] = STAINED, 1.0  # the record below
    tiles = np.array([[0, 0, 0, 0], [*PER_METRE, 0], [1, 1, 1, 0]], np.float32)
    trees = acceleration.build(corners, look, tiles)
    sent = np.zeros((1, len(LIMITS), 4), np.float32)
    sent[0, :, 0] = LIMITS
    found = images.create(len(LIMITS), 1, "RGBA32F")
    textures = {**trees.hierarchy.textures, "sent": images.upload(sent)}
    passes.compute(PROGRAM, (1, 1), textures=textures, images={"found": found})
    texels = images.read(found)[0]
    assert (texels[:, 3] < 0).all()
    return texels[:, :3]


@pytest.mark.usefixtures("gpu_context")
@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_slabs_absorb_up_to_any_distance(count):
    """Also where a ray ends between their faces."""
    for limit, found in zip(LIMITS, colors(count)):
        end = (
            min(limit, count) if limit == 1e30 else limit
        )  # what it enters and does not leave absorbs nothing without one
        inside = sum(np.clip(end - k, 0.0, 1.0 if k < count else np.inf) for k in range(1, count + 1, 2))
        assert found == pytest.approx(np.exp(-PER_METRE * inside), rel=1e-4)


@pytest.mark.usefixtures("gpu_context")
@pytest.mark.parametrize("count", [5, 6, 7])
def test_more_slabs_absorb_all_along_a_ray_without_an_end(count):
    """What it enters last and does not leave absorbs nothing."""
    assert colors(count)[-1] == pytest.approx(np.exp(-PER_METRE * (count // 2)), rel=1e-4)
