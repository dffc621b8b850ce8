"""Skip, then reuse, for every technique of the registry: a new one without a scene here fails.

What a technique costs where it is not needed is found by leaving it out: the renderer with it and the one without it
must bind the same programs in the same order, hold the same images and compile nothing more.
"""

import bpy
import numpy as np
import pytest

from addon import engine
from addon.frame.ledger import RAN, REUSED, SKIPPED
from addon.gfx import images, library, passes
from addon.techniques import REGISTRY, make_registry

ALWAYS = {"surfaces", "film"}  # depth, normals and the picture itself are wanted of every scene
RESOLVE = "film resolve"  # the sums' mean, drawn whenever pixels are asked for


def no_light(stage):
    stage.remove_lamps()


def no_shadow(stage):
    for lamp in stage.lamps:
        lamp.data.use_shadow = False


def no_emission(stage):
    stage.remove(stage.paper)


def no_world(stage):
    stage.scene.world = None


def no_glass(stage):
    stage.remove(stage.pane)


def no_gloss(stage):
    no_glass(stage)
    for thing in stage.scene.objects:
        if thing.type == "MESH" and thing is not stage.paper:
            thing.data.materials[0] = stage.diffuse(0.5)


def no_bounces(stage):
    stage.bounces = 0


def nothing_lit(stage):
    no_light(stage)
    no_world(stage)


def dark(stage):
    nothing_lit(stage)
    no_emission(stage)


def no_source_to_shadow(stage):
    """Chosen by hand, soft maps serve the world and emissive meshes, too."""
    no_shadow(stage)
    no_world(stage)
    no_emission(stage)


def no_relief(stage):
    for material in bpy.data.materials:
        material.displacement_method = "BUMP"


def no_glare(stage):
    stage.scene.camera.data.candela.glare_mode = "OFF"


def remembering(stage):
    stage.scene.candela.history_animation = True


def no_needs(stage):
    """Nothing of what this technique alone needs: the room as it is."""


# What the room lacks and a technique needs: too dear for the pictures of all the others.


def foggy(stage):
    tree = stage.scene.world.node_tree
    fog, output = tree.nodes.new("ShaderNodeVolumeScatter"), tree.nodes["World Output"]
    fog.inputs["Density"].default_value = 0.1
    tree.links.new(fog.outputs[0], output.inputs["Volume"])
    stage.scene.candela.airlight_bounces = 0  # walks are the dearest program of all to compile


def waxen(stage):
    wax = stage.principled(Subsurface_Weight=1.0, Subsurface_Scale=0.2)
    stage.rectangle((-0.4, -1.2), (0.4, -0.6), 0.3, material=wax)


def edited(stage):
    own = stage.paper.candela
    stage.paper.data.materials[0] = stage.principled(Roughness=0.1)
    one = own.reflection_editing_constraints.add()
    one.place, one.target = (0.8, 0.0, 0.8), (0.0, 0.0, 2.0)
    region = own.reflection_editing_regions.add()
    region.centre, region.radius = (0.8, 0.0, 0.8), 2.0


def edits_shown(stage):
    edited(stage)
    stage.scene.candela.edit_heat_shown = True


def grassy(stage):
    stage.floor_materials[0].candela.grass_patch = "MEADOW"


def passes_wanted(stage):
    layer = stage.scene.view_layers[0]
    layer.use_pass_uv = layer.use_pass_cryptomatte_object = layer.use_pass_ambient_occlusion = True


WITH = {
    "shader_aovs": passes_wanted,
    "cryptomatte": passes_wanted,
    "ambient_occlusion": passes_wanted,
    "grass": grassy,
    "media": foggy,
    "airlight": foggy,
    "volume_caustics": foggy,
    "image_space_subsurface": waxen,
    "reflection_editing": edited,
    "edit_heat": edits_shown,
    "history": remembering,
}


def samples_for(technique):
    """With fewer than four a picture is not denoised, and one of a single sample remembers; all else has had its first
    and a later one."""
    return {"denoise": 4, "history": 1}.get(technique.name, 2)


# For each technique, what to take from the full scene so that it is not needed any more.
WITHOUT = {
    "shader_aovs": no_needs,
    "cryptomatte": no_needs,
    "ambient_occlusion": no_needs,
    "media": no_needs,
    "airlight": no_needs,
    "volume_caustics": no_needs,
    "image_space_subsurface": no_needs,
    "reflection_editing": no_needs,
    "edit_heat": edited,
    "history": no_needs,
    "shaded_reflections": no_gloss,
    "light_probes": nothing_lit,
    "accumulated_maps": no_shadow,
    "vssm": no_source_to_shadow,
    "cssm": no_source_to_shadow,
    "depth_complexity": no_shadow,
    "penumbra_wedges": no_shadow,
    "shadows_by_light": no_shadow,
    "direct_light": no_light,
    "emissive_light": no_emission,
    "environment_light": no_world,
    "environment_area_lights": no_world,
    "directional_occlusion": no_world,
    "traced_glossy": no_gloss,
    "traced_refraction": no_glass,
    "instant_radiosity": no_bounces,
    "multires_radiosity": no_bounces,
    "clustered_visibility": no_bounces,
    "imperfect_shadow_maps": no_bounces,
    "micro_rendering": no_bounces,
    "implicit_visibility": no_bounces,
    "ssdo": no_bounces,
    "caustics_mapping": no_glass,
    "screen_space_photons": no_glass,
    "grass": no_needs,
    "relief": no_relief,
    "denoise": dark,
    "eye": no_glare,
    "glare": no_glare,
}


