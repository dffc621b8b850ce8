"""Programs that a second process compiles, and what a viewport shows until they are there."""

import json
import os
import pickle
import queue
import subprocess
import sys
import time
from dataclasses import replace
from types import SimpleNamespace

import bpy
import numpy as np
import pytest

from addon.frame.run import Renderer
from addon.gfx import device, images, library
from addon.materials.graph import Graph, Node
from addon.snapshot import SnapshotCache, take
from addon.snapshot.images import byte_shape
from addon.snapshot.scene import Image, Material
from addon.surfaces import first_look
from addon.techniques import make_registry
from addon.ui.properties import settings_of
from addon.viewport import ahead, ahead_worker, chosen
from addon.viewport.ahead import DRAFT, FULL, Ahead, needs_of
from tests.viewport.region import Region
from tests.viewport.test_compiling import material_named


class Slow:
    """Another process that has compiled nothing until it is told."""

    doing = "Compiling shaders for Film (3 so far)"

    def __init__(self):
        self.ready, self.asked = set(), []

    def left(self, renderer, whole, settings, draft, edit=False):
        self.asked.append((whole.film.width, whole.film.height, settings.schedule.is_draft))
        return None if (DRAFT if draft else FULL) in self.ready else 5


@pytest.fixture
def own_folder(tmp_path, monkeypatch):
    monkeypatch.setenv("CANDELA_CACHE", str(tmp_path))
    return tmp_path


def test_view_shows_a_first_look_then_direct_light_then_all_as_the_other_process_gets_ready(region):
    viewport = region.viewport
    viewport.ahead = slow = Slow()
    region.draw()
    assert viewport.looks and viewport.picture is not None and viewport.frame is None  # nothing else in the same redraw
    region.draw(region.moved(0.1))  # the first look follows the view
    for _ in range(20):
        region.clock.now += 1.0
        region.draw()
    assert viewport.held and viewport.direct and not viewport.looks and not viewport.done
    assert viewport.scale > 1 and viewport.frame.settings.bounces == 0
    assert viewport.status() == f"{slow.doing}, direct light only meanwhile"
    region.draw(region.moved(0.1))  # so does the picture without indirect light
    assert viewport.direct and viewport.frame.settings.bounces == 0
    assert not viewport.frame.plan.runs("traced_glossy")
    slow.ready.add(DRAFT)
    for _ in range(20):
        region.clock.now += 1.0
        region.draw()
    assert viewport.held and not viewport.direct and viewport.scale > 1 and viewport.frame.settings.bounces > 0
    slow.ready.add(FULL)
    held = region.rest()
    assert slow.asked[-1][:2] == viewport.frame.size and not slow.asked[-1][2]
    free = Region()
    assert np.array_equal(held, free.rest())
    free.viewport.release()


def test_an_update_that_changes_nothing_leaves_direct_light_as_it_is(region):
    region.viewport.ahead = Slow()
    for _ in range(20):
        region.clock.now += 1.0
        region.draw()
    frame = region.viewport.frame
    region.viewport.dirty = True
    for _ in range(10):
        region.clock.now += 1.0
        region.draw()
    assert region.viewport.frame is frame and region.viewport.held and region.viewport.direct


def test_without_bounces_nothing_is_left_out(region, scene):
    scene.candela.bounces = 0
    region.viewport.ahead = slow = Slow()
    for _ in range(20):
        region.clock.now += 1.0
        region.draw()
    assert region.viewport.held and not region.viewport.direct
    slow.ready.add(FULL)
    region.rest()


def test_an_edit_that_needs_other_programs_shows_its_direct_light_first(region):
    region.rest()
    region.viewport.ahead = other = Slow()
    bpy.context.scene.objects["Point"].data.type = "SUN"
    region.viewport.dirty = True
    for _ in range(20):
        region.clock.now += 1.0
        region.draw()
    assert region.viewport.held and region.viewport.direct and not region.viewport.looks
    other.ready |= {DRAFT, FULL}
    edited = region.rest()
    free = Region()
    assert np.array_equal(edited, free.rest())
    free.viewport.release()


def test_an_edit_of_a_material_alone_does_not_wait_for_another_process(region, own_folder, monkeypatch):
    """Its own programs are few and small: compiled here they are there sooner than a second Blender has read it."""
    monkeypatch.setattr(Ahead, "_start", lambda self: None)
    monkeypatch.setattr(ahead, "_send", lambda *_: None)
    region.rest()
    viewport, other = region.viewport, Ahead()
    seen, settings = viewport.frame.snapshot, viewport.frame.settings
    *_, features = needs_of(viewport.renderer, seen, settings)
    other._remember({f"{ahead._digest(features)} {stage}" for stage in (DRAFT, FULL)})
    assert other.left(viewport.renderer, seen, settings, True, edit=True) is None
    assert other.left(viewport.renderer, seen, settings, True) is not None


