"""Node trees of lamps: gobos, light profiles, falloffs, for every kind of lamp, beside Cycles."""

import bpy
import numpy as np
import pytest

from addon.compare.metrics import relative_squared_error

from .conftest import agree

PROFILE = """IESNA:LM-63-1995
TILT=NONE
1 1000 1 7 3 1 1 0.1 0.1 0.1
1 1 100
0 15 30 45 60 75 90
0 45 90
1000 900 600 400 200 50 0
1000 800 500 700 100 20 0
1000 700 900 100 300 60 0
"""
ROUND = """IESNA91
TILT=NONE
1 -1 2 5 1 1 2 0 0 0
1 1 100
0 45 90 135 180
0
100 200 300 400 50
"""


def on_its_side(kind, angles, across):
    """A profile of type A (3) or B (2): 0 to 90 degrees, mirrored, or -90 to 90."""
    values = [[100 + 40 * k + 7 * (k * n % 5) * n for n in range(len(angles))] for k in range(len(across))]
    words = [" ".join(map(str, row)) for row in (angles, across, *values)]
    head = f"1 -1 3 {len(angles)} {len(across)} {kind} 2 0 0 0"
    return "\n".join(["IESNA91", "TILT=NONE", head, "1 1 100", *words]) + "\n"


QUARTER, HALF = (0, 30, 60, 90), (-90, -40, 0, 50, 90)


@pytest.fixture
def lamp(stage):
    """A function that makes a lamp above a floor, and gives its tree and a function that adds a node linked to it."""

    def make(kind, location=(0.4, -0.3, 1.5), turn=(0.4, 0.2, 0.7), scale=(1, 1, 1), **settings):
        stage.scene.render.filter_size = 1.5
        stage.floor()
        stage.camera_above()
        light = stage.light(kind, location, turn, scale, **settings).data
        if bpy.app.version < (5, 2):
            light.use_nodes = True
        tree = light.node_tree
        return tree, next(node for node in tree.nodes if node.type == "EMISSION")

    return make


def chain(tree, emission, socket, *nodes):
    """Nodes one behind the other, the last one into the emission: (type, output, input of the next, settings)."""
    before = None
    for kind, output, into, settings in nodes:
        made = tree.nodes.new(kind)
        for name, value in settings.items():
            if name in made.inputs:
                made.inputs[name].default_value = value
            else:
                setattr(made, name, value)
        if before is not None:
            tree.links.new(before, made.inputs[into])
        before = made.outputs[output]
    tree.links.new(before, emission.inputs[socket])


def same(own, cycles, most=0.01):
    own, cycles = own["combined"][..., :3], cycles["combined"][..., :3]
    assert cycles.max() > 0.01
    error = relative_squared_error(own, cycles).mean()
    assert error <= most, f"relMSE {error:.4f}"
    agree(own.mean((0, 1)), cycles.mean((0, 1)))


CHECKER = ("ShaderNodeTexChecker", "Color", "Vector", {"Scale": 6.0})
FEW = ("ShaderNodeTexChecker", "Color", "Vector", {"Scale": 2.0})


@pytest.mark.parametrize(("kind", "output", "pattern", "settings"), [
    ("POINT", "Normal", CHECKER, {"shadow_soft_size": 0.0}),
    ("POINT", "Normal", CHECKER, {"shadow_soft_size": 0.2}),
    ("POINT", "Normal", CHECKER, {"shadow_soft_size": 0.2, "use_soft_falloff": False}),
    ("POINT", "UV", CHECKER, {"shadow_soft_size": 0.05}),
    ("SPOT", "Normal", CHECKER, {"shadow_soft_size": 0.0, "spot_size": 1.2}),
    ("SPOT", "UV", CHECKER, {"shadow_soft_size": 0.02, "spot_size": 1.2, "spot_blend": 0.3}),
    ("SPOT", "Normal", CHECKER, {"shadow_soft_size": 0.02, "spot_size": 1.2, "scale": (1.6, 0.7, 1)}),
    ("SUN", "Normal", CHECKER, {"angle": 0.2}),
    ("SUN", "Generated", FEW, {"angle": 0.0}),
    ("AREA", "UV", FEW, {"size": 1.5, "location": (0, 0, 0.5), "turn": (0, 0, 0.3)}),
    ("AREA", "Generated", FEW, {"size": 1.5, "shape": "DISK", "location": (0, 0, 0.5), "turn": (0, 0, 0.3)}),
])  # fmt: skip
def test_gobo(lamp, beside, kind, output, pattern, settings):
    tree, emission = lamp(kind, **settings)
    chain(tree, emission, "Color", ("ShaderNodeTexCoord", output, "", {}), pattern)
    same(*beside(64, (48, 48), 0, 256))


