"""Materials with a surface program of their own: what it moves is moved in the picture, its depth and its shadows."""

from dataclasses import replace

import numpy as np
import pytest

from addon.materials.compiled import OwnSurface
from addon.scene.materials import MaterialSet
from tests.techniques.conftest import places

# Lifts the surface by a metre to the right of the middle and lets rays pass to its left.
LIFTED = OwnSurface("""
bool own_surface(inout SurfacePoint point, Instance instance)
{
  point.position += point.incoming / point.incoming.z;
  return point.position.x > 0.0;
}
""")


@pytest.fixture
def lifted(monkeypatch):
    """Every material named Lifted has that program."""
    made = MaterialSet.update

    def update(self, snapshot):
        made(self, snapshot)
        for k, one in enumerate(self.compiled):
            if one.name == "Lifted":
                self.compiled[k] = replace(one, own_surface=LIFTED, casts_stochastically=True)
                self.own_images[k] = {}
        self.share()  # what has a program of its own is not drawn with others

    monkeypatch.setattr(MaterialSet, "update", update)


def test_what_an_own_program_moves_is_seen_cut_and_casts_where_it_is(stage, lifted):
    above, below = stage.diffuse(), stage.diffuse(0.5)
    above.name = "Lifted"
    stage.rectangle((-1, -1), (1, 1), 0.0, material=above)
    stage.rectangle((-1, -1), (1, 1), 0.5, material=stage.diffuse(0.25))  # hides the mesh, and not what it becomes
    stage.floor(material=below, location=(0, 0, -1))
    stage.light("SUN", turn=(0, 0.7853982, 0), angle=0.0)  # from the right, 45 degrees high
    stage.camera_above()
    passes = stage.render(size=(32, 32))
    x, y = places((32, 32))
    depth = passes["depth"][..., 0]
    inside = (np.abs(x) < 0.9) & (np.abs(y) < 0.9)
    assert np.allclose(depth[inside & (x > 0.1)], 9.0, atol=1e-4)
    assert np.allclose(depth[inside & (x < -0.1)], 9.5, atol=1e-4)
    shade = passes["diffuse_direct"][..., 0]
    # The lifted half from 0 to 1 at height 1 casts on what stands at height 0.5 half a metre further left.
    card = (np.abs(y) < 0.9) & (x < -0.1) & (x > -0.9)
    assert (shade[card & (x > -0.4)] < 1e-3).all()
    assert (shade[card & (x < -0.6)] > 0.1).all()
