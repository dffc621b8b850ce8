"""Closures against Cycles in a white furnace (albedo) and under single lights (shape), and coloured transparency."""

import itertools

import bpy
import numpy as np
import pytest

from addon.compare.passes import light_paths

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
    for r, m, t, c, s in itertools.product((0.1, 0.5, 1.0), (0.0, 0.6), (0.0, 0.7), (0.0, 1.0), (0.0, 1.0))
]


@pytest.mark.parametrize("degrees", [pytest.param(20, marks=SLOW), pytest.param(75, marks=SLOW)])
def test_principled_in_a_white_furnace_has_cycles_albedo(stage, degrees):
    size = strips(stage, [stage.principled(Base_Color=COLOR, **inputs) for inputs in SWEEP], degrees)
    ours = means(stage.render(64, size), "combined")
    cycles = means(stage.render(256, size, engine="CYCLES"), "combined")
    worst = np.abs(ours - cycles).max(axis=1) / cycles.max(axis=1)
    assert worst.max() < 0.01, SWEEP[int(worst.argmax())]
    assert ours.max() < 1.0


DISTRIBUTIONS = {
    "metal of one scattering": ("ShaderNodeBsdfMetallic", {"Base_Color": COLOR, "Roughness": 0.8}, "GGX"),
    "stretched gloss": ("ShaderNodeBsdfAnisotropic", {"Roughness": 0.7, "Anisotropy": 0.6}, "GGX"),
    "Beckmann": ("ShaderNodeBsdfAnisotropic", {"Roughness": 0.5}, "BECKMANN"),
    "stretched Beckmann": ("ShaderNodeBsdfAnisotropic", {"Roughness": 0.6, "Anisotropy": 0.6}, "BECKMANN"),
    "Beckmann metal": ("ShaderNodeBsdfMetallic", {"Base_Color": COLOR, "Roughness": 0.6}, "BECKMANN"),
    "Ashikhmin-Shirley": ("ShaderNodeBsdfAnisotropic", {"Roughness": 0.5}, "ASHIKHMIN_SHIRLEY"),
    "stretched Ashikhmin-Shirley": (
        "ShaderNodeBsdfAnisotropic", {"Roughness": 0.6, "Anisotropy": 0.6, "Rotation": 0.1}, "ASHIKHMIN_SHIRLEY",
    ),
}  # fmt: skip


def distributions(stage):
    """Name -> material of microfacets of a distribution that is not GGX with multiple scattering."""
    return {
        name: with_setting(stage.material(node, **inputs), distribution=distribution)
        for name, (node, inputs, distribution) in DISTRIBUTIONS.items()
    }


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
        "refraction": made("ShaderNodeBsdfRefraction", Color=COLOR, Roughness=0.4),
        "coloured transparency": made("ShaderNodeBsdfTransparent", Color=COLOR),
        **distributions(stage),
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


@pytest.mark.slow
@pytest.mark.parametrize("degrees", [pytest.param(20, marks=SLOW), 70])
def test_closures_in_a_white_furnace_have_cycles_albedo(stage, degrees):
    wanted = single_closures(stage)
    del wanted["glossy toon"]  # its narrow cone at the horizon takes thousands of directions; see the suns below
    # Under a world Cycles has up to a quarter more of it than the integral of the lobe that both have under suns.
    del wanted["stretched Ashikhmin-Shirley"]
    size = strips(stage, list(wanted.values()), degrees)
    ours, cycles = stage.render(256, size), stage.render(512, size, engine="CYCLES")
    found, expected = means(ours, "combined"), means(cycles, "combined")
    for name, a, b in zip(wanted, found, expected, strict=True):
        assert a == pytest.approx(b, abs=0.01 * b.max() + 1e-3), name
    # Cycles leaves out of the colour of glass what it scatters more than once. The colours of emission below layers are
    # means over few random layers; that of the conductor is its reflectance at this angle, ours a mean over the lobe.
    # In 4.5 and 5.0 its colour of rough glass is darker still at the horizon, at the same light.
    of_glass = 4e-2 if bpy.app.version > (5, 1) else 8e-2
    for color, tolerance in (("diffuse_color", 3e-3), ("glossy_color", 2.5e-2), ("transmission_color", of_glass)):
        for name, a, b in zip(wanted, means(ours, color), means(cycles, color), strict=True):
            if name not in ("emission below layers", "conductor"):
                assert a == pytest.approx(b, abs=tolerance), (name, color)


