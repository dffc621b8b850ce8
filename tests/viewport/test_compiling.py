"""What a viewport shows while the programs of its picture are compiled, and how long a redraw takes then."""

import warnings
from dataclasses import replace
from types import SimpleNamespace

import bpy
import numpy as np
import pytest
from mathutils import Vector

from addon import viewport
from addon.frame import device_probe
from addon.gfx import device, images, library
from addon.scene.view import View
from addon.surfaces.first_look import HEADLIGHT, FirstLook
from addon.techniques import surfaces
from addon.ui import ENGINE
from addon.ui.properties import settings_of
from tests.viewport.region import SIZE, Region


def material_named(name):
    """A new material with nodes, which Blender 4.5 does not give it by itself."""
    made = bpy.data.materials.new(name)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        made.use_nodes = True
    return made


@pytest.fixture
def cold(scene):
    """A viewport of a process that has compiled nothing, on a clock by which each part of the work takes a redraw."""
    library._shaders.clear()
    made = Region()
    made.clock.tick = viewport.BUDGET_S
    yield made
    made.viewport.release()


def test_first_redraw_shows_the_scene_by_programs_that_are_always_the_same(cold):
    compiled = library.compile_count
    picture = cold.draw()
    assert cold.viewport.looks and picture.size == SIZE
    assert library.compile_count - compiled <= 3  # of a first look, and what fetches and fills need
    assert not cold.viewport.done
    seen = images.read(picture)
    assert seen[..., 3].max() == 1.0 and seen[..., :3].std() > 0.01


def test_first_look_comes_before_textures_are_drawn(cold):
    """Their levels and their packing have programs of their own."""
    material = material_named("Textured")
    nodes = material.node_tree.nodes
    image = nodes.new("ShaderNodeTexImage")
    image.image = bpy.data.images.new("Painted", 64, 64)
    material.node_tree.links.new(image.outputs["Color"], nodes["Principled BSDF"].inputs["Base Color"])
    bpy.data.objects["Cube"].data.materials.append(material)
    cold.viewport.ahead = SimpleNamespace(left=lambda *_, **__: None)  # all has been compiled elsewhere
    compiled = library.compile_count
    cold.draw()
    assert cold.viewport.looks and library.compile_count == compiled + 1
    cold.draw()
    alone = library.compile_count
    assert compiled + 1 < alone <= compiled + 5 and not cold.viewport.frame  # and then they alone
    cold.draw()
    assert library.compile_count > alone


def test_programs_come_in_over_many_redraws_and_the_picture_is_that_of_warm_ones(cold):
    before, most, said = library.compile_count, 0, set()
    for _ in range(200):
        compiled = library.compile_count
        cold.draw()
        most = max(most, library.compile_count - compiled)
        said.add(cold.viewport.status().split(" ")[0])
        if not cold.viewport.looks:
            break
    assert "Compiling" in said and cold.viewport.frame.samples_done > 0
    assert library.compile_count - before > 2 * most
    cold.clock.tick = 0.0
    cold.rest()
    warm = Region()
    expected = warm.rest()
    warm.viewport.release()
    np.testing.assert_array_equal(images.read(cold.viewport.picture), expected)


def test_only_programs_in_view_have_first_draws_and_each_has_one(scene, monkeypatch):
    """Those of what stands behind the camera wait until a view sees it."""
    for k, kind in enumerate(("Wave", "Voronoi", "Magic", "Checker")):
        material = material_named(kind)
        nodes = material.node_tree.nodes
        texture = nodes.new(f"ShaderNodeTex{kind}")
        material.node_tree.links.new(texture.outputs["Color"], nodes["Principled BSDF"].inputs["Base Color"])
        bpy.ops.mesh.primitive_cube_add(size=0.5, location=(0.8 * k, -1.5, 0.3) if k < 2 else (8, -10 - k, 4))
        bpy.context.object.data.materials.append(material)
    drawn, draw_view = [], surfaces.draw_view

    def noted(frame, technique, target, block, rows, program_of, materials, constants):
        drawn.append({frame.snapshot.materials[k].name for k in materials})
        draw_view(frame, technique, target, block, rows, program_of, materials, constants)

    monkeypatch.setattr(surfaces, "draw_view", noted)
    region = Region()
    for _ in range(6):
        region.camera = region.moved(1e-3)
        region.draw()
    region.rest()
    assert 1 <= len(drawn) <= 2 and not set().union(*drawn) & {"Magic", "Checker"}
    region.viewport.release()


