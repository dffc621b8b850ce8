"""Drafts of scenes that few artists make: each is drawn, is finite, and shows something."""

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from addon.gfx import images
from bench.shading import tree_of


def shader(thing, **values):
    """A Principled material of these values on an object; its tree, node, and a function that adds linked nodes."""
    material = bpy.data.materials.new("odd")
    tree = tree_of(material)
    node = next(one for one in tree.nodes if one.type == "BSDF_PRINCIPLED")
    for name, value in values.items():
        node.inputs[name.replace("_", " ")].default_value = value
    thing.data.materials.clear()
    thing.data.materials.append(material)
    return tree, node


def into(tree, kind, socket, output=0, **properties):
    """A new node whose output is linked to a socket."""
    made = tree.nodes.new(kind)
    for name, value in properties.items():
        setattr(made, name, value)
    tree.links.new(made.outputs[output], socket)
    return made


def bumped_coat(scene, cube):
    tree, node = shader(cube, Coat_Weight=1.0, Coat_Roughness=0.1, Metallic=0.5)
    bump = into(tree, "ShaderNodeBump", node.inputs["Coat Normal"])
    into(tree, "ShaderNodeTexNoise", bump.inputs["Height"])


def bumped_glass_in_fog(scene, cube):
    tree, node = shader(cube, Transmission_Weight=1.0, Roughness=0.2)
    bump = into(tree, "ShaderNodeBump", node.inputs["Normal"])
    into(tree, "ShaderNodeTexVoronoi", bump.inputs["Height"])
    inside = into(tree, "ShaderNodeVolumeAbsorption", tree.nodes["Material Output"].inputs["Volume"])
    inside.inputs["Density"].default_value = 2.0
    world = scene.world = bpy.data.worlds.new("fog")
    fog = tree_of(world)
    into(fog, "ShaderNodeVolumeScatter", fog.nodes["World Output"].inputs["Volume"])


def anisotropic_film_over_skin(scene, cube):
    tree, node = shader(cube, Subsurface_Weight=0.5, Anisotropic=0.9, Thin_Film_Thickness=400.0, Sheen_Weight=1.0)
    into(tree, "ShaderNodeTangent", node.inputs["Tangent"])
    into(tree, "ShaderNodeNormalMap", node.inputs["Normal"])


def values_that_are_no_numbers(scene, cube):
    tree, node = shader(cube)
    root = into(tree, "ShaderNodeMath", node.inputs["Base Color"], operation="LOGARITHM")
    root.inputs[0].default_value = root.inputs[1].default_value = -1.0
    rough = into(tree, "ShaderNodeMath", node.inputs["Roughness"], operation="DIVIDE")
    rough.inputs[1].default_value = 0.0


def meshes_without_area(scene, cube):
    for name, places, faces in (("none", [], []), ("line", [(0, 0, 2)] * 3, [(0, 1, 2)]), ("point", [(0, 0, 2)], [])):
        mesh = bpy.data.meshes.new(name)
        mesh.from_pydata(places, [], faces)
        scene.collection.objects.link(bpy.data.objects.new(name, mesh))
    cube.scale = 1.0, 0.0, 1.0


def mirrored_copies_under_a_lamp_of_nodes(scene, cube):
    shader(cube, Metallic=1.0, Roughness=0.0)
    group = bpy.data.collections.new("copied")
    group.objects.link(cube)
    for k in range(3):
        copy = bpy.data.objects.new("copy", None)
        copy.instance_type, copy.instance_collection = "COLLECTION", group
        copy.matrix_world = Matrix.Translation((k - 1.0, 1.0, 0.0)) @ Matrix.Diagonal((-0.4, 0.4, 0.4, 1.0))
        scene.collection.objects.link(copy)
    lamp = next(one for one in scene.objects if one.type == "LIGHT").data
    lamp.use_nodes = True
    into(lamp.node_tree, "ShaderNodeTexChecker", lamp.node_tree.nodes["Emission"].inputs["Color"])


def emission_through_holes(scene, cube):
    tree, node = shader(cube, Emission_Strength=5.0)
    into(tree, "ShaderNodeTexNoise", node.inputs["Alpha"])
    into(tree, "ShaderNodeTexNoise", node.inputs["Emission Color"], output=1)


def catcher_and_holdout_without_light(scene, cube):
    floor = next(one for one in scene.objects if one.name.startswith("Plane"))
    floor.is_shadow_catcher = cube.is_holdout = True
    scene.render.film_transparent = True
    bpy.data.objects.remove(next(one for one in scene.objects if one.type == "LIGHT"))


def hair_seen_by_a_wide_lens(scene, cube):
    bpy.context.view_layer.objects.active = cube
    cube.modifiers.new("hair", "PARTICLE_SYSTEM")
    hair = cube.particle_systems[0].settings
    hair.type, hair.count, hair.hair_length = "HAIR", 50, 0.5
    camera = scene.camera.data
    camera.type, camera.dof.use_dof, camera.dof.aperture_fstop = "PERSP", True, 0.1


def orthographic_inside_of_a_box(scene, cube):
    cube.scale = 8.0, 8.0, 8.0
    shader(cube, Metallic=1.0, Roughness=0.3, Coat_Weight=1.0)
    scene.camera.data.type = "ORTHO"


def linked_light_on_two_lobes(scene, cube):
    tree, _ = shader(cube)
    added = tree.nodes.new("ShaderNodeAddShader")
    translucent = into(tree, "ShaderNodeBsdfTranslucent", added.inputs[0])
    into(tree, "ShaderNodeBump", translucent.inputs["Normal"])
    into(tree, "ShaderNodeBsdfToon", added.inputs[1])
    tree.links.new(added.outputs[0], tree.nodes["Material Output"].inputs["Surface"])
    lamp = next(one for one in scene.objects if one.type == "LIGHT")
    lamp.light_linking.receiver_collection = bpy.data.collections.new("lit")
    lamp.light_linking.receiver_collection.objects.link(cube)


ODD = (
    bumped_coat, bumped_glass_in_fog, anisotropic_film_over_skin, values_that_are_no_numbers, meshes_without_area,
    mirrored_copies_under_a_lamp_of_nodes, emission_through_holes, catcher_and_holdout_without_light,
    hair_seen_by_a_wide_lens, orthographic_inside_of_a_box, linked_light_on_two_lobes,
)  # fmt: skip
FAST = (meshes_without_area, catcher_and_holdout_without_light)
CASES = [pytest.param(one, id=one.__name__, marks=() if one in FAST else pytest.mark.slow) for one in ODD]


@pytest.mark.parametrize("odd", CASES)
def test_draft_of_an_odd_scene_is_drawn(scene, region, odd):
    odd(scene, bpy.data.objects["Cube"])
    region.viewport.pace.cost = {1: 1.0, 2: 0.3, 4: 0.01}
    for k in range(2):
        region.viewport.dirty, region.camera = True, region.moved(0.02 * k)
        for _ in range(100):
            picture = region.draw()
            if region.viewport.frame.samples_done:
                break
        else:
            pytest.fail("The draft was not there after 100 redraws.")
    assert region.viewport.scale > 1
    for image in (picture, region.viewport.display.shown):
        shown = images.read(image)
        assert np.isfinite(shown).all()
        assert (shown[..., :3].max() > 0.01) == (odd is not catcher_and_holdout_without_light)