@pytest.mark.parametrize(
    "kind", ["sheen", "velvet", "translucent", "toon", "glossy toon", "tinted sheen", *DISTRIBUTIONS]
)
def test_lobes_reflect_a_sun_as_in_cycles(stage, kind):
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


def joined(stage, node_type, *closures, **settings):
    """A material whose Mix or Add Shader joins closures, each a node's type and inputs."""
    made = stage.material(closures[0][0])
    nodes, links = made.node_tree.nodes, made.node_tree.links
    nodes.clear()
    both, output = nodes.new(node_type), nodes.new("ShaderNodeOutputMaterial")
    sockets = [socket for socket in both.inputs if socket.type == "SHADER"]
    for socket, (kind, inputs) in zip(sockets, closures):
        shader = nodes.new(kind)
        for name, value in inputs.items():
            shader.inputs[name].default_value = value
        links.new(shader.outputs[0], socket)
    if "factor" in settings:
        both.inputs[0].default_value = settings["factor"]
    links.new(both.outputs[0], output.inputs["Surface"])
    return made


ROUGH = ("ShaderNodeBsdfDiffuse", {"Color": (0.95, 0.6, 0.2, 1.0), "Roughness": 1.0})
BLACK = ("ShaderNodeBsdfDiffuse", {"Color": (0.0, 0.0, 0.0, 1.0)})


@pytest.mark.slow
def test_the_weight_of_a_rough_diffuse_closure_is_no_colour(stage):
    """Light that is scattered several times takes on the closure's colour, not that of the whole mix."""
    materials = [
        joined(stage, "ShaderNodeMixShader", BLACK, ROUGH, factor=0.1),
        joined(stage, "ShaderNodeMixShader", BLACK, ROUGH, factor=0.5),
        joined(stage, "ShaderNodeAddShader", ROUGH, ROUGH),
        stage.principled(Base_Color=ROUGH[1]["Color"], Diffuse_Roughness=1.0, Metallic=0.7, Roughness=0.5),
        stage.principled(Base_Color=ROUGH[1]["Color"], Diffuse_Roughness=1.0, Coat_Weight=1.0, Roughness=0.5),
    ]
    size = strips(stage, materials, 60)
    ours = means(stage.render(64, size), "diffuse_direct")
    cycles = means(stage.render(1024, size, engine="CYCLES"), "diffuse_direct")
    np.testing.assert_allclose(ours, cycles, rtol=0.012)


@pytest.mark.parametrize("turn", [(0, 0.2, 0), (0, 1.2, 0), (1.0, 0, 0)])
def test_diffuse_closures_that_differ_keep_their_normals_and_roughness(stage, turn):
    plain = ("ShaderNodeBsdfDiffuse", {"Color": (0.2, 0.9, 0.4, 1.0)})
    material = joined(stage, "ShaderNodeAddShader", ROUGH, plain)
    bumped = next(node for node in material.node_tree.nodes if node.inputs.get("Roughness") and node.outputs)
    normal = material.node_tree.nodes.new("ShaderNodeCombineXYZ")
    normal.inputs[0].default_value, normal.inputs[2].default_value = -0.6, 0.8
    material.node_tree.links.new(normal.outputs[0], bumped.inputs["Normal"])
    stage.floor(material=material)
    stage.light("SUN", turn=turn, angle=0.0)
    stage.camera_above(4.0)
    ours = stage.render(64, (8, 8))["diffuse_direct"][..., :3].mean(axis=(0, 1))
    cycles = stage.render(64, (8, 8), engine="CYCLES")["diffuse_direct"][..., :3].mean(axis=(0, 1))
    np.testing.assert_allclose(ours, cycles, rtol=0.01)


