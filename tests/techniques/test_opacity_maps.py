"""Opacity of triangles place by place: what rays meet of leaves, fences and sheets of sprites."""

import bpy
import numpy as np
import pytest

UPRIGHT = {"location": (-1.0, 0.0, 1.0), "turn": (0, np.pi / 2, 0)}


def with_alpha(stage, alpha, interpolation):
    """A diffuse material whose alpha is an image of (N, N) `alpha`."""
    image = bpy.data.images.new("Alpha", *alpha.shape, alpha=True)
    pixels = np.ones((*alpha.shape, 4), np.float32)
    pixels[..., 3] = alpha
    image.pixels.foreach_set(pixels.ravel())
    image.pack()
    material = stage.principled(Base_Color=(0.8, 0.8, 0.8, 1), Specular_IOR_Level=0.0)
    tree = material.node_tree
    texture = tree.nodes.new("ShaderNodeTexImage")
    texture.image, texture.interpolation = image, interpolation
    shader = next(node for node in tree.nodes if node.type == "BSDF_PRINCIPLED")
    tree.links.new(texture.outputs["Alpha"], shader.inputs["Alpha"])
    return material


@pytest.fixture
def sheet(stage):
    """The left half lets all light pass, the right half none."""
    return with_alpha(stage, np.arange(64)[None] * np.ones((64, 1)) >= 32, "Closest")


def sides(stage):
    """(2,) mean opacity of fronts and backs of all triangles that were measured, weighted by area."""
    frame = stage.renderer.frame
    total, area = np.zeros(2), 0.0
    for instance in frame.snapshot.instances:
        known = frame.opacity_maps.of(instance)
        if known is not None:
            mesh = frame.snapshot.meshes[instance.mesh]
            corners = mesh.positions[mesh.corner_vertices[mesh.triangle_corners]] @ instance.matrix[:3, :3].T
            size = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
            total += (known.sides * size[:, None])[known.measured].sum(axis=0)
            area += size[known.measured].sum()
    return total / area


@pytest.mark.parametrize(("left", "right", "expected"), [(0.55, 0.95, 1.0), (0.05, 0.45, 0.0), (0.0, 1.0, 0.5)])
@pytest.mark.parametrize("shadow", [True, False])
def test_opacity_is_that_of_the_part_that_is_shown(stage, sheet, left, right, expected, shadow):
    sheet.use_transparent_shadow = shadow
    stage.card(sheet, left, right)
    stage.floor(z=-1.0)
    stage.light("SUN")
    stage.camera_above()
    stage.render(1, (16, 16))
    assert sides(stage) == pytest.approx([expected] * 2, abs=0.01)


def test_what_shows_a_material_is_weighted_by_its_size(stage, sheet):
    stage.card(sheet, 0.55, 0.95)
    stage.card(sheet, 0.05, 0.45, location=(1.0, 0.0, 0.5), scale=(0.5, 0.5, 1.0))
    stage.light("SUN")
    stage.camera_above()
    stage.render(1, (16, 16))
    assert sides(stage) == pytest.approx([0.8] * 2, abs=0.01)


@pytest.mark.slow
def test_it_is_measured_once(stage, sheet):
    placed = stage.card(sheet, 0.0, 1.0)
    stage.light("SUN")
    stage.camera_above()
    stage.render(2, (16, 16), bounces=2)
    assert sides(stage) == pytest.approx([0.5] * 2, abs=0.01)
    maps = stage.renderer.frame.opacity_maps
    before = maps.changes
    placed.location.x = 0.3
    stage.render(2, (16, 16), bounces=2)
    assert stage.renderer.frame.opacity_maps is maps and maps.changes == before
    placed.data.uv_layers[0].uv[1].vector = (0.7, 0)
    placed.data.update()
    stage.render(2, (16, 16), bounces=2)
    assert maps.changes == before + 1


def test_a_wall_that_shows_an_opaque_part_keeps_light_in(stage, sheet):
    """Two walls of a corner under a sun: as much light between them as if the material had no alpha."""
    found = []
    for material in (sheet, stage.principled(Base_Color=(0.8, 0.8, 0.8, 1), Specular_IOR_Level=0.0)):
        walls = [stage.card(material, 0.55, 0.95, **place) for place in ({}, UPRIGHT)]
        if not found:
            stage.light("SUN", turn=(0, 0.5, 0), energy=5.0)
            stage.camera_above()
        found.append(stage.render(8, (24, 24), bounces=4)["diffuse_indirect"][..., :3].mean())
        for wall in walls:
            bpy.data.objects.remove(wall)
    assert found[0] == pytest.approx(found[1], rel=0.02)


@pytest.fixture
def one_sided(stage):
    """Diffuse where it faces the ray, and not there at all from behind."""
    material = stage.diffuse(0.8)
    tree = material.node_tree
    diffuse, output = (next(n for n in tree.nodes if n.type == kind) for kind in ("BSDF_DIFFUSE", "OUTPUT_MATERIAL"))
    mix, nothing = tree.nodes.new("ShaderNodeMixShader"), tree.nodes.new("ShaderNodeBsdfTransparent")
    tree.links.new(tree.nodes.new("ShaderNodeNewGeometry").outputs["Backfacing"], mix.inputs[0])
    tree.links.new(diffuse.outputs[0], mix.inputs[1])
    tree.links.new(nothing.outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], output.inputs["Surface"])
    return material