def test_light_by_the_angle_at_which_it_leaves_an_area(lamp, beside):
    tree, emission = lamp("AREA", (0, 0, 0.8), (0, 0, 0), size=1.0)
    absolute = ("ShaderNodeVectorMath", "Vector", 0, {"operation": "ABSOLUTE"})
    chain(tree, emission, "Color", ("ShaderNodeNewGeometry", "Incoming", "", {}), absolute)
    same(*beside(32, (32, 32), 0, 128))


@pytest.mark.parametrize(("kind", "output", "smooth"), [
    ("POINT", "Quadratic", 1.0), ("POINT", "Linear", 0.0), ("POINT", "Constant", 0.0), ("SPOT", "Linear", 0.5),
    ("SUN", "Constant", 1.0), ("AREA", "Constant", 0.0),
])  # fmt: skip
def test_falloff(lamp, beside, kind, output, smooth):
    tree, emission = lamp(kind)
    chain(tree, emission, "Strength", ("ShaderNodeLightFalloff", output, "", {"Strength": 0.5, "Smooth": smooth}))
    same(*beside(16, (32, 32), 0, 64))


def test_a_lamp_without_falloff_takes_no_shadow_from_another(stage, lamp):
    """Its strength is measured a kilometre away, and stands beside no inverse square."""
    tree, emission = lamp("POINT", (1.5, 0.0, 4.0), shadow_soft_size=0.0, energy=10.0)
    chain(tree, emission, "Strength", ("ShaderNodeLightFalloff", "Constant", "", {"Strength": 1.0, "Smooth": 0.0}))
    constant = stage.scene.objects[-1]
    stage.light("POINT", (0, 0, 3), energy=1000, shadow_soft_size=0.0)
    stage.blocker((-0.5, -0.5), (0.5, 0.5), 2.0).visible_camera = False
    stage.scene.candela.accumulated_maps_by = "MAPS"
    both = stage.render(1)["combined"][14:18, 14:18, 0].mean()
    constant.hide_render = True
    assert stage.render(1)["combined"][14:18, 14:18, 0].max() < 1e-3
    assert both < 1.0


@pytest.mark.slow
def test_falloff_of_a_gobo_in_reflected_light(stage, lamp, beside):
    tree, emission = lamp("POINT", shadow_soft_size=0.1)
    chain(tree, emission, "Strength", ("ShaderNodeLightFalloff", "Linear", "", {"Strength": 0.5}))
    chain(tree, emission, "Color", ("ShaderNodeTexCoord", "Normal", "", {}), CHECKER)
    ceiling = stage.rectangle((-2, -2), (2, 2), 2.0, material=stage.diffuse(0.8))
    ceiling.visible_camera = False
    same(*beside(64, (48, 48), 3, 256))


@pytest.mark.parametrize("output", ["Ray Length", "Ray Depth"])
def test_light_path(lamp, beside, output):
    tree, emission = lamp("POINT")
    half = ("ShaderNodeMath", 0, 0, {"operation": "MULTIPLY"})
    chain(tree, emission, "Strength", ("ShaderNodeLightPath", output, "", {}), half)
    same(*beside(8, (16, 16), 0, 64))


@pytest.mark.parametrize("output", ["Is Camera Ray", "Is Shadow Ray", "Is Diffuse Ray", "Is Glossy Ray"])
def test_rays_to_lamps_are_of_no_kind(lamp, beside, output):
    tree, emission = lamp("POINT")
    chain(tree, emission, "Strength", ("ShaderNodeLightPath", output, "", {}))
    own, cycles = beside(2, (8, 8), 0, 4)
    assert not own["combined"][..., :3].any() and not cycles["combined"][..., :3].any()


@pytest.mark.parametrize(("kind", "text", "settings"), [
    ("POINT", PROFILE, {"shadow_soft_size": 0.0}), ("POINT", ROUND, {"shadow_soft_size": 0.1}),
    ("SPOT", PROFILE, {"spot_size": 2.5, "shadow_soft_size": 0.0}), ("AREA", PROFILE, {"size": 0.5}),
    ("POINT", "no profile", {}), ("POINT", "", {}),
])  # fmt: skip
@pytest.mark.parametrize("file", [False, True])
def test_light_profile(lamp, beside, tmp_path, kind, text, settings, file):
    tree, emission = lamp(kind, **settings)
    if file:
        path = tmp_path / "profile.ies"
        path.write_text(text)
        chosen = {"mode": "EXTERNAL", "filepath": str(path)}
    else:
        block = bpy.data.texts.new("profile")
        block.write(text)
        chosen = {"mode": "INTERNAL", "ies": block}
    chain(tree, emission, "Strength", ("ShaderNodeTexIES", 0, "", {**chosen, "Strength": 0.5}))
    same(*beside(16, (32, 32), 0, 64))


