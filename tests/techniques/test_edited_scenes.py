"""Edits of an artist's scenes (bench/edited_scenes.py): a lacquered body, a mirror in a room, a glass bottle."""

import bpy
import numpy as np
import pytest

from addon.compare.reference import render_passes
from bench import edited_scenes


def rendered(name, edited, even):
    """The picture (H, W, 3), and where its edited object is."""
    edited_scenes.make(name, edited, even)
    found = render_passes(bpy.context.scene, "CANDELA", 2, 1, size=(48, 36), bounces=8).images
    shiny = sum(found.get(f"{lobe}_color", np.zeros(1))[..., :3].max(axis=-1) for lobe in ("glossy", "transmission"))
    assert np.isfinite(found["combined"]).all()
    return found["combined"][..., :3], shiny > 0.03


@pytest.mark.slow
@pytest.mark.parametrize("name", edited_scenes.SCENES)
def test_an_edit_loses_no_light(registered, name):
    """All around the object is as bright: what it shows is as bright with the edit as without."""
    plain, seen = rendered(name, False, True)
    edited, _ = rendered(name, True, True)
    assert seen.mean() > 0.02 and edited[seen].mean() == pytest.approx(plain[seen].mean(), rel=0.02)
    outside = ~seen
    assert edited[outside].mean() == pytest.approx(plain[outside].mean(), rel=2e-3)


def darkest(picture, inside):
    """The least mean luminance of squares of three pixels that lie on the object."""
    height, width = (3 * (extent // 3) for extent in inside.shape)
    grid = (height // 3, 3, width // 3, 3)
    whole = inside[:height, :width].reshape(grid).all(axis=(1, 3))
    return picture[:height, :width].mean(axis=-1).reshape(grid).mean(axis=(1, 3))[whole].min()


@pytest.mark.slow
@pytest.mark.parametrize("name", edited_scenes.SCENES)
def test_an_edit_leaves_nothing_black(registered, name):
    plain, seen = rendered(name, False, False)
    edited, _ = rendered(name, True, False)
    assert np.abs(edited - plain)[seen].max() > 0.1  # it does something
    assert darkest(edited, seen) > 0.5 * darkest(plain, seen)
