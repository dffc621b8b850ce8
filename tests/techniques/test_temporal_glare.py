"""Temporal glare in rendered pictures: when it runs, what it leaves as it is, and that time alone decides its state."""

import bpy
import numpy as np
import pytest

from addon.eye import optics, pupil, spectrum
from addon.frame.ledger import RAN, SKIPPED
from addon.frame.schedule import FINAL
from addon.frame.settings import Settings
from addon.gfx import images as gpu_images
from addon.gfx import library
from addon.techniques.temporal_glare import TemporalGlare

SIZE = (72, 54)


@pytest.fixture
def night(stage):
    """A grey floor in dim light with small bright squares, seen from above."""
    stage.world((0.05, 0.05, 0.05))
    stage.floor(material=stage.diffuse(0.5))
    lamp = stage.material("ShaderNodeEmission", Color=(1.0, 0.7, 0.4, 1), Strength=400.0)
    for x, y in ((-1.0, 0.6), (0.4, -0.7), (1.3, 0.9)):
        stage.rectangle((x, y), (x + 0.06, y + 0.06), 0.1, material=lamp)
    stage.camera_above()
    settings = stage.scene.camera.data.candela
    settings.glare_mode = "CONVOLUTION"
    settings.eye_side, settings.glare_magnification = "128", 100.0  # of a picture of few pixels
    stage.scene.frame_set(24)
    return stage


def test_drafts_ask_for_what_tells_fireflies_however_many_samples_the_picture_at_rest_has():
    """A draft shows one sample."""
    glare = TemporalGlare()
    many = Settings(samples=32, schedule=FINAL)
    assert glare.looks_at(many) == ()
    assert glare.looks_at(many.as_draft()) == glare.looks_at(Settings(samples=1)) != ()


def glare_row(stage):
    return stage.ledger.row("glare")


def test_glare_is_a_pass_beside_a_combined_that_stays_as_it_is(night):
    with_glare = night.render(size=SIZE)
    assert glare_row(night).state == RAN
    night.scene.camera.data.candela.glare_mode = "OFF"
    without = night.render(size=SIZE)
    assert "glare" not in without
    np.testing.assert_array_equal(with_glare["combined"], without["combined"])
    assert night.ledger.row("eye").state == glare_row(night).state == SKIPPED
    lens, combined = with_glare["glare"][..., :3], with_glare["combined"][..., :3]
    assert (lens >= 0).all()
    added = (lens - combined).clip(0)
    assert (added.max(axis=-1) > 1e-3).mean() > 0.2
    np.testing.assert_array_equal(with_glare["glare"][..., 3], with_glare["combined"][..., 3])


@pytest.mark.parametrize("resolution", ["FULL", "HALF"])
def test_the_picture_is_the_convolution_by_numpy_of_the_linear_picture(night, resolution):
    """With the kernel of the reference, from the aperture on."""
    night.scene.camera.data.candela.glare_resolution = resolution
    images = night.render(size=SIZE)
    service = night.renderer.frame.service(_point_spread())
    kernel = service._kernel[1]
    weights = gpu_images.read(kernel.weights)[..., :3].astype(np.float64)
    pattern = service._pattern[1]
    side = kernel.scale.side
    aperture = gpu_images.read(pattern.aperture)[..., 0].astype(np.float64).reshape(side, 2, side, 2).mean((1, 3))
    colours = optics.colours(optics.intensity(optics.field(aperture, 0.25)))
    expected = optics.tail(optics.over_pixels(colours, kernel.scale), kernel.scale)
    assert np.sqrt(np.mean((weights - expected) ** 2) / np.mean(expected**2)) < 1e-3
    if resolution == "FULL":
        lens = optics.glare(images["combined"].astype(np.float64), expected, 1.0, 1.0, 1e6)
        error = np.sqrt(np.mean((images["glare"][..., :3] - lens) ** 2) / np.mean(lens**2))
        assert error < 1e-3
        dark = images["combined"][..., :3].max(axis=-1) < 1.0  # what scatters is little beside the lamps themselves
        scattered, expected = (
            image[dark] - images["combined"][dark][:, :3] for image in (images["glare"][..., :3], lens)
        )
        assert scattered.sum() == pytest.approx(expected.sum(), rel=3e-3)
    else:
        total = images["combined"][..., :3].sum()
        assert images["glare"][..., :3].sum() == pytest.approx(total, rel=0.05)  # some leaves at the borders


def _point_spread():
    from addon.techniques.eye import PointSpread

    return PointSpread


