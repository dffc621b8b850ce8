"""Light linking and shadow linking, beside Cycles."""

import bpy
import numpy as np
import pytest

from addon.compare.metrics import relative_squared_error
from addon.lighting import linked
from addon.materials.gloss import THROWS
from addon.snapshot import SnapshotCache, take
from addon.snapshot.linking import MOST_GROUPS, LinkTable
from addon.sources import lights

SIZE = (64, 48)


def collection(objects, state="INCLUDE"):
    made = bpy.data.collections.new("Links")
    for one in objects:
        made.objects.link(one)
    for item in made.collection_objects:
        item.light_linking.link_state = state
    return made


def box(stage, x, albedo=0.7):
    corners = [(a + x, b, c) for a in (-0.4, 0.4) for b in (-0.4, 0.4) for c in (0.0, 1.0)]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (1, 5, 7, 3), (0, 2, 6, 4)]
    return stage.mesh(corners, faces, material=stage.diffuse(albedo))


@pytest.fixture
def room(stage):
    stage.scene.render.filter_size = 1.5
    stage.ground = stage.floor(6.0, material=stage.diffuse(0.6))
    stage.boxes = [box(stage, x) for x in (-1.2, 0.0, 1.2)]
    stage.lamp = stage.light("AREA", (-2.0, -2.0, 3.0), turn=(0.7, -0.5, 0), size=0.6, energy=150)
    stage.light("SUN", (0, 0, 5), turn=(-0.4, 0.6, 0), energy=0.4, angle=0.05)
    stage.camera((0, -6, 4), (0.97, 0, 0))
    yield stage
    for one in (*bpy.data.collections,):
        bpy.data.collections.remove(one)


def lit_alone(stage, giver):
    giver.light_linking.receiver_collection = collection([stage.boxes[0], stage.ground])


def all_but_one(stage, giver):
    giver.light_linking.receiver_collection = collection([stage.boxes[1]], "EXCLUDE")


def blocked_by_one(stage, giver):
    giver.light_linking.blocker_collection = collection([stage.boxes[2], stage.boxes[1]])


def blocked_by_others(stage, giver):
    giver.light_linking.blocker_collection = collection([stage.boxes[0]], "EXCLUDE")


def both(stage, giver):
    lit_alone(stage, giver)
    blocked_by_others(stage, giver)


LINKS = (lit_alone, all_but_one, blocked_by_one, blocked_by_others, both)


def beside_cycles(stage, bounces=0):
    own = stage.render(64, SIZE, bounces=bounces)["combined"][..., :3]
    truth = stage.render(512, SIZE, engine="CYCLES", bounces=bounces)["combined"][..., :3]
    return own, truth, relative_squared_error(own, truth).mean()


@pytest.mark.slow
@pytest.mark.parametrize("link", LINKS)
def test_lamps_beside_cycles(room, link):
    plain = room.render(64, SIZE)["combined"][..., :3]
    link(room, room.lamp)
    _, truth, error = beside_cycles(room)
    without = relative_squared_error(plain, truth).mean()
    print(f"relMSE {error:.5f}, without links {without:.5f}")
    assert error <= 0.01 and without > 3 * error


@pytest.mark.slow
@pytest.mark.parametrize("link", (all_but_one, blocked_by_others))
def test_bounced_light_follows_links_beside_cycles(room, link):
    """A white wall beside the boxes sends on what they get; copies of one mesh stand in different groups."""
    room.rectangle((-2, 0), (2, 2.5), material=room.diffuse(0.8), location=(0, 1.2, 0), turn=(np.pi / 2, 0, 0))
    copy = room.link("Copy", room.boxes[0].data, (0.0, -1.0, 0.0))
    room.boxes.insert(0, copy)
    found = {}
    for linked_now in (False, True):
        if linked_now:
            link(room, room.lamp)
        for engine, samples in (("CANDELA", 64), ("CYCLES", 512)):
            picture = room.render(samples, (32, 24), engine=engine, bounces=3)["diffuse_indirect"]
            found[engine, linked_now] = float(picture.mean())
    own, truth = (found[engine, True] / found[engine, False] for engine in ("CANDELA", "CYCLES"))
    print(f"links make indirect light {own:.4f} times as bright, in Cycles {truth:.4f}")
    assert abs(truth - 1) > 0.02 and abs(own - truth) < 0.25 * abs(truth - 1)


