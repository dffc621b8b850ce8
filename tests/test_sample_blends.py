"""The sample scenes: each file opens, stands alone, holds what it promises, renders, and comes out of its script."""

import subprocess
import sys
from collections import Counter
from pathlib import Path

import bpy
import numpy as np
import pytest

from addon.ui import ENGINE

FOLDER = Path(__file__).resolve().parent.parent / "sample_blends"

LIGHTS = {  # how many of each kind
    "cornell_box": {"AREA": 1},
    "soft_shadow_garden": {"SUN": 1, "AREA": 2, "SPOT": 1, "POINT": 1},
    "hdri_product": {},
    "instances": {"SUN": 1, "AREA": 1, "POINT": 4},
    "window_interior": {"SUN": 1, "AREA": 1, "POINT": 1},
    "alpha_foliage": {"SUN": 1},
    "colonnade_hall": {"SUN": 1},
    "door_ajar": {"AREA": 1},
    "meadow": {"SUN": 1},
    "sky_courtyard": {},
    "emissive_lamp": {},
    "caustics_pool": {"SUN": 1},
    "caustics_rings": {"SPOT": 1},
    "caustics_table": {"SPOT": 1},
}
SHADERS = {
    "BSDF_PRINCIPLED",
    "BSDF_DIFFUSE",
    "BSDF_GLOSSY",
    "BSDF_TRANSPARENT",
    "EMISSION",
    "MIX_SHADER",
    "ADD_SHADER",
    "TEX_IMAGE",
    "OUTPUT_MATERIAL",
}


@pytest.fixture(params=list(LIGHTS))
def sample(request, registered):
    """Each committed scene, opened; Blender is left empty."""
    bpy.ops.wm.open_mainfile(filepath=str(FOLDER / f"{request.param}.blend"))
    yield request.param
    bpy.ops.wm.read_factory_settings(use_empty=True)


@pytest.fixture(scope="module")
def made_anew(tmp_path_factory) -> Path:
    """A folder with all scenes, written by the script in a fresh process."""
    folder = tmp_path_factory.mktemp("samples")
    script = FOLDER / "make.py"
    run = subprocess.run([sys.executable, script, "--out", folder], capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    return folder


def drawn_triangles() -> tuple[int, int]:
    """Meshes drawn and triangles in them, instances counted each time they show."""
    counts, drawn, triangles = {}, 0, 0
    for instance in bpy.context.evaluated_depsgraph_get().object_instances:
        if instance.object.type != "MESH":
            continue
        mesh = instance.object.data
        if mesh.as_pointer() not in counts:
            mesh.calc_loop_triangles()
            counts[mesh.as_pointer()] = len(mesh.loop_triangles)
        drawn += 1
        triangles += counts[mesh.as_pointer()]
    return drawn, triangles


def inventory() -> dict:
    """What a scene is made of, by name."""
    objects = {}
    for thing in bpy.context.scene.objects:
        size = len(thing.data.polygons) if thing.type == "MESH" else 0
        place = tuple(round(value, 4) for row in thing.matrix_world for value in row)
        objects[thing.name] = (thing.type, size, place, tuple(modifier.type for modifier in thing.modifiers))
    return {
        "objects": objects,
        "lights": {light.name: (light.type, round(light.energy, 3)) for light in bpy.data.lights},
        "materials": sorted(material.name for material in bpy.data.materials),
        "images": {image.name: tuple(image.size) for image in bpy.data.images if image.users},
        "drawn": drawn_triangles(),
    }


def test_every_sample_file_is_listed_and_small():
    files = {path.stem: path.stat().st_size for path in FOLDER.glob("*.blend")}
    assert set(files) == set(LIGHTS)
    assert max(files.values()) < 1.5 * 2**20


def test_has_camera_world_and_its_lights(sample):
    scene = bpy.context.scene
    assert scene.camera is not None
    assert scene.world is not None
    kinds = Counter(thing.data.type for thing in scene.objects if thing.type == "LIGHT")
    assert kinds == LIGHTS[sample]


def test_opens_with_candela_at_a_common_size_with_a_plain_view(sample):
    scene = bpy.context.scene
    assert scene.render.engine == ENGINE
    assert (scene.render.resolution_x, scene.render.resolution_y) == (512, 384)
    assert scene.render.resolution_percentage == 100
    assert scene.view_settings.view_transform == "Standard"


def test_stands_alone(sample):
    """Images are packed, nothing is linked from elsewhere."""
    images = [image for image in bpy.data.images if image.users]
    assert all(image.packed_file for image in images)
    assert not bpy.data.libraries


def test_materials_use_only_the_first_shader_nodes(sample):
    for material in bpy.data.materials:
        kinds = {node.type for node in material.node_tree.nodes}
        assert kinds <= SHADERS, f"{material.name}: {kinds - SHADERS}"


def test_triangles_stay_few_enough_for_a_software_gpu(sample):
    drawn, triangles = drawn_triangles()
    if sample == "instances":
        assert drawn > 2000
        assert triangles < 200_000
    else:
        assert triangles < 60_000


def test_cycles_renders_it(sample, tmp_path):
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"  # the files open with Candela
    scene.render.resolution_x = scene.render.resolution_y = 16
    scene.cycles.samples = 64  # so that most pixels of a room behind a door see light
    scene.cycles.use_denoising = False
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.filepath = str(tmp_path / "picture.exr")
    bpy.ops.render.render(write_still=True)
    picture = bpy.data.images.load(scene.render.filepath)
    pixels = np.empty(16 * 16 * 4, np.float32)
    picture.pixels.foreach_get(pixels)
    rgb = pixels.reshape(-1, 4)[:, :3]
    assert np.isfinite(rgb).all()
    assert (rgb >= 0).all()
    assert (rgb.max(axis=1) > 0).mean() > 0.5


def test_script_makes_the_same_scene(sample, made_anew):
    committed = inventory()
    bpy.ops.wm.open_mainfile(filepath=str(made_anew / f"{sample}.blend"))
    anew = inventory()
    for part, content in committed.items():
        assert anew[part] == content, part


def test_script_refuses_a_name_it_does_not_know(tmp_path):
    run = subprocess.run(
        [sys.executable, FOLDER / "make.py", "--out", tmp_path, "teapot"], capture_output=True, text=True, check=False
    )
    assert run.returncode != 0
    assert "there is no scene 'teapot'" in run.stderr


def test_cornell_box_has_the_published_camera_and_lamp():
    bpy.ops.wm.open_mainfile(filepath=str(FOLDER / "cornell_box.blend"))
    camera, lamp = bpy.data.objects["Camera"], bpy.data.objects["Lamp"]
    assert np.degrees(camera.data.angle_y) == pytest.approx(39.3077, abs=1e-3)
    assert tuple(camera.location) == pytest.approx((0.0, -8.0, 2.73))
    radiance = np.array(lamp.data.color) * lamp.data.energy / (np.pi * lamp.data.size * lamp.data.size_y)
    assert radiance == pytest.approx([17.0, 12.0, 4.0], rel=1e-5)
    assert lamp.location.z == pytest.approx(5.488 - 0.01)
    bpy.ops.wm.read_factory_settings(use_empty=True)
