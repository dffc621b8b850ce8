"""Holdouts cut a hole in what the camera sees, and light others as they would without it, in each layer and frame."""

import tempfile
from pathlib import Path

import bpy
import numpy as np
import pytest

from addon.snapshot.exr import read_exr

from .conftest import agree


def principled(stage, color):
    return stage.principled(Base_Color=(*color, 1), Roughness=0.5)


@pytest.fixture
def corner(stage):
    """A red wall, seen edge on or from above, throws light on a floor under a sun."""
    stage.floor(1.0, material=principled(stage, (0.8, 0.8, 0.8)))
    wall = stage.rectangle((-0.9, -0.9), (0.9, 0.9), material=principled(stage, (0.9, 0.02, 0.02)))
    wall.rotation_euler, wall.location = (0, 1.5708, 0), (-0.3, 0, 0.9)
    stage.light("SUN", turn=(0, 0.9, 0), energy=5.0)
    stage.camera_above(2.0, 5.0)
    return wall


def on_floor(passes):
    return passes["combined"][26:38, 24:30, :3].mean((0, 1))


@pytest.mark.slow
@pytest.mark.parametrize("seen", [False, True])
@pytest.mark.parametrize("kind", ["object", "glowing", "collection"])
def test_light_of_a_holdout_reaches_others(stage, corner, beside, kind, seen):
    if seen:  # the camera sees the wall, too
        corner.rotation_euler = (0, 1.2, 0)
    if kind == "glowing":
        corner.data.materials[0] = stage.material("ShaderNodeEmission", Color=(1, 0.1, 0.1, 1))
    if kind == "collection":
        group = bpy.data.collections.new("Group")
        stage.scene.collection.children.link(group)
        stage.scene.collection.objects.unlink(corner)
        group.objects.link(corner)
        stage.scene.view_layers[0].layer_collection.children["Group"].holdout = True
    else:
        corner.is_holdout = True
    own, cycles = beside(32, (64, 64))
    agree(on_floor(own), on_floor(cycles))
    hole = own["combined"][..., 3] < 0.5
    assert hole.any() == seen
    assert (hole == (cycles["combined"][..., 3] < 0.5)).mean() > 0.98
    if kind == "collection":
        bpy.data.collections.remove(bpy.data.collections["Group"])


@pytest.mark.slow
@pytest.mark.parametrize("first", [True, False])
def test_what_was_a_holdout_in_one_frame_lights_the_next_and_the_other_way_round(stage, corner, beside, first):
    found = []
    for hold in (first, not first):
        corner.is_holdout = hold
        found.append([on_floor(passes) for passes in beside(16, (64, 64))])
    for own, cycles in found:
        agree(own, cycles)


@pytest.mark.slow
def test_a_holdout_of_one_layer_lights_that_layer_and_the_next(stage, corner):
    scene = stage.scene
    group = bpy.data.collections.new("Group")
    scene.collection.children.link(group)
    scene.collection.objects.unlink(corner)
    group.objects.link(corner)
    second = scene.view_layers.new("Second")
    first = scene.view_layers[0]
    first.layer_collection.children["Group"].holdout = True
    settings, before = scene.render.image_settings, scene.render.filepath
    if hasattr(settings, "media_type"):
        settings.media_type = "MULTI_LAYER_IMAGE"
    settings.file_format = "OPEN_EXR_MULTILAYER"
    scene.render.resolution_x = scene.render.resolution_y = 64
    try:
        cells = {}
        for engine in ("CANDELA", "CYCLES"):
            scene.render.engine = engine
            scene.candela.samples, scene.cycles.samples = 16, 64
            scene.render.filepath = str(Path(tempfile.mkdtemp()) / "layers.exr")
            bpy.ops.render.render(write_still=True, scene=scene.name)
            found = read_exr(scene.render.filepath)
            cells[engine] = [found[f"{one.name}.Combined"][26:38, 24:30, :3].mean((0, 1)) for one in (first, second)]
    finally:
        scene.view_layers.remove(second)
        bpy.data.collections.remove(group)
        if hasattr(settings, "media_type"):
            settings.media_type = "IMAGE"
        scene.render.filepath = before
    agree(np.array(cells["CANDELA"]), np.array(cells["CYCLES"]))