def shining(stage):
    bpy.data.objects.remove(stage.lamp)
    glow = stage.material("ShaderNodeEmission", Strength=30.0)
    return stage.rectangle((-0.3, -0.3), (0.3, 0.3), material=glow, location=(-2, -2, 3), turn=(0.7, -0.5, 0))


@pytest.mark.slow
@pytest.mark.parametrize("link", (all_but_one, both))
def test_shining_meshes_beside_cycles(room, link):
    link(room, shining(room))
    _, _, error = beside_cycles(room)
    print(f"relMSE {error:.5f}")
    assert error <= 0.01


@pytest.mark.slow
def test_glossy_receivers_beside_cycles(room):
    room.boxes[1].data.materials[0] = room.principled(Metallic=1.0, Roughness=0.3)
    all_but_one(room, room.lamp)
    _, _, error = beside_cycles(room)
    print(f"relMSE {error:.5f}")
    assert error <= 0.01


@pytest.mark.parametrize("shadow", ["accumulated_maps", "vssm", "cssm", "penumbra_wedges", "depth_complexity"])
def test_every_shadow_technique_follows_links(room, shadow):
    both(room, room.lamp)
    room.scene.candela.slot_shadow = shadow
    own = room.render(16, SIZE)["diffuse_direct"]
    room.scene.candela.slot_shadow = "AUTO"
    auto = room.render(16, SIZE)["diffuse_direct"]
    room.lamp.light_linking.blocker_collection = None
    blocked = room.render(16, SIZE)["diffuse_direct"]
    assert np.abs(own - auto).mean() < 0.25 * np.abs(own - blocked).mean()


@pytest.mark.slow
def test_the_ledger_says_by_what_blockers_are_found(room):
    blocked_by_one(room, room.lamp)
    room.render(1, SIZE)
    assert "whatever technique" in " ".join(room.ledger.row("direct_light").choices)


def test_children_follow_the_mark_of_their_collection(room):
    outer, inner = collection([]), collection([room.boxes[1]])
    outer.children.link(inner)
    outer.collection_children[0].light_linking.link_state = "EXCLUDE"
    room.lamp.light_linking.receiver_collection = outer
    own = room.render(4, SIZE)["combined"]
    room.lamp.light_linking.receiver_collection = collection([room.boxes[1]], "EXCLUDE")
    np.testing.assert_array_equal(own, room.render(4, SIZE)["combined"])


def test_a_collection_without_members_changes_nothing(room):
    plain = room.render(4, SIZE)
    room.lamp.light_linking.receiver_collection = collection([])
    room.lamp.light_linking.blocker_collection = collection([])
    linked_to_nothing = room.render(4, SIZE)
    for name in plain:
        np.testing.assert_array_equal(linked_to_nothing[name], plain[name])


def snapshot_of(stage):
    return take(bpy.context.evaluated_depsgraph_get(), SnapshotCache(), *SIZE)


def test_scenes_without_links_have_no_bits(room):
    found = snapshot_of(room)
    rows = [e.row(e.centre, 0, 1) for e in (lights.emitter(one, np.zeros(3)) for one in found.lights)]
    assert not linked.has_links(rows)
    assert all(one.links is found.instances[0].links for one in found.instances)


def test_more_groups_than_there_are_bits_are_named(room):
    for number in range(MOST_GROUPS + 1):
        lamp = room.light("POINT", (number, 0, 3))
        lamp.light_linking.receiver_collection = collection([box(room, 3.0 + number)])
    found = snapshot_of(room)
    assert any(f"more than {MOST_GROUPS}" in note.text for note in found.notes)
    assert all(group < MOST_GROUPS for light in found.lights for group in light.links.unlit)


def test_what_is_not_followed_is_said(room):
    lit_alone(room, room.lamp)
    assert any("caustics do not follow shadow linking" in note.text for note in snapshot_of(room).notes)


