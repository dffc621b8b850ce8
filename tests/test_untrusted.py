"""A file from someone else: rendering it runs none of its code and writes nothing but what was asked for."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
TINY = ("--size", "16x12", "--samples", "1")

# The folder is the first argument. Whatever of the file's code runs leaves a file ran_….
MAKE = """
import os, sys
from pathlib import Path
import bpy

folder = Path(sys.argv[1])
bpy.ops.wm.read_factory_settings(use_empty=False)
scene = bpy.context.scene
scene.camera.name = "../../escaped"

text = bpy.data.texts.new("register.py")
text.use_module = True
text.write(f'''
import bpy
open({str(folder / "ran_text")!r}, "w")
def handler(*_):
    open({str(folder / "ran_handler")!r}, "w")
bpy.app.handlers.render_pre.append(handler)
bpy.app.handlers.frame_change_post.append(handler)
''')
driver = bpy.data.objects["Cube"].driver_add("location", 0).driver
driver.expression = f"len(open({str(folder / 'ran_driver')!r}, 'w').name) * 0"
style = bpy.data.texts.new("style.py")
style.write(f"open({str(folder / 'ran_style')!r}, 'w')")
layer = scene.view_layers[0]
scene.render.use_freestyle = layer.use_freestyle = True
layer.freestyle_settings.mode = "SCRIPT"
layer.freestyle_settings.modules.new().script = style

scene.render.use_render_cache = True
bpy.ops.mesh.primitive_grid_add(location=(0, 0, 3))
bpy.context.object.modifiers.new("Cloth", "CLOTH").point_cache.use_disk_cache = True

image = bpy.data.images.new("Texture", 4, 4)
image.filepath_raw, image.file_format = str(folder / "texture.png"), "PNG"
image.save()
packed = bpy.data.images.new("Packed", 4, 4)
packed.pack()
packed.filepath_raw = str(folder / "other" / "victim.png")
material = bpy.data.objects["Cube"].data.materials[0]
material.use_nodes = True
for shown in (image, packed):
    material.node_tree.nodes.new("ShaderNodeTexImage").image = shown

if bpy.app.version >= (5, 0):
    tree = scene.compositing_node_group = bpy.data.node_groups.new("Compositor", "CompositorNodeTree")
else:
    scene.use_nodes = True
    tree = scene.node_tree
inner = bpy.data.node_groups.new("Inner", "CompositorNodeTree")
group = tree.nodes.new("CompositorNodeGroup")
group.node_tree = inner

def write_to(tree, name, place, file, extension=True):
    node = tree.nodes.new("CompositorNodeOutputFile")
    node.name = name
    # Before Blender 5 groups of the compositor hold no render layers.
    layers = tree.nodes.new("CompositorNodeRGB" if tree is inner else "CompositorNodeRLayers")
    if hasattr(node, "directory"):
        node.directory, node.file_name = place, file
        node.format.media_type = "IMAGE"
        node.file_output_items.new("RGBA", "")
        node.use_file_extension = extension
    else:
        node.base_path = place
        node.file_slots[0].path = file
    node.format.file_format = "PNG"
    tree.links.new(layers.outputs[0], node.inputs[0])

write_to(tree, "Elsewhere", str(folder / "other"), "victim")
write_to(inner, "Nested", str(folder / "other"), "victim")
write_to(tree, "Itself", "//", "scene.blend", extension=False)
write_to(tree, "Up", str(folder / "out"), "../escaped")
write_to(tree, "By name", str(folder / "out"), "{camera_name}")
write_to(tree, "Proper", str(folder / "out" / "parts"), "beauty")
write_to(tree, "Taken", str(folder / "out"), "taken")
(folder / "other").mkdir()
(folder / "out").mkdir()
number = "" if bpy.app.version >= (5, 0) else "0001"  # of the frame
for place in (folder / "other" / f"victim{number}.png", folder / "out" / f"taken{number}.png"):
    place.write_text("mine")
