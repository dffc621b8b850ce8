"""The extension's zip: what is in it, and that Blender installs, enables and runs it from there."""

import importlib.util
import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture(scope="module")
def package(tmp_path_factory):
    """The zip, built and validated by Blender's own tool."""
    specification = importlib.util.spec_from_file_location("package", ROOT / "tools" / "package.py")
    builder = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(builder)
    return builder.build(tmp_path_factory.mktemp("package"))


def test_zip_holds_the_extension_and_nothing_else(package):
    names = set(zipfile.ZipFile(package).namelist())
    assert {"blender_manifest.toml", "LICENSE", "__init__.py", "addon/__init__.py"} <= names
    rest = names - {"blender_manifest.toml", "LICENSE", "__init__.py"}
    foreign = [name for name in rest if not name.startswith(("addon/", "shaders/"))]
    foreign += [name for name in rest if not name.endswith((".py", ".glsl", ".html", ".npz", ".json", ".js", ".grass"))]
    assert not foreign


def test_zip_holds_every_module_and_shader(package):
    names = set(zipfile.ZipFile(package).namelist())
    sources = [*ROOT.glob("addon/**/*.py"), *ROOT.glob("shaders/**/*.glsl")]
    assert {path.relative_to(ROOT).as_posix() for path in sources} <= names


# Runs in an empty folder, so that nothing of the checkout can be imported: what works, works from the zip.
INSTALLED = """
import os, sys, traceback
import bpy

def main(package):
    bpy.ops.wm.read_factory_settings()
    installed = bpy.ops.extensions.package_install_files(filepath=package, repo="user_default", enable_on_install=True)
    assert installed == {"FINISHED"}, installed
    assert "bl_ext.user_default.candela" in bpy.context.preferences.addons
    assert "addon" not in sys.modules
    scene = bpy.context.scene
    scene.render.engine = "CANDELA"
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 48, 32, 100
    scene.render.image_settings.file_format = "PNG"
    scene.render.filepath = os.path.join(os.getcwd(), "picture.png")
    assert bpy.ops.render.render(write_still=True) == {"FINISHED"}
    picture = bpy.data.images.load(scene.render.filepath)
    assert tuple(picture.size) == (48, 32)
    assert len(set(picture.pixels[:][::4])) > 8, "the picture is of one colour"
    scene.render.engine = "BLENDER_WORKBENCH"
    bpy.ops.preferences.addon_disable(module="bl_ext.user_default.candela")
    try:
        scene.render.engine = "CANDELA"
    except TypeError:
        return
    raise AssertionError("the engine is still there after the extension was disabled")

try:
    main(sys.argv[1])
    code = 0
except BaseException:
    traceback.print_exc()
    code = 1
sys.stdout.flush()
sys.stderr.flush()
os._exit(code)
"""


@pytest.mark.slow
def test_zip_installs_renders_and_is_disabled(package, tmp_path):
    environment = {**os.environ, "BLENDER_USER_RESOURCES": str(tmp_path / "user")}
    environment.pop("PYTHONPATH", None)
    (tmp_path / "user").mkdir()
    done = subprocess.run(
        [sys.executable, "-c", INSTALLED, str(package)],
        check=False,
        cwd=tmp_path,
        env=environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stdout[-4000:]
