"""The packaged extension in a real Blender with a window: installed, chosen, rendered by F12, shown in the viewport.

    make test-window                                      uses `blender` from PATH, on the display of this session
    make test-window REAL_BLENDER="xvfb-run -a blender"   or any command that starts a Blender

What comes out stands in build/window/: the pictures, and what Blender printed.
"""

import json
import os
import shlex
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

pytestmark = pytest.mark.window

ROOT = Path(__file__).resolve().parents[2]
OUTPUT = ROOT / "build" / "window"
SAMPLE = ROOT / "sample_blends" / "soft_shadow_garden.blend"
BACKENDS = ("opengl", "vulkan")


def blender(*arguments, log, timeout_s):
    """Run the real Blender with the settings folder of this test; its output goes to the file `log`."""
    command = [*shlex.split(os.environ.get("REAL_BLENDER") or "blender"), *map(str, arguments)]
    environment = {**os.environ, "BLENDER_USER_RESOURCES": str(OUTPUT / "user")}
    with log.open("w") as file:
        done = subprocess.run(
            command,
            check=False,
            cwd=ROOT,
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=file,
            stderr=subprocess.STDOUT,
            timeout=timeout_s,
        )
    assert done.returncode == 0, log.read_text(errors="replace")[-3000:]


@pytest.fixture(scope="module")
def installed():
    """The newest zip of build/, installed and enabled in a fresh settings folder by Blender's own command."""
    shutil.rmtree(OUTPUT, ignore_errors=True)
    (OUTPUT / "user").mkdir(parents=True)
    package = max(ROOT.glob("build/candela-*.zip"), key=lambda path: path.stat().st_mtime)
    install = ("--command", "extension", "install-file", "--repo", "user_default", "--enable", package)
    blender(*install, log=OUTPUT / "install.log", timeout_s=120)


@pytest.fixture(scope="module", params=BACKENDS)
def driven(request, installed):
    """The folder of pictures of one backend, and what the script inside Blender recorded."""
    return drive(request.param)


def drive(backend, _done={}):  # noqa: B006 - a cache: each backend is driven once
    if backend not in _done:
        folder = OUTPUT / backend
        folder.mkdir()
        window = ("--gpu-backend", backend, "--window-geometry", "0", "0", "1280", "800")
        script = ("--python", Path(__file__).with_name("drive.py"), "--", folder, "CANDELA")
        blender(*window, SAMPLE, *script, log=folder / "blender.log", timeout_s=400)
        _done[backend] = folder, json.loads((folder / "result.json").read_text())
    return _done[backend]


def pixels(path, box=None):
    """The picture as (height, width, 3) in 0…255; `box` is (x, y, width, height) from the upper left corner."""
    picture = Image.open(path).convert("RGB")
    if box:
        x, y, width, height = box
        picture = picture.crop((x, y, x + width, y + height))
    return np.asarray(picture, np.float32)


def test_engine_is_there_and_nothing_failed(driven):
    folder, result = driven
    assert result.get("error") is None
    assert result["engine"] == "CANDELA"
    assert "Traceback" not in (folder / "blender.log").read_text(errors="replace")


def test_f12_completes_with_a_picture(driven):
    folder, result = driven
    assert result["render"] == "complete"
    picture = pixels(folder / "render.png")
    assert picture.shape == (180, 320, 3)
    assert picture.std() > 8


def test_viewport_shows_the_scene_and_refines_at_rest(driven):
    folder, result = driven
    first, early, late = (
        pixels(folder / f"viewport_{when}.png", result["viewport"]) for when in ("first", "early", "late")
    )
    assert late.std() > 8
    assert np.abs(early - late).mean() <= np.abs(first - late).mean()


def test_opengl_and_vulkan_render_the_same_picture(installed):
    """Within 1/255; one pixel in a thousand may differ more, where two rasterisers decide otherwise about an edge."""
    opengl, vulkan = (pixels(drive(backend)[0] / "render.png") for backend in BACKENDS)
    difference = np.abs(opengl - vulkan).max(axis=2)
    assert (difference > 1).mean() <= 0.001
    assert difference.mean() <= 0.05
