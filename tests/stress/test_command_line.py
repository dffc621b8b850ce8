"""Command lines of chance, and names with control characters: each is refused in one sentence, none with a traceback.

CANDELA_FUZZ=2000 tries that many; CANDELA_FUZZ_SEED=N others than usual.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
COUNT, SEED = int(os.environ.get("CANDELA_FUZZ", "100")), int(os.environ.get("CANDELA_FUZZ_SEED", "17"))

# A scene without a camera, so that nothing is rendered whatever is asked for. One process, in which main is called
# again and again: Blender takes seconds to begin.
CHILD = r"""
import contextlib, io, json, os, sys, traceback
from pathlib import Path
import bpy
import numpy as np
import addon
from addon import cli

count, seed, folder = int(sys.argv[1]), int(sys.argv[2]), Path(sys.argv[3])
os.chdir(folder)
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.context.scene.name = "Shot\n\x1b[2Kopenjd_fail: a"
bpy.context.scene.view_layers[0].name = "Layer\r\x07"
bpy.ops.wm.save_as_mainfile(filepath=str(folder / "scene.blend"))
(folder / "not\na scene.blend").write_text("no")
addon.register()
VALUES = [
    "-x", "--", "-", "", " ", "\n", "\r\x1b[2K", "a\nopenjd_fail: b", "\udcff", "½", "²", "٣", "1e999", "nan",
    "-inf", "-1", "0", "1", "1.5", "9" * 20, "9" * 5000, "4x4", "4x4x4", "9999999x4", "1-", "1-3:0", "3-1", "1,,2",
    "1-99999999", "=", "a=", "samples=", "samples=-1", "samples=" + "9" * 400, "use_denoise=\n", "slot.shadow=\n",
    "light_samples=nan", "exposure=1e999", "\u2028", "x" * 300, "../" * 40, "/", "5.2", "%s", "{}", "*", "png", "1/2",
    "2/1", "0/0", "-1/2", "Shot", "Layer", "picture.png", "scene.blend", "not\na scene.blend", "there/is/no.exr",
    "\U000e0001", "picture####.exr",
]
SHARED = ["--samples", "--size", "--frame", "--scene", "--view-layer", "--set"]
VERBS = {
    "render": ["--output", "--frames", "--show", "--slice", "--expect", "--compositing", "--skip-existing"],
    "plan": [], "compare": ["--output", "--reference-samples", "--cache", "--no-cache"],
    "tune": ["--milliseconds", "--budget", "--reference-samples", "--output", "--cache", "--apply"],
    "farm": ["--frames", "--chunk", "--split-samples", "--output", "--results", "--format", "--extensions"],
}
GRASS = ["--size", "--height", "--blades", "--seed", "--texels", "--views", "--lights", "--samples", "--luma"]
FLAGS = ("--compositing", "--skip-existing", "--no-cache", "--apply")
chance = np.random.default_rng(seed)
pick = lambda things: things[int(chance.integers(len(things)))]
wrong = []
for _ in range(count):
    verb = pick([*VERBS, "merge", "grass"])
    if verb == "merge":
        line, options = [verb, pick(VALUES), "--output=a.exr"], ["--file", "--frames", "--expect", "--output"]
    elif verb == "grass":  # of a folder that is a file: what is right is refused, too
        line, options = [verb, "/dev/null/patch.png" if chance.random() < 0.2 else "/dev/null/patch.grass"], GRASS
    else:
        line = [verb, pick(["scene.blend"] * 6 + VALUES)]
        options = SHARED + VERBS[verb]
        line += ["--milliseconds=5"] * (verb == "tune") + ["--output=there"] * (verb == "farm")
    for _ in range(int(chance.integers(1, 4))):
        option, value = pick(options), pick(VALUES)
        line += [option] if option in FLAGS else pick([[option, value], [f"{option}={value}"]])
    said, printed = io.StringIO(), io.StringIO()
    try:
        with contextlib.redirect_stderr(said), contextlib.redirect_stdout(printed):
            code = cli.main(line, "candela")
    except BaseException:
        wrong.append([line, traceback.format_exc()])
        continue
    text = said.getvalue()
    one = text.count("\n") == 1 and text.endswith(".\n") and text[:-1].isprintable()
    if code not in (1, 2) or not one or printed.getvalue():
        wrong.append([line, code, text, printed.getvalue()])
(folder / "wrong.json").write_text(json.dumps(wrong))
sys.stdout.flush()
os._exit(0)
"""


@pytest.mark.slow
def test_command_lines_of_chance_are_refused_in_one_sentence(tmp_path):
    clean = {name: value for name, value in os.environ.items() if name != "OCIO"}
    done = subprocess.run(
        [sys.executable, "-c", CHILD, str(COUNT), str(SEED), str(tmp_path)],
        check=False,
        cwd=ROOT,
        env={**clean, "PYTHONPATH": str(ROOT), "CANDELA_CACHE": str(tmp_path / "cache")},
        capture_output=True,
        timeout=120 + COUNT,
    )
    result = tmp_path / "wrong.json"
    assert result.exists(), done.stderr.decode(errors="replace")[-2000:]
    wrong = json.loads(result.read_text())
    assert not wrong, "\n".join(map(ascii, wrong[:5]))
