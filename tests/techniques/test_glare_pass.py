"""The pass Glare in a file: as large as the picture, with its light, whatever the render border."""

import pytest


@pytest.mark.slow
@pytest.mark.parametrize("border", [False, True])
def test_the_pass_has_the_size_and_the_light_of_the_picture(written, border):
    written.camera_above(2.0)
    lamp = written.material("ShaderNodeEmission", Strength=2000.0)
    written.rectangle((-0.02, -0.02), (0.02, 0.02), material=lamp)
    written.world((0.02, 0.02, 0.02))
    written.scene.camera.data.candela.glare_mode = "CONVOLUTION"
    options = (
        [(written.scene.render, "use_border", True), (written.scene.render, "border_min_x", 0.25)] if border else []
    )
    images = written.written("CANDELA", 2, size=(64, 48), extra=options, bounces=0)
    glare, picture = images["Glare"], images["Combined"]
    assert glare.shape == picture.shape == (48, 64, 4)
    assert glare[..., :3].max() < picture[..., :3].max()
    assert glare[..., :3].sum() == pytest.approx(picture[..., :3].sum(), rel=0.05)
