"""Principled Hair: its lobes beside the closed form of a single upright fibre."""

import bpy
import numpy as np
import pytest

from addon.compare.passes import light_paths

RADIUS, SPAN = 0.3, 1.0
SUN = 3.0


def fibre(stage, points, radius, **inputs):
    """Strands through `points` (n, p, 3), with one `radius` or that of each point of a strand, of Chiang's model."""
    curves = bpy.data.hair_curves.new("Hair")
    curves.add_curves([len(one) for one in points])
    curves.attributes["position"].data.foreach_set("vector", np.ravel(points))
    radii = curves.attributes.get("radius") or curves.attributes.new("radius", "FLOAT", "POINT")
    radii.data.foreach_set("value", np.broadcast_to(radius, (len(points), len(points[0]))).ravel().astype(np.float32))
    curves.materials.append(of_fibres(stage, **inputs))
    stage.link("Hair", curves)
    return curves


def of_fibres(stage, **inputs):
    """A material of Chiang's model."""
    material = stage.material("ShaderNodeBsdfHairPrincipled")
    node = next(node for node in material.node_tree.nodes if node.type == "BSDF_HAIR_PRINCIPLED")
    node.parametrization = "MELANIN"
    if hasattr(node, "model"):
        node.model = "CHIANG"
    for name, value in inputs.items():
        node.inputs[name].default_value = value
    return material


def fresnel(cosine, ior):
    g = np.sqrt(ior**2 - 1 + cosine**2)
    a = (g - cosine) / (g + cosine)
    b = ((g + cosine) * cosine - 1) / ((g - cosine) * cosine + 1)
    return 0.5 * a**2 * (1 + b**2)


def chiang(h, turn, absorption, roughness=0.3, radial=0.3, ior=1.55, tilt=0.0349066):
    """f cos of light and view across a fibre, by R, TT and TRT of Chiang et al. 2016 (the rest is below .1 %)."""
    variance = (0.726 * roughness + 0.812 * roughness**2 + 3.7 * roughness**20) ** 2
    scale = (0.265 * radial + 1.194 * radial**2 + 5.372 * radial**22) * np.sqrt(np.pi / 8)
    inside, entry = np.arcsin(h / ior), np.arcsin(h)
    passing = np.exp(-2.0 * absorption * np.cos(inside))
    f = fresnel(np.cos(entry), ior)
    shares = f, (1 - f) ** 2 * passing, (1 - f) ** 2 * passing**2 * f
    total = 0.0
    for lobe, (share, wide, angle) in enumerate(
        zip(shares, (1.0, 0.25, 4.0), (2 * tilt, -tilt, -4 * tilt), strict=True)
    ):
        v = wide * variance
        along = np.exp(np.log(np.i0(np.cos(angle) / v)) - 1 / v) / (v * (1 - np.exp(-2 / v)))
        off = turn - (2 * lobe * inside - 2 * entry + lobe * np.pi)
        off = (off + np.pi) % (2 * np.pi) - np.pi
        falling, edge = np.exp(-np.abs(off) / scale), np.exp(-np.pi / scale)
        total = total + share * along * falling / (scale * (1 + falling) ** 2) * (1 + edge) / (1 - edge)
    return total


@pytest.mark.parametrize("turn", [0.0, 0.5, 0.9])
def test_a_fibre_scatters_across_itself_what_the_closed_form_says(stage, turn):
    """A sun `turn` half turns beside the viewer, around the fibre."""
    fibre(stage, [[(0, 0, z) for z in np.linspace(-1, 2, 6)]], RADIUS, Melanin=0.3)
    stage.camera((0, -5, 0.5), (np.pi / 2, 0, 0))
    stage.scene.camera.data.type, stage.scene.camera.data.ortho_scale = "ORTHO", SPAN
    stage.light("SUN", turn=(np.pi / 2, 0, np.pi * turn), energy=SUN)
    picture = stage.render(4, (48, 36))["combined"][14:22, :, :3].mean(axis=0)
    h = (0.5 - (np.arange(48) + 0.5) / 48) * SPAN / RADIUS  # as the sun goes around
    inner = np.abs(h) < 0.9
    eumelanin = -np.log(0.7) * np.array([0.343, 0.733, 1.924])  # redness 1
    for channel, absorption in enumerate(eumelanin):
        expected = SUN * chiang(h[inner], np.pi * turn, absorption)
        np.testing.assert_allclose(picture[inner, channel], expected, rtol=0.05, atol=0.02 * expected.max())