def test_an_instance_is_linked_as_its_parent_is_before_itself():
    """A copy follows its instancer where that stands in a collection; else what is said of the object itself."""
    table = LinkTable(receivers={1: 1, 2: 2}, blockers={1: 3}, others=(0, 0), unlit={9: (2,)}, passing={})
    assert (table.of(1, 0).receiver, table.of(1, 2).receiver, table.of(1, 7).receiver) == (1, 2, 1)
    assert table.of(1, 2).blocker == 3, "of blockers the parent says nothing"
    assert table.of(9, 0).unlit == table.of(1, 9).unlit == (2,)


def waxen(stage):
    wax = stage.principled(
        Base_Color=(0.8, 0.8, 0.8, 1), Subsurface_Weight=1.0, Subsurface_Scale=4.0, Subsurface_Radius=(1, 1, 1),
        Specular_IOR_Level=0.0,
    )  # fmt: skip
    wax.node_tree.nodes[0].subsurface_method = "BURLEY"
    return wax


def test_a_lamp_that_leaves_out_wax_lights_no_side_of_it(stage):
    """Points of the mesh that the camera does not see have links, too; a lamp behind lights the other object alone."""
    wax = waxen(stage)
    body, other = box(stage, 0.0), box(stage, 5.0)
    body.data.materials[0] = wax
    stage.light("POINT", (1.0, -2.0, 1.5))
    stage.camera((0, -4, 0.5), (np.pi / 2, 0, 0), angle=0.4)
    alone = stage.render(1, (24, 24))["combined"][..., :3]
    behind = stage.light("POINT", (0, 2, 0.5), energy=500)
    both_lamps = stage.render(1, (24, 24))["combined"][..., :3]
    behind.light_linking.receiver_collection = collection([other])
    left_out = stage.render(1, (24, 24))["combined"][..., :3]
    bpy.data.collections.remove(behind.light_linking.receiver_collection)
    assert both_lamps.mean() > 1.2 * alone.mean()
    assert left_out == pytest.approx(alone, rel=0.02, abs=1e-4)


@pytest.mark.parametrize("by_mesh", [False, True])
def test_what_a_light_does_not_take_as_a_blocker_leaves_its_light_to_the_far_sides_of_wax(stage, by_mesh):
    """Points of the mesh that the camera does not see are lit past a board whose shadow the lamp, or the mesh that
    shines, does not throw."""
    wax = waxen(stage)
    body = box(stage, 0.0)
    body.data.materials[0] = wax
    if by_mesh:
        behind = box(stage, 0.0)
        behind.location.y, behind.data.materials[0] = 4.0, stage.material("ShaderNodeEmission", Strength=30.0)
    else:
        behind = stage.light("POINT", (0, 3, 0.5), energy=500)
    stage.camera((0, -4, 0.5), (np.pi / 2, 0, 0), angle=0.4)
    alone = stage.render(1, (24, 24))["combined"][..., :3]
    board = box(stage, 0.0)
    board.location.y = 2.0
    shadowed = stage.render(1, (24, 24))["combined"][..., :3]
    behind.light_linking.blocker_collection = collection([body, behind] if by_mesh else [body])
    passed = stage.render(1, (24, 24))["combined"][..., :3]
    bpy.data.collections.remove(behind.light_linking.blocker_collection)
    assert shadowed.mean() < 0.5 * alone.mean()
    assert passed.mean() == pytest.approx(alone.mean(), rel=0.02)


def test_lamps_shine_into_volumes_that_they_light_alone(room):
    """In Cycles a volume is the receiver. Of two volumes of which one is lit both are, with a sentence."""
    mist = room.material("ShaderNodeVolumeScatter", Density=0.2)
    tree = mist.node_tree
    out = next(node for node in tree.nodes if node.type == "OUTPUT_MATERIAL")
    scatter = next(node for node in tree.nodes if node.type == "VOLUME_SCATTER")
    for link in list(out.inputs["Surface"].links):
        tree.links.remove(link)
    tree.links.new(scatter.outputs[0], out.inputs["Volume"])
    fog = box(room, 0.0)
    fog.data.materials[0] = mist
    bpy.data.objects.remove(next(one for one in room.scene.objects if one.type == "LIGHT" and one.data.type == "SUN"))
    assert room.render(2, (16, 12))["volume_direct"].max() > 0.0
    room.lamp.light_linking.receiver_collection = collection([fog], "EXCLUDE")
    assert room.render(2, (16, 12))["volume_direct"].max() == 0.0
    second = box(room, 1.0)
    second.data.materials[0] = mist
    assert room.render(2, (16, 12))["volume_direct"].max() > 0.0
    assert any("some volumes" in note.text for note in room.ledger.notes)


