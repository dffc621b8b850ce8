"""What a moving view remembers: less noise, nothing of another light, and a picture at rest as without."""

from dataclasses import replace

import bpy
import numpy as np
import pytest

from addon import techniques
from addon.frame import history
from addon.frame.run import Renderer
from addon.gfx import images
from addon.lighting import probes
from addon.snapshot import SnapshotCache, camera_of_scene, take
from addon.snapshot.scene import Light
from addon.techniques.history import FEW, LAMPS, _between, _into_box, _outruns_penumbra, _sphere, _straight_light
from addon.ui.properties import settings_of
from tests.viewport.region import Region

SIZE = (32, 24)


@pytest.fixture
def drafts(scene):
    """Draws a draft of the scene as it is; returns the frame."""
    renderer, cache = Renderer(techniques.make_registry), SnapshotCache()

    def draw(moved=0.0, **changed):
        graph = bpy.context.evaluated_depsgraph_get()
        graph.update()
        cache.doubt()
        camera = camera_of_scene(scene, graph, *SIZE)
        matrix = camera.matrix.copy()
        matrix[:3, 3] += moved * matrix[:3, 0]
        snapshot = take(graph, cache, *SIZE, view=replace(camera, matrix=matrix))
        settings = replace(settings_of(scene, viewport=True), samples=1, bounces=1, **changed).as_draft()
        frame = renderer.begin(snapshot, settings)
        renderer.advance(frame)
        return frame

    yield draw
    renderer.release()


def samples_behind(frame):
    """(H, W) pictures that stand behind indirect light; 0 where nothing is seen."""
    return images.read(frame.images["history.facing"])[..., 2]


def test_pictures_of_a_moving_view_add_up(drafts):
    for k in range(4):
        frame = drafts(moved=0.01 * k)
    counts = samples_behind(frame)
    assert frame.before.turn == 3
    assert np.median(counts[counts > 0]) == pytest.approx(4.0, abs=0.1)
    seeds = [history.seeded(frame.settings, replace(frame.before, turn=k)).seed for k in range(1, 1001)]
    assert len({int(seed) for seed in seeds}) == 1000, "noise of two pictures is the same"


@pytest.mark.parametrize(("name", "value"), [("energy", 2000.0), ("color", (1.0, 0.2, 0.1)), ("shadow_soft_size", 2.0)])
def test_an_edit_of_a_lamp_gives_history_up(scene, drafts, name, value):
    drafts()
    drafts(moved=0.01)
    setattr(next(one for one in scene.objects if one.type == "LIGHT").data, name, value)
    frame = drafts(moved=0.02)
    assert frame.before is None and samples_behind(frame).max() == 1.0


def test_a_lamp_that_moves_keeps_as_much_history_as_it_leaves_light_alike(scene, drafts):
    lamp = next(one for one in scene.objects if one.type == "LIGHT")
    for _ in range(6):
        lamp.location.x += 0.02
        frame = drafts()
    assert len(frame.before.lamps) == 1 and frame.before.turn == 5
    assert 2.0 < samples_behind(frame).max() <= LAMPS + 1
    lamp.location.x += 50.0
    frame = drafts()
    assert samples_behind(frame).max() < 1.5


def test_light_lags_by_three_steps_at_most_behind_a_lamp_that_moves(scene, drafts):
    """As the lamp rises its light fades: what is shown has less of it than the scene had three steps before."""
    lamp = next(one for one in scene.objects if one.type == "LIGHT")
    height, light = lamp.location.z, {}
    for joined in (True, False):
        light[joined] = []
        for k in range(8):
            lamp.location.z = height + 0.1 * k
            # After another setting there is no history.
            frame = drafts(values={("instant_radiosity", "rays"): 2 if joined else 3 + k})
            light[joined].append(float(images.read(frame.images["history.direct"])[..., :3].mean()))
        assert (samples_behind(frame).max() > 1.0) == joined
    assert np.all(np.diff(light[False][-4:]) < 0.0)
    assert light[False][-1] < light[True][-1] < light[False][-4]


