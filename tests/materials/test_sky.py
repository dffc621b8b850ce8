"""The sky's models: what follows from energy and symmetry, and the disc against the light that leaves the sun."""

import numpy as np
import pytest

from addon.materials import sky
from addon.materials.sky import HEIGHT, WIDTH, Sky, sky_of, sky_pixels, sun_radiance

SCATTERING = ("SINGLE_SCATTERING", "MULTIPLE_SCATTERING")


def of(model, **values):
    return Sky(model, **{"sun_elevation": 0.5, "sun_size": 0.01, **values})


@pytest.mark.parametrize("model", [*SCATTERING, "PREETHAM", "HOSEK_WILKIE"])
def test_a_sky_is_finite_and_symmetric_about_the_sun(model):
    pixels = sky_pixels(of(model))[:HEIGHT, :, :3]
    assert np.isfinite(pixels).all()
    assert (pixels >= 0).all()
    assert np.array_equal(pixels, pixels[:, ::-1])
    above = pixels[3 * HEIGHT // 4]
    assert above.sum(axis=1).argmax() in (0, WIDTH - 1)  # the sun's azimuth


@pytest.mark.parametrize("model", SCATTERING)
def test_without_air_there_is_no_sky_and_the_sun_is_white(model):
    empty = of(model, air=0.0, aerosol=0.0, ozone=0.0)
    assert np.abs(sky_pixels(empty)[:HEIGHT, :, :3]).max() == 0.0
    low, high = sun_radiance(empty)
    assert low == pytest.approx(high)
    solid_angle = 2 * np.pi * (1 - np.cos(0.005))
    lit = sky.SUN @ sky.MATCHING * sky.STEP_NM if model == "SINGLE_SCATTERING" else sky.SUN_FOUR @ sky.XYZ_FOUR
    assert low * solid_angle == pytest.approx(sky.XYZ_TO_RGB @ lit)
    assert low.max() < 1.6 * low.min()


@pytest.mark.parametrize("model", SCATTERING)
def test_the_sun_reddens_towards_the_horizon(model):
    shares = [np.divide(*sun_radiance(of(model, sun_elevation=e))[0][[0, 2]]) for e in (1.5, 0.5, 0.1)]
    assert shares[0] < shares[1] < shares[2]


def test_half_a_disc_on_the_horizon_gives_half_its_light():
    whole = sky.disc_radiance(of("SINGLE_SCATTERING", sun_elevation=0.2, level=True, air=0.0, aerosol=0.0))
    half = sky.disc_radiance(of("SINGLE_SCATTERING", sun_elevation=0.0, level=True, air=0.0, aerosol=0.0))
    assert half == pytest.approx(whole / 2)


def test_settings_of_all_versions_are_read():
    old = {
        "sky_type": "NISHITA", "sun_elevation": 0.3, "sun_rotation": 1.0, "sun_size": 0.01, "sun_disc": True,
        "sun_intensity": 2.0, "altitude": 10.0, "air_density": 1.0, "dust_density": 3.0, "ozone_density": 1.0,
    }  # fmt: skip
    found = sky_of(old)
    assert (found.model, found.aerosol, found.level) == ("SINGLE_SCATTERING", 3.0, True)
    new = {**old, "sky_type": "MULTIPLE_SCATTERING", "aerosol_density": 4.0, "sun_disc": False}
    assert (sky_of(new).aerosol, sky_of(new).sun_size) == (4.0, 0.0)
    hosek = sky_of({"sky_type": "HOSEK_WILKIE", "sun_direction": (0, 0, 2), "turbidity": 3.0, "ground_albedo": 0.8})
    assert (hosek.sun_elevation, hosek.ground_albedo) == (pytest.approx(np.pi / 2), 0.8)
    preetham = sky_of({"sky_type": "PREETHAM", "sun_direction": (0.6, 0.0, 0.8), "turbidity": 3.0})
    assert preetham.sun == pytest.approx([0.6, 0.0, 0.8])