@pytest.mark.slow
def test_a_closure_of_little_weight_is_not_left_to_chance(stage):
    """One lobe is kept a sample: a faint one often enough for its own pass."""
    faint = ("ShaderNodeBsdfGlossy", {"Roughness": 0.6})
    strong = ("ShaderNodeBsdfTranslucent", {})
    size = strips(stage, [joined(stage, "ShaderNodeMixShader", strong, faint, factor=0.003)], 30)
    pixels = stage.render(64, size)["glossy_direct"][..., 0].astype(float)
    assert pixels.std() < 0.5 * pixels.mean()


@pytest.mark.slow
@pytest.mark.parametrize("degrees", [20, 70])
def test_thin_walls_have_cycles_albedo(stage, degrees):
    inputs = [
        {"Transmission_Weight": 1.0, "Roughness": 0.0}, {"Transmission_Weight": 1.0, "Roughness": 0.4},
        {"Transmission_Weight": 1.0, "IOR": 2.0, "Roughness": 0.2}, {"Transmission_Weight": 0.5},
        {"Subsurface_Weight": 0.6}, {"Subsurface_Weight": 1.0, "Subsurface_Anisotropy": 0.5},
    ]  # fmt: skip
    try:
        materials = [stage.principled(Base_Color=COLOR, Thin_Wall=True, **given) for given in inputs]
    except KeyError:
        pytest.skip("this Blender's Principled has no thin wall")
    size = strips(stage, materials, degrees)
    ours = means(stage.render(128, size), "combined")
    cycles = means(stage.render(512, size, engine="CYCLES"), "combined")
    for given, a, b in zip(inputs, ours, cycles, strict=True):
        assert a == pytest.approx(b, abs=0.01 * b.max()), given


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


def smooth_sphere(stage, material, **placement):
    import bmesh
    import bpy

    data, shape = bpy.data.meshes.new("Sphere"), bmesh.new()
    bmesh.ops.create_uvsphere(shape, u_segments=48, v_segments=24, radius=1.0)
    for face in shape.faces:
        face.smooth = True
    shape.to_mesh(data)
    shape.free()
    data.materials.append(material)
    return stage.link("Sphere", data, **placement)


def relative_error(found, expected):
    """relMSE and ratio of means, as addon/compare/metrics.py has them."""
    from addon.compare.metrics import compare_radiance

    error = compare_radiance("", found, expected, np.zeros_like(expected))
    return error.relmse, error.bias


@pytest.mark.slow
def test_anisotropy_without_a_tangent_node_runs_around_the_objects_own_axis(stage):
    metal = {"Base_Color": COLOR, "Metallic": 1.0, "Roughness": 0.4}
    principled = stage.principled(**metal, Anisotropic=0.8, Anisotropic_Rotation=0.1)
    glossy = stage.material("ShaderNodeBsdfGlossy", Color=COLOR, Roughness=0.4, Anisotropy=0.6, Rotation=0.2)
    smooth_sphere(stage, principled, turn=(0.5, 0.3, 0.2))
    smooth_sphere(stage, glossy, location=(2.2, 0, 0), turn=(1.0, 0.3, 0.2))
    stage.light("AREA", (1, -3, 4), turn=(0.6, 0, 0), energy=300, size=1.0)
    stage.camera((1.1, -6, 1), (1.4, 0, 0), 0.6)
    ours, cycles = stage.render(32, (64, 48)), stage.render(256, (64, 48), engine="CYCLES")
    error, bias = relative_error(ours["combined"][..., :3], cycles["combined"][..., :3])
    assert error < 1e-3
    assert bias == pytest.approx(1.0, abs=5e-3)


