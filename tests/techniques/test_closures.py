"""Closures against Cycles in a white furnace (albedo) and under single lights (shape), and coloured transparency."""

import itertools

import numpy as np
import pytest

COLOR = (0.8, 0.5, 0.3, 1.0)
PIXELS, ROWS = 3, 24  # of each strip
SLOW = pytest.mark.slow


def strips(stage, materials, degrees):
    """Strips of all materials in one plane under a white world, seen `degrees` from the normal; the picture's size."""
    width = 4.0 / len(materials)
    for k, material in enumerate(materials):
        stage.rectangle((-2 + k * width, -99), (-2 + (k + 1) * width, 99), material=material)
    stage.world()
    tilt = np.radians(degrees)
    camera = stage.camera_above(4.0)
    camera.location, camera.rotation_euler = (0, -20 * np.sin(tilt), 20 * np.cos(tilt)), (tilt, 0, 0)
    camera.data.clip_end = 1000
    return PIXELS * len(materials), ROWS


def means(images, name):
    """(strips, 3): the mean of each strip."""
    pixels = images[name][..., :3].astype(float)
    return pixels.reshape(ROWS, -1, PIXELS, 3).mean(axis=(0, 2))


def with_setting(material, **settings):
    """The same material with settings of its shader node."""
    shader = next(node for node in material.node_tree.nodes if "Output" not in node.bl_idname)
    for name, value in settings.items():
        setattr(shader, name, value)
    return material


SWEEP = [
    {"Roughness": r, "Metallic": m, "Transmission_Weight": t, "Coat_Weight": c, "Sheen_Weight": s}
    for r, m, t, c, s in itertools.product((0.1, 0.5, 1.0), (0.0, 0.5, 1.0), (0.0, 0.5, 1.0), (0.0, 1.0), (0.0, 1.0))
]


@pytest.mark.parametrize("degrees", [pytest.param(20, marks=SLOW), pytest.param(75, marks=SLOW)])
def test_principled_in_a_white_furnace_has_cycles_albedo(stage, degrees):
    size = strips(stage, [stage.principled(Base_Color=COLOR, **inputs) for inputs in SWEEP], degrees)
    ours = means(stage.render(64, size), "combined")
    cycles = means(stage.render(256, size, engine="CYCLES"), "combined")
    worst = np.abs(ours - cycles).max(axis=1) / cycles.max(axis=1)
    assert worst.max() < 0.01, SWEEP[int(worst.argmax())]
    assert ours.max() < 1.0


def single_closures(stage):
    """Name -> material with one closure, or with a layer that no other test looks at."""
    made = stage.material
    sheen = {"Sheen_Weight": 0.7, "Sheen_Roughness": 0.6, "Sheen_Tint": (0.2, 0.5, 0.9, 1.0)}
    coat = {"Coat_Weight": 0.7, "Coat_Roughness": 0.2, "Coat_Tint": (0.2, 0.5, 0.9, 1.0)}
    return {
        "sheen": made("ShaderNodeBsdfSheen", Color=COLOR, Roughness=0.5),
        "velvet": with_setting(made("ShaderNodeBsdfSheen", Color=COLOR, Roughness=0.8), distribution="ASHIKHMIN"),
        "translucent": made("ShaderNodeBsdfTranslucent", Color=COLOR),
        "toon": made("ShaderNodeBsdfToon", Color=COLOR, Size=0.6, Smooth=0.3),
        "glossy toon": with_setting(made("ShaderNodeBsdfToon", Color=COLOR, Size=0.3, Smooth=0.1), component="GLOSSY"),
        "glass": made("ShaderNodeBsdfGlass", Color=COLOR, Roughness=0.6),
        "clear glass": made("ShaderNodeBsdfGlass", Color=COLOR, Roughness=0.0),
        "glass of one scattering": with_setting(
            made("ShaderNodeBsdfGlass", Color=COLOR, Roughness=0.5), distribution="GGX"
        ),
        "coloured transparency": made("ShaderNodeBsdfTransparent", Color=COLOR),
        "conductor": with_setting(made("ShaderNodeBsdfMetallic", Roughness=0.3), fresnel_type="PHYSICAL_CONDUCTOR"),
        "edge tint": made("ShaderNodeBsdfMetallic", Base_Color=COLOR, Edge_Tint=(0.5, 0.6, 0.7, 1.0), Roughness=0.4),
        "tinted sheen": stage.principled(Base_Color=COLOR, **sheen),
        "tinted coat": stage.principled(Base_Color=COLOR, **coat),
        "all layers": stage.principled(Base_Color=COLOR, **sheen, **coat, Transmission_Weight=0.3, Metallic=0.3),
        "specular tint": stage.principled(Base_Color=COLOR, Specular_Tint=(0.2, 0.5, 0.9, 1.0)),
        "tinted glass": stage.principled(
            Base_Color=COLOR, Specular_Tint=(0.2, 0.5, 0.9, 1.0), Transmission_Weight=1.0, Roughness=0.3
        ),
        "emission below layers": stage.principled(
            Base_Color=COLOR, Emission_Color=(0.1, 0.2, 0.3, 1.0), Emission_Strength=2.0, Alpha=0.5, **sheen, **coat
        ),
    }


