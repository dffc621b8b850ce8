"""Shading of hits: mirrors and glass show surfaces with their own materials, bounce by bounce, by closed forms."""

import bpy
import numpy as np
import pytest

from addon.compare.passes import light_paths
from addon.frame.shares import Turns
from addon.gfx import images
from addon.techniques import shaded_reflections
from addon.techniques.shaded_reflections import GATHERED_FROM, ShadedReflections
from bench.shading import chequer

from .conftest import places

SIZE = (24, 24)


def shining(stage, source="UV"):
    """Emission by UV, or by another output of the Texture Coordinate node."""
    made = stage.material("ShaderNodeEmission", Strength=1.0)
    nodes, links = made.node_tree.nodes, made.node_tree.links
    place = nodes.new("ShaderNodeTexCoord")
    emission = next(node for node in nodes if node.type == "EMISSION")
    links.new(place.outputs[source], emission.inputs["Color"])
    return made


def mirror(stage, tint=1.0):
    return stage.principled(Metallic=1.0, Roughness=0.0, Base_Color=(tint, tint, tint, 1))


def reflected(images):
    return sum(images[f"glossy_{order}"][..., :3] * images["glossy_color"][..., :3] for order in ("direct", "indirect"))


def ceiling(stage, material, half=4.0, z=15.0):
    """A square above the camera that faces down, with a UV map over it."""
    made = stage.rectangle((-half, -half), (half, half), material=material, location=(0, 0, z), turn=(np.pi, 0, 0))
    layer = made.data.uv_layers.new(name="UVMap")
    for corner, place in enumerate([(0, 0), (1, 0), (1, 1), (0, 1)]):
        layer.uv[corner].vector = place
    return made


@pytest.mark.slow
def test_a_mirror_shows_a_texture_that_no_view_does(stage):
    """u runs with x, v against y, since the ceiling is turned around X."""
    stage.rectangle((-9, -9), (9, 9), material=mirror(stage))
    ceiling(stage, shining(stage))
    stage.camera_above()
    found = reflected(stage.render(1, SIZE, bounces=2))
    x, y = places(SIZE)
    assert found[..., 0] == pytest.approx((x + 4) / 8, abs=2e-3)
    assert found[..., 1] == pytest.approx((4 - y) / 8, abs=2e-3)
    assert np.abs(found[..., 2]).max() < 1e-6


def test_procedurals_see_the_objects_own_space(stage):
    stage.rectangle((-9, -9), (9, 9), material=mirror(stage))
    top = ceiling(stage, shining(stage, "Object"))
    top.scale = (2, 2, 2)
    stage.camera_above()
    found = reflected(stage.render(1, SIZE, bounces=2))
    x, y = places(SIZE)
    assert found[..., 0] == pytest.approx(x / 2, abs=2e-3)
    assert found[..., 1] == pytest.approx(-y / 2, abs=2e-3)


AT_45_DEGREES = 0.5 + 0.5 * (1 - np.sqrt(0.5)) ** 5  # what metal of .5 reflects there (Schlick)


@pytest.mark.parametrize("bounces, share", [(1, 0.0), (2, AT_45_DEGREES**2), (8, AT_45_DEGREES**2)])
def test_each_mirror_takes_its_share(stage, bounces, share):
    """A periscope of two mirrors that reflect half, before a lamp-like square."""
    half = mirror(stage, 0.5)
    stage.rectangle((-3, -3), (3, 3), material=half, turn=(0, np.radians(45), 0))
    stage.rectangle((-3, -3), (3, 3), material=half, location=(8, 0, 0), turn=(0, np.radians(-135), 0))
    light = stage.material("ShaderNodeEmission", Strength=1.0)
    stage.rectangle((-9, -9), (9, 9), material=light, location=(8, 0, -6))
    light_above = stage.rectangle((-9, -9), (9, 9), material=light, location=(8, 0, 30))
    light_above.visible_camera = False
    stage.camera_above(span=1.0)
    images = stage.render(1, (8, 8), bounces=bounces)
    assert reflected(images).mean() == pytest.approx(share, abs=1e-4)


