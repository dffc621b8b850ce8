"""Shadow catchers in a view: left out while it moves, and at rest as the final render shows them."""

import bpy
import numpy as np
import pytest

from addon.frame.run import Renderer
from addon.gfx import images
from tests.viewport.test_picture import final_picture

SAMPLES = 2


@pytest.fixture
def floor(scene):
    """The floor of the scene, as a shadow catcher, under a grey sky. A view has one point per light in each sample."""
    before, scene.world = scene.world, bpy.data.worlds.new("Grey")
    scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.05, 0.1, 0.2, 1.0)
    scene.candela.light_probes_maps, scene.candela.bounces = 0, 1
    found = next(one for one in scene.objects if one.type == "MESH" and one.dimensions.z == 0.0)
    found.is_shadow_catcher = True
    yield found
    scene.render.film_transparent, scene.world = False, before


@pytest.mark.parametrize("transparent", [True, False])
def test_the_picture_at_rest_is_the_final_render(scene, region, floor, tmp_path, transparent):
    scene.render.film_transparent = transparent
    scene.candela.viewport_samples = SAMPLES
    shown = region.rest()
    final = final_picture(scene, tmp_path, SAMPLES)
    if transparent:
        assert ((final[..., 3] > 0.05) & (final[..., :3].max(axis=-1) == 0.0)).sum() > 50  # shadows on nothing
    np.testing.assert_allclose(shown, final, atol=1e-4)


def test_drafts_leave_catchers_out_and_say_so(scene, region, floor):
    scene.candela.viewport_samples = 1
    scene.render.film_transparent = True
    at_rest = region.rest()
    assert region.viewport.warning() == ""
    region.viewport.pace.cost = {1: 1.0, 2: 0.3, 4: 0.06}
    draft = images.read(region.draw(region.moved(0.1)))
    assert "Shadow catchers" in region.viewport.warning()
    assert not region.viewport.catchers.known and region.viewport.catchers._renderer is None
    assert draft[..., 3].mean() < at_rest[..., 3].mean() - 0.02  # without the shadow


@pytest.mark.slow
def test_work_that_is_parted_and_another_film_give_the_same_picture(scene, region, floor):
    scene.candela.viewport_samples = 1
    opaque = region.rest()
    scene.render.film_transparent = True
    region.viewport.dirty, region.clock.tick = True, 0.005
    transparent = region.rest()
    assert transparent[..., 3].min() < 0.1 and opaque[..., 3].min() == 1.0
    scene.render.film_transparent = False
    region.viewport.dirty = True
    np.testing.assert_allclose(region.rest(), opaque, atol=1e-5)


def test_an_edit_ends_the_catching(scene, region, floor):
    scene.candela.viewport_samples = 1
    scene.render.film_transparent = True
    region.rest()
    catchers = region.viewport.catchers
    kept = list(catchers._lit.values())
    assert len(kept) == 2 and catchers._renderer is None
    floor.is_shadow_catcher = False
    region.viewport.dirty = True
    whole = region.rest()
    assert not catchers._lit and catchers.scene is None and region.viewport.warning() == ""
    assert whole[0, 0, 3] == pytest.approx(1.0)  # the floor, as any other


def test_scenes_without_catchers_make_one_picture(scene, region, monkeypatch):
    made = []
    monkeypatch.setattr(Renderer, "__init__", lambda self, *a, own=Renderer.__init__: made.append(1) or own(self, *a))
    scene.candela.viewport_samples = 1
    region.rest()
    assert not made and not region.viewport.catchers._lit
