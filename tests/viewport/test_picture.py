"""The viewport's picture: that of the final render, parted by bands, inside its border."""

from dataclasses import replace

import bpy
import numpy as np
import pytest

from addon import viewport
from addon.frame.bands import Bands
from addon.gfx import images
from addon.snapshot import camera_of_scene, camera_of_view
from addon.snapshot.scene import Note
from addon.ui import viewport_pass
from addon.ui.properties import settings_of
from tests.viewport.region import SIZE
from tests.viewport.test_compiling import material_named


def final_picture(scene, tmp_path, samples):
    """The final render in scene-linear values, (H, W, 4), bottom row first."""
    scene.candela.samples = samples
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    scene.render.resolution_percentage = 100
    settings = scene.render.image_settings
    settings.file_format, settings.color_mode, settings.color_depth = "OPEN_EXR", "RGBA", "32"
    scene.render.filepath = str(tmp_path / "final.exr")
    bpy.ops.render.render(write_still=True)
    loaded = bpy.data.images.load(scene.render.filepath)
    pixels = np.array(loaded.pixels[:], np.float32).reshape(SIZE[1], SIZE[0], 4)
    bpy.data.images.remove(loaded)
    return pixels


def displayed(pixels):
    """0…255 as a display without a look shows it."""
    return 255 * np.clip(pixels[..., :3], 0, 1) ** (1 / 2.2)


def test_picture_at_rest_is_the_final_render(scene, region, tmp_path):
    scene.candela.light_probes_maps = 0  # a view shows every sample: one point per light in each
    shown = region.rest()
    final = final_picture(scene, tmp_path, samples=4)
    assert final[..., :3].std() > 0.01
    difference = np.abs(displayed(shown) - displayed(final)).max(axis=-1)
    assert (difference <= 2).mean() >= 0.99


def test_view_matrices_give_the_picture_of_the_camera(scene, region):
    """What Blender hands to view_draw in camera view leads to the same picture as the camera itself."""

    class RegionData:
        is_perspective = True
        view_matrix = scene.camera.matrix_world.inverted()
        window_matrix = scene.camera.calc_matrix_camera(region.depsgraph, x=SIZE[0], y=SIZE[1])

    by_camera = region.rest()
    region.camera = camera_of_view(RegionData, None, scene.camera)
    difference = np.abs(displayed(region.rest()) - displayed(by_camera)).max(axis=-1)
    assert (difference <= 2).mean() >= 0.99


@pytest.mark.parametrize("glass", [False, True])
def test_bands_change_no_pixel(region, glass):
    names = {"direct_light", "instant_radiosity"} | ({"traced_refraction"} if glass else set())
    if glass:
        material = material_named("Glass")
        material.node_tree.nodes["Principled BSDF"].inputs["Transmission Weight"].default_value = 1.0
        bpy.data.objects["Cube"].data.materials.append(material)

    class Thin(Bands):
        def split(self, name, height):
            names.discard(name)
            return super().split(name, height)

        def learn(self, seconds, wanted):
            self._rows = dict.fromkeys(("direct_light", "instant_radiosity", "traced_refraction"), 5)

    class Whole(Bands):
        def split(self, name, height):
            yield 0, height

    region.viewport.bands = Whole()
    whole = region.rest()
    region.viewport.bands = Thin()
    region.draw(region.moved(0.1))
    assert np.array_equal(region.rest(), whole)
    assert not names


def test_sample_that_was_left_unfinished_is_not_continued_from(scene, region):
    whole = region.rest()
    region.viewport.renderer.begin(replace(region.viewport.frame.snapshot), replace(region.viewport.frame.settings))
    frame = region.viewport.frame
    parts = region.viewport.renderer.steps(frame)
    next(parts), next(parts), next(parts)
    parts.close()
    region.viewport.dirty = True
    assert np.array_equal(region.rest(), whole)
    assert region.viewport.frame is not frame


@pytest.mark.parametrize("scale", [1, 4])
def test_only_the_border_is_drawn(scene, region, scale):
    scene.candela.bounces = 0  # which lights stand for indirect light follows from what the picture shows
    whole = region.rest()
    border = (24, 16, 72, 40)
    settings = settings_of(bpy.context.scene, viewport=True)
    if scale > 1:
        region.viewport.pace.cost = {1: 1.0, 2: 0.3, 4: 0.06}
    else:
        region.viewport.pace.cost = {1: 0.01}
    for _ in range(1 if scale > 1 else 20):
        picture = region.viewport.draw_frame(region.source, region.camera, SIZE, settings, region.clock, border)
    assert region.viewport.display.place == (24, 16, 48, 24)
    assert picture.size == (48 // scale, 24 // scale)
    if scale == 1:
        difference = np.abs(displayed(images.read(picture)) - displayed(whole[16:40, 24:72])).max(axis=-1)
        assert (difference <= 2).mean() >= 0.99


def test_border_of_the_camera_lies_in_its_frame(scene, region):
    """A region twice as wide as the camera's frame shows the frame in its middle."""
    scene.render.resolution_x, scene.render.resolution_y = 100, 100
    scene.render.use_border = True
    scene.render.border_min_x, scene.render.border_max_x = 0.0, 0.5
    scene.render.border_min_y, scene.render.border_max_y = 0.25, 1.0
    camera = camera_of_scene(scene, region.depsgraph, 100, 100)
    left, right, bottom, top = camera.frame
    wide = replace(camera, frame=(2 * left, 2 * right, bottom, top))
    assert viewport.render_border(region.depsgraph, None, wide, scene.camera, (400, 200)) == (100, 50, 200, 200)


def test_the_text_says_what_the_picture_has_lost(region):
    region.rest()
    assert region.viewport.warning() == ""
    lost = Note("Material 'Fur'", "'Hair' is not supported yet; it is drawn as a diffuse surface.")
    region.viewport.frame.ledger.notes = (Note("World", "It is drawn with fewer texels."), lost)
    assert region.viewport.warning() == str(lost)
    region.viewport.frame.ledger.notes *= 2
    assert region.viewport.warning().endswith("(and 1 more, in Render Properties)")
    region.viewport.frame.ledger.notes = (Note("Material 'Fur'", 300 * "x" + " is not drawn."),)
    assert len(region.viewport.warning()) <= 160


def test_the_menu_of_passes_shows_one_in_the_pictures_place(scene, region):
    """What the light paths bring sums up to the picture; normals have the length 1; positions are the scene's."""
    scene.candela.viewport_samples = 1
    combined = region.rest()[..., :3]

    def shown(key):
        region.viewport.render_pass = viewport_pass.OFFERED[key]
        return region.rest()[..., :3]

    total = shown("ENVIRONMENT") + shown("DIFFUSE_COLOR") * (shown("DIFFUSE_DIRECT") + shown("DIFFUSE_INDIRECT"))
    total += shown("GLOSSY_COLOR") * (shown("GLOSSY_DIRECT") + shown("GLOSSY_INDIRECT"))
    assert abs(total.mean() - combined.mean()) < 0.02 * combined.mean()
    assert np.linalg.norm(shown("NORMAL"), axis=-1).max() == pytest.approx(1.0, abs=0.01)
    assert np.ptp(shown("POSITION")) > 1.0