@pytest.mark.parametrize(
    "content", ["[1, 2]", "null", '{"DRIVER": 7}', '{"DRIVER": [[], "a", 3]}', "[" * 100_000, "{", "\x00"]
)
def test_a_damaged_file_of_what_was_compiled_is_as_none(own_folder, gpu_context, content):
    (own_folder / "candela_programs.json").write_text(content.replace("DRIVER", ahead._driver()), encoding="utf-8")
    assert Ahead()._remembered() <= {"a"}


def test_a_folder_that_the_user_names_keeps_its_own_files(own_folder, gpu_context):
    """What is kept there bears Candela's name: whatever else lies there is neither replaced nor deleted."""
    for name in ("devices.json", "compiled_ahead.json", "programs.json"):
        (own_folder / name).write_text("mine")
    Ahead()._remember({"a draft"})
    device.write(own_folder, device.MADE_UP["card"])
    device.forget(own_folder)
    assert Ahead()._remembered() == {"a draft"}
    names = {one.name for one in own_folder.iterdir() if not one.name.startswith("candela_")}
    assert names == {"devices.json", "compiled_ahead.json", "programs.json"}
    assert all((own_folder / name).read_text() == "mine" for name in names)


def needs(region):
    region.viewport.dirty = True
    region.rest()
    viewport = region.viewport
    return set(map(repr, needs_of(viewport.renderer, viewport.frame.snapshot, viewport.frame.settings)))


def test_what_needs_programs_is_told_from_what_does_not(region):
    first = needs(region)
    cube, lamp = bpy.context.scene.objects["Cube"], bpy.context.scene.objects["Point"]
    cube.location.x += 0.5
    lamp.data.energy *= 2.0
    assert needs(region) == first
    lamp.data.type = "SPOT"
    assert needs(region) != first


def test_a_scene_that_is_handed_over_needs_what_it_needs_here(region):
    region.rest()
    renderer, seen, settings = region.viewport.renderer, region.viewport.frame.snapshot, region.viewport.frame.settings
    there = pickle.loads(pickle.dumps((seen, settings)))
    assert ahead.digests_of(renderer, *there) == ahead.digests_of(renderer, seen, settings)


@pytest.mark.slow
def test_another_process_draws_and_is_remembered(region, own_folder):
    region.viewport.ahead = other = Ahead()
    said, ended = set(), time.monotonic() + 300.0
    while not region.viewport.done and time.monotonic() < ended:
        time.sleep(0.05)
        region.clock.now += 1.0
        region.draw()
        said.add(region.viewport.status().split(" ")[0])
    other.close()
    assert region.viewport.done and not other.failed and "Compiling" in said
    assert (own_folder / "candela_programs.json").exists()
    again = Region()
    again.viewport.ahead = other = Ahead()
    again.rest()  # nothing is waited for
    assert other._process is None
    again.viewport.release()


def test_two_viewports_do_not_take_the_other_process_from_each_other(region, own_folder, monkeypatch):
    begun = []
    monkeypatch.setattr(Ahead, "_start", lambda self: begun.append(self._job.number))
    monkeypatch.setattr(ahead, "_send", lambda *_: None)
    region.rest()
    viewport = region.viewport
    other, settings = Ahead(), viewport.frame.settings
    seen = viewport.frame.snapshot
    lit = replace(seen, lights=tuple(replace(one, kind="SPOT") for one in seen.lights))
    second = type("Renderer", (), {"materials": viewport.renderer.materials, "geometry": viewport.renderer.geometry})()
    for _ in range(3):
        assert other.left(viewport.renderer, seen, settings, True) == 1
        assert other.left(second, lit, settings, True) == 1
    assert begun == [1]
    other._job.asked_at -= 2 * ahead.TURN_S
    other.left(second, lit, settings, True)
    assert begun == [1, 2]