bpy.ops.wm.save_as_mainfile(filepath=str(folder / "scene.blend"))
os._exit(0)
"""

WITH_PREFERENCE = """
import os, sys
import bpy
import addon
from addon import cli

bpy.context.preferences.filepaths.use_scripts_auto_execute = True
addon.register()
code = cli.main(sys.argv[1:])
sys.stdout.flush()
os._exit(code)
"""


def run(*arguments, folder: Path, start=("-m", "addon"), **environment) -> subprocess.CompletedProcess:
    """The command line in a working folder of its own, with a home and temporary files of its own."""
    clean = {name: value for name, value in os.environ.items() if name not in ("OCIO", "CANDELA_CACHE")}
    for name in ("work", "home", "temporary"):
        (folder / name).mkdir(exist_ok=True)
    own = {"PYTHONPATH": str(ROOT), "HOME": str(folder / "home"), "TMPDIR": str(folder / "temporary")}
    own["XDG_CACHE_HOME"] = str(folder / "home" / "caches")
    return subprocess.run(
        [sys.executable, *start, *map(str, arguments)],
        check=False, cwd=folder / "work", env={**clean, **own, **environment}, stdin=subprocess.DEVNULL,
        capture_output=True, text=True, timeout=180,
    )  # fmt: skip


@pytest.fixture
def folder(tmp_path):
    """A folder with scene.blend, which tries everything, and what it would overwrite."""
    place = tmp_path / "files"
    place.mkdir()
    made = subprocess.run(
        [sys.executable, "-c", MAKE, str(place)], check=False, capture_output=True, text=True, timeout=120,
        env={**os.environ, "TMPDIR": str(tmp_path)},
    )  # fmt: skip
    assert (place / "scene.blend").exists(), made.stderr
    for ran in place.glob("ran_*"):
        ran.unlink()
    return place


def contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.slow
def test_rendering_a_file_writes_the_picture_and_nothing_else(folder, tmp_path):
    before = contents(folder)
    done = run(
        "render", folder / "scene.blend", *TINY, "--frame", 3, "--output", folder / "out" / "a.png", folder=tmp_path
    )
    assert done.returncode == 0 and done.stderr == ""
    after = contents(folder)
    assert after.pop("out/a.png").startswith(b"\x89PNG")
    assert after == before
    assert "scripts were not run" in done.stdout
    assert contents(tmp_path / "work") == {} and contents(tmp_path / "temporary") == {}


@pytest.mark.slow
def test_file_output_nodes_write_below_the_output_and_replace_nothing(folder, tmp_path):
    before = contents(folder)
    options = ("--compositing", "--output", folder / "out" / "a.png")
    done = run("render", folder / "scene.blend", *TINY, *options, folder=tmp_path)
    assert done.returncode == 0 and done.stderr == ""
    after = contents(folder)
    new = sorted(after.keys() - before.keys())
    assert "out/a.png" in new and any(name.startswith("out/parts/beauty") for name in new)
    assert all(name.startswith("out/") for name in new)
    assert {name: after[name] for name in before} == before
    assert not list(tmp_path.glob("escaped*")) and not list(tmp_path.parent.glob("escaped*"))
    for name in ("Elsewhere", "Nested", "Itself", "Up"):
        assert f"'{name}'" in done.stdout and "mute" in done.stdout
    assert "taken" in done.stdout.partition("was there before")[0]


ONLY_PROPER = """
import os, sys
import bpy

bpy.ops.wm.open_mainfile(filepath=sys.argv[1], use_scripts=False)
scene = bpy.context.scene
tree = scene.compositing_node_group if bpy.app.version >= (5, 0) else scene.node_tree
for node in list(tree.nodes):
    if node.name != "Proper" and node.bl_idname in ("CompositorNodeOutputFile", "CompositorNodeGroup"):
        tree.nodes.remove(node)
node = tree.nodes["Proper"]
if hasattr(node, "directory"):
    node.file_name = "beauty_####"