def test_mirrors_show_what_a_light_leaves_out_in_the_dark(room):
    """Of a wall that no light reaches nothing is seen in gloss before it, which is too rough to throw caustics."""
    for one in (*room.boxes, room.ground):
        bpy.data.objects.remove(one)
    bpy.data.objects.remove(next(one for one in room.scene.objects if one.type == "LIGHT" and one.data.type == "SUN"))
    room.rectangle((-4, -4), (4, 4), material=room.principled(Metallic=1.0, Roughness=THROWS + 0.1))
    wall = room.rectangle((-4, 0), (4, 4), material=room.diffuse(0.8), location=(0, 3, 0), turn=(np.pi / 2, 0, 0))
    seen = [room.render(2, (16, 12), bounces=1)["glossy_indirect"].max()]
    room.lamp.light_linking.receiver_collection = collection([wall], "EXCLUDE")
    seen.append(room.render(2, (16, 12), bounces=1)["glossy_indirect"].max())
    assert seen[0] > 0.01 and seen[1] == 0.0


def test_a_mirror_shows_a_board_dark_that_a_lamp_touching_it_leaves_out(room):
    """Rays that look for emissive triangles close to what a mirror shows would not tell which mesh they meet."""
    for one in (*room.scene.objects,):
        bpy.data.objects.remove(one)
    shining = room.material("ShaderNodeEmission", Strength=100.0)
    lamp = room.mesh([(-1, 0, 1), (1, 0, 1), (1, 0, 0.99), (-1, 0, 0.99)], [(0, 1, 2, 3)], material=shining)
    corners = [(-1, -1, 1), (1, -1, 1), (1, 1, 1), (-1, 1, 1)]
    board = room.mesh(corners, [(0, 1, 2, 3)], material=room.diffuse(1.0))
    room.rectangle((-1, -1), (1, 1), material=room.principled(Metallic=1.0, Roughness=0.0))
    camera = room.camera((0, 0, 0.5), (0, 0, 0))
    camera.data.type, camera.data.ortho_scale = "ORTHO", 0.2
    seen = []
    for links in (None, collection([board], "EXCLUDE")):
        lamp.light_linking.receiver_collection = links
        seen.append(room.render(4, (12, 12), bounces=1)["glossy_indirect"][5:7, :, :3].mean())
    assert seen[0] > 0.5 and seen[1] == 0.0


def test_a_weak_lamp_touching_a_board_that_it_leaves_out_is_not_found_beside_a_strong_one(room):
    """On which most samples draw all of their points: those of the weak one would tell of its links."""
    for one in (*room.scene.objects,):
        bpy.data.objects.remove(one)
    weak, strong = (room.material("ShaderNodeEmission", Strength=strength) for strength in (1.0, 1000.0))
    touching = room.mesh([(-1, 0, 1), (1, 0, 1), (1, 0, 0.99), (-1, 0, 0.99)], [(0, 1, 2, 3)], material=weak)
    room.rectangle((-1, -1), (1, 1), material=strong, location=(20, 0, -5))
    corners = [(-1, -1, 1), (1, -1, 1), (1, 1, 1), (-1, 1, 1)]
    board = room.mesh(corners, [(0, 1, 2, 3)], material=room.diffuse(1.0))
    room.rectangle((-1, -1), (1, 1), material=room.principled(Metallic=1.0, Roughness=0.0))
    camera = room.camera((0, 0, 0.5), (0, 0, 0))
    camera.data.type, camera.data.ortho_scale = "ORTHO", 0.2

    def seen():
        return room.render(4, (12, 12), bounces=1)["glossy_indirect"][5:7, :, :3].mean()

    lit = seen()
    touching.light_linking.receiver_collection = collection([board], "EXCLUDE")
    left_out = seen()
    touching.hide_render = True
    expected = seen()
    print(f"{lit:.4f}, left out {left_out:.4f}, without the lamp {expected:.4f}")
    assert lit > 1.1 * expected and left_out == pytest.approx(expected, rel=0.05)
