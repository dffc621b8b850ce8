"""Pictures scattered on the GPU: against numpy, and against what must be true of any point spread function."""

import numpy as np
import pytest

from addon.eye import optics
from addon.eye.aperture import Eye, aperture_at
from addon.gfx import images

WHITE, MOST = 1.0, 1e6


@pytest.fixture(scope="module")
def eye_gpu(gpu_context):
    from addon.eye import point_spread, scatter

    return point_spread, scatter


class Glare:
    """A kernel of a small pattern, and pictures scattered by it."""

    def __init__(self, modules, degrees=0.03, sharp=True, eye=None, side=128, factor=1):
        self.point_spread, self.module = modules
        aperture = aperture_at(eye or Eye(), 0.5, 10.0)
        self.pattern = self.point_spread.make_pattern(aperture, side, 0.25)
        self.scale = optics.scale_of(side, degrees * factor, 10.0, aperture.diameter, 0.25, 60)
        self.kernel = self.point_spread.make_kernel(self.pattern.colours, self.scale, sharp)
        self.weights = images.read(self.kernel.weights)[..., :3].astype(np.float64)
        self.factor = factor
        self.scatter = self.module.Scatter()

    def __call__(self, picture, mode="convolve", white=WHITE, strength=1.0, dimming=1.0, dazzling=None):
        alpha = np.ones((*picture.shape[:2], 1))
        image, scattering = (
            None if light is None else images.upload(np.concatenate([light, alpha], axis=2).astype(np.float32))
            for light in (picture, dazzling)
        )
        target = images.Target((images.create(*image.size, "RGBA32F"),))
        options = {"factor": self.factor} if mode == "convolve" else {}
        getattr(self.scatter, mode)(
            image, self.kernel, target, white=white, strength=strength, dimming=dimming, dazzling=scattering, **options
        )
        found = images.read(target.colors[0])
        assert np.isfinite(found).all() and (found >= 0).all()
        np.testing.assert_array_equal(found[..., 3], 1.0)
        return found[..., :3].astype(np.float64)

    def release(self):
        self.kernel.release()
        self.pattern.release()
        self.scatter.release()


@pytest.fixture
def glare(eye_gpu):
    made = Glare(eye_gpu)
    yield made
    made.release()


@pytest.fixture
def whole_glare(eye_gpu):
    """With the kernel's core, for pictures that are scattered whole."""
    made = Glare(eye_gpu, sharp=False)
    yield made
    made.release()


def dark(width=97, height=61):
    return np.zeros((height, width, 3))


def night(width=97, height=61, seed=3):
    """Dim grain with some lamps of many colours and strengths."""
    random = np.random.default_rng(seed)
    picture = random.random((height, width, 3)) * 0.3
    for _ in range(12):
        picture[random.integers(height), random.integers(width)] = random.random(3) * 10 ** random.uniform(1, 3.5)
    return picture


def relative_error(found, expected):
    return np.sqrt(np.mean((found - expected) ** 2) / np.mean(np.square(expected)))


@pytest.mark.parametrize("size", [(97, 61), (64, 64), (33, 120), (1, 7)])
def test_a_picture_is_scattered_as_by_numpy(glare, size):
    picture = night(*size)
    expected = optics.glare(picture, glare.weights, 1.0, WHITE, MOST)
    assert relative_error(glare(picture), expected) < 1e-4


def test_strength_scales_what_is_scattered_and_no_more_than_all_is(glare):
    picture = night()
    for strength in (0.3, 2.0, 100.0):
        expected = optics.glare(picture, glare.weights, strength, WHITE, MOST)
        assert relative_error(glare(picture, strength=strength), expected) < 1e-4


def test_a_delta_gives_the_kernel_itself(whole_glare):
    picture, reach = dark(161, 143), whole_glare.scale.reach
    picture[70, 80] = 1000.0
    found = whole_glare(picture, white=0.0) / 1000.0
    square = found[70 - reach : 71 + reach, 80 - reach : 81 + reach]
    np.testing.assert_allclose(square, whole_glare.weights, atol=2e-5 * whole_glare.weights.max())