@pytest.mark.parametrize("degrees", [pytest.param(20, marks=SLOW), 70])
def test_closures_in_a_white_furnace_have_cycles_albedo(stage, degrees):
    wanted = single_closures(stage)
    del wanted["glossy toon"]  # its narrow cone at the horizon takes thousands of directions; see the suns below
    size = strips(stage, list(wanted.values()), degrees)
    ours, cycles = stage.render(256, size), stage.render(512, size, engine="CYCLES")
    found, expected = means(ours, "combined"), means(cycles, "combined")
    for name, a, b in zip(wanted, found, expected, strict=True):
        assert a == pytest.approx(b, abs=0.01 * b.max() + 1e-3), name
    # Cycles leaves out of the colour of glass what it scatters more than once. The colours of emission below layers are
    # means over few random layers; that of the conductor is its reflectance at this angle, ours a mean over the lobe.
    for color, tolerance in (("diffuse_color", 3e-3), ("glossy_color", 2.5e-2)):
        for name, a, b in zip(wanted, means(ours, color), means(cycles, color), strict=True):
            if name not in ("emission below layers", "conductor"):
                assert a == pytest.approx(b, abs=tolerance), (name, color)


@pytest.mark.parametrize("kind", ["sheen", "velvet", "translucent", "toon", "glossy toon", "tinted sheen"])
def test_soft_lobes_reflect_a_sun_as_in_cycles(stage, kind):
    """The value of f cos itself, for one direction to the viewer and several to the sun."""
    stage.rectangle((-99, -99), (99, 99), material=single_closures(stage)[kind])
    camera = stage.camera_above(4.0)
    camera.location, camera.rotation_euler = (0, -20 * np.sin(0.9), 20 * np.cos(0.9)), (0.9, 0, 0)
    for turn in ((0.2, 0.1, 0.0), (1.2, 0.0, 2.0), (-1.0, 0.3, 0.5), (2.5, 0.3, 0.0)):
        sun = stage.light("SUN", turn=turn, angle=0.0)
        ours = stage.render(16, (4, 4))["combined"][..., :3].mean(axis=(0, 1))
        cycles = stage.render(16, (4, 4), engine="CYCLES")["combined"][..., :3].mean(axis=(0, 1))
        assert ours == pytest.approx(cycles, rel=0.01, abs=1e-4), turn
        stage.scene.collection.objects.unlink(sun)


def test_a_translucent_sheet_shows_the_light_of_its_other_side(stage):
    stage.floor(material=stage.material("ShaderNodeBsdfTranslucent", Color=(1, 1, 1, 1)))
    stage.camera_above(4.0)
    stage.light("SUN", turn=(np.pi, 0, 0), angle=0.0)  # shines up
    below = stage.render(4)["combined"][..., :3]
    np.testing.assert_allclose(below, 1.0 / np.pi, rtol=1e-4)
    stage.blocker((-9, -9), (0, 9), -1.0)
    half = stage.render(4)["combined"][..., 0]
    np.testing.assert_allclose(half[:, :15], 0.0, atol=1e-6)
    np.testing.assert_allclose(half[:, 17:], 1.0 / np.pi, rtol=1e-4)


def test_coloured_layers_multiply_what_lies_behind_them(stage):
    """Two filters over a white floor under a sun, half of the picture behind one of them, all behind the other."""
    first, second = (0.9, 0.5, 0.1), (0.3, 0.6, 1.0)
    stage.floor()
    stage.light("SUN", energy=np.pi, angle=0.0)
    layers = [((-9, -9), (0, 9), 1.0, first), ((-9, -9), (9, 9), 2.0, second)]
    for low, high, z, color in layers:
        material = stage.material("ShaderNodeBsdfTransparent", Color=(*color, 1.0))
        stage.rectangle(low, high, z, material=material).visible_shadow = False
    stage.camera_above(4.0)
    found = stage.render(64)["combined"][..., :3]
    for columns, expected in ((slice(18, None), second), (slice(None, 14), np.multiply(first, second))):
        shown = found[:, columns].mean(axis=(0, 1))
        assert shown == pytest.approx(expected, rel=0.03)  # how many samples pass is random,
        assert shown / shown[0] == pytest.approx(np.divide(expected, expected[0]), rel=1e-5)  # their colour is not