def test_a_picture_that_is_foreseen_is_the_one_that_is_asked_for_or_makes_way(region, own_folder, monkeypatch):
    begun = []
    monkeypatch.setattr(Ahead, "_start", lambda self: begun.append(self._job.number))
    monkeypatch.setattr(ahead, "_send", lambda *_: None)
    region.rest()
    viewport, seen, settings = region.viewport, region.viewport.frame.snapshot, region.viewport.frame.settings

    def told(other, **what):
        other._lines.append(json.dumps({"number": other._job.number, **what}))
        return other.left(viewport.renderer, seen, settings, True)

    other = Ahead()
    other.foresee(seen, settings)
    other.foresee(seen, settings)  # it is being drawn
    assert told(other) == 1 and begun == [1]  # what it needs is not known yet
    assert told(other, needs=ahead.digests_of(viewport.renderer, seen, settings), left=3) == 3 and begun == [1]
    assert told(other, done=DRAFT, lasting=True) is None
    again = Ahead()
    assert told(other, done=FULL, lasting=True) is None
    again.foresee(seen, settings)  # known from before
    assert begun == [1]
    brighter = replace(seen, lights=tuple(replace(one, kind="SPOT") for one in seen.lights))
    again.foresee(brighter, settings)
    assert told(again, needs=["something else"]) is None  # this picture is known, whatever is foreseen
    again._known.clear()
    assert told(again) == 1 and begun == [1, 1, 2]


@pytest.mark.parametrize("large", [True, False])
def test_a_picture_that_is_foreseen_in_vain_is_not_waited_for(region, own_folder, monkeypatch, large):
    """It is too large to be sent, or the other process fails before it knows what it needs."""
    begun = []
    monkeypatch.setattr(Ahead, "_start", lambda self: begun.append(self._job.number))
    monkeypatch.setattr(ahead, "MOST_BYTES", 0 if large else ahead.MOST_BYTES)
    region.rest()
    viewport, seen, settings = region.viewport, region.viewport.frame.snapshot, region.viewport.frame.settings
    other = Ahead()
    other.foresee(seen, settings)
    for stage in () if large else (DRAFT, FULL):
        assert other.left(viewport.renderer, seen, settings, True) == 1
        other._lines.append(json.dumps({"number": 1, "done": stage, "lasting": False}))
    for draft in (True, False, True):
        assert other.left(viewport.renderer, seen, settings, draft) is None
    assert not other.failed and other._jobs == 1 and begun == ([] if large else [1])
    spots = replace(seen, lights=tuple(replace(one, kind="SPOT") for one in seen.lights))
    other.left(viewport.renderer, spots, settings, True)
    assert other._jobs == 2  # another picture has its own try


def test_a_foreseen_picture_is_known_by_content(region):
    region.rest()
    seen, settings = region.viewport.frame.snapshot, region.viewport.frame.settings

    def shown(uid, kind="ShaderNodeTexImage", bits=8):
        graph = Graph({"Tex": Node("Tex", "Tex", kind, {}, image=f"image {uid}")}, ("Tex", "Color"))
        material = Material(f"material {uid}", "M", graph, own_images=(("map", f"image {uid}"),))
        image = Image(f"image {uid}", uid, np.zeros((1, 1, 4), np.float32), bits=bits)
        world = replace(seen.world, graph=graph)
        return replace(seen, materials=(*seen.materials, material), images={image.key: image}, world=world)

    digest = ahead._foreseen(shown(7), settings)
    assert digest == ahead._foreseen(pickle.loads(pickle.dumps(shown(9))), settings)
    moved = replace(settings, seed=5, samples=settings.samples + 1, values={("direct", "rays"): 3})
    assert digest == ahead._foreseen(shown(7), moved)
    assert digest != ahead._foreseen(shown(7), replace(settings, slots={"shadow": "other"}))
    assert digest != ahead._foreseen(shown(7, "ShaderNodeTexEnvironment"), settings)
    assert digest != ahead._foreseen(shown(7, bits=16), settings)


def test_orders_reach_the_other_process_one_after_the_other():
    ends = os.pipe()
    source, sink = os.fdopen(ends[0], "rb"), os.fdopen(ends[1], "wb")
    orders, heard = queue.SimpleQueue(), []
    for order in ([b"one", b"buffer"], [b"two"], None):
        orders.put(order)
    ahead._send(type("Process", (), {"stdin": sink}), orders)
    for count in (2, 1):
        assert int.from_bytes(source.read(8), "little") == count
        heard.append([ahead_worker.part(source) for _ in range(count)])
    assert heard == [[b"one", b"buffer"], [b"two"]]
    sink.close()
    source.close()


def test_what_an_ended_process_said_is_not_the_next_ones(gpu_context, monkeypatch):
    started = subprocess.Popen
    monkeypatch.setattr(
        ahead.subprocess, "Popen", lambda command, **options: started((sys.executable, "-c", ""), **options)
    )
    other = Ahead()
    other._start()
    lines, first = other._lines, other._process
    other._start()
    first.wait()
    assert other._lines is not lines
    other._process.wait()


