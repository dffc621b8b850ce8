"""Stereoscopic pictures: each eye's is that of Cycles."""

import bpy
import numpy as np
import pytest


def pictures(stage, folder, engine):
    """{suffix: (H, W) brightness} of the files that Blender writes, one for each view."""
    render = stage.scene.render
    render.engine = engine
    stage.scene.cycles.samples = stage.scene.candela.samples = 16
    render.filter_size = stage.scene.cycles.filter_width = 1.0
    stage.scene.view_settings.view_transform = "Raw"
    stage.scene.render.filepath = str(folder / engine / "eye.png")
    render.resolution_x = render.resolution_y = 48
    bpy.ops.render.render(write_still=True)
    found = {}
    for path in sorted((folder / engine).glob("*.png")):
        image = bpy.data.images.load(str(path))
        found[path.stem] = np.array(image.pixels[:]).reshape(48, 48, 4)[..., 0]
        bpy.data.images.remove(image)
    return found


@pytest.mark.parametrize("mode", ["OFFAXIS", "PARALLEL", "TOE"])
def test_eyes_see_what_they_see_in_cycles(stage, tmp_path, mode):
    stage.rectangle((-0.5, -0.5), (0.5, 0.5), 1.0, material=stage.material("ShaderNodeEmission", Strength=0.8))
    stage.rectangle((-3, -3), (0.4, 3), -4.0, material=stage.material("ShaderNodeEmission", Strength=0.3))
    camera = stage.camera((0, 0, 4), (0, 0, 0), angle=0.8)
    camera.data.shift_x = 0.05
    stereo = camera.data.stereo
    stereo.pivot = "CENTER"
    stereo.convergence_mode, stereo.interocular_distance, stereo.convergence_distance = mode, 0.6, 4.0
    render = stage.scene.render
    render.use_multiview, render.views_format = True, "STEREO_3D"
    render.image_settings.views_format = "INDIVIDUAL"
    try:
        ours, theirs = (pictures(stage, tmp_path, engine) for engine in ("CANDELA", "CYCLES"))
    finally:
        render.use_multiview = False
    assert sorted(ours) == sorted(theirs) == ["eye_L", "eye_R"]
    for eye, picture in ours.items():
        assert np.abs(picture - theirs[eye]).mean() < 0.01, eye
    assert np.abs(ours["eye_L"] - ours["eye_R"]).mean() > 0.02