def test_two_sources_give_the_sum_of_both(glare):
    one, other = dark(), dark()
    one[20, 30], other[41, 60] = (50.0, 20.0, 5.0), 300.0
    both = glare(one + other)
    np.testing.assert_allclose(both, glare(one) + glare(other), atol=1e-5 * both.max())


def test_twice_the_light_scatters_twice(glare):
    picture = dark()
    picture[20, 30] = 100.0
    found = glare(picture, white=0.0)
    np.testing.assert_allclose(glare(2 * picture, white=0.0), 2 * found, atol=1e-6 * found.max())


def test_an_even_picture_stays_itself_away_from_the_borders(whole_glare):
    reach = whole_glare.scale.reach
    picture = np.full((2 * reach + 20, 2 * reach + 31, 3), (3.0, 2.0, 1.5))
    found = whole_glare(picture, white=0.0)[reach:-reach, reach:-reach]
    np.testing.assert_allclose(found, picture[reach:-reach, reach:-reach], rtol=1e-4)


def plausible(module, picture, samples=1, **straight):
    """What of a picture may dazzle; `straight`: of what is seen straight, mean of the samples."""
    height, width = picture.shape[:2]
    upload = lambda light: images.upload(np.dstack([light, np.ones((height, width))]).astype(np.float32))  # noqa: E731
    of_kinds = {
        kind: upload(samples * straight.get(kind, 0 * picture)) for kind in ("emission", "environment", "reflected")
    }
    target = images.Target((images.create(width, height, "RGBA32F"),))
    how = {"scale": 1.0 / samples, "world": 1.0, "white": WHITE, "samples": samples}
    module.plausible(upload(picture), of_kinds, target, **how)
    return images.read(target.colors[0])[..., :3].astype(np.float64)


@pytest.mark.parametrize("mode", ["convolve", "billboards"])
def test_a_firefly_of_one_sample_is_no_star_and_a_lamp_is_one(eye_gpu, glare, mode):
    """Of bounced light, also where the pixel filter shares the sample out among four pixels; its light stays where it
    is. A lamp of one pixel, seen straight or in a mirror, keeps its star."""
    random = np.random.default_rng(5)
    around, lamps = 0.05 + 0.15 * random.random((61, 97, 3)), dark()
    lamps[40, 70] = (300.0, 200.0, 100.0)
    flies = dark()
    flies[20, 20], flies[30, 40], flies[30:32, 50:52], flies[0, 96] = 56.0, (5.0, 28.0, 1.0), 14.0, 56.0
    for kind in ("emission", "environment", "reflected"):
        dazzling = plausible(eye_gpu[1], around + lamps + flies, **{kind: lamps})
        assert np.abs(dazzling - around - lamps).max() < 2.0
        expected = glare(around + lamps, mode) + flies
        found = glare(around + lamps + flies, mode, dazzling=dazzling)
        other = glare(around + lamps + flies, mode)
        star = np.abs(other - expected).sum()
        assert np.abs(found - expected).sum() < 0.02 * star
        assert found.sum() == pytest.approx((around + lamps + flies).sum(), rel=0.02)  # but for what leaves the picture


def test_light_that_surroundings_or_samples_hold_plausible_dazzles_whole(eye_gpu):
    """A lamp's image of 3 x 3 pixels behind glass, the middle of any; with more samples what stands out still more."""
    picture = np.full((61, 97, 3), 0.2)
    picture[20:23, 30:33] = 80.0
    np.testing.assert_allclose(plausible(eye_gpu[1], picture), picture, rtol=1e-6)
    picture[40, 50] = 40.0
    left = [plausible(eye_gpu[1], picture, samples)[40, 50, 0] for samples in (1, 2, 4, 8)]
    assert left == pytest.approx([1.0, 3.2, 12.8, 40.0])  # white, 16 and 64 times its surroundings, all


@pytest.mark.parametrize("mode", ["convolve", "billboards"])
def test_energy_is_kept_away_from_the_borders(glare, mode):
    reach = glare.scale.reach
    picture = dark(2 * reach + 41, 2 * reach + 33)
    picture[reach + 1 : -reach - 1 : 7, reach + 1 : -reach - 1 : 5] = (100.0, 60.0, 20.0)
    found = glare(picture, mode)
    np.testing.assert_allclose(found.sum(axis=(0, 1)), picture.sum(axis=(0, 1)), rtol=1e-3)