def test_rounds_of_reflections_read_nothing_back(stage, monkeypatch):
    """A readback inside a sample stops the queue of a GPU; which materials rays met is asked in a first picture."""
    stage.rectangle((-9, -9), (9, 9), material=mirror(stage))
    ceiling(stage, stage.diffuse(0.5), half=30.0)
    stage.camera_above()
    stage.render(1, SIZE, bounces=8)
    reads = []
    read = images.read
    monkeypatch.setattr(images, "read", lambda image: reads.append(image) or read(image))
    counts = []
    for samples in (1, 7):
        reads.clear()
        stage.render(samples, SIZE, bounces=8)
        counts.append(len(reads))
    assert counts[0] == counts[1]


def test_what_no_ray_meets_costs_nothing(stage):
    stage.rectangle((-9, -9), (9, 9), material=mirror(stage))
    hidden = stage.rectangle((-1, -1), (1, 1), material=stage.diffuse(0.3), location=(0, 0, -5))
    hidden.visible_camera = True
    stage.world((0.5, 0.5, 0.5))
    stage.camera_above()
    stage.render(2, SIZE, bounces=4)
    row = next(row for row in stage.ledger.rows if row.name == "shaded_reflections")
    assert row.state == "ran" and "materials" not in row.counters


def test_light_reaches_what_a_mirror_shows(stage):
    """A white ceiling under a world of radiance 1 that stands before an endless mirror: it sends back what it gets."""
    stage.rectangle((-9, -9), (9, 9), material=mirror(stage))
    ceiling(stage, stage.diffuse(0.5), half=3.0)
    stage.light("SUN", location=(0, 0, 0), turn=(np.pi, 0, 0), angle=0.0).data.use_shadow = False
    stage.camera_above(span=1.0)
    found = reflected(stage.render(4, (8, 8), bounces=2))
    assert found.mean() == pytest.approx(0.5 / np.pi, rel=0.01)


def test_a_draft_shows_means(stage):
    from addon.frame.settings import Settings

    stage.rectangle((-9, -9), (9, 9), material=mirror(stage))
    stage.world()
    stage.camera_above()
    stage.render(1, SIZE, bounces=2)
    snapshot = stage.renderer.frame.snapshot
    assert ShadedReflections().skip(snapshot, Settings()) is None
    assert "drafts" in ShadedReflections().skip(snapshot, Settings().as_draft())


@pytest.mark.slow
@pytest.mark.parametrize("roughness", [0.0, 0.05, 0.15, 0.5])
def test_light_behind_a_pane_is_found_once(stage, roughness):
    """Samples of the world pass a pane on straight lines, and rays of lobes go through it: in a furnace of white gloss
    and clear glass both together are 1."""
    stage.rectangle((-30, -30), (30, 30), material=stage.principled(
        Metallic=1.0, Roughness=roughness, Base_Color=(1, 1, 1, 1)
    ))  # fmt: skip
    glass = stage.principled(Roughness=0.0, IOR=1.5, Transmission_Weight=1.0, Base_Color=(1, 1, 1, 1))
    low, high = 2.0, 2.1
    corners = [(x, y, z) for z in (low, high) for y in (-40, 40) for x in (-40, 40)]
    faces = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    stage.mesh(corners, faces, material=glass)
    stage.world()
    stage.camera((0, 0, 1.5), (0, 0, 0), 0.5)
    found = reflected(stage.render(64, (12, 12), bounces=8))
    assert found.mean() == pytest.approx(1.0, abs=0.03)


def frosted(stage, roughness):
    """A cube of frosted glass, seen from aslant and above."""
    corners = [(a, b, c) for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (1, 5, 7, 3), (0, 2, 6, 4)]
    glass = stage.material("ShaderNodeBsdfGlass", Roughness=roughness, IOR=1.5)
    made = stage.mesh(corners, faces, material=glass)
    stage.camera((6.6, -6.6, 5.0), (1.08, 0, 0.785), angle=0.25)
    return made


@pytest.mark.parametrize("roughness", [0.28, 0.5])
def test_frosted_solids_vanish_in_a_furnace(stage, roughness):
    """Light samples from within pass the faces on straight lines, where rays of lobes bend: one of both counts."""
    frosted(stage, roughness)
    stage.world(strength=1.0)
    shown = stage.render(16, (24, 18), bounces=12)["combined"][6:-6, 8:-8, :3]
    assert shown.mean() == pytest.approx(1.0, abs=0.05)