def test_sides_have_an_opacity_each(stage, one_sided):
    stage.blocker((-1, -1), (1, 1), 1.0, material=one_sided)
    stage.floor()
    stage.light("SUN")
    stage.camera_above()
    stage.render(1, (16, 16))
    assert sides(stage) == pytest.approx([1.0, 0.0])


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("upside_down", [False, True])
def test_rays_meet_the_side_that_is_there(stage, one_sided, mirrored, upside_down):
    """What a mirror shows of a card above it that is there from one side only."""
    stage.floor(material=stage.material("ShaderNodeBsdfGlossy", Color=(1, 1, 1, 1), Roughness=0.0))
    stage.rectangle(
        (-1, -1), (1, 1), material=one_sided, location=(0, 0, 1), turn=(np.pi * upside_down, 0, 0),
        scale=(-1 if mirrored else 1, 1, 1),
    ).visible_camera = False  # fmt: skip
    stage.world()
    stage.camera_above()
    direct = stage.render(16, (16, 16))["glossy_direct"][6:10, 6:10, 0].mean()
    cycles = stage.render(16, (16, 16), engine="CYCLES")["glossy_direct"][6:10, 6:10, 0].mean()
    assert cycles == pytest.approx(0.0 if upside_down else 1.0, abs=0.01)
    assert direct == pytest.approx(cycles, abs=0.01)


@pytest.mark.slow
def test_a_room_whose_walls_are_seen_through_from_outside_keeps_its_light(stage, one_sided):
    """A box with its faces turned inwards and a lamp in it, seen through its own wall: as if it were opaque."""
    corners = [(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (0, 2)]
    faces = [(0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6)]
    stage.mesh(corners, faces, material=one_sided)
    stage.light("AREA", (0, 0, 1.9), size=0.5)
    stage.camera((0, -5, 1), (np.pi / 2, 0, 0), angle=0.5)
    ours, cycles = (
        stage.render(samples, (24, 24), bounces=6, engine=engine)["diffuse_indirect"][..., :3].mean()
        for engine, samples in (("CANDELA", 16), ("CYCLES", 64))
    )
    assert ours == pytest.approx(cycles, rel=0.03)


@pytest.fixture
def spots(stage):
    """A material that is there inside of discs, three to an edge of the image."""
    y, x = np.mgrid[:96, :96] % 32 - 15.5
    return with_alpha(stage, np.hypot(x, y) < 12.8, "Linear")


@pytest.mark.parametrize("scale", [(1, 1, 1), (-1, 1, 1), (1, 0.5, 1)], ids=["plain", "mirrored", "flat"])
@pytest.mark.parametrize("upside_down", [False, True])
def test_a_mirror_shows_what_is_there_of_a_card(stage, spots, upside_down, scale):
    """A card of nine discs above a mirror under a white sky, pixel by pixel beside Cycles. It shows u from .1 to .9, so
    that it is not alike under any turn."""
    stage.floor(material=stage.material("ShaderNodeBsdfGlossy", Color=(1, 1, 1, 1), Roughness=0.0))
    placement = {"location": (0, 0, 1), "turn": (np.pi * upside_down, 0, 0), "scale": scale}
    stage.card(spots, 0.1, 0.9, **placement).visible_camera = False
    stage.world()
    stage.camera_above()
    ours = stage.render(32, (48, 48))["glossy_direct"][..., 0]
    cycles = stage.render(64, (48, 48), engine="CYCLES")["glossy_direct"][..., 0]
    assert 0.1 < cycles.mean() < 0.95 and cycles.min() < 0.05 and cycles.max() > 0.95
    assert ours.mean() == pytest.approx(cycles.mean(), abs=0.005)
    assert np.abs(ours - cycles).mean() < 0.02


def test_a_grid_of_copies_shares_what_was_measured(stage, spots):
    """Sixteen instances of a card, half of them mirrored, and one with another material in the slot."""
    first = stage.card(spots, 0.0, 1.0, location=(-1.5, -1.5, 1), scale=(0.4, 0.4, 1))
    for number in range(1, 16):
        y, x = divmod(number, 4)
        copy = first.copy()
        copy.location, copy.scale.x = (x - 1.5, y - 1.5, 1), 0.4 * (-1) ** number
        bpy.context.collection.objects.link(copy)
    copy.material_slots[0].link = "OBJECT"
    copy.material_slots[0].material = stage.diffuse(0.8)
    stage.floor(material=stage.material("ShaderNodeBsdfGlossy", Color=(1, 1, 1, 1), Roughness=0.0))
    for placed in bpy.context.scene.objects:
        placed.visible_camera = placed.data.name != first.data.name
    stage.world()
    stage.camera_above()
    ours = stage.render(32, (48, 48))["glossy_direct"][..., 0]
    cycles = stage.render(64, (48, 48), engine="CYCLES")["glossy_direct"][..., 0]
    assert ours.mean() == pytest.approx(cycles.mean(), abs=0.01)
    assert np.abs(ours - cycles).mean() < 0.03
    assert len(stage.renderer.frame.opacity_maps.means) == 3  # two triangles, and what stands for none


def test_what_is_empty_or_whole_has_no_tile(stage, sheet):
    stage.card(sheet, 0.55, 0.95)
    stage.card(sheet, 0.05, 0.45, location=(0, 0, 1))
    stage.floor(z=-1.0)
    stage.light("SUN")
    stage.camera_above()
    stage.render(1, (16, 16))
    frame = stage.renderer.frame
    assert len(frame.opacity_maps.texels) == 0
    assert sorted(frame.hierarchy(path).triangles for path in ("glossy", "diffuse")) == [4, 4]  # floor and one card
