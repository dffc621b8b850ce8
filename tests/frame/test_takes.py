"""The list of takes of a picture."""

from dataclasses import replace

import numpy as np
import pytest

from addon.film.takes import Picture, takes_of
from addon.snapshot.scene import Camera, Film, Light, Snapshot, World
from addon.snapshot.shutter import Moments

CAMERA = Camera(np.eye(4), "PERSPECTIVE", (-1.0, 1.0, -1.0, 1.0), 0.1, 10.0, "Camera")


def lamp(group):
    return Light(group, group, "POINT", np.eye(4), np.ones(3), group=group)


def scene(*lamps, groups=("key", "fill")):
    film = Film(4, 4, (0, 0, 4, 4), 1.5, light_groups=groups)
    return Snapshot({}, (), (), {}, tuple(map(lamp, lamps)), World(np.zeros(3)), CAMERA, film)


def test_each_eye_has_plates_then_groups():
    eyes = [(name, replace(CAMERA, name=name)) for name in ("left", "right")]
    takes = takes_of(scene("key", "fill", "other"), catches=True, eyes=eyes)
    names = ["all", "plate", "0", "1", "2"]
    assert [take.name for take in takes] == [f"{eye}.{name}" for eye, _ in eyes for name in names]
    assert [take.snapshot.camera.name for take in takes] == ["left"] * 5 + ["right"] * 5
    assert [take.left for take in takes] == [5, 4, 3, 2, 1] * 2
    assert [take.is_plate for take in takes[:5]] == [True, True, False, False, False]
    assert [[one.group for one in take.snapshot.lights] for take in takes[2:5]] == [["key"], ["fill"], ["other"]]
    assert all(len(take.snapshot.lights) == 3 and not take.snapshot.film.light_groups for take in takes[:2])


def test_a_group_that_shines_at_one_moment_alone_has_a_take_with_all_moments():
    moments = Moments((scene("key"), scene("key", "fill")), (0, 1))
    takes = takes_of(scene("key"), moments)
    lit = [[[one.group for one in at.lights] for at in take.moments.snapshots] for take in takes]
    assert lit == [[["key"], ["key"]], [[], ["fill"]]]


def test_the_first_group_tells_all_that_is_no_light():
    whole = scene("key", "fill")
    whole = replace(whole, film=replace(whole.film, indices=True, cryptomattes=("object",)))
    first, second = (take.snapshot.film for take in takes_of(whole))
    assert first is whole.film and second == replace(whole.film, indices=False, cryptomattes=())


def test_a_plain_picture_is_one_take():
    whole = scene("key", groups=())
    (take,) = takes_of(whole)
    assert take.snapshot is whole and (take.name, take.number, take.left) == ("", 0, 1)


def test_light_is_added_up_and_other_images_are_those_of_the_first():
    picture = Picture()
    for k, take in enumerate(takes_of(scene("key", "fill"))):
        picture.add(take, {"film.combined": np.full((1, 1, 4), k + 1.0), "film.depth": np.full((1, 1, 4), k + 1.0)})
    found = picture.with_black({"light group  nobody"})
    assert found["film.combined"][0, 0, :3].tolist() == [3.0] * 3 and found["film.depth"][0, 0, 0] == 1.0
    assert found["light group  fill"].max() == pytest.approx(2.0) and not found["light group  nobody"].any()
