"""Smooth-shaded surfaces of few triangles are lit up to where a curved one would be, as by Cycles."""

import numpy as np
import pytest

from addon.compare.reference import render_passes
from tests.techniques.test_shadows import irradiance

SIZE = (96, 96)
LOW_SUN = (0, 1.2, 0)
OUTLINE = 8  # pixels of an outline whose centres one finds on the ball and the other does not


def ball(stage, segments=8, rings=6, smooth=True, **placement):
    """A sphere of one metre and few faces."""
    turns = np.arange(segments) * 2 * np.pi / segments
    heights = np.pi * np.arange(1, rings) / rings
    places = [(np.sin(h) * np.cos(t), np.sin(h) * np.sin(t), np.cos(h)) for h in heights for t in turns]
    top, bottom = len(places), len(places) + 1
    faces = []
    for k in range(segments):
        after = (k + 1) % segments
        faces += [(top, k, after), (bottom, top - segments + after, top - segments + k)]
        faces += [
            (r * segments + k, r * segments + segments + k, r * segments + segments + after, r * segments + after)
            for r in range(rings - 2)
        ]
    made = stage.mesh([*places, (0, 0, 1), (0, 0, -1)], faces, material=stage.diffuse(0.8), **placement)
    made.data.shade_smooth() if smooth else made.data.shade_flat()
    return made


@pytest.fixture
def lit(stage):
    stage.camera_above(span=2.4)
    stage.light("SUN", turn=LOW_SUN, angle=0.0)
    return stage


def by_cycles(stage):
    return render_passes(stage.scene, "CYCLES", 16, 1, True, SIZE).images["diffuse_direct"][..., 0] * np.pi


def off(found, expected):
    """Pixels that differ by more than a hundredth of the brightest."""
    return int((abs(found - expected) > 0.01 * expected.max()).sum())


@pytest.mark.parametrize("scale", [1, -1, 1e-3, 1e4])
def test_light_ends_where_it_does_by_cycles(lit, scale):
    made = ball(lit, scale=(scale, abs(scale), abs(scale)))
    camera = lit.scene.camera
    camera.data.ortho_scale, camera.location.z = 2.4 * abs(scale), 10 * abs(scale)
    camera.data.clip_start, camera.data.clip_end = 0.1 * abs(scale), 100 * abs(scale)
    expected = by_cycles(lit)
    assert off(irradiance(lit, 1, SIZE), expected) < OUTLINE
    made.shadow_terminator_geometry_offset = 0.0
    assert off(by_cycles(lit), expected) > 10 * OUTLINE
    assert off(irradiance(lit, 1, SIZE), by_cycles(lit)) < OUTLINE


@pytest.mark.parametrize("kind", ["POINT", "SPOT", "AREA"])
@pytest.mark.parametrize("technique", ["AUTO", "accumulated_maps", "vssm", "cssm"])
def test_so_it_does_by_any_technique_and_lamp(stage, kind, technique):
    stage.camera_above(span=2.4)
    stage.light(kind, (6, 0, 2.4), turn=LOW_SUN)
    stage.scene.candela.slot_shadow = technique
    made = ball(stage)
    expected = by_cycles(stage)
    with_offset = off(irradiance(stage, 16, SIZE), expected)
    made.shadow_terminator_geometry_offset = 0.0
    without = off(irradiance(stage, 16, SIZE), expected)
    assert with_offset < OUTLINE
    assert without > 10 * OUTLINE


@pytest.mark.parametrize("fine", [False, True])
def test_flat_faces_are_as_without_and_fine_ones_nearly(lit, fine):
    made = ball(lit, 128, 96) if fine else ball(lit, smooth=False)
    found = irradiance(lit, 1, SIZE)
    made.shadow_terminator_geometry_offset = 0.0
    assert off(found, irradiance(lit, 1, SIZE)) <= (2 if fine else 0)


def test_other_things_still_cast_their_shadow_there(lit):
    """The ray begins beside the surface, not beyond what stands next to it."""
    ball(lit)
    open_light = irradiance(lit, 1, SIZE)
    lit.blocker((-5, -5), (5, 0.0), 1.6)
    found = irradiance(lit, 1, SIZE)
    shaded = np.zeros(SIZE, bool)
    shaded[:40] = True
    assert found[shaded & (open_light > 0)].max() < 1e-3 * open_light.max()