@pytest.fixture
def room(stage):
    """A scene that needs every technique: a floor with gloss, a box, glass, lamps, a paper that shines, a world."""
    stage.floor_materials = [stage.principled(Roughness=0.3)]
    stage.floor(material=stage.floor_materials[0])
    stage.rectangle((-1, -0.3), (0.4, 0.3), 0.5, material=stage.diffuse(0.5))
    stage.paper = stage.rectangle(
        (0.6, -0.4), (1.0, 0.4), 0.8, material=stage.material("ShaderNodeEmission", Strength=2.0)
    )
    stage.pane = stage.rectangle((-1, 0.6), (0, 1.2), 0.4, material=stage.material("ShaderNodeBsdfGlass"))
    stage.lamps = [stage.light("AREA", (0.5, 0.7, 2), size=1.0), stage.light("SUN", turn=(0.3, 0, 0))]
    stage.remove_lamps = lambda: [setattr(lamp, "hide_render", True) for lamp in stage.lamps]
    stage.world((0.2, 0.3, 0.4))
    stage.camera_above(4.0)
    stage.bounces = 2
    yield stage
    layer = stage.scene.view_layers[0]
    layer.use_pass_uv = layer.use_pass_cryptomatte_object = layer.use_pass_ambient_occlusion = False


@pytest.fixture
def bound(monkeypatch):
    """Names of the programs that are bound, in order, but for those that are drawn where a context is left."""
    names = []
    bind = library.Shader.bind

    def told(shader, *arguments, **keywords):
        if shader.program not in passes.LAST_DRAWN:
            names.append(shader.program.name)
        bind(shader, *arguments, **keywords)

    monkeypatch.setattr(library.Shader, "bind", told)
    return names


def displace(material):
    """Heights over the surface, on a mesh of two triangles."""
    nodes, join = material.node_tree.nodes, material.node_tree.links.new
    noise, node = nodes.new("ShaderNodeTexNoise"), nodes.new("ShaderNodeDisplacement")
    output = next(one for one in nodes if one.type == "OUTPUT_MATERIAL")
    node.inputs["Scale"].default_value = 0.2
    join(noise.outputs[0], node.inputs["Height"])
    join(node.outputs[0], output.inputs["Displacement"])
    material.displacement_method = "DISPLACEMENT"


def choose(stage, technique):
    if technique.name in ("eye", "glare"):
        stage.scene.camera.data.candela.glare_mode = "CONVOLUTION"
        stage.scene.camera.data.candela.glare_white = 0.01
    if technique.name == "relief":
        displace(bpy.data.objects["Mesh"].data.materials[0])
    for slot in technique.fills:
        setattr(stage.scene.candela, f"slot_{slot}", technique.name)


def test_every_technique_has_a_scene_that_does_not_need_it():
    assert not {t.name for t in REGISTRY} - ALWAYS - set(WITHOUT), "add them to WITHOUT, for the tests below"


@pytest.mark.slow
@pytest.mark.parametrize("technique", [t for t in REGISTRY if t.name not in ALWAYS], ids=lambda t: t.name)
def test_a_scene_without_the_need_plans_allocates_compiles_and_draws_nothing_of_it(room, bound, monkeypatch, technique):
    choose(room, technique)
    WITHOUT[technique.name](room)

    def render():
        engine.free_sessions()
        bound.clear()
        picture = room.render(samples_for(technique), bounces=room.bounces)
        return picture["combined"], list(bound), images.pool.allocated_bytes

    with monkeypatch.context() as patch:
        patch.setattr(engine, "make_registry", lambda: [t for t in make_registry() if t.name != technique.name])
        expected = render()
    assert RESOLVE in expected[1]
    compiled = library.compile_count
    found = render()
    row = room.ledger.row(technique.name)
    assert (row.state, row.counters) == (SKIPPED, {})
    assert row.reason
    np.testing.assert_array_equal(found[0], expected[0])
    assert found[1:] == expected[1:]
    assert library.compile_count == compiled


@pytest.mark.slow
@pytest.mark.parametrize("technique", REGISTRY, ids=lambda t: t.name)
def test_an_unchanged_frame_redoes_nothing_of_it(room, bound, technique):
    WITH.get(technique.name, no_needs)(room)
    choose(room, technique)
    room.render(samples_for(technique), bounces=room.bounces)
    assert room.ledger.row(technique.name).state == RAN
    bound.clear()
    room.render(samples_for(technique), bounces=room.bounces)
    assert room.ledger.row(technique.name).state == REUSED
    assert set(bound) <= {RESOLVE}


def test_what_only_shines_measures_no_emission(stage, bound):
    """Nothing takes the light: unlit drawings, whose colours vary."""
    drawing = stage.material("ShaderNodeEmission")
    tree = drawing.node_tree
    noise, shader = tree.nodes.new("ShaderNodeTexNoise"), next(n for n in tree.nodes if n.type == "EMISSION")
    tree.links.new(noise.outputs["Color"], shader.inputs["Color"])
    stage.floor(material=drawing)
    stage.camera_above(4.0)
    picture = stage.render(1)["combined"]
    assert stage.ledger.row("emissive_light").reason == "no material reflects light"
    assert picture[..., :3].std() > 0.01
    assert not [name for name in bound if name.startswith("emission")]


@pytest.mark.slow
def test_what_scatters_below_its_surface_alone_takes_light_of_others(stage):
    wax = stage.material("ShaderNodeSubsurfaceScattering", Scale=0.1)
    stage.floor(material=wax)
    stage.rectangle((-0.5, -0.5), (0.5, 0.5), 0.5, material=stage.material("ShaderNodeEmission", Strength=2.0))
    stage.camera_above(4.0)
    stage.scene.candela.slot_indirect = "instant_radiosity"
    stage.render(1, bounces=1)
    assert stage.ledger.row("emissive_light").state == RAN
    assert stage.ledger.row("instant_radiosity").state == RAN
