"""The eye's parts against closed forms: pupil, lens, vitreous body, lids; and that any time is reached at once."""

from dataclasses import replace

import numpy as np
import pytest

from addon.eye import crystalline, lids, optics, pupil, spectrum, vitreous
from addon.eye.aperture import WINDOW, Aperture, Eye, _cornea, aperture_at, older
from addon.eye.noise import at_integers, value_noise
from addon.eye.presets import PRESETS

# -------------------------------------------------------------------------------------------------------------- pupil


@pytest.mark.parametrize(
    ("luminance", "as_in_the_source", "without_offset"),
    [(0.01, 6.04, 6.89), (1.0, 3.76, 4.90), (100.0, 2.40, 2.91), (1e4, 2.01, 2.14)],
)
def test_the_pupil_has_the_diameter_of_the_table(luminance, as_in_the_source, without_offset):
    assert pupil.mean_diameter(luminance) == pytest.approx(as_in_the_source, abs=0.01)
    assert pupil.mean_diameter(luminance, offset=0.0) == pytest.approx(without_offset, abs=0.01)


def test_the_pupil_adapts_faster_to_light_than_to_darkness():
    """Nothing for a quarter of a second, then exponentially; at any time without those before it."""
    eye = Eye(before=1.0, changed=2.0, restlessness=0.0)
    dark, bright = (aperture_at(replace(eye, before=0.0), 0.0, light).diameter for light in (1.0, 1000.0))
    at = [aperture_at(eye, 2.0 + after, 1000.0).diameter for after in (-1.0, 0.2, 0.65, 5.0)]
    assert at[0] == at[1] == pytest.approx(dark)
    assert at[2] == pytest.approx(bright + (dark - bright) * np.exp(-1.0)) and at[3] == pytest.approx(bright, abs=1e-3)
    slower = aperture_at(replace(eye, before=1000.0), 2.65, 1.0).diameter
    assert slower == pytest.approx(dark + (bright - dark) * np.exp(-1.0 / 3.0))


def test_the_pupil_shrinks_with_light_and_with_age_and_knows_black():
    diameters = pupil.mean_diameter(np.geomspace(1e-5, 1e7, 200))
    assert (np.diff(diameters) <= 0).all()
    assert np.isfinite(pupil.mean_diameter(0.0))
    assert pupil.mean_diameter(0.01, age=75.0) < pupil.mean_diameter(0.01, age=25.0) - 1.0
    assert pupil.mean_diameter(0.01, age=5.0) == pupil.mean_diameter(0.01, age=20.0)


@pytest.mark.parametrize("mean", [1.5, 2.4, 4.0, 7.0, 9.0])
def test_hippus_stays_within_the_eye_and_is_faster_and_larger_for_small_pupils(mean):
    seconds = np.random.default_rng(1).uniform(-1e4, 1e4, 100_000)
    diameters = pupil.diameter_at(seconds, mean, seed=3)
    assert diameters.min() >= 1.5
    assert diameters.max() <= 9.0
    if mean == 2.4:
        assert np.abs(diameters - mean).max() == pytest.approx(0.32, abs=0.05)
    if mean == 7.0:
        assert np.abs(diameters - mean).max() == pytest.approx(0.06, abs=0.02)


def test_noise_is_smooth_bounded_and_the_same_wherever_one_begins():
    time = np.linspace(-50, 50, 20_001)
    noise = value_noise(time, seed=1)
    assert np.abs(noise).max() <= 1.0
    assert abs(noise.mean()) < 0.1
    assert np.abs(np.diff(noise)).max() < 0.05
    np.testing.assert_array_equal(noise[7000:7100], value_noise(time[7000:7100], seed=1))
    assert (value_noise(time, seed=2) != noise).any()
    drawn = at_integers(np.arange(100_000), 0, 0)
    assert np.histogram(drawn, 10, (0, 1))[0] == pytest.approx(10_000, rel=0.05)
    assert abs(np.corrcoef(drawn[:-1], drawn[1:])[0, 1]) < 0.01


# --------------------------------------------------------------------------------------------------------------- lens


def test_the_lens_at_rest_holds_its_particles_where_they_are():
    distance, axis, _ = crystalline.particles(750, 0)
    np.testing.assert_allclose(crystalline.deform(distance, axis, 0.0), distance)
    assert crystalline.muscle(3.0, 0, 4.0, tremor=0.0) == 0.0


def test_a_pull_moves_the_equator_by_itself_and_the_axis_not_at_all():
    moved = crystalline.deform(np.array([0.0, 2.0, 4.5]), np.zeros(3), 0.03)
    assert moved[0] == pytest.approx(0.0, abs=1e-9)
    assert moved[2] == pytest.approx(4.53, abs=1e-6)
    assert 2.0 < moved[1] < 2.03