def test_frosted_solids_are_as_calm_as_in_cycles(stage):
    """Rays take one of both ways by the facet that they meet: none weighs as 1 over a lobe's albedo."""
    frosted(stage, 0.5)
    stage.world(strength=1.0)
    pictures = [stage.render(4, (24, 18), engine=engine, bounces=12)["combined"] for engine in ("CANDELA", "CYCLES")]
    own, truth = (np.square(picture[6:-6, 8:-8, :3] - 1.0).mean() for picture in pictures)
    print(f"squared error {own:.4f}, in Cycles {truth:.4f}")
    assert own < 1.5 * truth


@pytest.mark.slow
def test_lamps_shine_into_frosted_solids(stage):
    """Most of what one sees there has been mirrored by inner faces."""
    frosted(stage, 0.5)
    stage.light("POINT", (4.0, 1.0, 5.9), energy=1000, shadow_soft_size=1.0)
    own, truth = (stage.render(n, (24, 18), engine=e, bounces=12) for e, n in (("CANDELA", 64), ("CYCLES", 1024)))
    through = [images["transmission_indirect"].mean() for images in (own, truth)]
    print(f"light through the solid {through[0]:.4f}, in Cycles {through[1]:.4f}")
    assert through[0] == pytest.approx(through[1], rel=0.25)


def gleaming(stage, tint):
    """A mirror that shines by itself, so that what it shows is a part of its light alone."""
    white = (1, 1, 1, 1)
    return stage.principled(
        Metallic=1.0, Roughness=0.0, Base_Color=(tint, tint, tint, 1), Emission_Color=white, Emission_Strength=1.0
    )


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_faint_mirror_is_drawn_in_few_samples_and_shows_the_same(stage, seed):
    """Seen straight from above it reflects its colour: .05 of the texture."""
    stage.rectangle((-9, -9), (9, 9), material=gleaming(stage, 0.05))
    ceiling(stage, shining(stage))
    stage.camera_above()
    found = reflected(stage.render(16, SIZE, bounces=2, seed=seed))
    x, y = places(SIZE)
    assert found[..., 0] == pytest.approx(0.05 * (x + 4) / 8, abs=3e-4)
    assert found[..., 1] == pytest.approx(0.05 * (4 - y) / 8, abs=3e-4)
    assert "in 5 of 16 samples" in " ".join(stage.ledger.row("shaded_reflections").choices)


@pytest.mark.slow
def test_a_faint_coat_costs_less_than_a_tenth_of_a_mirror(stage):
    passes = []
    for values in ({"Metallic": 1.0, "Roughness": 0.0}, {"Coat_Weight": 0.05, "Roughness": 0.8}):
        stage.clear()
        stage.world()
        stage.rectangle((-9, -9), (9, 9), material=stage.principled(**values))
        ceiling(stage, stage.diffuse(0.5), half=3.0)
        stage.light(
            "AREA", (0, 0, 0.6), turn=(np.pi, 0, 0), size=1.0
        )  # so that what a sample shows is not all there is
        stage.camera_above()
        stage.render(128, (16, 12), bounces=1)
        passes.append(stage.ledger.row("shaded_reflections").counters["passes"])
    assert passes[1] < 0.1 * passes[0]


def prism(stage, glasses):
    """Glass nodes, added: a color for each index."""
    made = stage.material("ShaderNodeAddShader")
    tree = made.node_tree
    joined = next(node for node in tree.nodes if node.type == "ADD_SHADER")
    for socket, (ior, color) in zip(joined.inputs, glasses.items()):
        node = tree.nodes.new("ShaderNodeBsdfGlass")
        node.inputs["IOR"].default_value, node.inputs["Color"].default_value = ior, (*color, 1)
        node.inputs["Roughness"].default_value = 0.0
        tree.links.new(node.outputs[0], socket)
    return made