def test_large_scenes_are_told_without_reading_them(scene, monkeypatch, tmp_path):
    def is_large():
        return chosen._is_large(bpy.context.evaluated_depsgraph_get())

    assert not is_large()
    cube = bpy.context.scene.objects["Cube"]
    made = cube.modifiers.new("Array", "ARRAY")
    made.count = 50
    with monkeypatch.context() as bounds:
        bounds.setattr(chosen, "MOST_FACES", 100)  # the cube has 6 of its own
        assert is_large()
    cube.modifiers.remove(made)
    hair = cube.modifiers.new("Hair", "PARTICLE_SYSTEM")
    hair.particle_system.settings.type, hair.particle_system.settings.count = "HAIR", 100
    assert not is_large()
    hair.particle_system.settings.count = 100_000
    assert is_large()
    cube.modifiers.remove(hair)
    shown = bpy.data.collections.new("Shown")
    for _ in range(4):
        shown.objects.link(bpy.data.objects.new("Copy", cube.data))
    for _ in range(4):
        empty = bpy.data.objects.new("Instancer", None)
        empty.instance_type, empty.instance_collection = "COLLECTION", shown
        scene.collection.objects.link(empty)
    with monkeypatch.context() as bounds:
        bounds.setattr(chosen, "MOST_OBJECTS", 15)  # 8 objects and 16 instances
        assert is_large()
    assert not is_large()
    written = bpy.data.images.new("Written", 4, 4, float_buffer=True)  # nothing stands in for floats
    written.filepath_raw, written.file_format = str(tmp_path / "written.exr"), "OPEN_EXR"
    written.save()
    bpy.data.images.remove(written)
    for _ in range(chosen.MOST_PIXELS // chosen.UNKNOWN_PIXELS + 1):
        image = bpy.data.images.load(str(tmp_path / "written.exr"))
        image.use_fake_user = True
    assert is_large() and not any(one.has_data for one in bpy.data.images)
    for image in bpy.data.images:
        _ = image.size[0]  # loads it
    assert not is_large()


def test_a_pipe_among_the_images_is_not_opened(scene, tmp_path):
    os.mkfifo(tmp_path / "pipe.png")
    image = bpy.data.images.new("Pipe", 4, 4)
    image.source, image.filepath_raw = "FILE", str(tmp_path / "pipe.png")
    assert not image.has_data and byte_shape(image) is None


def written(path, ending: str, size: tuple[int, int], alpha: bool) -> bpy.types.Image:
    """A file of noise, opaque without `alpha`, as a data-block that is not loaded yet."""
    image = bpy.data.images.new("Written", *size, alpha=True)
    pixels = np.random.default_rng(1).random((size[0] * size[1], 4), np.float32)
    pixels[:, 3] = pixels[:, 3] if alpha else 1.0
    image.pixels.foreach_set(pixels.ravel())
    image.filepath_raw, image.file_format = str(path), ending
    image.save()
    bpy.data.images.remove(image)
    return bpy.data.images.load(str(path))


@pytest.mark.parametrize(
    ("ending", "cut_out", "further"), [("PNG", True, 0), ("PNG", False, 0), ("PNG", False, 14), ("JPEG", True, 0)]
)
def test_images_of_bytes_are_neither_loaded_nor_too_many(scene, region, tmp_path, ending, cut_out, further):
    """What stands in for them needs the programs that they need: of a cut-out, of opaque files with alpha, and of more
    images than samplers, of several sizes."""
    sockets = ("Base Color", "Roughness", "Metallic", "Emission Color", "Normal", *(("Alpha",) if cut_out else ()))
    material = material_named("Textured")
    nodes, links = material.node_tree.nodes, material.node_tree.links
    for socket in sockets:
        image = nodes.new("ShaderNodeTexImage")
        image.image = written(tmp_path / f"{socket}.{ending.lower()}", ending, (16, 16), socket == "Alpha")
        links.new(image.outputs["Alpha" if socket == "Alpha" else "Color"], nodes["Principled BSDF"].inputs[socket])
    for number in range(further):
        mixed, image = nodes.new("ShaderNodeVectorMath"), nodes.new("ShaderNodeTexImage")
        image.image = written(tmp_path / f"{number}.png", ending, (8 + number, 40 - number), False)
        into = nodes["Principled BSDF"].inputs["Base Color"]
        links.new(into.links[0].from_socket, mixed.inputs[0])
        links.new(image.outputs["Color"], mixed.inputs[1])
        links.new(mixed.outputs[0], into)
    bpy.data.objects["Cube"].data.materials.append(material)
    depsgraph = region.depsgraph
    assert not chosen._is_large(depsgraph)
    foreseen = take(depsgraph, SnapshotCache(stands_in=True), 96, 64, view=region.camera)
    assert len(foreseen.images) == len(sockets) + further and not any(one.has_data for one in bpy.data.images)
    real = take(depsgraph, SnapshotCache(), 96, 64, view=region.camera)
    assert all(one.has_data for one in bpy.data.images if one.users)
    settings, found = settings_of(scene, viewport=True), []
    for seen in (foreseen, real):
        renderer = Renderer(make_registry)
        next(renderer.beginning(seen, settings))
        found.append((ahead.digests_of(renderer, seen, settings), ahead._foreseen(seen, settings)))
        renderer.release()
    assert found[0] == found[1]


def test_nothing_is_said_where_a_scene_cannot_be_read_ahead(scene, monkeypatch):
    asked = []

    def fails(depsgraph):
        asked.append(depsgraph)
        raise KeyError("a fault of ours")

    area = SimpleNamespace(type="VIEW_3D", width=8, height=8)
    layer = SimpleNamespace(depsgraph=bpy.context.evaluated_depsgraph_get())
    window = SimpleNamespace(scene=scene, view_layer=layer, screen=SimpleNamespace(areas=[area]))
    context = SimpleNamespace(window_manager=SimpleNamespace(windows=[window]))
    monkeypatch.setattr(chosen, "bpy", SimpleNamespace(app=bpy.app, context=context))
    monkeypatch.setattr(chosen, "compiles_ahead", lambda: True)
    monkeypatch.setattr(chosen, "_viewports", {})
    monkeypatch.setattr(chosen, "_is_large", fails)
    chosen._foresee()
    assert asked


@pytest.mark.slow
def test_a_picture_that_is_foreseen_is_drawn_by_another_process(region, own_folder):
    region.rest()
    viewport, seen, settings = region.viewport, region.viewport.frame.snapshot, region.viewport.frame.settings
    other, ended = Ahead(), time.monotonic() + 300.0
    other.foresee(seen, settings)
    while not other.failed and FULL not in other._job.done and time.monotonic() < ended:
        time.sleep(0.1)
        other._hear()
    number = other._job.number
    assert not other.failed
    assert all(other.left(viewport.renderer, seen, settings, draft) is None for draft in (True, False))
    assert other._jobs == number
    other.close()


def test_another_process_compiles_what_the_full_picture_needs_though_it_draws_fewer_pixels(region, scene):
    """Rays cost less than a map where a fourth of the pixels ask them; the map, where all do."""
    costs = replace(device.MADE_UP["software"], texel=1.0, view=4e4, ray_level=6.0)
    before = device.current()
    device.use(costs)
    try:
        scene.candela.bounces = 0
        library._shaders.clear()
        region.rest()
        viewport = region.viewport
        needed = {program.name for program in library._shaders if program.name.startswith("direct light")}
        order = {
            "snapshot": viewport.frame.snapshot, "settings": viewport.frame.settings, "foreseen": True
        }  # fmt: skip
        library._shaders.clear()
        renderer = Renderer(make_registry)
        told = {}
        with ahead_worker.costs_of("full"):
            for _ in ahead_worker.drawn(renderer, (), order, "full", told.update):
                pass
        assert told["needs"]  # though no draft was drawn before
        found = {program.name for program in library._shaders if program.name.startswith("direct light")}
        renderer.release()
        assert device.current() is costs
        assert "direct light, edge rays" in needed and needed <= found | {"direct light, hard"}
    finally:
        device.use(before)


def test_process_that_ends_is_done_without(region, own_folder, monkeypatch):
    started = subprocess.Popen
    nothing = (sys.executable, "-c", "")
    monkeypatch.setattr(ahead.subprocess, "Popen", lambda command, **options: started(nothing, **options))
    region.viewport.ahead = other = Ahead()
    ended = time.monotonic() + 30.0
    while not other.failed and time.monotonic() < ended:
        time.sleep(0.02)
        region.clock.now += 1.0
        region.draw()
    assert other.failed and not region.viewport.held
    region.rest()


def test_shadows_of_direct_light_are_not_black_meanwhile(region, monkeypatch):
    """A faint light from the eye stands in for indirect light until its programs are there."""

    def direct():
        region.viewport.drop()
        region.viewport.ahead = Slow()
        for _ in range(12):
            region.clock.now += 1.0
            region.draw()
        assert region.viewport.held and region.viewport.direct
        return images.read(region.viewport.picture)

    filled = direct()
    monkeypatch.setattr(first_look, "FILLED", 0.0)
    plain = direct()
    assert 0.01 < (filled - plain)[..., :3].mean() < 0.1
    np.testing.assert_allclose(filled[..., 3], plain[..., 3], atol=1e-3)