def test_the_pattern_grows_until_nobody_sees_its_rim(night):
    """By itself it is small before faint lamps and large before ones that are 200,000 times as bright."""
    settings = night.scene.camera.data.candela
    settings.eye_side, settings.glare_magnification = "AUTO", 10.0
    sides = []
    for strength in (20.0, 4e6):
        for material in bpy.data.materials:
            for node in material.node_tree.nodes:
                if node.type == "EMISSION":
                    node.inputs["Strength"].default_value = strength
        night.render(size=SIZE)
        assert glare_row(night).state == RAN
        sides.append(night.renderer.frame.service(_point_spread())._kernel[1].scale.side)
    assert sides[0] == 512 < sides[1]


def test_a_picture_without_bright_light_is_left_to_the_bit_and_no_transform_compiled(night):
    night.remove(next(o for o in night.scene.objects if o.name.startswith("Mesh.001")))
    for thing in [o for o in night.scene.objects if o.type == "MESH" and o.dimensions.x < 1]:
        night.remove(thing)
    library._shaders.clear()
    images = night.render(size=SIZE)
    row = glare_row(night)
    assert row.state == SKIPPED
    assert "white" in row.reason
    assert not [program.name for program in library._shaders if "Fourier" in program.name]
    np.testing.assert_array_equal(images["glare"], images["combined"])


def test_one_faint_highlight_is_not_worth_it(night):
    night.scene.camera.data.candela.glare_strength = 1e-4
    images = night.render(size=SIZE)
    assert "half a step" in glare_row(night).reason
    np.testing.assert_array_equal(images["glare"], images["combined"])


def test_the_same_frame_is_the_same_alone_and_in_sequence(night):
    scene = night.scene
    sequence = {}
    for frame in range(38, 41):
        scene.frame_set(frame)
        sequence[frame] = night.render(size=SIZE)["glare"]
    assert np.abs(sequence[40] - sequence[39]).max() > 1e-4 * sequence[40].max()
    night.renderer.release()
    alone = night.render(size=SIZE)["glare"]
    np.testing.assert_array_equal(alone, sequence[40])
    np.testing.assert_array_equal(night.render(size=SIZE)["glare"], alone)


@pytest.mark.parametrize("samples", [1, 16])
def test_an_isolated_pixel_of_bounced_light_is_a_star_of_many_samples_only(night, samples):
    """A picture of one sample with such a pixel has the glare that it has without; the lamps' own does not change."""
    night.render(samples, size=SIZE)
    frame, technique = night.renderer.frame, next(t for t in night.renderer.techniques if t.name == "glare")
    own = gpu_images.read(frame.images["film.combined"]).copy()
    lens = []
    for firefly in (0.0, 56.0):
        pixels = own.copy()
        pixels[10, 60, :3] += firefly
        frame.images["film.combined"] = gpu_images.upload(pixels)
        assert technique._show(frame) is None
        lens.append(gpu_images.read(frame.images["film.lens"])[..., :3] - pixels[..., :3])
    star = np.abs(lens[1] - lens[0]).sum()
    assert own[..., :3].max() > 100.0
    if samples == 1:
        assert star < 0.01 * np.abs(lens[0]).sum()
    else:
        assert star > 5.0  # of 56: what an eye scatters, here and there


def test_another_time_draws_no_sample_anew(night):
    night.render(size=SIZE)
    night.scene.frame_set(31)
    night.render(size=SIZE)
    assert night.ledger.row("film").state == "reused"
    assert glare_row(night).state == RAN
    night.scene.camera.data.candela.glare_strength = 0.5
    night.render(size=SIZE)
    assert night.ledger.row("film").state == "reused"


def test_billboards_show_needles_where_a_convolution_washes_them_out(night):
    candle = night.material("ShaderNodeEmission", Color=(1, 0.6, 0.3, 1), Strength=60.0)
    night.rectangle((-0.1, -0.1), (0.1, 0.7), 0.2, material=candle)
    convolved = night.render(size=SIZE)["glare"]
    night.scene.camera.data.candela.glare_mode = "BILLBOARDS"
    boards = night.render(size=SIZE)["glare"]
    assert np.abs(boards - convolved).mean() > 1e-3 * convolved.mean()
    assert boards.sum() == pytest.approx(convolved.sum(), rel=0.02)


def test_a_blink_darkens_the_picture_and_shut_lids_leave_nothing(night):
    before = night.render(size=SIZE)["glare"][..., :3]
    night.scene.camera.data.candela.eye_blink = 0.75
    half = night.render(size=SIZE)["glare"][..., :3]
    night.scene.camera.data.candela.eye_blink = 1.0
    shut = night.render(size=SIZE)
    assert 0.0 < half.sum() < 0.9 * before.sum()
    assert not shut["glare"][..., :3].any()
    assert shut["combined"].any()


