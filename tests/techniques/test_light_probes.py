"""What probes find out about lights before the picture: moments of a point's irradiance, against closed forms."""

import numpy as np
import pytest

from addon.techniques.light_probes import LightProbes

HEIGHT, POWER = 2.0, 40.0
BELOW = POWER / (4 * np.pi * HEIGHT**2)  # irradiance right below a lamp of that power


@pytest.fixture
def moments(stage, monkeypatch):
    """(mean, mean square) of the irradiance by a lamp's points, (probes, 2), on a floor seen from above."""
    kept, drawn = [], LightProbes._draw_moments

    def keep(self, frame, trials):
        found = drawn(self, frame, trials)
        kept.extend(found)
        return found

    monkeypatch.setattr(LightProbes, "_draw_moments", keep)
    stage.floor()
    stage.camera_above(span=0.2)

    def moments():
        kept.clear()
        stage.render(samples=4, size=(16, 16))
        return np.concatenate([one.pixels()[..., :2] for one in kept])[0].astype(float)

    return moments


def test_points_of_a_lamp_without_size_all_bring_what_the_inverse_square_says(stage, moments):
    """Within a tenth of a metre below a lamp at two metres, cosines and distances differ by less than a hundredth."""
    stage.light("POINT", (0, 0, HEIGHT), energy=POWER, shadow_soft_size=0.0)
    mean, square = moments().T
    assert mean == pytest.approx(BELOW, rel=1e-2)
    assert square == pytest.approx(mean**2, rel=1e-4)


@pytest.mark.parametrize("casts", [True, False])
def test_what_a_caster_hides_brings_nothing_unless_the_lamp_casts_no_shadows(stage, moments, casts):
    lamp = stage.light("POINT", (0, 0, HEIGHT), energy=POWER, shadow_soft_size=0.0)
    lamp.data.use_shadow = casts
    stage.blocker((-0.5, -0.5), (0.5, 0.5), 0.5 * HEIGHT)
    mean, square = moments().T
    assert mean == pytest.approx(0.0 if casts else BELOW, rel=1e-2)
    assert square == pytest.approx(mean**2, rel=1e-4)
