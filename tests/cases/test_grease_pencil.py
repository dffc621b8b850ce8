"""Blender draws Grease Pencil over the picture of any engine: nothing is missing, and nothing is said."""

import bpy
import pytest

from addon.compare.reference import render_passes
from addon.frame import ledger

from .conftest import agree


@pytest.mark.slow
@pytest.mark.skipif(bpy.app.version < (5, 0), reason="Grease Pencil has another Python interface before Blender 5.0")
def test_a_stroke_is_drawn_without_a_warning(stage):
    pencil = bpy.data.grease_pencils.new("Pencil")
    ink = bpy.data.materials.new("Ink")
    bpy.data.materials.create_gpencil_data(ink)
    ink.grease_pencil.color = (0, 0.2, 1, 1)
    pencil.materials.append(ink)
    layer = pencil.layers.new("Layer")
    layer.use_lights = False
    drawing = layer.frames.new(1).drawing
    drawing.add_strokes([2])
    for point, x in zip(drawing.strokes[0].points, (-1.8, 1.8)):
        point.position, point.radius, point.opacity = (x, 0, 0), 0.4, 1.0
    stage.link("Pencil", pencil)
    stage.camera_above()
    found = {}
    for engine in ("CANDELA", "CYCLES"):
        found[engine] = render_passes(stage.scene, engine, 4, 1, size=(32, 32)).images["combined"][16, 16]
        if engine == "CANDELA":
            assert not ledger.latest().notes
    bpy.data.grease_pencils.remove(pencil)
    assert found["CYCLES"][2] > 0.5
    agree(found["CANDELA"], found["CYCLES"])