def test_the_pulled_grid_is_in_balance():
    grid = crystalline.grid()
    force = grid.stiffness @ grid.pulled().ravel()
    assert np.abs(force[grid.free]).max() < 1e-6 * np.abs(force).max()


def test_without_drive_the_grid_loses_energy_until_it_rests():
    grid = crystalline.grid()
    shift = np.where(grid.free, np.random.default_rng(1).normal(size=len(grid.free)) * 0.01, 0.0)
    speed = np.zeros_like(shift)
    energies = [grid.energy(shift, speed)]
    for _ in range(480):  # half a second
        shift, speed = grid.step(shift, speed, 1 / 960)
        energies.append(grid.energy(shift, speed))
    means = np.array(energies[: 480 // 24 * 24]).reshape(-1, 24).mean(axis=1)  # over more than a swing
    assert (np.diff(means) <= 0).all()
    assert energies[-1] < 1e-3 * energies[0]


def test_the_muscle_trembles_between_one_and_two_hertz_by_tens_of_micrometres():
    seconds = np.arange(0, 120, 1 / 32)
    pull = np.array([crystalline.muscle(s, 0, 4.0) for s in seconds])
    assert 0.005 < np.abs(pull).max() < 0.1
    spectrum_of = np.abs(np.fft.rfft(pull - pull.mean())) ** 2
    hertz = np.fft.rfftfreq(len(pull), 1 / 32)
    assert spectrum_of[(hertz > 1.25) & (hertz < 2.15)].sum() > 10 * spectrum_of[(hertz > 4.0)].sum()
    assert spectrum_of[hertz < 1.2].sum() > 0.2 * spectrum_of.sum()


# ----------------------------------------------------------------------------------------------------------- vitreous


def test_the_vitreous_body_swings_out_and_stays_within_bounds():
    assert abs(vitreous.response(np.array([vitreous.MEMORY]))[0]) < 1e-5
    turns = np.array([vitreous.turn_at(s, 0) for s in np.arange(0, 300, 0.25)])
    assert np.abs(turns).max() < np.radians(20)
    assert np.abs(turns).mean() > np.radians(0.1)


def test_its_particles_keep_their_distances():
    rest = vitreous.particles(200, 0)
    turned = rest @ vitreous.rotation(vitreous.turn_at(7.3, 0, movement=10.0)).T
    assert (turned != rest).any()
    pairs = np.random.default_rng(1).integers(0, 200, (500, 2))
    before, after = (np.linalg.norm(one[pairs[:, 0]] - one[pairs[:, 1]], axis=1) for one in (rest, turned))
    np.testing.assert_allclose(after, before, rtol=1e-12, atol=1e-12)
    assert np.linalg.norm(rest, axis=1).max() <= vitreous.RADIUS
    share = (np.hypot(rest[:, 0], rest[:, 1]) < 4.5).mean()
    assert share == pytest.approx(0.435, abs=0.08)


def test_its_closed_form_is_what_small_steps_lead_to():
    """Semi-implicit Euler over the seconds that are felt, from rest, with the same impulses."""
    end, step = 23.0, 1e-3
    when, speeds = vitreous.impulses(end, seed=2)
    gamma, swing = 1 / vitreous.DECAY, 2 * np.pi * vitreous.FREQUENCY
    turn, speed = np.zeros(3), np.zeros(3)
    start = end - vitreous.MEMORY
    kicks = {round((w - start) / step): s for w, s in zip(when, speeds, strict=True)}
    for k in range(round(vitreous.MEMORY / step)):
        speed = speed + kicks.get(k, 0.0)
        speed = speed + step * (-2 * gamma * speed - (gamma**2 + swing**2) * turn)
        turn = turn + step * speed
    found = vitreous.turn_at(end, seed=2)
    assert np.abs(found - turn).max() < 0.02 * np.abs(found).max()


# --------------------------------------------------------------------------------------------------------------- lids


def test_open_lids_free_the_widest_pupil_and_shut_ones_nothing():
    assert lids.open_share(9.0, 0.0) == 1.0
    assert lids.open_share(9.0, 1.0) == 0.0
    shares = [lids.open_share(4.0, closed) for closed in np.linspace(0, 1, 20)]
    assert (np.diff(shares) <= 0).all()
    assert lids.closure(0.0, 0.0) == 0.0
    assert lids.closure(0.5, 1.0) == 1.0


@pytest.mark.slow
def test_an_eye_blinks_as_often_as_is_asked():
    seconds = np.arange(0, 600, 0.01)
    state = np.array([lids.blinking(s, 15.0, 0) for s in seconds])
    begins = ((state[1:] > 0.5) & (state[:-1] <= 0.5)).sum()
    assert begins == pytest.approx(150, abs=1)
    assert state.max() == 1.0
    assert (state > 0).mean() == pytest.approx(0.35 / 4.0, rel=0.1)
    assert lids.blinking(3.3, 0.0, 0) == 0.0


def test_a_squint_darkens_nothing_and_a_blink_does():
    assert aperture_at(Eye(squint=1.0), 0.3, 10.0).light == 1.0
    assert aperture_at(Eye(blink=0.8), 0.3, 10.0).light < 0.9
    assert aperture_at(Eye(squint=0.5, blink=1.0), 0.3, 10.0).light == 0.0


# ---------------------------------------------------------------------------------------------------------- the whole


def test_any_time_is_reached_without_those_before_it():
    alone = aperture_at(Eye(), 40 / 24, 10.0)
    for frame in range(40):
        aperture_at(Eye(), frame / 24, 10.0)
    again = aperture_at(Eye(), 40 / 24, 10.0)
    assert again.diameter == alone.diameter
    np.testing.assert_array_equal(again.strokes, alone.strokes)
    assert (aperture_at(Eye(seed=1), 40 / 24, 10.0).strokes[:5] != alone.strokes[:5]).any()


def test_an_eye_that_is_held_still_does_not_change():
    still = Eye(restlessness=0.0, tremor=0.0, movement=0.0)
    first, second = (aperture_at(still, seconds, 10.0) for seconds in (0.0, 17.3))
    assert first.diameter == second.diameter
    np.testing.assert_array_equal(first.strokes, second.strokes)


def test_what_is_obstructed_is_what_was_asked_for():
    for share in (0.05, 0.1, 0.2):
        eye = Eye(scatter=share, fibres=0.0, lashes=0.0, pupil=8.0, age=25.0, restlessness=0.0)
        assert aperture_at(eye, 0.0, 1.0).obstructed == pytest.approx(share, rel=0.25)
    assert older(75.0) > 2.5


def test_every_preset_names_what_an_eye_has():
    for preset in PRESETS.values():
        eye = replace(Eye(), **{name: value for name, value in preset.values.items() if name != "defocus"})
        assert aperture_at(eye, 1.0, 10.0).strokes.shape[1] == 8


# ------------------------------------------------------------------------------------------------------------- optics


def test_the_colour_matching_functions_are_balanced():
    sums = spectrum.xyz(spectrum.wavelength(np.arange(32) / 32)).sum(axis=0) * spectrum.RANGE / 32
    np.testing.assert_allclose(sums, (106.8, 106.9, 106.8), rtol=2e-3)
    assert np.ptp(sums) / sums.mean() < 0.01
    rows = spectrum.table().astype(np.float64)
    np.testing.assert_allclose((rows[:, :3] / rows[:, 3:] ** 2).sum(axis=0) / len(rows), 1.0, atol=1e-5)


def planck(kelvin, nanometres):
    """Spectral radiance but for a factor, from the constants of the SI."""
    metres = np.asarray(nanometres, np.float64) * 1e-9
    return metres**-5 / np.expm1(6.62607015e-34 * 299792458.0 / (metres * 1.380649e-23 * kelvin))


EVERY_NM = np.arange(380.5, 770.0)


@pytest.mark.parametrize("kelvin", [1900.0, 2800.0, 5800.0, 12000.0])
def test_the_spectrum_of_a_blackbodys_colour_is_plancks(kelvin):
    power = planck(kelvin, EVERY_NM)
    colour = tuple(spectrum.TO_REC709 @ (power @ spectrum.xyz(EVERY_NM)))
    np.testing.assert_allclose(spectrum.of_light("BLACKBODY", kelvin, EVERY_NM) * power.sum(),
                               power * spectrum.of_light("BLACKBODY", kelvin, EVERY_NM).sum(), rtol=1e-4)  # fmt: skip
    if min(colour) < 0.0:
        colour = tuple(max(channel, 0.0) for channel in colour)  # candles are redder than the picture's red and green
    found = spectrum.of_light("COLOUR", colour, EVERY_NM)
    seen = spectrum.xyz(EVERY_NM)[:, 1]
    ratio = found / (found @ seen) / (power / (power @ seen))
    assert np.abs(ratio - 1.0)[(EVERY_NM > 430) & (EVERY_NM < 670)].max() < 0.1


def test_an_upsampled_spectrum_has_the_colour_it_is_of():
    random = np.random.default_rng(5)
    for colour in (*random.random((40, 3)), *np.eye(3), (1, 1, 0), (1, 0, 1), (0, 1, 1), (1, 1, 1), (1, 0.1, 0.1)):
        power = spectrum.of_light("COLOUR", tuple(map(float, colour)), EVERY_NM)
        seen = power @ spectrum.xyz(EVERY_NM)
        wanted = np.linalg.solve(spectrum.TO_REC709, np.asarray(colour, float))
        assert (power >= 0.0).all() and power.max() <= 1.0
        # Reds and purples at the rim of the picture's colours have none so smooth: the nearest.
        near = 1e-3 if min(colour) > 0.05 * max(colour) else 0.02
        np.testing.assert_allclose(seen[:2] / seen.sum(), wanted[:2] / wanted.sum(), atol=near, err_msg=str(colour))


def test_a_picture_of_no_light_is_white_and_noise_makes_no_other_colour():
    assert spectrum.rounded((0.0, 0.0, 0.0)) == spectrum.rounded((np.nan, 0.0, -1.0)) == (1.0, 1.0, 1.0)
    assert spectrum.rounded((40.0, 20.0, 0.0)) == (1.0, 0.5, 2.0**-5)
    assert spectrum.rounded((4.0, 2.0, 1.0)) == spectrum.rounded((4.1, 2.0, 1.02))


def radial_mean(image):
    side = len(image)
    y, x = np.mgrid[0:side, 0:side] - side // 2
    radius = np.round(np.hypot(x, y)).astype(int)
    return np.bincount(radius.ravel(), image.ravel()) / np.maximum(np.bincount(radius.ravel()), 1)


def test_the_tail_falls_like_the_disability_glare_of_the_cie():
    """10 / theta^3 + 5 / theta^2: between the second and the third power, over the decade beyond the core."""
    total = 0.0
    for seed in range(3):
        eye = Eye(seed=seed, pupil=4.0, lashes=0.0, restlessness=0.0)
        total = total + radial_mean(
            optics.intensity(optics.field(optics.transmittance(aperture_at(eye, 0, 1), 512), 0))
        )
    radius = np.arange(20, 200)
    slope = np.polyfit(np.log(radius), np.log(total[radius]), 1)[0]
    assert -3.2 < slope < -1.8


def test_fibres_make_a_ring_where_their_period_says():
    """200 radial fibres: radius W 200 / (2 pi r) texels, a third of a degree; ten times that is the eye's halo."""
    eye = Eye(pupil=8.0, lashes=0.0, scatter=0.0, restlessness=0.0)
    open_part = optics.transmittance(aperture_at(replace(eye, fibres=0.8), 0, 1), 512)
    light = radial_mean(optics.intensity(optics.field(open_part, 0)))
    inner, outer = (WINDOW * crystalline.FIBRES / (2 * np.pi * r) for r in (4.0, crystalline.FIBRES_FROM))
    peak = 60 + light[60:250].argmax()
    assert inner * 0.95 < peak < outer * 1.05
    assert light[peak] > 20 * light[60:75].min()
    assert light[peak] > 20 * light[135:150].min()
    assert peak * optics.degrees_per_texel() * 10 == pytest.approx(3.0, abs=1.5)


def test_defocus_blurs_the_core_and_keeps_the_light():
    aperture = Aperture(4.9, 0.0, np.zeros((0, 8), np.float32), 1.0)
    sharp, blurred = (optics.intensity(optics.field(optics.transmittance(aperture, 256), d)) for d in (0.0, 0.25))
    assert sharp.sum() == pytest.approx(blurred.sum(), rel=1e-9)
    assert blurred.max() < 0.2 * sharp.max()


@pytest.mark.slow
def test_the_kernel_does_not_depend_on_how_fine_the_pattern_is():
    """The same angle holds the same share of the light, whatever the pattern's and the picture's resolution."""
    aperture = aperture_at(Eye(pupil=4.0, lashes=0.0), 0.0, 1.0)
    shares = []
    for side, degrees in ((256, 0.03), (512, 0.03), (512, 0.06)):
        colours = optics.colours(optics.intensity(optics.field(optics.transmittance(aperture, side), 0.25)))
        scale = optics.scale_of(side, degrees, 10.0, 4.0, 0.25, 2000)
        kernel = optics.over_pixels(colours, scale)
        offset = np.arange(-scale.reach, scale.reach + 1) * degrees
        within = np.hypot(offset[None], offset[:, None]) < 2.0
        shares.append(kernel[within].sum() / 3)
    assert shares[1] == pytest.approx(shares[2], abs=0.02)
    assert shares[0] == pytest.approx(shares[1], abs=0.08)


def test_particles_of_the_cornea_are_uniform_over_the_widest_pupil():
    """Of a uniform disc all moments cos(k angle) vanish, the mean squared distance is half of the radius squared."""
    x, y = _cornea(20_000, 3)
    radius = pupil.LARGEST / 2
    turn = np.exp(1j * np.arctan2(y, x)[:, None] * np.arange(1, 7))
    assert np.abs(turn.mean(axis=0)).max() < 4.0 / np.sqrt(20_000)
    assert (x**2 + y**2).mean() == pytest.approx(radius**2 / 2, rel=0.02)
