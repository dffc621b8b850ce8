"""The eye's point spread function on the GPU against numpy, step by step, and against the optics of textbooks."""

from dataclasses import replace

import numpy as np
import pytest

from addon.eye import lids, optics, spectrum
from addon.eye.aperture import WINDOW, Aperture, Eye, aperture_at
from addon.gfx import images

DEGREES_PER_PIXEL = 0.04


@pytest.fixture
def point_spread(gpu_context):
    from addon.eye import point_spread

    return point_spread


def empty_pupil(diameter, strokes=()):
    rows = np.array(strokes, np.float32).reshape(-1, 8)
    return Aperture(diameter, 0.0, rows, 1.0)


def relative_error(found, expected):
    return np.sqrt(np.mean((found - expected) ** 2) / np.mean(np.square(expected)))


def drawn(point_spread, aperture, side):
    target = images.Target((images.create(2 * side, 2 * side, "R16F"),))
    point_spread.draw_aperture(aperture, target)
    return target.colors[0]


def means(pixels):
    side = len(pixels) // 2
    return pixels.astype(np.float64).reshape(side, 2, side, 2).mean(axis=(1, 3))


def diffracted(point_spread, aperture, side, defocus=0.0):
    """(intensity by the GPU in numpy's units, the aperture's transmittance as the GPU drew it)."""
    open_part = drawn(point_spread, aperture, side)
    target = images.Target((images.create(side, side, "R32F"),))
    point_spread.diffract(open_part, defocus, target)
    found = images.read(target.colors[0])[..., 0].astype(np.float64) * side**4
    return found, means(images.read(open_part)[..., 0])


@pytest.mark.parametrize("eye", [Eye(), Eye(pupil=7.5), Eye(squint=0.8, pupil=4.0)], ids=["open", "dark", "squint"])
def test_the_aperture_is_drawn_as_by_numpy(point_spread, eye):
    aperture = aperture_at(eye, 1.25, 10.0)
    found = means(images.read(drawn(point_spread, aperture, 128))[..., 0])
    expected = optics.transmittance(aperture, 128)
    # Half floats: products of a dozen of them keep three digits.
    assert np.abs(found - expected).max() < 5e-3
    assert relative_error(found, expected) < 1e-3


@pytest.mark.parametrize("defocus", [0.0, 0.25])
def test_diffraction_is_that_of_numpy(point_spread, defocus):
    found, open_part = diffracted(point_spread, aperture_at(Eye(), 0.5, 10.0), 256, defocus)
    expected = optics.intensity(optics.field(open_part, defocus))
    assert relative_error(found, expected) < 1e-4


@pytest.mark.parametrize("defocus", [0.0, 0.5])
def test_energy_is_kept_as_parseval_says(point_spread, defocus):
    found, open_part = diffracted(point_spread, aperture_at(Eye(), 0.5, 10.0), 256, defocus)
    assert found.sum() == pytest.approx(256**2 * (open_part**2).sum(), rel=1e-4)


def test_an_empty_pupil_gives_an_airy_disc(point_spread):
    found, _ = diffracted(point_spread, empty_pupil(2.4), 512)
    row = found[256, 256:] / found[256, 256]
    np.testing.assert_allclose(row[1:5], (0.866, 0.550, 0.233, 0.049), atol=0.01)
    y, x = np.mgrid[0:512, 0:512] - 256
    radius = np.hypot(x, y)
    first_zero = 1.22 * WINDOW / 2.4  # 5.08 texels
    assert row[5] < 2e-3
    assert found[radius <= first_zero].sum() / found.sum() == pytest.approx(0.838, abs=0.01)


def test_particles_take_their_share_from_the_straight_direction(point_spread):
    """Babinet: what covers a share f of the pupil leaves 1 - f of the light unscattered."""
    random = np.random.default_rng(5)
    strokes = []
    while len(strokes) < 400:
        x, y = random.uniform(-2.4, 2.4, 2)
        if np.hypot(x, y) < 2.35:
            strokes.append((x, y, x, y, 0.03, 0.03, 1.0, 0.0))
    clear, open_part = diffracted(point_spread, empty_pupil(4.9), 512)
    dotted, dotted_part = diffracted(point_spread, empty_pupil(4.9, strokes), 512)
    covered = 1.0 - dotted_part.sum() / open_part.sum()
    y, x = np.mgrid[0:512, 0:512] - 256
    core = np.hypot(x, y) < 3 * 1.22 * WINDOW / 4.9
    shares = [one[core].sum() / one.sum() for one in (clear, dotted)]
    assert 0.03 < covered < 0.12
    assert shares[1] / shares[0] == pytest.approx(1.0 - covered, abs=0.015)


