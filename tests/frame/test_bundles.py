"""Bundles of short rays find what single rays do."""

import numpy as np
import pytest

from addon.gfx import images, passes
from addon.gfx.library import Program
from addon.scene import acceleration

BUNDLES, RAYS = 512, 4
OPAQUE, SHEER = 2047 * 2049, 1000 * 2049  # codes of both sides alike
MAIN = """
#define OPAQUE_ONLY
#include "trace/bundle.glsl"
void main()
{
  int bundle = int(gl_GlobalInvocationID.x);
  if (bundle >= BUNDLES) {
    return;
  }
  vec3 origin = sent_fetch(ivec2(0, bundle)).xyz;
  mat4 rays;
  uint open = 0u;
  float single = 0.0;
  for (int k = 0; k < 4; k++) {
    vec4 ray = sent_fetch(ivec2(1 + k, bundle));
    rays[k] = ray;
    if (ray.w > 0.0) {
      open |= 1u << uint(k);
      ivec2 hit;
      single += (trace_until(origin, ray.xyz, ray.w, ray.w, 0u, hit) >= ray.w) ? exp2(float(k)) : 0.0;
    }
  }
  imageStore(found, ivec2(bundle, 0), vec4(float(clear_bundle(origin, rays, open)), single, float(open), 0.0));
}
"""
PROGRAM = Program(
    name="bundles beside rays",
    compute="generated/main",
    textures=(*acceleration.HIERARCHY_TEXTURES, ("RGBA32F", "sent")),
    images=(("found", "RGBA32F", "FLOAT_2D", "WRITE"),),
    snippets=(("generated/main", MAIN),),
    defines=(("BUNDLES", str(BUNDLES)),),
    group=(64, 1, 1),
)


def sent(rng, count, spread, reach):
    """Bundles of up to four rays: an origin, and directions with lengths; (BUNDLES, 5, 4)."""
    rays = np.zeros((BUNDLES, 1 + RAYS, 4), np.float32)
    rays[:, 0, :3] = rng.uniform(-1, 1, (BUNDLES, 3))
    directions = rng.normal(size=(BUNDLES, 1, 3)) + spread * rng.normal(size=(BUNDLES, RAYS, 3))
    rays[:, 1:, :3] = directions / np.linalg.norm(directions, axis=2, keepdims=True)
    rays[:, 1 : 1 + count, 3] = rng.uniform(0.2, 1.0, (BUNDLES, count)) * reach
    return rays


@pytest.mark.parametrize("count", [1, 3, 4])
@pytest.mark.parametrize(("spread", "reach"), [(0.05, 0.3), (1.0, 0.3), (10.0, 3.0)])
@pytest.mark.parametrize("triangles", [0, 1, 600])
def test_bundles_meet_what_each_of_their_rays_meets(gpu_context, count, spread, reach, triangles):
    rng = np.random.default_rng(7)
    corners = rng.uniform(-1, 1, (triangles, 1, 3)) + rng.uniform(-0.15, 0.15, (triangles, 3, 3))
    corners[: triangles // 6, :, 2] = 0.25  # flat boxes
    look = rng.uniform(0, 1, (triangles, 8))
    look[:, 0] = np.where(rng.uniform(size=triangles) < 0.8, OPAQUE, SHEER)
    tree = acceleration.build(corners.astype(np.float32), look)
    found = images.create(BUNDLES, 1, "RGBA32F")
    rays = images.upload(sent(rng, count, spread, reach))
    passes.compute(PROGRAM, (BUNDLES, 1), textures={**tree.hierarchy.textures, "sent": rays}, images={"found": found})
    bundle, single, asked, _ = images.read(found)[0].T
    assert (asked == 2**count - 1).all()
    assert (bundle == single).all()
    if triangles == 600:
        assert 0.02 < (single != asked).mean() < 0.98
