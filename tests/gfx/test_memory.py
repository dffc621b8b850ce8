"""What a process keeps from picture to picture is bounded: programs, images of the pool, sessions of scenes."""

import bpy
import numpy as np
import pytest

from addon import engine
from addon.gfx import context, images, library, passes


@pytest.fixture
def few_programs(gpu_context, monkeypatch):
    monkeypatch.setattr(library, "_shaders", {})
    monkeypatch.setattr(library, "MOST_PROGRAMS", 5)


def program(number):
    text = f"void main() {{ out_color = vec4({number}.0); }}\n"
    return passes.fullscreen_program(
        f"kept {number}", "generated/kept", snippets=(("generated/kept", text),), outputs=(("VEC4", "out_color"),)
    )


@pytest.mark.slow
def test_programs_that_no_recent_picture_used_make_room(few_programs):
    for number in range(20):
        context.begin_picture()
        library.get(program(0))
        library.get(program(1 + number))
    assert library.kept() <= 5 + context.RECENT
    compiled = library.compile_count
    library.get(program(0))
    library.get(program(20))
    assert library.compile_count == compiled, "what pictures go on using stays"
    library.get(program(1))
    assert library.compile_count == compiled + 1, "the oldest one had gone"


@pytest.mark.parametrize(("lavapipe", "kept"), [(True, 4 + context.RECENT), (False, 20)])
def test_a_driver_that_holds_programs_in_much_memory_keeps_fewer(few_programs, monkeypatch, lavapipe, kept):
    monkeypatch.setattr(context, "is_lavapipe", lambda: lavapipe)
    monkeypatch.setattr(library, "MOST_PROGRAMS", 20)
    monkeypatch.setattr(library, "MOST_IN_LAVAPIPE", 4)
    for number in range(20):
        context.begin_picture()
        library.get(program(number))
    assert library.kept() <= kept and (lavapipe or library.kept() == kept)
    assert all(library.has(program(number)) for number in range(20 - context.RECENT, 20)), "of recent pictures"


def test_a_picture_of_many_programs_keeps_them_all(few_programs):
    for _ in range(2 * context.RECENT):
        context.begin_picture()
        for number in range(12):
            library.get(program(number))
    assert library.kept() == 12


def test_a_program_that_was_freed_draws_again(few_programs):
    target = images.Target((images.create(2, 2, "RGBA32F"),))
    for number in (*range(10), 3):
        for _ in range(context.RECENT):
            context.begin_picture()
        passes.fullscreen(program(number), target)
        assert np.all(images.read(target.colors[0]) == number)


def test_images_of_a_size_that_is_not_asked_for_any_more_are_freed(gpu_context):
    pool = images.Pool()
    pool.give(pool.take(8, 4, "R32F"))
    usual = pool.take(16, 4, "R32F")
    for _ in range(context.RECENT + 2):
        context.begin_picture()
        pool.free_old()
        pool.give(usual)
        assert pool.take(16, 4, "R32F") is usual
    assert pool.allocated_bytes == usual.bytes


def test_a_file_of_many_scenes_keeps_the_sessions_of_the_last(registered):
    scenes = []
    try:
        for number in range(engine.MOST_SESSIONS + 3):
            scene = bpy.data.scenes.new(f"Kept {number}")
            scenes.append(scene)
            scene.render.engine = "CANDELA"
            scene.render.resolution_x, scene.render.resolution_y, scene.candela.samples = 8, 6, 1
            camera = bpy.data.objects.new(scene.name, bpy.data.cameras.new(scene.name))
            scene.collection.objects.link(camera)
            scene.camera = camera
            bpy.ops.render.render(scene=scene.name)
            assert len(engine._sessions) <= engine.MOST_SESSIONS
        assert (scenes[-1].session_uid, "final") in engine._sessions
    finally:
        for scene in scenes:
            bpy.data.scenes.remove(scene)
