"""Voronoi textures by themselves."""

import numpy as np

from tests.glsl import evaluated


def test_octaves_of_edges_count_by_their_roughness(gpu_context):
    """The second one, at twice the scale, by .05 where the roughness is .05, as far as its edges are nearer."""

    def edges(scale, detail):
        before = f"""float found;
  voronoi_edge_texture(vec3(k, 0.3, 0.7), 0.0, {scale}, {detail}, 0.05, 2.0, 1.0, 3, true, false, found);"""
        return evaluated("material/voronoi.glsl", "vec4(found)", before=before)[:, 0]

    one, finer = edges(6.0, 0.0), edges(12.0, 0.0) / 2.0
    assert (finer < one).any()
    np.testing.assert_allclose(edges(6.0, 1.0), 0.95 * one + 0.05 * np.minimum(one, finer), atol=1e-6)
