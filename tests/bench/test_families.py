"""The procedural scenes: each dial turns what it names, and every member renders."""

import bpy
import pytest

from bench import growth, profile
from bench.families import FAMILIES, build

pytestmark = pytest.mark.usefixtures("registered")


def triangle_count():
    return sum(len(thing.data.polygons) * 2 for thing in bpy.data.objects if thing.type == "MESH")


def lamps():
    return [thing.data for thing in bpy.data.objects if thing.type == "LIGHT"]


def test_lamps_share_the_power():
    build("lights", 4)
    few = lamps()
    assert len(few) == 4 and sum(lamp.energy for lamp in few) == pytest.approx(300)
    build("lights", 64)
    assert len(lamps()) == 64 and sum(lamp.energy for lamp in lamps()) == pytest.approx(300)


def test_terrain_has_about_as_many_triangles_as_asked_for():
    build("triangles", 2e3)
    assert triangle_count() == pytest.approx(2e3, rel=0.1)


def test_layers_lie_above_each_other():
    build("layers", 4)
    heights = [thing.location.z for thing in bpy.data.objects if thing.name.startswith("Layer")]
    assert len(heights) == len(set(heights)) == 4


def test_bounces_are_the_scene_setting():
    build("bounces", 8)
    assert bpy.context.scene.candela.bounces == 8


@pytest.mark.parametrize("family", FAMILIES.values(), ids=FAMILIES)
def test_every_family_has_a_path_a_rising_dial_and_a_camera(family):
    assert family.path.split()[0] in ("diffuse", "glossy")
    assert list(family.values) == sorted(set(family.values)) and len(family.values) > 2
    build(family.name, family.values[0])
    assert bpy.context.scene.camera is not None and lamps()


def test_growth_names_exponent_and_counters_that_grew():
    rows = [
        {"dial": "lights", "path": "diffuse direct", "value": n, "seconds": 0.1 * n**2,
         "techniques": {"Film": 1.0, "Direct light": 3.0}, "counters": {"Direct light": {"passes": 4, "lights": n}}}
        for n in (1, 4, 16)
    ]  # fmt: skip
    assert growth.exponent(rows) == pytest.approx(2.0)
    line = growth.table(rows)[1]
    assert line[5] == "2.00" and line[6] == "Direct light (75 %)" and line[7] == "lights 1 to 16"


def test_profile_tells_python_from_the_gpu():
    draw, compiling = ("~", 0, "<method 'draw' of 'GPUBatch' objects>"), ("~", 0, "<gpu.shader.create_from_info>")
    own, numpy = ("/x/addon/scene/culling.py", 43, "seen"), ("/y/numpy/linspace.py", 7, "linspace")
    stats = {
        draw: (1, 1, 6.0, 6.0, {}),
        compiling: (1, 1, 1.0, 1.0, {}),
        ("~", 0, "<built-in method _bpy.ops.call>"): (1, 1, 1.0, 10.0, {}),
        own: (1, 1, 1.5, 2.0, {}),
        numpy: (1, 1, 0.5, 0.5, {own: (1, 1, 0.5, 0.5)}),
    }
    share = profile.shares(stats, {"readback": 1.0, "sync": 0.5})
    assert share == pytest.approx(
        {"sync": 0.05, "compile": 0.1, "GPU": 0.5, "readback": 0.1, "Python": 0.15, "Blender": 0.1}
    )
    assert profile.dearest(stats, 3) == [("scene/culling.py: seen", 2.0)]
    row = {"scene": "room", "warm": 1.0, "unchanged": 0.6, "shares": share, "dearest": [["a: b", 0.2]]}
    assert len(profile.missed(row)) == 2