@pytest.mark.parametrize("kind", [2, 3], ids="BA")
@pytest.mark.parametrize(("angles", "across"), [(QUARTER, QUARTER), (HALF, HALF), (HALF, QUARTER[:3])])
def test_profiles_that_lie_on_their_side(lamp, beside, kind, angles, across):
    tree, emission = lamp("POINT", turn=(2.9, 0.3, 0.5), shadow_soft_size=0.0)  # half of these shine up only
    block = bpy.data.texts.new("profile")
    block.write(on_its_side(kind, angles, across))
    profile = ("ShaderNodeTexIES", 0, "", {"mode": "INTERNAL", "ies": block, "Strength": 0.03})
    chain(tree, emission, "Strength", profile)
    # Means, since light ends abruptly where the file's angles do.
    own, cycles = (one["combined"][..., 0].reshape(8, 4, 8, 4).mean((1, 3)) for one in beside(8, (32, 32), 0, 32))
    assert cycles.max() > 0.1
    agree(own, cycles)


@pytest.mark.slow
def test_a_lamp_that_is_seen_in_a_mirror_shows_its_tree(stage, beside):
    stage.camera_above()
    stage.rectangle((-2, -2), (2, 2), material=stage.material("ShaderNodeBsdfGlossy", Roughness=0.05))
    light = stage.light("AREA", (0, 0, 12), size=3.0, energy=300.0).data
    if bpy.app.version < (5, 2):
        light.use_nodes = True
    emission = next(node for node in light.node_tree.nodes if node.type == "EMISSION")
    chain(light.node_tree, emission, "Color", ("ShaderNodeTexCoord", "UV", "", {}), FEW)
    own, cycles = beside(32, (24, 24), 0, 256)
    agree(own["combined"][2:10, 2:10, :3].mean((0, 1)), cycles["combined"][2:10, 2:10, :3].mean((0, 1)), 0.06)
    same(own, cycles, 0.03)


def test_a_moved_lamp_and_a_new_image_are_seen(stage, lamp):
    tree, emission = lamp("POINT", shadow_soft_size=0.0)
    chain(tree, emission, "Color", ("ShaderNodeTexCoord", "Normal", "", {}), CHECKER)
    first = stage.render(2)["combined"]
    maps = stage.renderer.frame.lamp_maps
    changes = maps.changes
    assert np.array_equal(stage.render(2)["combined"], first) and maps.changes == changes
    stage.scene.objects["POINT"].rotation_euler.x += 0.3
    assert not np.array_equal(stage.render(2)["combined"], first)
    tree.nodes["Checker Texture"].inputs["Scale"].default_value = 3.0
    changes = maps.changes
    stage.render(2)
    assert maps.changes == changes + 1


def test_plain_lamps_have_no_maps(stage, lamp):
    tree, emission = lamp("POINT")
    emission.inputs["Color"].default_value = (1.0, 0.5, 0.2, 1.0)
    stage.render()
    maps = stage.renderer.frame.lamp_maps
    changes = maps.changes
    emission.inputs["Strength"].default_value = 2.0
    stage.render()
    assert maps.image is None and maps.changes == changes
    chain(tree, emission, "Color", ("ShaderNodeBlackbody", 0, "", {}), ("ShaderNodeGamma", 0, "Color", {"Gamma": 2.0}))
    stage.render()
    assert stage.renderer.frame.lamp_maps.image is None  # run once, and the same all around


@pytest.mark.slow
def test_a_lamps_influence_is_left_to_eevee(stage, beside):
    """Cycles has none of these factors, and neither has Candela."""
    stage.floor(material=stage.principled(Base_Color=(0.5, 0.5, 0.5, 1)))
    stage.camera_above()
    light = stage.light("AREA").data
    before = beside(1, (8, 8), 0, 1)
    for kind in ("diffuse", "specular", "transmission", "volume"):
        setattr(light, f"{kind}_factor", 0.0)
    for first, second in zip(before, beside(1, (8, 8), 0, 1)):
        assert first["combined"].any() and np.array_equal(first["combined"], second["combined"])