def test_light_that_is_red_leaves_a_prism_by_the_glass_for_red(stage):
    """A ball of red and cyan glass in an even world: as bright as the world, and no path of a color that the next
    glass does not have stands for those that it does."""
    glasses = {1.2: (1.0, 0.0, 0.0), 1.4: (0.0, 1.0, 1.0)}
    bpy.ops.mesh.primitive_uv_sphere_add(segments=24, ring_count=12)
    bpy.context.object.data.materials.append(prism(stage, glasses))
    stage.world((1.0, 1.0, 1.0))
    stage.camera_above(0.8)
    seen = stage.render(16, (16, 16), bounces=8)["combined"][..., :3]
    assert seen.mean() == pytest.approx(1.0, abs=0.05)
    assert seen.max() < 1.5


def test_one_sample_sees_through_a_pane_without_grain(stage):
    """Before a shining wall in a dark room: what the far side of a pane mirrors is black."""
    wall = stage.material("ShaderNodeEmission", Strength=1.0)
    stage.mesh([(-9, -9, -2), (9, -9, -2), (9, 9, -2), (-9, 9, -2)], [(0, 1, 2, 3)], material=wall)
    bpy.ops.mesh.primitive_cube_add(size=1)
    bpy.context.object.scale = (20, 20, 0.1)
    bpy.context.object.data.materials.append(stage.material("ShaderNodeBsdfGlass", IOR=1.5, Roughness=0.0))
    stage.camera_above(2.0)
    found = stage.render(1, (16, 16), bounces=4)["combined"][..., :3]
    assert found.mean() == pytest.approx(0.96**2, rel=0.03)
    assert found.min() > 0.9 and found.max() < 1.0


def test_one_sample_averages_what_a_mirror_shows_over_the_pixel(stage, monkeypatch):
    """A chequer of tiles a fifth of a pixel wide: rays from four points of a pixel have half the noise of one."""
    stage.rectangle((-9, -9), (9, 9), material=mirror(stage))
    tiles = stage.material("ShaderNodeEmission", Strength=1.0)
    emission = next(node for node in tiles.node_tree.nodes if node.type == "EMISSION")
    tiles.node_tree.links.new(chequer(tiles, 317, (1, 1, 1, 1), (0, 0, 0, 1)), emission.inputs["Color"])
    ceiling(stage, tiles)
    stage.camera_above()
    bpy.context.scene.render.filter_size = 1.5
    found = {}
    for rays in (1, 4):
        monkeypatch.setattr(shaded_reflections, "MORE_RAYS", rays)
        found[rays] = reflected(stage.render(1, SIZE, bounces=2, seed=rays))[4:-4, 4:-4, 0]
    assert found[4].mean() == pytest.approx(0.5, abs=0.03)
    assert found[4].std() < 0.65 * found[1].std()


@pytest.mark.parametrize(
    "shader", ["ShaderNodeBsdfGlossy", pytest.param("ShaderNodeBsdfGlass", marks=pytest.mark.slow)]
)
def test_rays_from_elsewhere_in_a_pixel_keep_to_its_own_surface(stage, shader):
    """Within a shining sphere a smooth ball that loses nothing is not to be seen, its outline included."""
    around = stage.material("ShaderNodeEmission", Strength=1.0)
    bpy.ops.mesh.primitive_uv_sphere_add(radius=40.0)
    bpy.context.object.data.materials.append(around)
    bpy.ops.mesh.primitive_uv_sphere_add(radius=2.5, segments=48, ring_count=24)
    bpy.ops.object.shade_smooth()
    bpy.context.object.data.materials.append(stage.material(shader, Roughness=0.0, Color=(1, 1, 1, 1)))
    stage.camera_above()
    bpy.context.scene.render.filter_size = 1.5
    found = stage.render(1, SIZE, bounces=16)["combined"][..., :3]
    assert found.mean() == pytest.approx(1.0, abs=5e-3)
    assert np.abs(found - 1.0).mean() < 0.01


def test_gloss_on_the_bound_of_what_is_gathered_has_its_light(stage):
    """Metal of roughness .4 before a wall: in single precision that exceeds Python's .4, and equals a shader's."""
    stage.rectangle((-4, 0), (4, 4), material=stage.diffuse(0.8), location=(0, 3, 0), turn=(np.pi / 2, 0, 0))
    stage.light("POINT", (0, 0, 3), energy=200.0)
    stage.camera((0, -5, 3), (1.2, 0, 0), angle=0.9)
    floor, found = stage.rectangle((-4, -4), (4, 4)), []
    for roughness in (GATHERED_FROM, GATHERED_FROM + 0.01):
        floor.data.materials.clear()
        floor.data.materials.append(stage.principled(Metallic=1.0, Roughness=roughness))
        found.append(stage.render(4, (16, 12), bounces=1)["glossy_indirect"][..., :3].mean())
    assert found[0] == pytest.approx(found[1], rel=0.1) and found[1] > 1e-3


