"""What an edit costs the viewport, and what it keeps, publishes and frees."""

import bpy
import numpy as np
import pytest

from addon.frame import ledger
from addon.gfx import images
from addon.scene import acceleration, instance_tree
from tests.viewport.region import Region


def test_nothing_is_done_at_rest(region):
    region.rest()
    frame, uploads = region.viewport.frame, region.viewport.renderer.geometry.uploads
    before = region.reads
    for _ in range(3):
        region.draw()
    assert region.viewport.frame is frame and frame.samples_done == 4
    assert (region.reads, region.viewport.renderer.geometry.uploads) == (before, uploads)


def test_moving_the_view_reads_and_uploads_nothing(region):
    region.rest()
    before = region.reads, region.viewport.renderer.geometry.uploads
    for step in range(5):
        region.draw(region.moved(0.01 * step))
    assert (region.reads, region.viewport.renderer.geometry.uploads) == before


def test_update_that_changes_nothing_keeps_the_samples(region):
    region.rest()
    frame = region.viewport.frame
    region.viewport.dirty = True
    region.draw()
    assert region.viewport.frame is frame and region.viewport.done


def test_moved_object_starts_anew_and_uploads_no_mesh(scene, region):
    before = region.rest()
    uploads = region.viewport.renderer.geometry.uploads
    bpy.data.objects["Cube"].location.x += 0.5
    region.viewport.dirty = True
    after = region.rest()
    assert np.abs(after - before).max() > 0.05
    assert region.viewport.renderer.geometry.uploads == uploads


def lift():
    bpy.data.objects["Cube"].location.z += 0.4


def redden():
    material = bpy.data.objects["Cube"].active_material
    shader = next(node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED")
    red, *others = shader.inputs["Base Color"].default_value
    shader.inputs["Base Color"].default_value = (red + 0.2, 0.2 * others[0], 0.2 * others[1], 1.0)


@pytest.mark.parametrize("edit", [lift, redden])
def test_draft_after_an_edit_is_that_of_a_new_viewport(scene, region, edit):
    """Its rays search a tree that was refitted, its maps and the means of its materials are partly kept."""
    scene.candela.bounces = 2
    scene.candela.history_drafts = False  # it would join what is compared here with the picture before
    for k in range(4):
        bpy.ops.mesh.primitive_torus_add(location=(k - 1.5, -1.5, 0.5), major_segments=12, minor_segments=6)
    for name in ("Plane", "Cube", "Torus"):
        bpy.data.objects[name].active_material = made = bpy.data.materials.new(name)
        if bpy.app.version < (5, 0):
            made.use_nodes = True
    region.rest()
    for _ in range(2):
        edit()
        region.viewport.dirty = True
        picture = images.read(region.draw())
    assert region.viewport.scale > 1
    other = Region()
    other.viewport.scale, other.viewport.pace = region.viewport.scale, region.viewport.pace
    fresh = images.read(other.draw())
    other.viewport.release()
    assert np.isclose(picture, fresh, rtol=1e-3, atol=1e-4).all(axis=-1).mean() > 0.98


@pytest.mark.slow
@pytest.mark.parametrize("own_trees", [False, True])
def test_view_at_rest_keeps_a_large_tree_after_a_move(scene, region, monkeypatch, own_trees):
    """Small ones are built anew; so this one counts as large, and in turn all meshes have trees of their own."""
    monkeypatch.setattr(acceleration, "ALWAYS_FRESH", 0)
    monkeypatch.setattr(instance_tree, "OWN_TREE", 0 if own_trees else 10**9)
    scene.candela.bounces = 2
    for k in range(4):
        bpy.ops.mesh.primitive_torus_add(location=(k - 1.5, -1.5, 0.5), major_segments=12, minor_segments=6)
    region.rest()
    made, tree = [], acceleration.Tree
    monkeypatch.setattr(acceleration, "Tree", lambda *given: made.append(1) or tree(*given))
    bpy.data.objects["Torus"].location.z += 0.1
    region.viewport.dirty = True
    moved = region.rest()
    assert not made
    other = Region()
    fresh = other.rest()
    other.viewport.release()
    assert made and np.isclose(moved, fresh, rtol=1e-3, atol=1e-4).all(axis=-1).mean() > 0.95


def test_more_samples_continue_where_it_rested(scene, region):
    region.rest()
    frame = region.viewport.frame
    scene.candela.viewport_samples = 6
    region.rest()
    assert region.viewport.frame is frame and frame.samples_done == 6


def test_ledger_is_published_at_rest(region):
    region.rest()
    assert ledger.latest().samples == 4
    assert ledger.latest().row("surfaces").state == ledger.RAN


def test_viewports_do_not_share_samples(scene, region):
    other = Region()
    region.rest()
    other.camera = other.moved(1.0)
    there = other.rest()
    assert np.array_equal(images.read(region.draw()), region.rest())
    assert np.abs(there - region.rest()).max() > 0.05
    other.viewport.release()


@pytest.mark.slow
def test_resizing_leaves_no_images_behind(region):
    """As many after twelve sizes as after four: each number of shadow maps has an image, which is not the window's."""

    def resized(widths):
        for width in widths:
            region.draw(size=(width, 64))
        region.draw(size=(64, 64))
        region.rest()
        return images.pool.allocated_bytes

    region.rest()
    assert resized(range(70, 310, 20)) <= resized(range(100, 260, 40)) == resized(range(80, 320, 20))


def test_released_viewport_holds_no_image(scene):
    images.pool.trim()
    before = images.pool.allocated_bytes
    made = Region()
    made.rest()
    assert images.pool.allocated_bytes > before
    made.viewport.release()
    images.pool.trim()
    assert images.pool.allocated_bytes == before


def test_picture_comes_back_after_an_error_that_changed_nothing(region):
    region.viewport.pace.cost = {1: 1e-3}  # fast: the frame is begun at full resolution, as the one before
    before = region.rest()
    region.viewport.drop()
    assert region.viewport.picture is None
    np.testing.assert_array_equal(region.rest(), before)