else:
    node.file_slots[0].path = "beauty_####"
bpy.ops.wm.save_mainfile()
os._exit(0)
"""


@pytest.mark.slow
def test_file_output_nodes_write_below_the_output_in_each_of_several_frames(folder, tmp_path):
    subprocess.run([sys.executable, "-c", ONLY_PROPER, str(folder / "scene.blend")], check=True, capture_output=True)
    options = ("--compositing", "--frames", "1-3", "--output", folder / "out" / "a_####.png")
    for _ in range(2):  # the second run deletes what the first has left behind
        done = run("render", folder / "scene.blend", *TINY, *options, folder=tmp_path)
        assert done.returncode == 0 and done.stderr == ""
        found = sorted(path.name for path in (folder / "out" / "parts").glob("*"))
        assert found == [f"beauty_000{frame}.png" for frame in (1, 2, 3)]
        assert not [path for path in (folder / "out").iterdir() if path.name.startswith(".")]


@pytest.mark.slow
@pytest.mark.parametrize("start", [("-m", "addon"), ("-c", WITH_PREFERENCE)], ids=["module", "preference on"])
def test_no_code_of_the_file_runs_unless_it_is_trusted(start, folder, tmp_path):
    options = (*TINY, "--frame", 3, "--output", tmp_path / "a.png")
    done = run("render", folder / "scene.blend", *options, folder=tmp_path, start=start)
    assert done.returncode == 0
    assert not list(folder.glob("ran_*"))
    trusted = run("render", folder / "scene.blend", *options, "--run-scripts", folder=tmp_path, start=start)
    assert trusted.returncode == 0
    assert {"ran_text", "ran_handler", "ran_driver"} <= {path.name for path in folder.glob("ran_*")}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("verb", "output"),
    [
        (("render",), "texture.png"),
        (("tune", "--milliseconds", "50", "--budget", "1", "--apply"), "linked.blend"),
    ],
    ids=["a texture", "a library"],
)
def test_an_output_that_is_an_input_is_refused(verb, output, folder, tmp_path):
    if output == "linked.blend":
        link = (
            "import bpy, sys, os\nfrom pathlib import Path\nfolder = Path(sys.argv[1])\n"
            "bpy.ops.wm.open_mainfile(filepath=str(folder / 'scene.blend'), use_scripts=False)\n"
            "bpy.data.libraries.write(str(folder / 'linked.blend'), {bpy.data.worlds[0]})\n"
            "with bpy.data.libraries.load(str(folder / 'linked.blend'), link=True) as (there, here):\n"
            "    here.worlds = there.worlds\n"
            "bpy.context.scene.world = here.worlds[0]\n"
            "bpy.ops.wm.save_mainfile()\nos._exit(0)\n"
        )
        subprocess.run([sys.executable, "-c", link, str(folder)], check=True, capture_output=True, timeout=120)
    before = contents(folder)
    done = run(verb[0], folder / "scene.blend", *TINY, *verb[1:], "--output", folder / output, folder=tmp_path)
    assert done.returncode == 1 and "not replaced" in done.stderr and done.stderr.count("\n") == 1, done.stderr
    assert contents(folder) == before


@pytest.mark.slow
def test_compare_leaves_nothing_in_the_working_folder(folder, tmp_path):
    scene = ROOT / "sample_blends" / "cornell_box.blend"
    options = (*TINY, "--reference-samples", "1", "--output", tmp_path / "page")
    done = run("compare", scene, *options, folder=tmp_path)
    assert done.returncode == 0, done.stderr
    assert contents(tmp_path / "work") == {}
    assert len(list((tmp_path / "home" / "caches" / "candela" / "references").rglob("*.npz"))) == 1
    again = run("compare", scene, *options, "--cache", tmp_path / "kept", folder=tmp_path)
    assert again.returncode == 0 and "from the cache" not in again.stdout
    assert len(list((tmp_path / "kept").rglob("*.npz"))) == 1