TURNS = (-170, -130, -100, -80, -60, 35, 80, 95, 110, 130, 160)  # degrees of the sun from above the card


@pytest.fixture
def card(stage):
    """What both engines show under a sun of a card whose normals all lean by `tilt` degrees, as those of leaves do that
    were taken from a ball around the crown."""
    kinds = {"ShaderNodeBsdfTranslucent": {}, "ShaderNodeBsdfDiffuse": {}, "ShaderNodeBsdfGlossy": {"Roughness": 0.6}}

    def show(kind, tilt, angle):
        stage.clear()
        stage.camera_above(0.5)
        material = stage.material(kind, **kinds[kind])
        made = stage.rectangle((-1, -1), (1, 1), material=material)
        lean = (np.sin(np.radians(tilt)), 0, np.cos(np.radians(tilt)))
        made.data.shade_smooth()
        made.data.normals_split_custom_set_from_vertices([lean] * len(made.data.vertices))
        stage.light("SUN", turn=(0, np.radians(angle), 0), angle=0.0, energy=np.pi)
        found = []
        for engine in ("CANDELA", "CYCLES"):
            passes = stage.render(4, (8, 8), engine=engine)
            light = passes["diffuse_direct"] + passes["glossy_direct"]
            found.append(float(np.median(light[..., 0])))
        return found

    return show


@pytest.mark.parametrize("tilt", [0, 30, 60])
@pytest.mark.parametrize("kind", ["Translucent", "Diffuse", "Glossy"])
def test_cards_whose_normals_lean_are_lit_by_what_their_normals_face(card, kind, tilt):
    found = np.array([card(f"ShaderNodeBsdf{kind}", tilt, angle) for angle in TURNS])
    assert found[:, 1].max() > 0.1
    np.testing.assert_allclose(found[:, 0], found[:, 1], atol=0.01 * found[:, 1].max())


@pytest.mark.parametrize("light", ["SUN", "AREA"])
def test_nothing_shines_into_a_closed_body_whose_normals_are_smooth(stage, light):
    stage.camera_above(span=2.4)
    made = ball(stage, 4, 2, turn=(0.3, 0.4, 0.2))
    stage.light(light, (6, 0, 2.4), turn=LOW_SUN)
    bright = irradiance(stage, 16, SIZE).mean()
    made.data.materials[0] = stage.material("ShaderNodeBsdfTranslucent")
    assert irradiance(stage, 16, SIZE).mean() < 1e-3 * bright


@pytest.mark.slow
@pytest.mark.parametrize("even", [True, False])
def test_light_of_the_world_ends_as_by_cycles(stage, even):
    """Cycles lifts rays that it draws from the world's own light, of which a single colour has none."""
    stage.camera_above(span=2.4)
    ball(stage, 4, 2, turn=(0.3, 0.4, 0.2))
    stage.world()
    if not even:
        tree = stage.scene.world.node_tree
        background = next(node for node in tree.nodes if node.type == "BACKGROUND")
        sky = tree.nodes.new("ShaderNodeTexSky")
        sky.sun_disc = False
        tree.links.new(sky.outputs[0], background.inputs["Color"])
    found = stage.render(64, SIZE)["diffuse_direct"]
    expected = stage.render(256, SIZE, engine="CYCLES")["diffuse_direct"]
    assert found.mean() == pytest.approx(expected.mean(), rel=0.005 if even else 0.01)


@pytest.mark.parametrize("shared", [False, True])
def test_normals_of_a_squashed_body_run_as_by_cycles(lit, shared):
    """In world space where one object alone shows a mesh, in the mesh's own where several do."""
    made = ball(lit, scale=(1.0, 0.4, 0.7))
    if shared:
        other = made.copy()
        other.location.x += 20
        lit.scene.collection.objects.link(other)
    assert off(irradiance(lit, 1, SIZE), by_cycles(lit)) < OUTLINE
