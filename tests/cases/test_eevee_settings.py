"""What an artist has set for EEVEE, and Candela reads."""

import pytest

from addon.compare.reference import render_passes


@pytest.mark.parametrize(("camera", "shadow"), [(False, False), (True, False), (True, True)])
def test_backs_are_left_out_where_eevee_would(stage, camera, shadow):
    """A card that shows its back to a camera above, and to a sun, over a floor: seen through or not, and lit or not.
    With the switch of the scene off, as Cycles, which has none."""
    stage.rectangle((-2, -2), (2, 2), material=stage.diffuse(0.5))
    made = stage.diffuse(0.9)
    made.use_backface_culling, made.use_backface_culling_shadow = camera, shadow
    stage.rectangle((-1, -1), (1, 1), material=made, location=(0, 0, 1), turn=(3.14159265, 0, 0))
    stage.light("SUN", angle=0.0, energy=3.14159265)
    stage.camera_above()
    stage.scene.candela.use_backface_culling = True
    shown = render_passes(stage.scene, "CANDELA", 8, 1, size=(16, 16), bounces=0).images["combined"][8, 8, :3]
    assert shown == pytest.approx([(0.5 if shadow else 0.0) if camera else 0.9] * 3, abs=0.02)
    if camera:
        stage.scene.candela.use_backface_culling = False
        shown = render_passes(stage.scene, "CANDELA", 2, 1, size=(16, 16), bounces=0).images["combined"][8, 8, :3]
        assert shown == pytest.approx([0.9] * 3, abs=0.02)
