"""Light that is reflected by surfaces below a coloured pane has the pane's colour."""

from types import SimpleNamespace

import numpy as np
import pytest

from addon.scene import acceleration
from addon.scene.traced_triangles import RECORD, absorption_records
from tests.techniques.foggy_stage import box, fill, volume

COLOR = (0.9, 0.3, 0.1)


def room(stage, color, panes=1):
    """A floor and a wall below panes that all of a lamp's light passes."""
    stage.clear()
    stage.camera((0, -2.2, 0.9), (1.2, 0, 0), angle=1.0)
    stage.floor(1.5, material=stage.diffuse(0.7))
    stage.rectangle((-1.5, 0), (1.5, 0.9), material=stage.diffuse(0.7), location=(0, 1.0, 0), turn=(np.pi / 2, 0, 0))
    for k in range(panes):
        glass = stage.material("ShaderNodeBsdfTransparent", Color=(*color, 1))
        stage.rectangle((-9, -9), (9, 9), 1.0 + 0.1 * k, material=glass)
    stage.light("POINT", (0.2, 0, 2.0), energy=200.0, shadow_soft_size=0.1)


def indirect(stage, samples):
    """Mean of eight samples at least."""
    seeds = range(-(-8 // samples))
    found = [stage.render(samples, size=(24, 20), bounces=2, seed=seed)["diffuse_indirect"] for seed in seeds]
    return np.mean(found, axis=0)[..., :3].mean((0, 1))


# One sample takes another technique; light that comes back through a pane has its colour twice, which is in neither.
@pytest.mark.parametrize(("samples", "panes"), [(1, 1), (8, 1), (8, 2)])
def test_bounced_light_has_the_colours_of_the_panes_that_it_passed(stage, samples, panes):
    room(stage, (1, 1, 1), panes)
    clear = indirect(stage, samples)
    room(stage, COLOR, panes)
    assert indirect(stage, samples) / clear == pytest.approx(np.array(COLOR) ** panes, rel=0.06)


def below_a_pane(stage, color, material):
    """Fog and a surface below a pane that all of a sun's light passes, seen from below it."""
    stage.clear()
    stage.camera((0, -2.5, 1.0), (1.1, 0, 0), angle=1.0)
    stage.floor(1.5, material=material(stage))
    glass = stage.material("ShaderNodeBsdfTransparent", Color=(*color, 1))
    stage.rectangle((-9, -9), (9, 9), 2.2, material=glass)
    stage.light("SUN", (0, 0, 4), (-1.1, 0, 0), energy=3.0, angle=0.3)


def mist(stage):
    box(stage, volume(stage, Color=(1, 1, 1, 1), Density=0.5), (-1, -1, 0.1), (1, 1, 1))


def of_pass(stage, name, samples, **options):
    return stage.render(samples, size=(24, 20), **options)[name][..., :3].mean((0, 1))


@pytest.mark.parametrize("samples", [1, 8])
def test_fog_below_a_pane_has_its_colour(stage, samples):
    """Light that is scattered once, and what surfaces scatter on into the fog."""
    found = []
    for color in ((1, 1, 1), COLOR):
        below_a_pane(stage, color, lambda stage: stage.diffuse(0.7))
        mist(stage)
        passes = stage.render(samples, size=(24, 20), bounces=2)
        found.append([passes[name][..., :3].mean((0, 1)) for name in ("volume_direct", "volume_indirect")])
    (straight, further), (coloured, coloured_further) = found
    assert straight.min() > 1e-3 and further.min() > 1e-4
    assert coloured / straight == pytest.approx(
        np.array(COLOR), rel=0.03 if samples > 1 else 0.1
    )  # it passes by chance
    assert coloured_further / further == pytest.approx(np.array(COLOR), rel=0.1)


@pytest.mark.parametrize("roughness", [0.0, 0.4])
def test_gloss_below_a_pane_shows_a_lamp_in_its_colour(stage, roughness):
    found = []
    for color in ((1, 1, 1), COLOR):
        below_a_pane(stage, color, lambda stage: stage.principled(Metallic=1.0, Roughness=roughness))
        found.append(of_pass(stage, "glossy_direct", 8))
    clear, coloured = found
    assert clear.min() > 1e-3
    assert coloured / clear == pytest.approx(np.array(COLOR), rel=0.03)


def test_glass_below_a_pane_shows_a_lamp_in_its_colour(stage):
    """A sheet of glass before the lamp, which is seen through it and through the pane."""
    found = []
    for color in ((1, 1, 1), COLOR):
        stage.clear()
        stage.camera((0, 0, 0), (np.pi, 0, 0), angle=0.8)
        stage.rectangle((-9, -9), (9, 9), 1.0, material=stage.material("ShaderNodeBsdfGlass", Roughness=0.2, IOR=1.3))
        stage.rectangle((-9, -9), (9, 9), 2.0, material=stage.material("ShaderNodeBsdfTransparent", Color=(*color, 1)))
        stage.light("SUN", (0, 0, 4), (0, 0, 0), energy=3.0, angle=0.3)
        passes = stage.render(32, size=(24, 20), bounces=2)
        found.append(sum(passes[f"transmission_{part}"][..., :3].mean((0, 1)) for part in ("direct", "indirect")))
    clear, coloured = found
    assert clear.min() > 1e-3
    assert coloured / clear == pytest.approx(np.array(COLOR), rel=0.03)


@pytest.mark.parametrize("samples", [1, 2])
@pytest.mark.parametrize("node", ["ShaderNodeVolumeScatter", "ShaderNodeEmission"])
def test_a_pane_colours_fog_up_to_its_rim_and_no_further(stage, samples, node):
    """Pictures of few samples find light of fog at a quarter of the pixels: those on the other side of a rim count
    without its colour. The pane is so wide that pixels beside the rim see nothing but it, or nothing of it."""
    found = []
    for color in ((1, 1, 1), COLOR):
        stage.clear()
        stage.camera((0, -2.5, 0.5), (np.pi / 2, 0, 0), angle=0.6)
        pane = stage.material("ShaderNodeBsdfTransparent", Color=(*color, 1))
        stage.rectangle((0, -9), (9, 9), material=pane, location=(0, -1.5, 0), turn=(np.pi / 2, 0, 0))
        stage.light("SUN", (0, 0, 4), (0, 0, 0), energy=3.0, angle=0.0)
        box(stage, volume(stage, node, Color=(1, 1, 1, 1)), (-1, -1, 0), (1, 1, 1))
        passes = stage.render(samples, size=(24, 20), bounces=1)
        found.append(passes["volume_direct" if "Scatter" in node else "emission"][4:16, :, :3])
    share = found[1].mean(0) / found[0].mean(0)
    assert share[8:12] == pytest.approx(np.ones((4, 3)), abs=0.02)
    assert share[12:16] == pytest.approx(np.tile(COLOR, (4, 1)), abs=0.02)


@pytest.mark.parametrize("samples", [1, 8])
@pytest.mark.parametrize("panes", [1, 2])
def test_fog_behind_a_pane_has_its_colour(stage, samples, panes):
    """And what stands before it has not."""
    found = []
    for color in ((1, 1, 1), COLOR):
        stage.clear()
        stage.camera((0, -2.5, 0.5), (np.pi / 2, 0, 0), angle=0.6)
        stage.floor(1.5, material=stage.diffuse(0.7))
        for k in range(panes):
            pane = stage.material("ShaderNodeBsdfTransparent", Color=(*color, 1))
            stage.rectangle((0, -9), (9, 9), material=pane, location=(0, -1.5 + 0.1 * k, 0), turn=(np.pi / 2, 0, 0))
        stage.light("SUN", (0, 0, 4), (0, 0, 0), energy=3.0, angle=0.0)
        mist(stage)
        passes = stage.render(samples, size=(24, 20), bounces=2)
        found.append(np.array([passes[f"volume_{name}"][..., :3] for name in ("direct", "indirect")]))
    # Filters of few samples bring a few thousandths of what is beside the panes this far.
    clear, coloured = (np.array([one[:, :, :6].mean((1, 2)), one[:, :, 18:].mean((1, 2))]) for one in found)
    assert clear.min() > 1e-4
    assert coloured[0] == pytest.approx(clear[0], rel=0.05)
    for order, bound in ((0, 0.02), (1, 0.15)):
        share = coloured[1, order] / clear[1, order]
        assert share == pytest.approx(np.array(COLOR) ** panes, rel=bound, abs=0.005)


BANDS = np.array([(1.0, 0.05, 0.1), (0.05, 0.8, 1.0)])


def banded(stage, kind="ShaderNodeBsdfTransparent", socket="Color", width=1.0, **inputs):
    """A material whose colour is that of BANDS by turns along x."""
    made = stage.material(kind, **inputs)
    nodes, links = made.node_tree.nodes, made.node_tree.links
    place, axes, way, above, mix = (
        nodes.new(f"ShaderNode{name}") for name in ("NewGeometry", "SeparateXYZ", "Math", "Math", "Mix")
    )
    links.new(place.outputs["Position"], axes.inputs[0])
    way.operation, way.inputs[1].default_value = "PINGPONG", width
    above.operation, above.inputs[1].default_value = "GREATER_THAN", 0.5 * width
    mix.data_type = "RGBA"
    links.new(axes.outputs["X"], way.inputs[0])
    links.new(way.outputs[0], above.inputs[0])
    links.new(above.outputs[0], mix.inputs[0])
    for value, side in zip(BANDS, (6, 7)):
        mix.inputs[side].default_value = (*value, 1)
    links.new(mix.outputs[2], nodes[0].inputs[socket])
    return made


def painted(stage):
    """A material that takes its colour from an attribute of the mesh."""
    made = stage.material("ShaderNodeBsdfTransparent")
    node = made.node_tree.nodes.new("ShaderNodeAttribute")
    node.attribute_name = "Paint"
    made.node_tree.links.new(node.outputs["Color"], made.node_tree.nodes[0].inputs["Color"])
    return made


def below_a_lit_ceiling(stage, pane=None, thick=0.005):
    """A floor that has the light of a white ceiling by way of a wide pane of what `pane` makes (one box; or, of painted
    ones, one of either colour of BANDS beside the other), and no other."""
    stage.clear()
    stage.floor(material=stage.diffuse(0.8))
    made = pane and pane(stage)
    if pane is painted:
        for k in range(-18, 18):
            part = box(stage, made, (0.5 * k, -9, 1.0), (0.5 * k + 0.5, 9, 1.0 + thick))
            paint = part.data.color_attributes.new("Paint", "FLOAT_COLOR", "CORNER")
            paint.data.foreach_set("color", np.tile((*BANDS[k % 2], 1), len(paint.data)))
            part.visible_camera = False
    elif made:
        box(stage, made, (-9, -9, 1.0), (9, 9, 1.0 + thick)).visible_camera = False
    stage.rectangle((-9, -9), (9, 9), 3.0, material=stage.diffuse(0.8)).visible_camera = False
    stage.light("AREA", (0, 0, 1.6), turn=(np.pi, 0, 0), size=18.0, energy=1000.0).visible_camera = False
    stage.camera_above(2.0)
    stage.scene.candela.slot_caustics = "OFF"


PATTERNS = {
    "transparent": banded,
    "glass": lambda stage: banded(stage, "ShaderNodeBsdfGlass", IOR=1.0, Roughness=0.0),
    "refraction": lambda stage: banded(stage, "ShaderNodeBsdfRefraction", IOR=1.0, Roughness=0.0),
    "painted": painted,
}


@pytest.mark.parametrize(("pattern", "samples"), [("transparent", 1), *((pattern, 8) for pattern in PATTERNS)])
def test_bounced_light_passes_both_faces_of_a_box_in_the_colour_of_the_place(stage, pattern, samples):
    """The mean of squares, not the square of the mean."""
    found = []
    for pane in (None, PATTERNS[pattern]):
        below_a_lit_ceiling(stage, pane)
        seeds = range(8 if samples > 1 else 24)  # which layers a ray passes is chance
        lit = [stage.render(samples, (16, 16), bounces=1, seed=seed)["diffuse_indirect"] for seed in seeds]
        found.append(np.mean(lit, axis=(0, 1, 2))[:3])
    assert found[0].min() > 0.01
    assert found[1] / found[0] == pytest.approx((BANDS**2).mean(axis=0), rel=0.06)


def absorbing_glass(stage, per_metre, ior=1.0):
    made = stage.material("ShaderNodeBsdfGlass", IOR=ior, Roughness=0.0, Color=(1, 1, 1, 1))
    fill(made.node_tree, "ShaderNodeVolumeAbsorption", Color=(*(1 - np.array(per_metre) / 4), 1), Density=4.0)
    return made


def test_absorbing_glass_makes_rays_look_no_tiles_up(stage):
    """Its records lie where tiles of opacity would, and programs without tiles are a tenth faster."""
    below_a_lit_ceiling(stage, lambda stage: absorbing_glass(stage, (2.0, 0.5, 0.0)), 0.4)
    stage.render(1, (8, 8), bounces=1)
    defines = set(stage.renderer.frame.hierarchy("diffuse").leaves.defines)
    assert set(acceleration.ABSORBING) <= defines and not set(acceleration.TILED) & defines


def test_only_glass_that_is_shown_has_records_of_what_it_absorbs():
    made = [SimpleNamespace(absorbed_inside=(0.5 * k, 0.0, 0.0), emissive=False, tinted=False) for k in range(4)]
    shown, maps = [SimpleNamespace(materials=(3,))], SimpleNamespace(texels=np.zeros((5, 4)))
    texels, records = absorption_records(made, shown, maps)
    assert records == {3: 5} and texels[0, 0] == 1.5 and len(texels) == RECORD


def test_bounced_light_is_absorbed_in_glass_that_it_passes(stage):
    per_metre, thick, found = (2.0, 0.5, 0.0), 0.4, []
    for pane in (None, lambda stage: absorbing_glass(stage, per_metre)):
        below_a_lit_ceiling(stage, pane, thick)
        found.append(stage.render(16, (16, 16), bounces=1)["diffuse_indirect"][..., :3].mean((0, 1)))
    # Ways through the slab of even light on the floor below, but for what the ceiling's rim cuts off.
    cosine = np.sqrt((np.arange(1000) + 0.5) / 1000)
    cosine = cosine[cosine > np.cos(np.arctan(10.0 / 3.0))]
    expected = [np.exp(-a * thick / cosine).mean() for a in per_metre]
    assert found[1] / found[0] == pytest.approx(np.array(expected), rel=0.05)


@pytest.mark.parametrize(
    ("kind", "samples"),
    [("SUN", 1), ("SUN", 4), ("AREA", 1), ("AREA", 4), ("MESH", 1), ("MESH", 4), ("WORLD", 64)],
)  # fmt: skip
def test_light_of_sources_is_absorbed_in_glass_that_it_passes_straight(stage, kind, samples):
    """Below a wide slab that bends nothing."""
    per_metre, thick, found = np.array((2.0, 0.5, 0.0)), 0.4, []
    for filled in (False, True):
        stage.clear()
        stage.scene.candela.slot_indirect = "OFF"
        stage.rectangle((-1, -1), (1, 1), material=stage.diffuse(0.8))
        if kind == "WORLD":
            stage.world((1, 1, 1))
        elif kind == "MESH":
            shining = stage.material("ShaderNodeEmission", Strength=1000.0)
            stage.rectangle((-0.5, -0.5), (0.5, 0.5), 20.0, material=shining).visible_camera = False
        elif kind == "AREA":
            stage.light("AREA", (0, 0, 20.0), energy=1e4, size=1.0)
        else:
            stage.light("SUN", angle=0.01)
        if filled:
            slab = absorbing_glass(stage, per_metre, ior=1.0)
            box(stage, slab, (-60, -60, 0.5), (60, 60, 0.5 + thick)).visible_camera = False
        stage.camera_above(0.2)
        found.append(stage.render(samples, (8, 8), bounces=2)["combined"][..., :3].mean((0, 1)))
    cosine = np.sqrt((np.arange(1000) + 0.5) / 1000) if kind == "WORLD" else np.ones(1)
    expected = [np.exp(-a * thick / cosine).mean() for a in per_metre]
    assert found[1] / found[0] == pytest.approx(np.array(expected), rel=0.04)


def test_light_of_a_lamp_in_glass_is_absorbed_on_its_way_out(stage):
    """In the middle of a wide slab: all light of the floor and the wall far below it has passed half of that, and the
    quotients of its colours say by what. Rays that end in the slab lost nothing there."""
    per_metre, thick, found = np.array((2.0, 0.5, 0.0)), 0.4, []
    for filled in (False, True):
        stage.clear()
        stage.scene.candela.slot_caustics = "OFF"
        stage.rectangle((-0.5, -0.5), (0.5, 0.5), material=stage.diffuse(0.8))
        stage.rectangle(
            (-0.5, 0), (0.5, 1.0), material=stage.diffuse(0.8), location=(0, 0.5, 0), turn=(np.pi / 2, 0, 0)
        )
        stage.light("POINT", (0, 0, 20.0), energy=1e5, shadow_soft_size=0.0)
        if filled:
            glass = absorbing_glass(stage, per_metre, ior=1.2)
            box(stage, glass, (-9, -9, 20.0 - thick), (9, 9, 20.0 + thick))
        camera = stage.camera((0, -3, 0.5), (np.pi / 2, 0, 0))
        camera.data.type, camera.data.ortho_scale = "ORTHO", 0.9
        found.append(stage.render(4, (8, 8), bounces=1)["diffuse_indirect"][..., :3].mean((0, 1)))
    passed = found[1] / found[0]
    assert passed[2] > 0.5
    assert passed / passed[2] == pytest.approx(np.exp(-per_metre * thick), rel=0.02)


def test_bounced_light_passes_a_thin_wall_in_its_base_colour(stage):
    """Two faces with what they mirror to and fro, and the base colour by the way between them."""
    base, ior = np.array(COLOR), 1.5
    made = stage.principled()
    if "Thin Wall" not in made.node_tree.nodes[0].inputs:
        pytest.skip("this Blender's Principled has no thin wall")
    found = []
    for walled in (False, True):
        below_a_lit_ceiling(stage)
        if walled:
            wall = stage.principled(
                Base_Color=(*base, 1), Transmission_Weight=1.0, Thin_Wall=True, Roughness=0.0, IOR=ior
            )
            stage.rectangle((-9, -9), (9, 9), 1.0, material=wall).visible_camera = False
        lit = [stage.render(8, (16, 16), bounces=1, seed=seed)["diffuse_indirect"] for seed in range(4)]
        found.append(np.mean(lit, axis=(0, 1, 2))[:3])
    cosine = np.sqrt((np.arange(1000) + 0.5) / 1000)[:, None]
    cosine = cosine[cosine[:, 0] > np.cos(np.arctan(10.0 / 3.0))]  # the ceiling's rim cuts off the rest
    inside = np.sqrt(1.0 - (1.0 - cosine**2) / ior**2)
    across, along = ((a - b) / (a + b) for a, b in ((cosine, ior * inside), (ior * cosine, inside)))
    face, absorbed = (across**2 + along**2) / 2, base ** (1.0 / inside)
    expected = ((1.0 - face) ** 2 * absorbed / (1.0 - (face * absorbed) ** 2)).mean(axis=0)
    assert found[1] / found[0] == pytest.approx(expected, rel=0.06)
