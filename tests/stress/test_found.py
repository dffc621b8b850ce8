"""Scenes that generated pictures once failed on: sound, and the same in another order of objects.

A file opened here ends the scene that test_generated.py keeps, hence a module of its own.
"""

from __future__ import annotations

import bpy
import pytest

from addon import engine
from addon.frame import ledger
from tests.stress.test_generated import FOUND, SIZE, same_but_for_edges, sound


@pytest.mark.parametrize("path", sorted(FOUND.glob("*.blend")), ids=lambda path: path.stem)
def test_what_was_once_found_stays_mended(registered, path):
    from addon.compare.reference import render_passes

    def drawn():
        engine.free_sessions()
        images = render_passes(bpy.context.scene, "CANDELA", 2, 0, direct_only=False, size=SIZE).images
        assert ledger.latest().bad_pixels == 0
        return images

    bpy.ops.wm.open_mainfile(filepath=str(path))
    first = drawn()
    sound(first)
    objects = bpy.context.scene.collection.objects
    things = list(objects)
    for thing in things:
        objects.unlink(thing)
    for k, thing in enumerate(things[::-1]):
        thing.name = f"{997 * k % 1009:04d}"
        objects.link(thing)
    assert same_but_for_edges(first["combined"], drawn()["combined"])