# Cycles, bounces 0: red of a card's half whose first edge is level, by the card's turn about it and the sun's, radians.
CARDS = {(0.5, -1.168): 0.2503, (0.5, 2.366): 1.484, (0.5, 0.403): 0.0, (1.0, -1.953): 0.692, (1.0, 2.366): 10.62}


@pytest.mark.parametrize(("turn", "sun"), CARDS)
def test_a_card_is_a_fibre_along_its_first_edge(stage, turn, sun):
    """Less what Cycles leaves out: light from the other side of the plane of view and edge than the normal says."""
    corners = [(-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0)]
    card = stage.mesh(corners, [(0, 1, 2, 3)], material=of_fibres(stage, Melanin=0.3))
    card.rotation_euler = (np.pi / 2 + turn, 0, 0)
    stage.camera((0, -6, 0), (np.pi / 2, 0, 0))
    stage.scene.camera.data.type, stage.scene.camera.data.ortho_scale = "ORTHO", 0.5
    stage.light("SUN", turn=(np.pi / 2 - sun, 0, 0), energy=SUN)
    red = stage.render(1, (16, 16))["combined"][:, :, 0]
    np.testing.assert_allclose(np.median(red[:5, 4:12]), CARDS[turn, sun], rtol=0.05, atol=1e-3)


def test_strands_light_each_other_through_themselves(stage):
    """Red of Cycles' ribbons, 512 samples; of it .0780 comes from the lamp straight (strands of .7 pixels through
    a filter of 1.5; at the pixels' centres alone, where strands stand in step with them, Cycles has .1357 of .1061)."""
    stage.scene.render.filter_size = 1.5
    rows = [[(-1 + 0.05 * k, 0.3 * (-1) ** k, z) for z in np.linspace(0, 1, 4)] for k in range(41)]
    fibre(stage, rows, 0.03, Melanin=0.25)
    stage.camera((0, -5, 0.5), (np.pi / 2, 0, 0))
    stage.scene.camera.data.type, stage.scene.camera.data.ortho_scale = "ORTHO", 2.0
    stage.light("AREA", (1, -4, 1.5), (np.pi / 2 - 0.24, 0, 0.24), energy=150.0, size=0.5)
    red = stage.render(8, (48, 36), bounces=2)["combined"][12:24, 8:40, 0]
    np.testing.assert_allclose(red.mean(), 0.1050, rtol=0.03)


@pytest.mark.slow
def test_light_goes_on_ahead_from_strand_to_strand(stage):
    """Three close rows with a lamp behind or before them: bounced light towards the camera in Cycles .854 and .053, 16
    times as much (ribbons, 1024 samples). At least half of that is asked: sent to all sides alike it is three times,
    sent ahead 9.4; virtual lights send what they find to all sides still."""
    across = np.arange(41) * 0.05 - 1
    rows = [[(x + 0.025 * (row % 2), 0.1 * row, z) for z in np.linspace(0, 1, 4)] for row in range(3) for x in across]
    fibre(stage, rows, 0.02, Melanin=0.25)
    stage.camera((0, -5, 0.5), (np.pi / 2, 0, 0))
    stage.scene.camera.data.type, stage.scene.camera.data.ortho_scale = "ORTHO", 2.0
    lamp = stage.light("AREA", energy=150.0, size=0.5)
    bounced = {}
    for side in (1, -1):
        lamp.location, lamp.rotation_euler = (1, 4 * side, 1.5), (side * (0.24 - np.pi / 2), 0, -0.24 * side)
        pictures = [stage.render(8, (24, 18), bounces=n)["combined"] for n in (0, 3)]
        bounced[side] = np.diff([one[6:12, 4:20, 0].mean() for one in pictures])[0]
    print(f"behind {bounced[1]:.4f}, before {bounced[-1]:.4f}")
    assert bounced[1] > 8 * bounced[-1] > 0
    assert bounced[1] > 0.45


@pytest.mark.slow
def test_single_samples_of_hair_have_its_bounced_light_in_the_mean(stage):
    """Three close rows lit from behind: the mean of bounced light over seeds of one sample, which is filtered and
    gathered by regions, is that of sixteen samples, which are not. Paths go on from strand
    to strand as far in both: .433 for .553 where virtual lights had a share by their number (red)."""
    across = np.arange(41) * 0.05 - 1
    rows = [[(x + 0.025 * (row % 2), 0.1 * row, z) for z in np.linspace(0, 1, 4)] for row in range(3) for x in across]
    fibre(stage, rows, 0.02, Melanin=0.25)
    stage.camera((0, -5, 0.5), (np.pi / 2, 0, 0))
    stage.scene.camera.data.type, stage.scene.camera.data.ortho_scale = "ORTHO", 2.0
    stage.light("AREA", (1, 4, 1.5), (0.24 - np.pi / 2, 0, -0.24), energy=150.0, size=0.5)
    bounced = [
        np.mean(
            [
                light_paths(stage.render(count, (24, 18), seed, bounces=8))["diffuse_indirect"][6:12, 4:20].mean((0, 1))
                for seed in range(seeds)
            ],
            axis=0,
        )
        for count, seeds in ((1, 16), (16, 2))
    ]
    np.testing.assert_allclose(*bounced, rtol=0.05)


