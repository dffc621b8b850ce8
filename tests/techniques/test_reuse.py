"""Skip, reuse, then compute: the ledger says what ran and why the rest did not, and unchanged work is not redone."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from addon import engine
from addon.frame.ledger import RAN, REUSED, SKIPPED
from addon.gfx import context, device, images, library
from addon.lighting.point_maps import PointMaps
from addon.techniques.surfaces import Surfaces
from bench.memory import resident_bytes


@pytest.fixture
def room(stage):
    """A floor, two boxes and a lamp."""
    stage.floor(material=stage.principled())
    stage.boxes = [stage.rectangle((x, -0.3), (x + 0.6, 0.3), 0.5, material=stage.diffuse(0.5)) for x in (-1, 0.5)]
    stage.lamp = stage.light("AREA", (0.5, 0.7, 2), size=1.0)
    stage.camera_above(4.0)
    return stage


def states(stage):
    return {row.name: row.state for row in stage.ledger.rows}


def reason(stage, name):
    return stage.ledger.row(name).reason


def test_a_scene_without_lights_draws_no_light_and_no_shadow(room):
    room.lamp.hide_render = True
    images = room.render(2)
    assert states(room)["direct_light"] == states(room)["accumulated_maps"] == SKIPPED
    assert reason(room, "direct_light") == "the scene has no light with power"
    assert reason(room, "environment_light") == "the world is black"
    assert not images["combined"][..., :3].any()


def test_a_scene_without_surfaces_draws_no_light(stage):
    stage.light("POINT")
    stage.world()
    stage.camera_above(4.0)
    images = stage.render(2)
    assert {name for name, state in states(stage).items() if state == RAN} == {"surfaces", "film"}
    assert (images["combined"] == 1).all()


def test_lights_without_shadow_need_no_depth_maps(room):
    room.lamp.data.use_shadow = False
    room.render(2)
    assert states(room)["accumulated_maps"] == SKIPPED
    assert reason(room, "accumulated_maps") == "no light casts a shadow"


def test_what_ran_is_timed_and_counted(room):
    room.scene.candela.accumulated_maps_by = "MAPS"
    room.render(4)
    assert room.ledger.samples == 4
    row = room.ledger.row("direct_light")
    assert row.state == RAN
    assert row.milliseconds > 0
    assert row.counters["passes"] == 4
    assert room.ledger.row("surfaces").counters["passes"] == 8  # each sample is drawn, and its pixels are marked
    assert room.ledger.row("accumulated_maps").counters["maps"] >= 4
    assert {"sync", "upload", "compile", "passes", "readback", "total"} <= room.ledger.times.keys()


def test_rays_take_the_place_of_maps_that_cost_more(room, monkeypatch):
    """As told by triangles, texels and pixels; what lets some light pass has maps, whatever they cost."""
    maps = "accumulated_maps"
    for costs, by_rays in (((1e9, 0.0, 0.0, 1.0), True), ((0.0, 0.0, 0.0, 1.0), False)):
        triangle, texel, view, level = costs
        figures = replace(device.current(), triangle=triangle, texel=texel, view=view, ray_level=level)
        monkeypatch.setattr(device, "current", lambda figures=figures: figures)
        room.render(2, seed=int(by_rays))
        assert ("maps" in room.ledger.row(maps).counters) != by_rays
    room.scene.candela.accumulated_maps_by = "RAYS"
    room.render(2, seed=2)
    assert "maps" not in room.ledger.row(maps).counters
    room.boxes[0].data.materials[0] = room.see_through(0.5)
    room.render(2, seed=3)
    assert room.ledger.row(maps).counters["maps"] >= 2


def test_of_many_lights_those_that_are_drawn_are_asked_for_rays(room, monkeypatch):
    """It takes a thousandth of a second each: not to be spent on what a sample leaves out."""
    for k in range(40):
        room.light("POINT", (k / 20 - 1, 0, 2))
    asked, traces = [], PointMaps.traces
    monkeypatch.setattr(PointMaps, "traces", lambda *given: asked.append(given[2]) or traces(*given))
    room.scene.candela.direct_light_lights_per_sample = 4
    room.render(2)
    assert 0 < len(asked) <= 2 * 5 and len({emitter.light.key for emitter in asked}) == len(asked)


def test_a_second_render_of_an_unchanged_scene_draws_nothing(room):
    first = room.render(4)
    second = room.render(4)
    assert all(row.state in (REUSED, SKIPPED) for row in room.ledger.rows)
    for name, pixels in first.items():
        np.testing.assert_array_equal(second[name], pixels)


CHANGES = {
    "light moved": lambda s: s.lamp.location.__setitem__(0, -1.0),
    "light power": lambda s: setattr(s.lamp.data, "energy", 50.0),
    "light colour": lambda s: setattr(s.lamp.data, "color", (1, 0, 0)),
    "light size": lambda s: setattr(s.lamp.data, "size", 0.2),
    "object moved": lambda s: s.boxes[0].location.__setitem__(2, 0.3),
    "object hidden": lambda s: setattr(s.boxes[0], "hide_render", True),
    "shadow switched off": lambda s: setattr(s.boxes[0], "visible_shadow", False),
    "vertex moved": lambda s: move_vertex(s),
    "camera moved": lambda s: s.scene.camera.location.__setitem__(0, 0.5),
    "lens": lambda s: setattr(s.scene.camera.data, "ortho_scale", 3.0),
    "material": lambda s: set_color(s),
}


def move_vertex(stage):
    mesh = stage.boxes[1].data
    mesh.vertices[0].co.x += 0.4
    mesh.update()


def set_color(stage):
    stage.boxes[0].data.materials[0].node_tree.nodes[0].inputs["Color"].default_value = (1, 0, 0, 1)


@pytest.mark.parametrize("change", CHANGES)
def test_whatever_changes_the_picture_is_drawn_anew_and_as_if_it_were_the_first(room, change):
    before = room.render(4)["combined"]
    CHANGES[change](room)
    after = room.render(4)["combined"]
    assert states(room)["surfaces"] == RAN
    assert (after != before).any()
    engine.free_sessions()
    np.testing.assert_array_equal(room.render(4)["combined"], after)


def test_moving_an_object_uploads_no_mesh(room):
    room.render(1)
    uploads = room.renderer.geometry.uploads
    assert uploads > 0
    room.boxes[0].location.x += 0.3
    room.render(1)
    room.lamp.location.x += 0.3
    room.render(1)
    assert room.renderer.geometry.uploads == uploads


def test_sliders_of_a_material_compile_nothing(room):
    room.render(1)
    compiled = library.compile_count
    shader = room.scene.objects["Mesh"].active_material.node_tree.nodes[0]
    for value in (0.1, 0.9):
        shader.inputs["Roughness"].default_value = value
        shader.inputs["Base Color"].default_value = (value, 0.5, 0.5, 1)
        room.render(1)
        assert states(room)["surfaces"] == RAN
    assert library.compile_count == compiled


@pytest.mark.slow
def test_changing_lights_world_and_size_compiles_nothing(room, monkeypatch):
    """On GPUs; for software that masks branches, programs hold no more kinds of light than the scene has."""
    monkeypatch.setattr(context, "masks_branches", lambda: False)
    monkeypatch.setattr(device, "current", lambda: device.MADE_UP["card"])
    room.world((0.1, 0.1, 0.1))
    room.render(1)
    compiled = library.compile_count
    room.lamp.data.type = "SUN"
    room.render(1)
    room.render(1, (24, 40))
    room.scene.candela.seed = 3
    room.render(1, seed=3)
    assert library.compile_count == compiled


def test_a_technique_that_was_skipped_leaves_no_light_behind(room):
    """Images are kept from frame to frame: what an earlier frame wrote must not show in a later one."""
    room.world((1, 1, 1))
    assert room.render(2)["combined"][..., :3].max() > 0
    room.scene.world = None
    room.lamp.hide_render = True
    assert not room.render(2)["combined"][..., :3].any()


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="only Linux tells a process its size in a file")
def test_fifty_renders_with_changes_leave_memory_flat(room):
    """Sessions freed, sizes and settings changed, objects added and removed: neither pool nor process grows."""
    room.world((0.2, 0.3, 0.4))
    sizes, used = [(32, 32), (48, 16), (20, 36)], []
    for k in range(50):
        room.lamp.data.energy = 50 + k
        room.lamp.data.type = ("AREA", "SUN", "POINT")[k % 3]
        extra = room.rectangle((-0.2, -0.2), (0.2, 0.2), 0.3 + 0.01 * k, material=room.diffuse(0.5))
        room.render(1, sizes[k % 3])
        room.remove(extra)
        if k % 2:
            engine.free_sessions()
        used.append((resident_bytes(), images.pool.allocated_bytes))
    (early, _), (late, pool) = np.median(used[10:20], axis=0), np.median(used[40:], axis=0)
    assert late < 1.05 * early
    engine.free_sessions()
    assert images.pool.allocated_bytes == 0
    assert pool <= max(bytes_ for _, bytes_ in used[:10])


def test_error_leaves_no_half_made_frame(room, monkeypatch):
    """What fails before the first sample is said, and the next picture is whole."""
    whole = room.render(1)["combined"]
    room.lamp.data.energy *= 2.0

    def broken(self, frame):
        raise KeyError("half made")

    monkeypatch.setattr(Surfaces, "begin", broken)
    with pytest.raises(RuntimeError, match="half made"):
        room.render(1)
    monkeypatch.undo()
    np.testing.assert_allclose(room.render(1)["combined"][..., :3], 2.0 * whole[..., :3], rtol=1e-4, atol=1e-6)


def test_what_an_object_does_to_refracted_rays_begins_a_new_picture(room):
    room.boxes[0].visible_transmission = True
    room.render(1)
    room.render(1)
    assert states(room)["surfaces"] == REUSED
    room.boxes[0].visible_transmission = False
    room.render(1)
    assert states(room)["surfaces"] == RAN


@pytest.mark.slow
def test_absorption_begins_a_new_picture(room):
    glass = room.material("ShaderNodeBsdfGlass")
    tree = glass.node_tree
    absorbs = tree.nodes.new("ShaderNodeVolumeAbsorption")
    output = next(node for node in tree.nodes if node.type == "OUTPUT_MATERIAL")
    tree.links.new(absorbs.outputs[0], output.inputs["Volume"])
    room.boxes[0].data.materials[0] = glass
    room.render(1)
    absorbs.inputs["Density"].default_value = 5.0
    room.render(1)
    assert states(room)["surfaces"] == RAN


def test_passes_that_are_not_written_are_named(room):
    layer = room.scene.view_layers[0]
    layer.use_pass_ambient_occlusion = layer.use_pass_shadow = True
    try:
        room.render(1)
    finally:
        layer.use_pass_ambient_occlusion = layer.use_pass_shadow = False
    (note,) = (note for note in room.ledger.notes if note.subject == f"View layer '{layer.name}'")
    assert "does not write Shadow:" in note.text  # Ambient Occlusion it does


def test_sums_begin_at_zero_in_every_picture(room):
    """Images come from a pool and hold what another picture left there."""
    room.world((0.2, 0.3, 0.4))
    first = room.render(2, seed=1)
    for image in room.renderer.frame.images.values():
        images.Target((image,)).clear((7.0, 7.0, 7.0, 7.0)) if image.format == "RGBA32F" else None
    room.render(2, seed=2)
    again = room.render(2, seed=1)
    for name, pixels in first.items():
        np.testing.assert_array_equal(again[name], pixels, err_msg=name)