@pytest.mark.parametrize("beside, gathered", [(0.42, True), (0.05, False)])
def test_rough_gloss_is_gathered_but_beside_smooth_metal(stage, beside, gathered):
    """Virtual lights spread what smooth metal mirrors; rays of the floor's gloss see it as it is."""
    stage.rectangle((-9, -9), (9, 9), material=stage.principled(Metallic=1.0, Roughness=0.6))
    metal = stage.principled(Metallic=1.0, Roughness=beside)
    stage.rectangle((-1, -1), (1, 1), material=metal, location=(3, 0, 1), turn=(0, np.radians(-60), 0))
    stage.light("AREA", (0, 0, 6), size=2.0)
    stage.camera_above()
    stage.render(1, (12, 12), bounces=2)
    assert any("roughness" in one for one in stage.ledger.row("shaded_reflections").choices) == gathered


def coated(stage, **coat):
    """Red metal under a clear coat, seen at a slant."""
    values = {"Metallic": 1.0, "Roughness": 0.35, "Base_Color": (0.8, 0.1, 0.1, 1), "Coat_Weight": 1.0, **coat}
    stage.rectangle((-9, -9), (9, 9), material=stage.principled(**values))
    stage.camera((0.0, -6.0, 2.5), (1.17, 0, 0), angle=0.3)


def apart(monkeypatch, yes):
    monkeypatch.setattr(ShadedReflections, "follows_coats", lambda *_: yes)


def test_one_sample_shows_a_coat_and_what_lies_below_it_without_grain(stage, monkeypatch):
    """Under an even sky each of the two reflects its own colour, wherever its rays go."""
    coated(stage, Roughness=0.1)
    stage.world(strength=1.0)
    whole = stage.render(1, (16, 16), bounces=2)["combined"][4:-4, 4:-4, :3]
    apart(monkeypatch, False)
    chosen = stage.render(1, (16, 16), bounces=2, seed=2)["combined"][4:-4, 4:-4, :3]
    many = stage.render(32, (16, 16), bounces=2)["combined"][4:-4, 4:-4, :3]
    own, before = (np.square(one - many).mean((0, 1))[1:] for one in (whole, chosen))
    assert (own < 0.2 * before).all(), (own, before)
    assert whole.mean((0, 1)) == pytest.approx(many.mean((0, 1)), rel=0.02)


@pytest.mark.parametrize("coat", [{"Coat_Roughness": 0.1}, {"Coat_Roughness": 0.03, "Coat_Weight": 0.4}])
def test_a_coat_that_is_drawn_apart_reflects_lamps_as_before(stage, monkeypatch, coat):
    """One that rays find and one that light samples alone do."""
    coated(stage, **coat)
    stage.light("POINT", (-0.3, 6.0, 2.5), energy=100, shadow_soft_size=0.5)
    stage.light("POINT", (0.5, 5.0, 2.5), energy=10, shadow_soft_size=0.0)
    found = []
    for yes in (True, False):
        apart(monkeypatch, yes)
        images = [stage.render(32, (16, 16), bounces=1, seed=seed) for seed in (1, 2)]
        found.append(np.mean([one["combined"][..., :3].mean((0, 1)) for one in images], axis=0))
    assert found[0] == pytest.approx(found[1], rel=0.02)


@pytest.mark.parametrize("seen, rests", [("ShaderNodeBsdfGlass", [False, True]), ("ShaderNodeBsdfGlossy", [True])])
def test_what_is_seen_through_glass_has_all_its_bounces_in_each_sample(stage, monkeypatch, seen, rests):
    """Which face mirrors is chance: of a bounce that the first sample shows nothing of, more may come. (Wine in a thick
    glass: squared error .077 at 16 samples while such bounces rested, beside .042 at 4.)"""
    found, begin = [], Turns.begin

    def told(self, frame, names, may_rest=True):
        begin(self, frame, names, may_rest)
        if isinstance(self._technique, ShadedReflections):
            found.append(self.may_rest)

    monkeypatch.setattr(Turns, "begin", told)
    stage.rectangle((-1, -1), (1, 1), material=stage.material(seen, Roughness=0.0))
    stage.world()
    stage.camera_above()
    stage.render(8, (8, 8), bounces=4)
    assert found[: len(rests)] == rests