TURNS = (0.0, 0.2, 0.45, 0.8, 1.3)  # of the camera about the strands


@pytest.mark.slow
@pytest.mark.parametrize("sides", [12, 9, 7, 5, 3])
def test_strands_are_as_wide_as_cycles_from_every_side(stage, monkeypatch, sides):
    """Glowing upright strands above each other; `-s` prints the table of docs/log/2026-11-29-scenes.md."""
    monkeypatch.setattr("addon.snapshot.strands.ROUND_SIDES", (sides,))
    hair = fibre(stage, [[(0, 0, 0.3 * k), (0, 0, 0.3 * k + 0.25)] for k in range(12)], RADIUS)
    hair.materials[0] = stage.material("ShaderNodeEmission")
    camera = stage.camera((0, -5, 1.8), (np.pi / 2, 0, 0))
    camera.data.type, camera.data.ortho_scale = "ORTHO", 3.6
    widths = {}
    for engine, samples in (("CANDELA", 32), ("CYCLES", 64)):
        for turn in TURNS:
            camera.location = 5 * np.sin(turn), -5 * np.cos(turn), 1.8
            camera.rotation_euler = (
                np.pi / 2,
                0.3,
                turn,
            )  # edges along the grid of pixels would meet few of its places
            glow = stage.render(samples, (24, 72), engine=engine)["combined"][..., 0].mean()
            widths[engine, turn] = glow * 1.2 * 3.6 / (12 * 0.25)
    for turn in TURNS:
        own, cycles = widths["CANDELA", turn], widths["CYCLES", turn]
        print(f"{sides} sides, {np.degrees(turn):.0f} degrees: {own:.4f} m, Cycles {cycles:.4f}: {own / cycles:.3f}")
        assert own == pytest.approx(cycles, rel=0.03)


@pytest.mark.parametrize("roll", [0.0, 0.3, 1.1071])  # along the grid of pixels, across it, along two by one of them
@pytest.mark.parametrize("width", [0.64, 0.16, 0.03])  # pixels
@pytest.mark.parametrize("lean", [0.0, 1.0])  # away from the camera as they run down
def test_strands_thinner_than_a_pixel_keep_their_light(stage, width, roll, lean):
    """Parallel ones two pixels apart, whose places in their pixels are the same for all. What is seen of them is drawn
    by chance: within 2 % and two and a half deviations."""
    radius, places = 0.5 * width * 4 / 64, np.linspace(-1.24, 1.26, 21)
    strands = fibre(stage, [[(x, lean * y, -y) for y in (-1.25, 1.25)] for x in places], radius)
    strands.materials[0] = stage.material("ShaderNodeEmission")
    camera = stage.camera((0, -5, 0), (np.pi / 2, roll, 0))
    camera.data.type, camera.data.ortho_scale = "ORTHO", 4.0
    glow = stage.render(16, (64, 64))["combined"][..., 0].mean() * 16.0
    met = len(places) * (2.5 * 64 / 4) * 16 * width
    assert glow == pytest.approx(len(places) * 2.5 * 2 * radius, rel=0.02 + 2.5 * np.sqrt((1 - width) / met))


def test_a_lamp_at_the_camera_shadows_little_that_is_seen_of_dense_strands(stage):
    """Of strands thinner than a pixel, too: what one hides is not seen of another. Strands are shadowed as tubes of
    flat sides; when each was kept by a chance of its own, .81 of their light was left."""
    draw = np.random.default_rng(1)
    middle, way = draw.uniform(-0.5, 0.5, (200, 3)), draw.normal(size=(200, 3)) * (1, 0.5, 1)
    way *= 1.5 / np.linalg.norm(way, axis=1)[:, None]
    hair = fibre(stage, np.stack([middle - way, middle, middle + way], axis=1), 0.016)
    hair.materials[0] = stage.diffuse(1.0)
    camera = stage.camera((0, -4, 0), (np.pi / 2, 0, 0))
    camera.data.type, camera.data.ortho_scale = "ORTHO", 0.8
    lamp = stage.light("SUN", turn=(np.pi / 2, 0, 0), energy=3.0, angle=0.0)
    stage.scene.candela.slot_shadow, stage.scene.candela.accumulated_maps_by = "accumulated_maps", "RAYS"
    lit = []
    for lamp.data.use_shadow in (False, True):
        lit.append(stage.render(16, (16, 12))["combined"][..., 0].mean())
    print(f"shadowed {lit[1]:.4f}, of {lit[0]:.4f}: {lit[1] / lit[0]:.4f}")
    assert lit[1] > 0.96 * lit[0]