def test_shapes_of_a_draft_come_in_by_one_program_a_redraw(scene, cold, monkeypatch):
    """Three where a lamp is in view."""
    bpy.ops.object.light_add(type="POINT", location=scene.camera.matrix_world @ Vector((0.0, 0.0, -3.0)))
    bpy.context.object.data.shadow_soft_size, bpy.context.object.visible_camera = 0.1, True
    wanted = {f"first look {name}" for name in ("lamps", "shines", "guides")}
    redraws, compile_one = [], library._compile

    def noted(program):
        redraws[-1].update({program.name} & wanted)
        return compile_one(program)

    monkeypatch.setattr(library, "_compile", noted)
    for _ in range(200):
        redraws.append(set())
        cold.draw()
        if "first look guides" in redraws[-1]:
            break
    assert sorted(map(sorted, filter(None, redraws))) == sorted([name] for name in wanted)


def made_by_parts(scene, made, samples):
    """What each part of a draft, and then of a picture, adds to `made`, in which programs are noted as they compile."""
    region = Region()
    settings = replace(settings_of(scene, viewport=True), samples=samples)
    renderer, snapshot = region.viewport.renderer, region.source(region.camera, *SIZE)
    parts = []
    for drawn in (settings.as_draft(), settings):
        frame, before = renderer.begin(snapshot, drawn), len(made)
        for _ in renderer.steps(frame):
            parts.append(made[before:])
            before = len(made)
    region.viewport.release()
    return parts


def test_programs_of_the_film_come_in_one_by_one(scene, monkeypatch):
    """In a draft and in full, where light between points of the film has one more."""
    library._shaders.clear()
    made, compile_one = [], library._compile
    monkeypatch.setattr(library, "_compile", lambda program: made.append(program.name) or compile_one(program))
    parts = made_by_parts(scene, made, samples=1)
    together = [[name for name in names if name.startswith("film ") and name != "film depth"] for names in parts]
    first_words = {" ".join(name.split(" ")[:2]) for names in together for name in names}
    assert first_words >= {"film collect", "film filter,", "film light"}, first_words
    assert max(map(len, together)) == 1, together


@pytest.mark.slow
def test_programs_that_follow_rays_come_in_one_by_one(scene, monkeypatch):
    """They are the largest: no part of a sample compiles two, in a draft or in full, at pixels or in mirrors."""
    material = material_named("Shiny")
    material.node_tree.nodes["Principled BSDF"].inputs["Roughness"].default_value = 0.15
    bpy.data.objects["Cube"].data.materials.append(material)
    library._shaders.clear()
    made, compile_one = [], library._compile

    def noted(program):
        source = program.fragment or program.compute
        if any(file == "trace/hierarchy.glsl" for file, _ in library.resolve(source, dict(program.snippets))[1]):
            made.append(program.name)
        return compile_one(program)

    monkeypatch.setattr(library, "_compile", noted)
    together = made_by_parts(scene, made, samples=2)
    assert {"instant radiosity", "instant radiosity, rays", "light at hits", "bounced light at hits"} <= set(made)
    assert max(map(len, together)) == 1, [names for names in together if len(names) > 1]


def test_programs_that_a_driver_compiles_while_it_draws_come_in_over_many_redraws(cold, monkeypatch):
    """As llvmpipe does for Vulkan, in a thread of its own: it takes no time of the caller, until that waits."""
    finish, waited = images.finish, [library.first_uses]

    def finish_late():
        finish()
        cold.clock.now += viewport.BUDGET_S * (library.first_uses - waited[0])
        waited[:] = [library.first_uses]

    monkeypatch.setattr(images, "finish", finish_late)
    cold.clock.tick, most, began = 0.0, 0, library.first_uses
    for _ in range(200):
        used = library.first_uses
        cold.draw()
        most = max(most, library.first_uses - used)
        if not cold.viewport.looks:
            break
    assert cold.viewport.frame.samples_done > 0
    assert library.first_uses - began > 2 * most


