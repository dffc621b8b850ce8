"""Depth complexity by rasterised wedges and by the gather: the same bits from other hardware."""

import numpy as np
import pytest

from addon.gfx import images
from addon.lighting import edge_raster
from addon.lighting.edge_shadows import point_patterns

from .test_depth_complexity import by_edges, fill, lamp, technique  # noqa: F401 - a fixture


@pytest.mark.parametrize("kind", ("RECTANGLE", "ELLIPSE", "SUN"))
def test_wedges_that_are_drawn_count_as_the_gather_does(by_edges, kind, monkeypatch):  # noqa: F811
    """Every bit of every pixel, with the eye inside of wedges and outside."""
    stage = by_edges
    fill(stage)
    lamp(stage, kind)
    stage.camera((0.1, -1.8, 1.6), (1.0, 0, 0.1), 1.2)
    stage.scene.candela.depth_complexity_mode = "POINTS"
    kept = {}

    def gathered(self, frame, lit, views, found):
        yield from gather(self, frame, lit, views, found)
        kept.update(lit=lit, samples=[view.sample for view in views], by_wedges=_drawn(frame, lit, views))

    gather = technique_class().gather
    monkeypatch.setattr(technique_class(), "gather", gathered)
    stage.render(size=(48, 32))
    own = technique(stage)
    width, height = 48, 32
    words = images.read(own.tiles._kept["seen_points"])[..., 0].reshape(-1, height, width)
    receivers = images.read(own.tiles._kept["receivers"]).reshape(height, width, 4)
    seen = np.stack([(words[k // 32] >> (k % 32)) & 1 for k in range(64)], axis=-1).astype(bool)
    valid = receivers[..., 3] != 0
    layers = kept["by_wedges"]
    assert 0.1 < seen[valid].mean() < 0.95 and layers[valid].min() >= 0 and layers.max() >= 2
    assert np.array_equal((layers == 0)[valid], seen[valid])


def technique_class():
    from addon.techniques.depth_complexity import DepthComplexity

    return DepthComplexity


def _drawn(frame, lit, views):
    """Layers (H, W, 64) by path A, of the light that was just gathered."""
    width, height = frame.size
    texels, shape = point_patterns(lit.extent, [view.sample for view in views])
    before = lit.values["shape"]
    lit.update(shape=shape, pattern_count=1)
    counters = [images.create(width, height, "RGBA32F") for _ in range(4)]
    for image in counters:
        images.Target((image,)).clear((edge_raster.cleared(),) * 4)
    prisms = edge_raster.prisms(lit.found.wedges, 20.0)
    edge_raster.draw(
        frame, lit, images.upload_list(prisms.reshape(-1, 4)), images.upload(texels), images.Target(tuple(counters))
    )
    lit.update(shape=before)
    return edge_raster.layers([images.read(one) for one in counters], images.read(lit.count)[..., 0])