def test_a_bright_field_makes_the_pupil_small(night):
    def diameter():
        night.render(size=SIZE)
        technique = next(t for t in night.renderer.techniques if t.name == "eye")
        frame = night.renderer.frame
        service = frame.service(_point_spread())
        assert service is technique._service
        return service._pattern[0][3]

    night.scene.camera.data.candela.eye_restlessness = 0.0
    night.scene.camera.data.candela.glare_luminance = 0.01
    dark = diameter()
    night.scene.camera.data.candela.glare_luminance = 1e4
    assert diameter() < dark - 1.0
    night.scene.camera.data.candela.eye_pupil = 6.0
    assert diameter() == pytest.approx(6.0)


def diameter_of(stage):
    """Of the pupil that the last picture's pattern is of, mm."""
    return stage.renderer.frame.service(_point_spread())._pattern[0][3]


@pytest.mark.parametrize("speed", [1.0, 0.0])
def test_a_pupil_adapts_in_rendered_frames_from_the_luminance_before(night, speed):
    """Out of the dark at second 1, at any frame alone; by the scene's clock, whether or not the eye moves by itself."""
    settings, scene = night.scene.camera.data.candela, night.scene
    settings.eye_restlessness, settings.eye_speed, settings.glare_luminance = 0.0, speed, 1000.0
    settings.eye_before, settings.eye_changed = 0.01, 1.0
    lens = {}
    for frame in (240, 12, 36, 29):
        scene.frame_set(frame)
        images = night.render(size=SIZE)
        lens[frame] = images["glare"]
        mean = 1000.0 * (images["combined"][..., :3] @ np.array([0.2126, 0.7152, 0.0722])).mean()
        before, after = (float(pupil.mean_diameter(light, settings.eye_age)) for light in (0.01, mean))
        expected = pupil.adapting(frame / 24 - 1.0, before, after)
        assert diameter_of(night) == pytest.approx(expected, abs=0.02), frame  # mm; of a luminance in steps
    assert before - after > 2.0
    settings.eye_before = 0.0
    for frame, by_hand in ((240, 0.0), (12, before)):
        scene.frame_set(frame)
        settings.eye_pupil = by_hand
        same = night.render(size=SIZE)["glare"]
        assert np.sqrt(np.mean((same - lens[frame]) ** 2) / np.mean(same**2)) < 1e-3
    assert np.sqrt(np.mean((lens[12] - lens[240]) ** 2) / np.mean(lens[12] ** 2)) > 5e-3


def halo_of(stage, kind, kelvin):
    """(72, 72, 3) glare beside a lamp of one pixel over the lamp's own light, and the degrees of 575 nm by texels."""
    settings = stage.scene.camera.data.candela
    settings.eye_spectrum, settings.eye_kelvin = kind, kelvin
    images = stage.render(size=(72, 72))
    lamp = images["combined"][36, 36, :3].astype(np.float64)
    halo = (images["glare"] - images["combined"])[..., :3] / (lamp * (1.0 - 1.0 / lamp.max()))
    halo[34:39, 34:39] = 0.0
    return halo


@pytest.mark.parametrize("kelvin", [2400.0, 5800.0])
def test_the_halo_of_a_glowing_body_has_the_colours_of_its_spectrum(stage, kelvin):
    """A lamp of one pixel whose colour a Blackbody node has: the mean over circles of its glare is that of one
    wavelength, at all of them, weighed by Planck's law. *By Colour* finds nearly the same by itself."""
    lamp = stage.material("ShaderNodeEmission", Strength=4000.0)
    nodes = lamp.node_tree.nodes
    heat = nodes.new("ShaderNodeBlackbody")
    heat.inputs["Temperature"].default_value = kelvin
    lamp.node_tree.links.new(heat.outputs[0], next(n for n in nodes if n.type == "EMISSION").inputs["Color"])
    stage.rectangle((0.0, 0.0), (4 / 72, 4 / 72), material=lamp)
    stage.camera_above()
    settings = stage.scene.camera.data.candela
    settings.glare_mode, settings.eye_side, settings.glare_magnification = "CONVOLUTION", "512", 40.0
    settings.eye_pupil, settings.eye_restlessness, settings.eye_lashes, settings.eye_scatter = 8.0, 0.0, 0.0, 0.0
    settings.eye_fibres = 0.8  # a ring, of which the inner rim is blue
    own = halo_of(stage, "BLACKBODY", kelvin)
    service = stage.renderer.frame.service(_point_spread())
    fine = gpu_images.read(service._pattern[1].aperture)[..., 0].astype(np.float64)
    light = optics.intensity(optics.field(fine.reshape(512, 2, 512, 2).mean((1, 3)), 0.25))
    expected = circles(light, kelvin, service._kernel[1].scale)
    y, x = np.mgrid[0:72, 0:72] - 36
    ring = np.round(np.hypot(x, y)).astype(int)

    def means(image):
        return np.stack([np.bincount(ring.ravel(), image[..., k].ravel()) for k in range(3)], axis=-1)

    beyond = slice(9, 36)  # the core's rim is at 8.8 pixels
    found, wanted = means(own)[beyond], means(expected[ring])[beyond]
    assert np.abs(found - wanted).max(axis=0) / wanted.max(axis=0) == pytest.approx(0.0, abs=0.05)
    by_colour, even = (means(halo_of(stage, kind, kelvin))[beyond] for kind in ("COLOUR", "EQUAL"))
    away, of_even = (np.abs(one - wanted).sum() / wanted.sum() for one in (by_colour, even))
    assert np.abs(found - wanted).sum() / wanted.sum() < 0.03  # means over circles of pixels, of texels
    assert away < 0.035 and (of_even > 2.0 * away or kelvin > 5000.0), (away, of_even)  # the sun's is nearly even