@pytest.mark.slow
def test_edit_that_needs_new_programs_leaves_the_old_picture_until_they_are_there(cold):
    cold.clock.tick = 0.0
    before = cold.rest()
    cold.clock.tick = viewport.BUDGET_S
    glass = material_named("Glass")
    glass.node_tree.nodes["Principled BSDF"].inputs["Transmission Weight"].default_value = 1.0
    bpy.data.objects["Cube"].data.materials.append(glass)
    cold.viewport.dirty = True
    cold.viewport.cache.doubt()
    picture = cold.draw()
    assert not cold.viewport.done and not cold.viewport.looks
    np.testing.assert_array_equal(images.read(picture), before)
    cold.clock.tick = 0.0
    after = cold.rest()
    assert np.abs(after - before).max() > 0.05


def test_another_view_meanwhile_is_a_first_look_at_it(cold):
    first = images.read(cold.draw())
    cold.camera = cold.moved(0.5)
    second = images.read(cold.draw())
    assert cold.viewport.looks
    assert np.abs(first - second).max() > 0.05


def test_first_look_at_a_lambertian_plane_under_a_sun(registered, gpu_context, empty_scene):
    """Radiance of a surface that faces the sun: albedo times (irradiance + that of the light at the eye) over pi."""
    bpy.ops.mesh.primitive_plane_add(size=8)
    material = material_named("Red")
    material.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (0.6, 0.2, 0.1, 1.0)
    bpy.context.object.data.materials.append(material)
    bpy.ops.object.light_add(type="SUN", rotation=(0.0, 0.0, 0.0))
    bpy.context.object.data.energy = 3.0
    bpy.ops.object.camera_add(location=(0, 0, 50), rotation=(0, 0, 0))
    bpy.context.object.data.angle = 0.05
    empty_scene.camera = bpy.context.object
    empty_scene.render.engine = ENGINE
    library._shaders.clear()
    region = Region()
    region.clock.tick = viewport.BUDGET_S
    seen = images.read(region.draw())[SIZE[1] // 2, SIZE[0] // 2]
    region.viewport.release()
    expected = np.array([0.6, 0.2, 0.1]) * (3.0 / np.pi + HEADLIGHT)
    np.testing.assert_allclose(seen[:3], expected, rtol=0.01)


@pytest.mark.parametrize(("opacity", "guides"), [("glass", 1.0), ("alpha", 0.0)])
def test_what_lets_pass_hides_every_other_pixel_and_guides_by_its_shape_if_it_has_one(scene, opacity, guides):
    """A cube of glass, or of alpha 0.5: half of its pixels in a first look; as a guide all of them, or none."""
    material = material_named("Clear")
    shader = material.node_tree.nodes["Principled BSDF"]
    name, value = {"glass": ("Transmission Weight", 1.0), "alpha": ("Alpha", 0.5)}[opacity]
    shader.inputs[name].default_value = value
    cube = bpy.data.objects["Cube"]
    cube.data.materials.append(material)
    bpy.data.objects["Plane"].hide_render = bpy.data.objects["Plane"].hide_viewport = True
    region = Region()
    region.clock.tick = viewport.BUDGET_S
    library._shaders.clear()
    region.draw()
    looked = region.viewport
    covered = {}
    for guide in (False, True):
        look = FirstLook()
        view = View(region.camera, looked._snapshot.film, looked.renderer.geometry.origin)
        look.draw(looked._snapshot, looked.renderer.geometry, looked.renderer.materials.compiled, view, guides=guide)
        covered[guide] = (images.read(look.guide)[..., 3] > 0).mean()
        look.release()
    looked.release()
    assert 0.01 < covered[False] < 0.6
    assert covered[True] == pytest.approx(2.0 * covered[False] * guides, rel=0.1, abs=1e-6)


def test_first_look_comes_before_a_device_is_measured(cold, monkeypatch):
    measured, figures = [], device.current()
    monkeypatch.setattr(device, "given", lambda: None)
    monkeypatch.setattr(device, "read", lambda folder: None)
    monkeypatch.setattr(device, "write", lambda folder, found: None)
    monkeypatch.setattr(device_probe, "measure", lambda: measured.append(True) or figures)
    device.use(None)
    try:
        cold.draw()
        assert cold.viewport.looks and not measured
        cold.draw()
        assert measured == [True] and device.known()
    finally:
        device.use(figures)