LIT_SWEEP = [
    {"Roughness": 0.15}, {"Roughness": 0.5}, {"Roughness": 1.0}, {"Roughness": 0.5, "Diffuse_Roughness": 1.0},
    {"Metallic": 1.0, "Roughness": 0.15}, {"Metallic": 1.0, "Roughness": 0.4}, {"Metallic": 1.0, "Roughness": 0.8},
    {"Metallic": 0.5, "Roughness": 0.4},
    {"Metallic": 1.0, "Roughness": 0.4, "Specular_Tint": (0.2, 0.5, 0.9, 1.0)},
    {"Metallic": 1.0, "Roughness": 0.4, "Anisotropic": 0.8}, {"Roughness": 0.4, "Specular_Tint": (0.2, 0.5, 0.9, 1.0)},
    {"Roughness": 0.4, "IOR": 2.0},
    {"Roughness": 0.6, "Coat_Weight": 1.0, "Coat_Roughness": 0.2},
    {"Roughness": 0.6, "Coat_Weight": 0.7, "Coat_Roughness": 0.3, "Coat_Tint": (0.2, 0.5, 0.9, 1.0)},
    {"Metallic": 1.0, "Roughness": 0.5, "Coat_Weight": 1.0, "Coat_Roughness": 0.2},
    {"Roughness": 0.6, "Specular_IOR_Level": 1.0},
    {"Sheen_Weight": 1.0, "Sheen_Roughness": 0.3}, {"Sheen_Weight": 1.0, "Sheen_Roughness": 0.7},
    {"Sheen_Weight": 0.7, "Sheen_Tint": (0.2, 0.5, 0.9, 1.0), "Coat_Weight": 0.5, "Coat_Roughness": 0.3},
    {"Metallic": 1.0, "Sheen_Weight": 0.5, "Roughness": 0.5},
]  # fmt: skip
# What glass mirrors is one of two lobes, kept in a quarter of the samples or less, so that more of them are drawn.
LIT_GLASS = [
    {"Transmission_Weight": 1.0, "Roughness": 0.3}, {"Transmission_Weight": 1.0, "Roughness": 0.7, "IOR": 2.0},
    {"Transmission_Weight": 0.5, "Roughness": 0.4}, {"Transmission_Weight": 0.7, "Metallic": 0.5, "Roughness": 0.5},
    {"Transmission_Weight": 1.0, "Roughness": 0.5, "Specular_Tint": (0.2, 0.5, 0.9, 1.0)},
]  # fmt: skip
COLUMNS, CELL = 5, 16  # spheres in a row, pixels of each