def test_a_lamp_outruns_its_penumbra_where_three_steps_are_wider_than_it():
    there = np.eye(4)
    there[0, 3] = 0.1
    lamp = Light("a", "a", "AREA", np.eye(4), np.ones(3), size=(2.0, 0.25))
    assert _outruns_penumbra(lamp, replace(lamp, matrix=there))
    assert not _outruns_penumbra(lamp, replace(lamp, matrix=there, size=(2.0, 0.5)))
    turned = np.eye(4)
    turned[:3, 2] = np.sin(0.01), 0.0, np.cos(0.01)
    sun = replace(lamp, kind="SUN", angle=0.009)
    assert _outruns_penumbra(sun, replace(sun, matrix=turned))
    assert not _outruns_penumbra(replace(sun, angle=0.1), replace(sun, angle=0.1, matrix=turned))


def test_light_of_a_lamp_follows_the_inverse_square():
    """Closed form: half as far, four times as strong, from where the lamp stands; a sun's is the same everywhere."""
    matrix = np.eye(4)
    matrix[:3, 3] = 0.0, 0.0, 4.0
    places = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 2.0]])
    lamp = Light("a", "a", "POINT", matrix, np.full(3, 4.0 * np.pi))
    np.testing.assert_allclose(_straight_light(lamp, places), [(0, 0, -1 / 16), (0, 0, -1 / 4)], atol=1e-12)
    sun = replace(lamp, kind="SUN")
    np.testing.assert_allclose(_straight_light(sun, places), np.tile([0.0, 0.0, -4.0 * np.pi], (2, 1)), atol=1e-12)


def test_history_moves_with_an_object(drafts):
    """A cube that goes along with the camera keeps what it had; where it was is new."""
    drafts()
    bpy.data.objects["Cube"].location.x += 0.4
    frame = drafts()
    counts = samples_behind(frame)
    assert list(frame.before.moved) and 0.02 < (counts == 1.0).mean() < 0.4
    assert (counts == 2.0).mean() > 0.3


def test_picture_at_rest_is_as_without_history(scene, region):
    pictures = []
    for k in range(3):
        region.draw(region.moved(0.02 * k))
    region.camera = region.moved(0.04)
    pictures.append(region.rest())
    scene.candela.history_drafts = False
    other = Region()
    other.camera = region.camera
    pictures.append(other.rest())
    other.viewport.release()
    np.testing.assert_array_equal(*pictures)


