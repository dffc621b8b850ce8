"""The pass tree in Blender: nodes from the registry, running it, comparing it, rendering with it."""

import warnings

import bpy
import numpy as np
import pytest

from addon import engine
from addon.frame import ledger
from addon.frame.pass_graph import sockets
from addon.techniques import REGISTRY
from addon.ui import ENGINE, pass_tree, shown_images
from addon.ui.pass_nodes import NODES, SHOWING
from addon.ui.pass_tree import TREE, checked, graph_of, result
from addon.ui.properties import settings_of, titled


@pytest.fixture
def scene(registered, gpu_context, empty_scene):
    """A sphere on a floor, lit by a lamp."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        bpy.ops.mesh.primitive_plane_add(size=8)
        bpy.ops.mesh.primitive_uv_sphere_add(segments=16, ring_count=8, location=(0, 0, 1))
        bpy.ops.object.light_add(type="POINT", location=(2, -2, 4))
        bpy.context.object.data.energy = 400
        bpy.ops.object.camera_add(location=(4, -5, 4), rotation=(0.95, 0, 0.67))
        empty_scene.camera = bpy.context.object
    empty_scene.render.engine = ENGINE
    empty_scene.render.resolution_x, empty_scene.render.resolution_y = 64, 48
    empty_scene.candela.bounces = 0
    yield empty_scene
    engine.free_sessions()


@pytest.fixture
def tree(scene):
    assert bpy.ops.candela.passes_from_auto(tree="Passes", use=True) == {"FINISHED"}
    made = bpy.data.node_groups["Passes"]
    made.samples, made.percentage, made.reference_samples = 4, 100, 16
    return made


def node(tree, technique):
    return next(one for one in tree.nodes if one.technique == technique)


def output(tree):
    return next(one for one in tree.nodes if one.bl_idname == "CandelaPassOutput")


def test_every_technique_has_a_node_with_its_sockets(registered, empty_scene):
    tree = bpy.data.node_groups.new("All", TREE)
    for technique in REGISTRY:
        made = tree.nodes.new(f"CandelaPass_{technique.name}")
        inputs, outputs = sockets(technique, REGISTRY)
        assert [socket.identifier for socket in made.inputs] == [socket.name for socket in inputs]
        assert [socket.identifier for socket in made.outputs] == [socket.name for socket in outputs]
        assert made.bl_label == titled(technique.label)
    assert len(NODES) == len(REGISTRY) + len(SHOWING)


def test_new_from_auto_is_fine_and_names_what_auto_runs(scene, tree):
    found = checked(graph_of(tree))
    assert found.fine
    assert {"surfaces", "direct_light", "film"} <= set(found.order)
    assert "environment_light" not in found.order, "the world is black"
    assert scene.candela.pass_tree == tree
    assert all(link.is_valid for link in tree.links)


def test_new_from_auto_leaves_what_renders_run_alone(scene):
    assert bpy.ops.candela.passes_from_auto(tree="Passes") == {"FINISHED"}
    assert "Passes" in bpy.data.node_groups and scene.candela.pass_tree is None


def test_nodes_have_the_colour_of_what_they_are_for(tree):
    colors = {one.technique: tuple(round(c, 3) for c in one.color) for one in tree.nodes if one.technique}
    assert all(one.use_custom_color for one in tree.nodes if one.technique)
    assert colors["film"] != colors["surfaces"] != colors["direct_light"] != colors["film"]


def test_pictures_of_nodes_are_opaque(tree):
    """The fourth channel of light is no opacity: an image with it would show nothing."""
    assert bpy.ops.candela.passes_run(tree=tree.name) == {"FINISHED"}
    pictures = {one.name: result(one).picture for one in tree.nodes if result(one) and result(one).picture is not None}
    assert len(pictures) > 3
    for name, picture in pictures.items():
        assert picture.shape[-1] < 4 or (picture[..., 3] == 1.0).all(), name
    assert bpy.ops.candela.passes_run(tree=tree.name, node=node(tree, "direct_light").name) == {"FINISHED"}
    pixels = np.array(bpy.data.images[f"Candela {tree.name}"].pixels).reshape(-1, 4)
    assert (pixels[:, 3] == 1.0).all() and pixels[:, :3].max() > 0.0


def test_the_time_of_a_first_run_holds_no_compilation(tree, monkeypatch):
    """Where something was compiled, the picture is drawn once more, and that is what is timed."""
    from addon.gfx import library
    from addon.ui import pass_run

    begun = []
    whole = pass_run._begun
    monkeypatch.setattr(pass_run, "_begun", lambda *given: begun.append(library.compile_count) or whole(*given))
    library._release()
    pass_run.free()
    assert bpy.ops.candela.passes_run(tree=tree.name) == {"FINISHED"}
    assert len(begun) == 2 and begun[1] > begun[0]
    compiled = library.compile_count
    assert bpy.ops.candela.passes_run(tree=tree.name) == {"FINISHED"}
    assert len(begun) == 3 and library.compile_count == compiled


def test_run_gives_pictures_and_times(tree):
    assert bpy.ops.candela.passes_run(tree="Passes") == {"FINISHED"}
    for name in ("surfaces", "direct_light", "film"):
        assert result(node(tree, name)).milliseconds > 0
    picture = result(output(tree)).picture
    assert picture.shape == (48, 64, 4) and picture[..., :3].std() > 0.01
    image = bpy.data.images["Candela Passes"]
    assert np.allclose(np.array(image.pixels[:]).reshape(48, 64, 4), picture, atol=1e-6)


def test_run_is_the_final_render(scene, tree, tmp_path):
    bpy.ops.candela.passes_run(tree="Passes")
    picture = result(output(tree)).picture
    scene.candela.samples = 4
    settings = scene.render.image_settings
    settings.file_format, settings.color_mode, settings.color_depth = "OPEN_EXR", "RGBA", "32"
    scene.render.filepath = str(tmp_path / "final.exr")
    for with_tree in (True, False):
        scene.candela.pass_tree = tree if with_tree else None
        bpy.ops.render.render(write_still=True)
        loaded = bpy.data.images.load(scene.render.filepath, check_existing=False)
        assert np.allclose(np.array(loaded.pixels[:]).reshape(picture.shape), picture, atol=1e-5), with_tree


def test_engine_renders_the_tree_in_place_of_auto(scene, tree):
    node(tree, "accumulated_maps").mute = True
    assert settings_of(scene, viewport=False).passes == checked(graph_of(tree)).order
    scene.candela.samples = 1
    bpy.ops.render.render()
    assert ledger.latest().row("accumulated_maps").reason == "it is not in the pass tree"
    assert ledger.latest().row("direct_light").state == ledger.RAN


def test_tree_without_film_fails_with_a_sentence(scene, tree):
    tree.nodes.remove(node(tree, "film"))
    with pytest.raises(RuntimeError, match="The pass tree holds no Film"):
        bpy.ops.render.render()


def test_run_to_a_node_runs_what_it_needs(tree):
    name = node(tree, "direct_light").name
    assert bpy.ops.candela.passes_run(tree="Passes", node=name) == {"FINISHED"}
    assert result(node(tree, "direct_light")).picture.max() > 0
    assert result(node(tree, "film")) is None


def test_empty_tree_and_wrong_names_are_refused_with_a_sentence(scene):
    bpy.data.node_groups.new("Empty", TREE)
    with pytest.raises(RuntimeError, match="Nothing leads to an Image Output"):
        bpy.ops.candela.passes_run(tree="Empty")
    with pytest.raises(RuntimeError, match="There is no pass tree 'Other'"):
        bpy.ops.candela.passes_run(tree="Other")
    with pytest.raises(RuntimeError, match="choose New from Auto first"):
        bpy.ops.candela.passes_run()


def test_circle_missing_and_wrong_links_are_told_on_the_node(tree):
    direct, film, surfaces = node(tree, "direct_light"), node(tree, "film"), node(tree, "surfaces")
    tree.links.remove(direct.inputs["Surface"].links[0])
    tree.links.new(direct.inputs["Surface"], film.outputs["Depth"])
    pass_tree.mark_links(tree)
    found = checked(graph_of(tree))
    assert any("but the link brings depth" in sentence for sentence in found.sentences[direct.name])
    assert any("has no link: it comes from Surfaces" in sentence for sentence in found.sentences[direct.name])
    assert any("wait for each other" in s for said in found.sentences.values() for s in said) or found.wrong_links
    assert not all(link.is_valid for link in tree.links)
    assert surfaces.name not in found.sentences
    bpy.ops.candela.passes_run(tree="Passes")  # draws what is left


def test_showing_nodes_show_what_they_say(tree):
    film = node(tree, "film")
    made = {}
    for kind in SHOWING[1:]:
        new = made[kind.bl_idname] = tree.nodes.new(kind.bl_idname)
        for socket in new.inputs:
            tree.links.new(socket, film.outputs["Combined"])
    assert bpy.ops.candela.passes_run(tree="Passes") == {"FINISHED"}
    picture = result(output(tree)).picture
    assert np.all(result(made["CandelaPassDifference"]).picture == 0)
    assert result(made["CandelaPassFalseColor"]).picture.shape == (48, 64, 3)
    split = result(made["CandelaPassSplit"]).picture
    assert np.array_equal(split[:, :32], picture[:, :32, :3]) and np.all(split[:, 32] == 1)
    assert result(made["CandelaPassErrorMap"]) is None, "there is no reference yet"


def test_bake_keeps_the_picture_in_the_file(tree):
    bpy.ops.candela.passes_run(tree="Passes")
    name = output(tree).name
    assert bpy.ops.candela.passes_bake(tree="Passes", node=name) == {"FINISHED"}
    image = bpy.data.images[f"Passes {name}"]
    assert image.packed_file and image.is_float and tuple(image.size) == (64, 48)
    kept = np.array(image.pixels[:], np.float32)
    image.pixels.foreach_set(np.zeros_like(kept))
    assert bpy.ops.candela.passes_bake(tree="Passes", node=name) == {"FINISHED"}  # into the same image
    assert f"Passes {name}.001" not in bpy.data.images and image.packed_file
    np.testing.assert_allclose(np.array(image.pixels[:]), kept, atol=1e-6)
    with pytest.raises(RuntimeError, match="has no picture yet"):
        bpy.ops.candela.passes_bake(tree="Passes", node="nobody")


def test_image_takes_another_size(registered, empty_scene):
    first = shown_images.write("Candela test", np.zeros((4, 6, 3), np.float32))
    again = shown_images.write("Candela test", np.full((8, 5, 1), 0.25, np.float32))
    assert first == again and tuple(again.size) == (5, 8)
    assert np.allclose(np.array(again.pixels[:]).reshape(8, 5, 4)[2, 2], [0.25, 0.25, 0.25, 1.0])


def test_compare_shows_the_error_of_each_light_path(tree, tmp_path, monkeypatch):
    monkeypatch.setenv("CANDELA_CACHE", str(tmp_path))
    assert bpy.ops.candela.passes_compare(tree="Passes") == {"FINISHED"}
    lines = " ".join(line for one in tree.nodes for line in (result(one).errors if result(one) else []))
    for path in ("Diffuse direct", "Glossy direct", "Combined", "Color diffuse"):
        assert f"{path}: " in lines
    assert len(result(node(tree, "direct_light")).errors) == 2, "diffuse and glossy"
    assert list(tmp_path.rglob("*.npz"))
