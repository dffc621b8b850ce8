"""Undo among pass trees and their images: what a step does not know of must not be there, or Blender crashes.

Blender's undo takes data-blocks over that are the same in both states. One that a script has made without a step is in
neither, is freed, and what points to it points to nothing. So everything of Candela's that makes a data-block makes a
step too.
"""

import contextlib
import random

import bpy
import numpy as np
import pytest

from addon import engine
from addon.ui import ENGINE, pass_tree, shown_images

STEPS = 60
NAME = "Candela Shown"


@pytest.fixture
def undoable(registered, gpu_context, empty_scene):
    """A triangle before a camera, and the first step."""
    mesh = bpy.data.meshes.new("Triangle")
    mesh.from_pydata([(-1, -1, 0), (1, -1, 0), (0, 1, 0)], [], [(0, 1, 2)])
    empty_scene.collection.objects.link(bpy.data.objects.new("Triangle", mesh))
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location.z = 4
    empty_scene.collection.objects.link(camera)
    empty_scene.camera = camera
    empty_scene.render.engine, empty_scene.candela.bounces = ENGINE, 0
    empty_scene.render.resolution_x, empty_scene.render.resolution_y = 16, 16
    push("begin")
    yield
    engine.free_sessions()


def push(message):
    bpy.ops.ed.undo_push(message=message)


def make_tree():
    bpy.ops.candela.passes_from_auto(use=True)
    push("New from Auto")  # as the button does
    bpy.context.scene.candela.pass_tree.samples = 1
    push("Samples")


def test_image_of_a_run_is_a_step_of_its_own(undoable):
    make_tree()
    bpy.ops.candela.passes_run()
    assert "Candela Passes" in bpy.data.images
    bpy.ops.ed.undo()
    assert "Candela Passes" not in bpy.data.images
    assert bpy.context.scene.candela.pass_tree.samples == 1
    bpy.ops.ed.redo()
    assert "Candela Passes" in bpy.data.images
    tree = bpy.context.scene.candela.pass_tree
    assert pass_tree.result(next(node for node in tree.nodes if node.bl_idname == "CandelaPassOutput")) is not None


def test_second_run_is_no_step(undoable):
    make_tree()
    bpy.ops.candela.passes_run()
    bpy.ops.candela.passes_run()
    bpy.ops.ed.undo()
    assert "Candela Passes" not in bpy.data.images


def bake():
    make_tree()
    bpy.ops.candela.passes_run()
    node = next(node for node in bpy.context.scene.candela.pass_tree.nodes if node.bl_idname == "CandelaPassOutput")
    return bpy.ops.candela.passes_bake("EXEC_DEFAULT", True, node=node.name)


def maps():
    triangle = bpy.data.objects["Triangle"]
    triangle.data.uv_layers.new()
    triangle.data.materials.append(bpy.data.materials.new("Skin"))
    bpy.context.view_layer.objects.active = triangle
    push("Skin")
    return bpy.ops.candela.new_translucency_maps("EXEC_DEFAULT", True, size=16)


def eye():
    bpy.context.scene.camera.data.candela.eye_side = "128"
    push("Side")
    return bpy.ops.candela.eye_pictures("EXEC_DEFAULT", True)


def from_auto():
    return bpy.ops.candela.passes_from_auto("EXEC_DEFAULT", True, use=True)


@pytest.mark.parametrize("call", [eye, maps, from_auto, bake])
def test_what_an_operator_makes_is_a_step(undoable, call):
    """`True` has Blender push the step as for a button, which it does if the operator declares UNDO."""

    def blocks():
        return {one.name for kind in (bpy.data.images, bpy.data.node_groups) for one in kind}

    assert call() == {"FINISHED"}
    made = blocks()
    bpy.ops.ed.undo()
    before = blocks()
    assert before < made
    bpy.ops.ed.redo()
    assert blocks() == made


@pytest.mark.parametrize("float_buffer", [False, True])
def test_an_image_beside_one_of_the_artists_own_is_a_step_and_one_only(undoable, float_buffer):
    """An artist's image stays as it is, whatever its name: one of bytes, or a map that was painted."""
    own = bpy.data.images.new(NAME, 4, 4, float_buffer=float_buffer)
    push("Own")
    picture = np.full((8, 8, 3), 2.0, np.float32)
    shown = [shown_images.show(bpy.context, NAME, picture).name for _ in range(2)]
    assert shown == [f"{NAME}.001"] * 2 and tuple(own.size) == (4, 4)
    bpy.ops.ed.undo()
    assert [image.name for image in bpy.data.images if image.name.startswith(NAME)] == [NAME]


def test_random_walk_of_trees_runs_edits_and_undo(undoable):
    """A pointer to a freed tree ends this process."""
    dice = random.Random(6)

    def tree():
        candela = bpy.context.scene.candela
        if candela.pass_tree is None:
            make_tree()
        else:
            candela.pass_tree = None
            push("No tree")

    def remove():
        groups = bpy.data.node_groups
        if groups:
            groups.remove(dice.choice(list(groups)))
            push("Remove")

    def link():
        found = bpy.context.scene.candela.pass_tree
        if found is not None and found.links:
            found.links.remove(dice.choice(list(found.links)))
            push("Unlink")

    def run():
        with contextlib.suppress(RuntimeError):  # no tree, or one that lacks a link: refused with a sentence
            bpy.ops.candela.passes_run()

    def move():
        bpy.data.objects["Triangle"].location.x += 0.1
        push("Move")

    def undo():
        if bpy.ops.ed.undo.poll():
            bpy.ops.ed.undo()

    def redo():
        if bpy.ops.ed.redo.poll():
            bpy.ops.ed.redo()

    for _ in range(STEPS):
        dice.choice((tree, tree, remove, link, run, move, undo, undo, redo))()
        found = bpy.context.scene.candela.pass_tree
        assert found is None or bpy.data.node_groups.get(found.name) == found