def test_matrices_take_places_to_where_they_were():
    """Closed form: a turn by 90 degrees about z and a step of 2 m, seen from two origins."""
    turned = np.array([[0.0, -1.0, 0.0, 2.0], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
    rows = _between(turned, np.array([10.0, 0.0, 0.0]), np.array([0.0, 5.0, 0.0]))
    np.testing.assert_allclose(rows @ (1.0, 0.0, 3.0, 1.0), (2.0, 11.0 - 5.0, 3.0))

    class Box:
        bounds_min, bounds_max = np.array([-1.0, -1.0, 0.0]), np.array([3.0, 1.0, 2.0])

    inside = _into_box(turned, Box, np.zeros(3)) @ (*(turned @ (1.0, 0.0, 1.0, 1.0))[:3], 1.0)
    np.testing.assert_allclose(inside, 0.0, atol=1e-12)
    edge = _into_box(turned, Box, np.zeros(3)) @ (*(turned @ (3.0, 0.0, 1.0, 1.0))[:3], 1.0)
    assert 0.9 < edge[0] < 1.0  # the box is a little larger than its object


def test_cameras_side_by_side_have_the_same_probes(drafts, monkeypatch):
    """They stand in cells of space: one that moves by a tenth of a probe's share of the picture keeps most of them."""
    found, find = [], probes.find
    monkeypatch.setattr(probes, "find", lambda *a: found.append(find(*a)) or found[-1])
    places = []
    for k in range(2):
        drafts(moved=0.03 * k, values={("history", "drafts"): False})  # with it each picture has a seed of its own
        row = images.read(found[-1]["probe_places"])[0]
        places.append({int(one[3]): one[:3] for one in row if one[3] > 0})
    first, second = places
    common = set(first) & set(second)
    assert len(first) > 20 and len(common) > 0.6 * len(first)
    apart = [np.linalg.norm(first[one] - second[one]) for one in common]
    assert np.median(apart) < 0.05


def test_light_is_kept_near_fresh_light_only_where_something_moves_before_a_lamp(scene, drafts):
    """A cube that moves on the floor's one side leaves the history of the other side alone: FEW is no limit there."""
    bpy.data.objects["Cube"].location.x -= 0.5
    for _ in range(12):
        bpy.data.objects["Cube"].location.x += 0.02
        frame = drafts()
    counts = images.read(frame.images["history.place"])[..., 3]
    assert frame.before.moved and counts.max() == pytest.approx(12.0)
    assert 0.05 < (counts[counts > 0] <= FEW + 1).mean() < 0.95


def test_a_shadow_does_not_stay_where_a_moving_object_no_longer_throws_it(scene, drafts):
    """Of what the light changed by in three steps about a fifth is left, where it is lit or shadowed anew; a quarter
    where history only stayed within the spread of fresh light. What is true: the mean of drafts without history."""
    lamp = next(one for one in scene.objects if one.type == "LIGHT")
    lamp.data.shadow_soft_size = 0.6
    cube, shown, true, number = bpy.data.objects["Cube"], {}, {}, 0
    cube.location.z += 1.0
    for step in range(10):
        cube.location.x += 0.1
        shown[step] = images.read(drafts().images["history.direct"])[..., :3].mean(axis=2)
    for step in (6, 9):
        cube.location.x += 0.1 * (step - 9)
        drawn = []
        for _ in range(32):
            number += 1  # another setting: no history, another seed
            frame = drafts(seed=number, values={("instant_radiosity", "rays"): 2 + number % 2})
            assert samples_behind(frame).max() == 1.0
            drawn.append(images.read(frame.images["history.direct"])[..., :3].mean(axis=2))
        true[step] = np.mean(drawn, axis=0)
        cube.location.x -= 0.1 * (step - 9)
    change = true[6] - true[9]
    far = np.abs(change) > 0.3 * true[9].max()
    assert far.sum() > 10
    left = ((shown[9] - true[9]) * np.sign(change))[far].sum() / np.abs(change)[far].sum()
    assert left < 0.22


def test_history_counts_by_how_much_of_a_place_shows_the_surface(drafts):
    """Between the pixels of the picture before, of which some show another surface next to outlines."""
    drafts()
    counts = samples_behind(drafts(moved=0.01))
    counts = counts[counts > 0]
    assert np.median(counts) == pytest.approx(2.0)
    assert 0.02 < ((counts > 1.05) & (counts < 1.95)).mean() < 0.3


def test_a_box_is_within_a_sphere_that_moves_with_it():
    """Closed form: a box of 2 x 4 x 4 m whose middle was 2 m to the side, seen from an origin 10 m away."""

    class Box:
        bounds_min, bounds_max = np.array([-1.0, 0.0, -2.0]), np.array([1.0, 4.0, 2.0])

    then = np.eye(4)
    then[0, 3] = -2.0
    found = _sphere(then, np.eye(4), Box, np.array([10.0, 0.0, 0.0]))
    np.testing.assert_allclose(found, [(-10.0, 2.0, 0.0, 3.0), (2.0, 0.0, 0.0, 0.0)])


def test_bounced_light_far_from_what_moves_counts_for_more_pictures(scene, drafts):
    """A small step of the cube changes little of the hemisphere of the floor's corners, and more beside it."""
    for _ in range(14):
        bpy.data.objects["Cube"].location.x += 0.02
        frame = drafts()
    counts = samples_behind(frame)
    assert counts.max() > FEW + 3.0
    assert ((counts > 0) & (counts <= FEW + 1.0)).mean() > 0.01


def test_bounced_light_of_what_emits_and_moves_counts_for_few_pictures_everywhere(scene, drafts):
    """Far from it, too, its light changes by more than what it covers of the hemisphere."""
    material = bpy.data.materials.new("Glow")
    material.use_nodes = True
    material.node_tree.nodes["Principled BSDF"].inputs["Emission Color"].default_value = (1.0, 1.0, 1.0, 1.0)
    material.node_tree.nodes["Principled BSDF"].inputs["Emission Strength"].default_value = 20.0
    cube = bpy.data.objects["Cube"]
    cube.data.materials.clear()
    cube.data.materials.append(material)
    for _ in range(14):
        cube.location.x += 0.02
        frame = drafts()
    assert 1.0 < samples_behind(frame).max() <= FEW + 1.0