@pytest.mark.parametrize(("roughness", "rays"), [(0.5, False), (0.35, True)])
def test_lobes_that_none_are_as_smooth_as_take_no_rays(stage, roughness, rays):
    """Rougher lobes than .4 are gathered, so without smoother ones no pass of rays is made."""
    stage.rectangle((-9, -9), (9, 9), material=stage.principled(Roughness=roughness))
    ceiling(stage, stage.material("ShaderNodeEmission", Strength=1.0))
    stage.camera_above()
    assert reflected(stage.render(2, SIZE, bounces=2)).max() > 0
    row = stage.ledger.row("shaded_reflections")
    assert any("none, because no material is smoother" in one for one in row.choices) != rays
    assert bool(row.counters.get("passes")) == rays


def test_a_coat_that_is_drawn_apart_lights_others(stage):
    """A floor before dark metal under a clear coat, which the picture shows: the coat sends most of what it gets."""
    stage.rectangle((-3, -3), (3, 0), material=stage.diffuse(0.5))
    dark = stage.principled(Metallic=1.0, Roughness=0.35, Base_Color=(0.02, 0.02, 0.02, 1), Coat_Weight=1.0)
    stage.rectangle((-3, 0), (3, 3), material=dark, turn=(np.pi / 2, 0, 0))
    stage.light("AREA", (0, -3, 1.5), turn=(np.pi / 2, 0, 0), size=1.0)
    stage.camera((0, -5.0, 3.0), (1.1, 0, 0), angle=0.9)
    stage.scene.candela.use_denoise = False  # it spreads light over the pixels of so small a picture
    own, truth = (
        light_paths(stage.render(samples, (24, 18), engine=engine, bounces=2))["diffuse_indirect"].mean()
        for engine, samples in (("CANDELA", 32), ("CYCLES", 512))
    )
    assert own == pytest.approx(truth, rel=0.15)


def test_one_sample_mirrors_faintly(stage):
    """What a mirror of little colour shows of what is very bright."""
    stage.floor(material=mirror(stage, 2e-4))
    ceiling(stage, stage.material("ShaderNodeEmission", Strength=5000.0), half=9.0)
    stage.camera_above()
    bpy.context.scene.render.filter_size = 1.5  # rays start from several points of a pixel
    found = stage.render(1, (8, 8), bounces=2)["combined"][..., :3]
    assert found.mean() == pytest.approx(1.0, rel=0.05)


def test_a_mirror_shows_a_board_where_a_thin_lamp_touches_it(stage):
    """Points of light stand for more than the sheet is high. Beside a long sheet of height c a board has, at a distance
    y, the irradiance  pi L (1 - y / sqrt(y^2 + c^2)) / 2. Points alone brought .23 of it in the picture's middle."""
    height = 0.01
    shining = stage.material("ShaderNodeEmission", Strength=100.0)
    stage.mesh([(-1, 0, 1), (1, 0, 1), (1, 0, 1 - height), (-1, 0, 1 - height)], [(0, 1, 2, 3)], material=shining)
    stage.mesh([(-1, -1, 1), (1, -1, 1), (1, 1, 1), (-1, 1, 1)], [(0, 1, 2, 3)], material=stage.diffuse(1.0))
    stage.rectangle((-1, -1), (1, 1), material=mirror(stage))
    camera = stage.camera((0, 0, 0.5), (0, 0, 0))
    camera.data.type, camera.data.ortho_scale = "ORTHO", 0.2
    found = [stage.render(1, (12, 12), seed, bounces=1)["glossy_indirect"][5:7, :, :3].mean() for seed in range(1, 7)]
    expected = 50 * (1 - 1 / np.hypot(1, height * 120))
    print(f"{np.mean(found):.3f}, closed form {expected:.3f}")
    assert np.mean(found) == pytest.approx(expected, rel=0.2)