def circles(light, kelvin, scale):
    """(60, 3) weights of a kernel's pixels by their distance from its middle, from the pattern of 575 nm, (side, side):
    the sum over wavelengths of its mean over circles, at their share of the distance, by Planck's law."""
    side = len(light)
    y, x = np.mgrid[0:side, 0:side] - side // 2
    away = np.hypot(x, y)
    mean = np.bincount(away.round().astype(int).ravel(), light.ravel()) / np.bincount(away.round().astype(int).ravel())
    metres = spectrum.wavelength((np.arange(390) + 0.5) / 390) * 1e-9
    power = metres**-5 / np.expm1(6.62607015e-34 * 299792458.0 / (metres * 1.380649e-23 * kelvin))
    matched = power[:, None] * (spectrum.xyz(1e9 * metres) @ spectrum.TO_REC709.T)
    texels = np.arange(0.5, 180.0, 0.5)
    share = 575e-9 / metres
    seen = np.interp(texels[:, None] * share, np.arange(len(mean)), mean) @ (matched * share[:, None] ** 2)
    usable = optics.usable_radius(side)
    fade = np.clip((usable - texels) / ((1 - optics.FADE_FROM) * usable), 0, 1)
    seen = seen.clip(0.0) * (fade * fade * (3 - 2 * fade))[:, None]
    seen /= (seen * texels[:, None]).sum(axis=0) * 2 * np.pi * 0.5  # all of it, over texels of half a unit's width
    centres = (
        np.arange(60)[:, None] * scale.per_pixel + (np.arange(16) + 0.5) / 16 * scale.per_pixel - 0.5 * scale.per_pixel
    )
    over = np.stack([np.interp(np.abs(centres), texels, seen[:, k]).mean(axis=1) for k in range(3)], axis=-1)
    return over * scale.per_pixel**2


@pytest.mark.parametrize("change", [{}, {"film_transparent": True}, {"border": True}])
def test_odd_pictures_are_drawn(night, change):
    render = night.scene.render
    render.film_transparent = change.get("film_transparent", False)
    if change.get("border"):
        render.use_border = True
        render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = 0.1, 0.93, 0.2, 0.77
    night.scene.camera.data.candela.glare_sharp = False
    night.scene.camera.data.candela.eye_fibres = 1.0
    images = night.render(size=(53, 31))
    assert np.isfinite(images["glare"]).all()


@pytest.mark.slow
def test_a_viewport_shows_the_lens_and_shows_its_samples_anew_at_another_time(night):
    from tests.viewport.region import SIZE as REGION_SIZE
    from tests.viewport.region import Region

    night.scene.camera.data.candela.glare_white = 0.5
    region = Region(samples=2)
    first = region.rest()
    frame = region.viewport.frame
    assert frame.picture == "film.lens"
    linear = region.viewport.renderer.frame.images["film.combined"]
    assert (first[..., :3] != gpu_images.read(linear)[..., :3]).any()
    night.scene.frame_set(30)
    region.viewport.dirty = True
    second = gpu_images.read(region.draw())
    assert region.viewport.frame is frame
    assert second.shape == (REGION_SIZE[1], REGION_SIZE[0], 4)
    assert (first != second).any()
    night.scene.camera.data.candela.glare_strength = 0.25
    region.viewport.dirty = True
    weaker = gpu_images.read(region.draw())
    assert region.viewport.frame is frame
    assert np.abs(weaker - gpu_images.read(linear)).sum() < np.abs(second - gpu_images.read(linear)).sum()
    region.viewport.release()