@pytest.mark.parametrize("ends", [(1.2, 0.1), (1.02, 0.9), (0.9, 0.1)])  # pixels
def test_strands_that_taper_to_less_than_a_pixel_keep_their_light(stage, ends):
    """Also between a ring of vertices that is drawn as it is and one that is drawn wider."""
    radii, places = 0.5 * np.array(ends) * 4 / 64, np.linspace(-1.24, 1.26, 21)
    strands = fibre(stage, [[(x, 0, z) for z in (-1.25, 1.25)] for x in places], radii)
    strands.materials[0] = stage.material("ShaderNodeEmission")
    camera = stage.camera((0, -5, 0), (np.pi / 2, 0.3, 0))
    camera.data.type, camera.data.ortho_scale = "ORTHO", 4.0
    glow = stage.render(16, (64, 64))["combined"][..., 0].mean() * 16.0
    assert glow == pytest.approx(len(places) * 2.5 * radii.sum(), rel=0.03)


def test_strands_that_run_away_from_the_camera_keep_their_light(stage):
    """From wider than a pixel to thinner ones, beside a picture with ten times the pixels a side."""
    strands = fibre(
        stage, [[(x, -3, -0.6), (1.5 * x, 1, 0.2), (2 * x, 6, 1.5)] for x in np.linspace(-1.2, 1.2, 21)], 0.02
    )
    strands.materials[0] = stage.material("ShaderNodeEmission")
    stage.camera((0, -5, 0), (np.pi / 2, 0.3, 0))
    coarse, fine = (stage.render(16, (size, size))["combined"][..., 0].mean() for size in (64, 640))
    assert coarse == pytest.approx(fine, rel=0.03)


def test_programs_of_what_no_strand_shows_know_no_strands(stage):
    """Hair that comes later makes its own materials' programs anew, and no others."""

    def of_strands():
        stage.render(1, (8, 6))
        shown = stage.renderer.materials
        programs = {one.name: shown.surface_program(k) for k, one in enumerate(shown.compiled) if one.name != "Default"}
        defined = {name: ("WIDENS_STRANDS", "") in one.defines for name, one in programs.items()}
        return programs, defined

    material = stage.diffuse(0.5)
    stage.mesh([(-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0)], [(0, 1, 2, 3)], material=material)
    stage.camera_above()
    before, defined = of_strands()
    assert defined == {material.name: False} and not dict(before[material.name].snippets)["generated/strands"]
    strands = fibre(stage, [[(0, 0, z) for z in (0, 1)]], RADIUS)
    strands.materials[0] = other = stage.diffuse(0.25)
    after, defined = of_strands()
    assert defined == {material.name: False, other.name: True} and after[material.name] == before[material.name]
    shown = stage.renderer.materials
    leaders = {one.name: leader for one, leader in zip(shown.compiled, shown.leaders)}
    assert leaders[material.name] != leaders[other.name]  # although of one topology
    strands.materials[0] = material
    assert of_strands()[1] == {material.name: True}


def test_a_card_in_the_light_of_the_world_is_said_to_be_uncertain(stage):
    material = of_fibres(stage, Melanin=0.3)
    stage.mesh([(-2, -2, 0), (2, -2, 0), (2, 2, 0), (-2, 2, 0)], [(0, 1, 2, 3)], material=material)
    stage.camera_above()
    stage.light("SUN")
    stage.render(1, (8, 6))
    assert not stage.ledger.notes
    stage.world((0.5, 0.5, 0.5))
    stage.render(1, (8, 6))
    (note,) = stage.ledger.notes
    assert note.material == material.name and "too bright or too dark" in note.text
    fibre(stage, [[(0, 0, z) for z in (0, 1)]], RADIUS)
    card = next(one for one in stage.scene.objects if one.type == "MESH")
    card.hide_render = True
    stage.render(1, (8, 6))
    assert not stage.ledger.notes
