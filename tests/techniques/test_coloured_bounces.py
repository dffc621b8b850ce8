"""Light that is reflected by surfaces below a coloured pane has the pane's colour."""

import numpy as np
import pytest

COLOR = (0.9, 0.3, 0.1)


def room(stage, color, panes=1):
    """A floor and a wall below panes that all of a lamp's light passes."""
    stage.clear()
    stage.camera((0, -2.2, 0.9), (1.2, 0, 0), angle=1.0)
    stage.floor(1.5, material=stage.diffuse(0.7))
    stage.rectangle((-1.5, 0), (1.5, 0.9), material=stage.diffuse(0.7), location=(0, 1.0, 0), turn=(np.pi / 2, 0, 0))
    for k in range(panes):
        glass = stage.material("ShaderNodeBsdfTransparent", Color=(*color, 1))
        stage.rectangle((-9, -9), (9, 9), 1.0 + 0.1 * k, material=glass)
    stage.light("POINT", (0.2, 0, 2.0), energy=200.0, shadow_soft_size=0.1)


def indirect(stage, samples):
    """Mean of eight samples at least."""
    seeds = range(-(-8 // samples))
    found = [stage.render(samples, size=(24, 20), bounces=2, seed=seed)["diffuse_indirect"] for seed in seeds]
    return np.mean(found, axis=0)[..., :3].mean((0, 1))


# One sample takes another technique; light that comes back through a pane has its colour twice, which is in neither.
@pytest.mark.parametrize(("samples", "panes"), [(1, 1), (8, 1), (8, 2)])
def test_bounced_light_has_the_colours_of_the_panes_that_it_passed(stage, samples, panes):
    room(stage, (1, 1, 1), panes)
    clear = indirect(stage, samples)
    room(stage, COLOR, panes)
    assert indirect(stage, samples) / clear == pytest.approx(np.array(COLOR) ** panes, rel=0.06)