def test_a_grating_has_its_first_order_where_its_period_says_and_red_outside(point_spread):
    period, side = 0.1, 512  # mm
    lines = [(x, -4, x, 4, 0.02, 0.02, 1.0, 0.0) for x in np.arange(-3, 3, period)]
    found, _ = diffracted(point_spread, empty_pupil(4.0, lines), side)
    order = WINDOW / period  # 100 texels
    row = found[side // 2, side // 2 :]
    assert 60 + row[60:140].argmax() == pytest.approx(order, abs=1)
    pattern = images.upload(found[..., None].astype(np.float32), "R32F")
    target = images.Target((images.create(side, side, "RGBA32F"),))
    point_spread.colour(pattern, target)
    row = images.read(target.colors[0])[side // 2, side // 2 :, :3]
    # Peaks in the picture's primaries: blue about 450 nm, red about 605 nm.
    peaks = 50 + row[50:150].argmax(axis=0)
    assert peaks[2] == pytest.approx(order * 450 / 575, rel=0.04)
    assert peaks[0] == pytest.approx(order * 605 / 575, rel=0.04)
    assert peaks[2] < peaks[1] < peaks[0]


def test_orders_of_single_wavelengths_scale_with_them():
    """450 nm at 0.783 and 650 nm at 1.130 of the base's radius."""
    for wavelength, ratio in ((450.0, 0.783), (650.0, 1.130)):
        entry = int((wavelength - spectrum.SHORTEST) / spectrum.RANGE * spectrum.ENTRIES)
        assert 1.0 / spectrum.table()[entry, 3] == pytest.approx(ratio, abs=2e-3)


def test_colours_and_kernel_are_those_of_numpy(point_spread):
    aperture = aperture_at(Eye(), 0.5, 10.0)
    pattern = point_spread.make_pattern(aperture, 128, 0.25)
    open_part = means(images.read(pattern.aperture)[..., 0])
    expected = optics.colours(optics.intensity(optics.field(open_part, 0.25)) / 128**4)
    found = images.read(pattern.colours)[..., :3]
    assert relative_error(found, expected) < 1e-4
    for degrees, sharp in ((0.02, True), (0.3, True), (0.3, False)):
        scale = optics.scale_of(128, degrees, 10.0, aperture.diameter, 0.25, 400)
        kernel = point_spread.make_kernel(pattern.colours, scale, sharp)
        over = optics.over_pixels(expected, scale)
        wanted = optics.tail(over, scale) if sharp else over
        assert relative_error(images.read(kernel.weights)[..., :3], wanted) < 1e-4
        np.testing.assert_allclose(images.read(kernel.share)[0, 0, :3], wanted.sum(axis=(0, 1)), rtol=1e-4)
        kernel.release()
    pattern.release()


def test_white_stays_white(point_spread):
    """Each channel's weights sum to 1, within half a percent of each other even without normalisation."""
    pattern = point_spread.make_pattern(aperture_at(Eye(), 0.5, 10.0), 256, 0.0)
    sums = images.read(pattern.colours)[..., :3].astype(np.float64).sum(axis=(0, 1))
    scale = optics.scale_of(256, DEGREES_PER_PIXEL, 10.0, 3.0, 0.0, 400)
    kernel = point_spread.make_kernel(pattern.colours, scale, sharp=False)
    np.testing.assert_allclose(images.read(kernel.share)[0, 0, :3], 1.0, atol=1e-4)
    # What lies beyond the pattern is missing more of red, whose copy is the largest.
    assert np.ptp(sums) / sums.mean() < 0.05
    kernel.release()
    pattern.release()


def test_a_turned_aperture_turns_the_pattern(point_spread):
    strokes = np.array([(0.2, -1, 1.0, 0.5, 0.05, 0.02, 1.0, 0.0), (-1, 0.6, -1, 0.6, 0.1, 0.1, 1.0, 0.0)])
    turned = strokes.copy()
    turned[:, 0:4:2], turned[:, 1:4:2] = -strokes[:, 1:4:2], strokes[:, 0:4:2]
    first, _ = diffracted(point_spread, empty_pupil(4.0, strokes), 256)
    second, _ = diffracted(point_spread, empty_pupil(4.0, turned), 256)
    # By a quarter turn about the texel of the straight direction.
    rotated = np.roll(np.rot90(first, -1), 1, axis=1)
    mirrored = np.roll(np.rot90(first, 1), (1, 0), axis=(0, 1))
    errors = [relative_error(second[1:, 1:], one[1:, 1:]) for one in (rotated, mirrored)]
    assert min(errors) < 1e-3


def test_shut_lids_leave_no_light(point_spread):
    aperture = aperture_at(Eye(blink=1.0), 0.5, 10.0)
    assert aperture.light == 0.0
    pattern = point_spread.make_pattern(aperture, 64, 0.25)
    scale = optics.scale_of(64, 0.3, 10.0, aperture.diameter, 0.25, 64)
    kernel = point_spread.make_kernel(pattern.colours, scale)
    assert not images.read(pattern.colours).any()
    assert not images.read(kernel.weights).any()
    kernel.release()
    pattern.release()


def test_a_pupil_never_reaches_the_window():
    for light in np.geomspace(1e-4, 1e6, 40):
        assert aperture_at(replace(Eye(), restlessness=3.0), light, light).diameter < WINDOW
    assert lids.open_share(9.0, 0.0) == 1.0


def test_the_same_time_gives_the_same_pattern_to_the_bit(point_spread):
    found = []
    for seconds in (1.7, 0.3, 1.7):
        pattern = point_spread.make_pattern(aperture_at(Eye(), seconds, 10.0), 128, 0.25)
        found.append(images.read(pattern.colours))
        pattern.release()
    np.testing.assert_array_equal(found[0], found[2])
    assert (found[0] != found[1]).any()


def test_three_planes_are_those_of_numpy_and_keep_the_light(point_spread):
    """What stands in cornea, lens and vitreous body, one behind the other."""
    aperture = aperture_at(Eye(pupil=4.0), 0.5, 10.0)
    apart = [drawn(point_spread, optics.plane_of(aperture, plane), 128) for plane in range(3)]
    target = images.Target((images.create(128, 128, "R32F"),))
    point_spread.diffract(apart[0], 0.25, target, *apart[1:])
    found = images.read(target.colors[0])[..., 0].astype(np.float64) * 128**4
    open_parts = [means(images.read(one)[..., 0]) for one in apart]
    expected = optics.intensity(optics.through_planes(open_parts, 0.25))
    assert relative_error(found, expected) < 1e-3
    one = optics.intensity(optics.field(np.prod(open_parts, axis=0), 0.25))
    assert expected.sum() == pytest.approx(one.sum(), rel=0.05)
    y, x = np.mgrid[-64:64, -64:64]
    tail = np.hypot(x, y) > 40  # texels: the core hardly knows where scatterers stand
    assert relative_error(expected[tail], one[tail]) > 0.1


def test_carried_light_is_a_fresnel_zone_plate_ago():
    """A wide pupil's field after a distance: on the axis 2 sin of half the phase of its rim, as Fresnel has it."""
    distance, radius = 2000.0, 1.6
    aperture = Aperture(2 * radius, 0.0, np.zeros((0, 8), np.float32), 1.0)
    found = optics.carried(optics.transmittance(aperture, 512).astype(complex), distance)
    zones = np.pi * radius**2 / (575e-6 * distance)
    assert np.abs(found[255:257, 255:257]).mean() == pytest.approx(2 * abs(np.sin(zones / 2)), abs=0.1)


@pytest.mark.parametrize("kelvin", [2400.0, 2800.0, 6500.0])
def test_a_blackbody_disperses_a_ring_as_plancks_law_says(point_spread, kelvin):
    """The light of a wavelength lies at its share of 575 nm of the ring's radius, and the sum over wavelengths is shown
    where it is positive: each channel's mean radius and light."""
    side, ring = 512, 60.0
    y, x = np.mgrid[0:side, 0:side] - side // 2
    radius = np.hypot(x, y)
    pattern = images.upload(np.exp(-0.5 * ((radius - ring) / 1.5) ** 2), "R32F")
    target = images.Target((images.create(side, side, "RGBA32F"),))
    point_spread.colour(pattern, target, least=256, light=("BLACKBODY", kelvin))
    found = images.read(target.colors[0])[..., :3].astype(np.float64)
    metres = spectrum.wavelength((np.arange(2000) + 0.5) / 2000) * 1e-9
    power = metres**-5 / np.expm1(6.62607015e-34 * 299792458.0 / (metres * 1.380649e-23 * kelvin))
    seen = power[:, None] * (spectrum.xyz(1e9 * metres) @ spectrum.TO_REC709.T)
    scale, at = 575e-9 / metres, np.arange(0.05, 120.0, 0.1)
    profile = np.exp(-0.5 * ((at[:, None] * scale - ring) / 1.5) ** 2) @ (seen * scale[:, None] ** 2)
    shown = profile.clip(0.0) * at[:, None]  # what lies outside of the picture's colours is cut
    light, whole = found.sum(axis=(0, 1)), np.exp(-0.5 * ((at - ring) / 1.5) ** 2) @ at * seen.sum(axis=0)
    np.testing.assert_allclose(
        (found * radius[..., None]).sum(axis=(0, 1)) / light,
        (shown * at[:, None]).sum(axis=0) / shown.sum(axis=0),
        rtol=2e-3,
    )
    ring_light = np.exp(-0.5 * ((radius - ring) / 1.5) ** 2).sum()
    np.testing.assert_allclose(light / ring_light, shown.sum(axis=0) / whole, rtol=5e-3)


def test_a_lamps_spectrum_disperses_as_it_has_wavelengths():
    """Channels keep their sum; a blackbody is brightest where Wien says, and sodium is one line."""
    for light in ("LED", "FLUORESCENT", "SODIUM", "BLACKBODY"):
        rows = spectrum.table(light, 3000.0).astype(np.float64)
        np.testing.assert_allclose((rows[:, :3] / rows[:, 3:] ** 2).sum(axis=0) / len(rows), 1.0, atol=1e-4)
    nanometres = spectrum.wavelength((np.arange(spectrum.ENTRIES) + 0.5) / spectrum.ENTRIES)
    power = spectrum.of_light("BLACKBODY", 5000.0, nanometres)
    assert nanometres[power.argmax()] == pytest.approx(2.8978e6 / 5000.0, abs=1.0)  # Wien
    sodium = np.abs(spectrum.table("SODIUM")[:, 1])
    assert np.abs(nanometres[sodium > 0.01 * sodium.max()] - 589.3).max() < 20.0