@pytest.mark.slow
@pytest.mark.parametrize(
    ("light", "sweep"), [("area", LIT_SWEEP), ("world", LIT_SWEEP), ("area", LIT_GLASS)], ids=["area", "world", "glass"]
)
def test_a_sweep_of_principled_is_lit_as_in_cycles(stage, light, sweep):
    rows = len(sweep) // COLUMNS
    for k, inputs in enumerate(sweep):
        place = (2.2 * (k % COLUMNS - (COLUMNS - 1) / 2), 2.2 * (k // COLUMNS - (rows - 1) / 2), 0.0)
        smooth_sphere(stage, stage.principled(Base_Color=COLOR, **inputs), location=place)
    stage.camera_above(2.2 * COLUMNS)
    if light == "area":
        stage.light("AREA", (3, -3, 5), turn=(0.55, 0.5, 0), energy=1500, size=3.0)
    else:
        studio(stage)
    size = (CELL * COLUMNS, CELL * rows)
    samples = 256 if sweep is LIT_GLASS else 128
    stage.scene.candela.light_probes_maps = 4.0  # there is no shadow to be soft: a few maps in each sample are enough
    ours, cycles = stage.render(samples, size), stage.render(1024, size, engine="CYCLES")
    found, expected = (
        light_paths(images)["direct_light"] - images["environment"][..., :3] for images in (ours, cycles)
    )
    errors = {}
    for k, inputs in enumerate(sweep):
        cell = np.s_[CELL * (k // COLUMNS) : CELL * (k // COLUMNS + 1), CELL * (k % COLUMNS) : CELL * (k % COLUMNS + 1)]
        errors[str(inputs)] = relative_error(found[cell], expected[cell])
    for name, (error, bias) in errors.items():
        assert error <= 0.005, name
        # 128 directions of a world leave 0.8 % (0.1 % at 2048); rough diffuse below a layer is 0.6 % too dark.
        assert bias == pytest.approx(1.0, abs=0.015 if light == "world" else 0.01), name


def studio(stage):
    """A world with a dim sky, a soft box and a small bright lamp, as in an HDRI of a studio."""
    import bpy

    world = stage.world()
    height, width = 64, 128
    v, u = np.mgrid[0:height, 0:width]
    radiance = np.full((height, width, 4), 0.3)
    radiance[..., 2] += 0.2 * v / height
    radiance[(v > 40) & (v < 54) & (u > 20) & (u < 45), :3] = 4.0
    radiance[(v > 46) & (v < 50) & (u > 90) & (u < 94), :3] = (60.0, 50.0, 40.0)
    radiance[..., 3] = 1.0
    image = bpy.data.images.new("Studio", width, height, float_buffer=True)
    image.pixels.foreach_set(radiance.astype(np.float32).ravel())
    image.pack()
    texture = world.node_tree.nodes.new("ShaderNodeTexEnvironment")
    texture.image = image
    background = next(node for node in world.node_tree.nodes if node.type == "BACKGROUND")
    world.node_tree.links.new(texture.outputs["Color"], background.inputs["Color"])


def test_holdout_cuts_a_hole_as_in_cycles(stage):
    """Whole, half of a mix, and not at all."""
    stage.scene.render.film_transparent = True
    hole = stage.material("ShaderNodeHoldout")
    half = stage.material("ShaderNodeMixShader")
    nodes, links = half.node_tree.nodes, half.node_tree.links
    mix = next(node for node in nodes if node.type == "MIX_SHADER")
    links.new(nodes.new("ShaderNodeHoldout").outputs[0], mix.inputs[1])
    links.new(nodes.new("ShaderNodeBsdfDiffuse").outputs[0], mix.inputs[2])
    size = strips(stage, [material for material in (hole, half, stage.diffuse(0.5)) for _ in range(3)], 0)
    ours, cycles = (stage.render(64, size, engine=engine)["combined"] for engine in ("CANDELA", "CYCLES"))
    a, b = (pixels.reshape(ROWS, -1, PIXELS, 4).mean(axis=(0, 2)) for pixels in (ours, cycles))
    assert a == pytest.approx(b, abs=0.01)
    assert a[1::3, 3] == pytest.approx([0.0, 0.5, 1.0], abs=0.01)


@pytest.mark.slow
def test_the_coat_has_a_normal_of_its_own(stage):
    """The coat mirrors a sun where the surface below, tilted the other way, does not."""
    material = stage.principled(Base_Color=(0.02, 0.02, 0.02, 1.0), Roughness=0.3, Coat_Weight=1.0, Coat_Roughness=0.2)
    nodes, links = material.node_tree.nodes, material.node_tree.links
    shader = next(node for node in nodes if node.type == "BSDF_PRINCIPLED")
    for name, x in (("Coat Normal", 0.3), ("Normal", -0.3)):
        normal = nodes.new("ShaderNodeCombineXYZ")
        normal.inputs[0].default_value, normal.inputs[2].default_value = x, 1.0
        links.new(normal.outputs[0], shader.inputs[name])
    stage.floor(material=material)
    stage.camera_above(4.0)
    for turn in ((0, 0.58, 0), (0, -0.58, 0), (0.2, 0.3, 0)):
        sun = stage.light("SUN", turn=turn, angle=0.1)
        ours = stage.render(32, (4, 4))["combined"][..., :3].mean(axis=(0, 1))
        cycles = stage.render(256, (4, 4), engine="CYCLES")["combined"][..., :3].mean(axis=(0, 1))
        assert ours == pytest.approx(cycles, rel=0.01, abs=1e-4), turn
        stage.scene.collection.objects.unlink(sun)