@pytest.mark.parametrize("factor", [2, 4])
def test_a_coarser_convolution_keeps_energy_and_nearly_the_shape(eye_gpu, factor):
    fine, coarse = Glare(eye_gpu), Glare(eye_gpu, factor=factor)
    picture = dark(220, 220)
    picture[108:112, 108:112] = 500.0
    found, expected = coarse(picture), fine(picture)
    np.testing.assert_allclose(found.sum(axis=(0, 1)), picture.sum(axis=(0, 1)), rtol=2e-3)
    away = np.s_[:90, :90]
    assert found[away].sum() == pytest.approx(expected[away].sum(), rel=0.1)
    for made in (fine, coarse):
        made.release()


def test_what_is_below_white_is_left_as_it_is(glare):
    picture = np.random.default_rng(1).random((61, 97, 3))
    assert np.sqrt(np.mean((glare(picture) - picture) ** 2)) < 1e-6


@pytest.mark.parametrize("mode", ["convolve", "billboards"])
def test_black_stays_black(glare, mode):
    assert not glare(dark(), mode).any()


@pytest.mark.parametrize("mode", ["convolve", "billboards"])
def test_a_light_in_a_corner_does_not_come_in_at_the_other_side(glare, mode):
    picture = dark(180, 170)
    picture[0, 0] = 1e6
    found = glare(picture, mode)
    assert found[14:22, 14:22].min() > 0.1
    reach = glare.scale.reach + 2
    far = np.concatenate([found[reach:].ravel(), found[:, reach:].ravel()])
    # What float32 leaves of a millionfold white is a ten-thousandth of white.
    assert far.max() < (1e-3 if mode == "convolve" else 1e-30)


@pytest.mark.parametrize("mode", ["convolve", "billboards"])
def test_what_is_not_finite_scatters_nothing(glare, mode):
    picture = night()
    picture[5, 5], picture[9, 9, 1], picture[20, 4, 2] = np.nan, np.inf, -np.inf
    clean = np.where(np.isfinite(picture), picture, 0.0)
    np.testing.assert_allclose(glare(picture, mode), glare(clean, mode), atol=1e-5)


def test_billboards_of_single_pixels_are_the_convolution(glare):
    picture = dark(120, 100)
    for x, y in ((10, 20), (70, 50), (100, 90)):
        picture[y, x] = 200.0
    assert relative_error(glare(picture, "billboards"), glare(picture)) < 1e-5


def test_billboards_differ_for_what_is_extended(glare):
    """As in the source: a flame's convolution washes needles out, a billboard keeps them."""
    picture = dark(160, 160)
    picture[70:94, 76:84] = 60.0
    outside = np.ones((160, 160), bool)
    outside[60:104, 66:94] = False
    board, smooth = glare(picture, "billboards")[outside], glare(picture)[outside]
    assert relative_error(board, smooth) > 0.1
    assert board.sum() == pytest.approx(smooth.sum(), rel=0.05)


def test_lids_that_are_shut_leave_black(eye_gpu):
    shut = Glare(eye_gpu, eye=Eye(blink=1.0))
    assert not shut(night(), dimming=0.0).any()
    np.testing.assert_allclose(shut(np.minimum(night(), 1.0), dimming=0.5), 0.5 * np.minimum(night(), 1.0), rtol=1e-5)
    shut.release()


def test_brightness_is_measured_as_by_numpy(eye_gpu):
    _, scatter = eye_gpu
    picture = night(201, 77)
    picture[3, 3, 0] = np.nan
    image = images.upload(np.concatenate([picture, np.ones((77, 201, 1))], axis=2).astype(np.float32))
    found = scatter.measure(image, WHITE)
    clean = np.where(np.isfinite(picture), picture, 0.0)
    assert found.mean == pytest.approx((clean @ (0.2126, 0.7152, 0.0722)).mean(), rel=1e-5)
    assert found.excess == pytest.approx(optics.excess(clean, WHITE, MOST).max(axis=-1).sum(), rel=1e-5)
    assert found.most == pytest.approx(clean.max(), rel=1e-6)
