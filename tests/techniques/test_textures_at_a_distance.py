"""Textures smaller than pixels: one sample shows what Cycles shows on average, many samples show the same as Cycles."""

import bpy
import numpy as np
import pytest

from addon.compare.metrics import relative_squared_error
from addon.frame.picture import Frame

SIZE = (64, 48)


def blocks(side=256, block=8):
    """Squares of random colours with noise, (side, side, 4)."""
    rng = np.random.default_rng(1)
    coarse = rng.integers(0, 256, (side // block, side // block, 3)).repeat(block, 0).repeat(block, 1)
    pixels = np.ones((side, side, 4), np.float32)
    pixels[..., :3] = np.round(np.clip(coarse + rng.integers(-40, 40, (side, side, 3)), 0, 255)) / 255
    return pixels


def data_block(pixels):
    made = bpy.data.images.new("texture", pixels.shape[1], pixels.shape[0], alpha=True)
    made.pixels.foreach_set(pixels.astype(np.float32).ravel())
    made.update()
    return made


def shows(stage, pixels, shader="ShaderNodeEmission", socket="Color", repeats=1.0, alpha=None):
    """A material that shows an image, and its texture node; `alpha`: the socket that its alpha goes to."""
    made = stage.material(shader)
    tree = made.node_tree
    texture, mapping = tree.nodes.new("ShaderNodeTexImage"), tree.nodes.new("ShaderNodeMapping")
    texture.image = data_block(pixels)
    mapping.inputs["Scale"].default_value = (repeats, repeats, 1)
    tree.links.new(tree.nodes.new("ShaderNodeUVMap").outputs[0], mapping.inputs[0])
    tree.links.new(mapping.outputs[0], texture.inputs[0])
    given = next(node for node in tree.nodes if node.bl_idname == shader)
    tree.links.new(texture.outputs["Color"], given.inputs[socket])
    if alpha is not None:
        tree.links.new(texture.outputs["Alpha"], given.inputs[alpha])
    return made, texture


def with_uv(placed):
    layer = placed.data.uv_layers.new(name="UVMap")
    for corner, place in enumerate([(0, 0), (1, 0), (1, 1), (0, 1)]):
        layer.uv[corner].vector = place
    return placed


def floor(stage, pixels=None, repeats=40.0, **how):
    """A floor that recedes to the horizon; its texture node."""
    stage.scene.render.filter_size = 1.5
    material, texture = shows(stage, blocks() if pixels is None else pixels, repeats=repeats, **how)
    with_uv(stage.rectangle((-40, -40), (40, 40), material=material))
    stage.camera((0, -35, 1.5), (np.pi / 2 - 0.12, 0, 0.05), angle=1.0)
    return texture


def picture(stage, samples, engine="CANDELA", **how):
    return stage.render(samples, SIZE, engine=engine, **how)["combined"]


def error(found, reference):
    return float(relative_squared_error(found[..., :3], reference[..., :3]).mean())


@pytest.fixture
def by_points(monkeypatch):
    """Renders with lookups that show what stands at the point, as all did before."""

    def rendered(stage, samples, **how):
        with monkeypatch.context() as patch:
            patch.setattr(Frame, "_footprints", lambda _: (0.0, 0.0))
            stage.renderer.forget()
            found = picture(stage, samples, **how)
        stage.renderer.forget()
        return found

    return rendered


@pytest.mark.slow
def test_one_sample_of_a_floor_to_the_horizon_is_as_smooth_as_the_mean(stage, by_points):
    floor(stage)
    reference = picture(stage, 1024, "CYCLES")
    one = error(picture(stage, 1), reference)
    assert one < 0.03
    assert one < 0.15 * error(by_points(stage, 1), reference)
    assert one < error(picture(stage, 8, "CYCLES"), reference)


@pytest.mark.parametrize("kind", ["colours", "texels", "data"])
def test_many_samples_show_what_cycles_shows(stage, by_points, kind):
    pixels = blocks()
    if kind == "texels":  # black and white texels: lookups between them are what levels have to average
        y, x = np.mgrid[0:256, 0:256]
        pixels[..., :3] = ((x + y) % 2)[..., None]
    texture = floor(stage, pixels)
    if kind == "data":
        texture.image.colorspace_settings.name = "Non-Color"
    reference = picture(stage, 1024, "CYCLES")
    found = picture(stage, 64)
    assert error(found, reference) < max(0.5 * error(by_points(stage, 64), reference), 5e-4)
    ground = reference[: SIZE[1] // 2, :, :3].mean()
    assert found[: SIZE[1] // 2, :, :3].mean() == pytest.approx(ground, rel=0.01)


@pytest.mark.parametrize("samples", [1, 64])
def test_a_floor_seen_close_is_not_blurred(stage, by_points, samples):
    """Where texels are larger than pixels nothing is averaged but what the pixel filter covers."""
    floor(stage, blocks(32, 1), repeats=4.0)
    reference = picture(stage, 1024, "CYCLES")
    assert error(picture(stage, samples), reference) <= 1.05 * error(by_points(stage, samples), reference) + 1e-5


def test_closest_stays_as_it_is(stage, by_points):
    floor(stage).interpolation = "Closest"
    np.testing.assert_array_equal(picture(stage, 1), by_points(stage, 1))


def test_a_narrow_pixel_filter_sees_points(stage, by_points):
    floor(stage)
    stage.scene.render.filter_size = 0.01
    found, points = picture(stage, 1), by_points(stage, 1)
    assert np.median(np.abs(found - points)[: SIZE[1] // 4]) == 0.0


def leaves(stage, alpha):
    """Cards one behind the other that show small green leaves on red that is transparent, over blue; emission."""
    stage.scene.render.filter_size = 1.5
    pixels = np.zeros((256, 256, 4), np.float32)
    pixels[:] = (1, 0, 0, 0)
    y, x = np.mgrid[0:256, 0:256]
    pixels[((x % 16) - 8) ** 2 + ((y % 16) - 8) ** 2 < 30] = (0.1, 0.8, 0.1, 1)
    material, texture = shows(stage, pixels, "ShaderNodeBsdfPrincipled", "Emission Color", 8.0, alpha)
    principled = next(node for node in material.node_tree.nodes if node.bl_idname == "ShaderNodeBsdfPrincipled")
    principled.inputs["Emission Strength"].default_value = 1.0
    principled.inputs["Base Color"].default_value = (0, 0, 0, 1)
    for k in range(3):
        with_uv(stage.rectangle((-6, -5), (6, 5), z=-k - 1.0, material=material))
    blue = stage.material("ShaderNodeEmission", Color=(0, 0, 1, 1))
    stage.rectangle((-60, -60), (60, 60), z=-6.0, material=blue)
    stage.camera((0, 0, 24), (0, 0, 0), angle=0.6)
    return material, texture


@pytest.mark.slow
@pytest.mark.parametrize("samples", [1, 64])
def test_leaves_keep_their_density(stage, by_points, samples):
    leaves(stage, "Alpha")
    reference = picture(stage, 256, "CYCLES")
    found, middle = picture(stage, samples), np.s_[8:-8, 8:-8]
    tolerance = 0.02 if samples == 1 else 0.01  # of one sample: 1536 pixels, dithered
    np.testing.assert_allclose(
        found[middle][..., :3].mean((0, 1)), reference[middle][..., :3].mean((0, 1)), atol=tolerance
    )  # fmt: skip
    assert error(found, reference) < 1.05 * error(by_points(stage, samples), reference)


@pytest.mark.slow
def test_alpha_behind_a_threshold_stays_as_it_is(stage, by_points):
    """The mean of alpha would lose all leaves that cover less than half."""
    material, texture = leaves(stage, "Alpha")
    tree = material.node_tree
    threshold = tree.nodes.new("ShaderNodeMath")
    threshold.operation = "GREATER_THAN"
    principled = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeBsdfPrincipled")
    tree.links.new(texture.outputs["Alpha"], threshold.inputs[0])
    tree.links.new(threshold.outputs[0], principled.inputs["Alpha"])
    np.testing.assert_array_equal(picture(stage, 1), by_points(stage, 1))


@pytest.mark.slow
def test_a_mirror_shows_a_smooth_floor(stage, by_points):
    """Rays know the footprint of their pixel where they arrive."""
    floor(stage)
    mirror = stage.material("ShaderNodeBsdfAnisotropic", Roughness=0.0)
    stage.mesh([(-30, -10, 0), (30, -10, 0), (30, -10, 20), (-30, -10, 20)], [(0, 1, 2, 3)], material=mirror)
    stage.scene.camera.location, stage.scene.camera.rotation_euler = (0, -20, 3), (np.pi / 2 - 0.15, 0, 0)
    reference = picture(stage, 512, "CYCLES", bounces=2)
    mirrored = np.s_[20:30]
    found, points = picture(stage, 1, bounces=2), by_points(stage, 1, bounces=2)
    assert error(found[mirrored], reference[mirrored]) < 0.5 * error(points[mirrored], reference[mirrored])


@pytest.mark.slow
def test_normals_are_averaged_in_the_first_sample_of_many_alone(stage, by_points):
    """The mean of shaded normals is not what the mean normal shades: many samples show the former."""
    floor(stage, shader="ShaderNodeBsdfPrincipled", socket="Roughness")
    stage.light("SUN", turn=(0.9, 0, 0), angle=0.1)
    reference = picture(stage, 512, "CYCLES")
    found, points = picture(stage, 64), by_points(stage, 64)
    assert error(found, reference) < 1.1 * error(points, reference) + 1e-5
