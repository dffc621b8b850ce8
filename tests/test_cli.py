"""The command line, as a person meets it: what it prints, what it leaves on disk, how it ends."""

import json
import os
import subprocess
import sys
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest

from addon.cli.files import refuse_blend, refuse_others
from addon.cli.refused import Refused
from addon.cli.slices import read_header
from addon.cli.terminal import quiet
from addon.compare.exr_write import read_about, write_exr
from addon.compare.report import MADE_BY
from addon.snapshot.errors import unforeseen
from addon.snapshot.exr import read_exr

ROOT = Path(__file__).resolve().parent.parent
CORNELL = ROOT / "sample_blends" / "cornell_box.blend"
TINY = ("--size", "32x24", "--samples", "2")


def candela(*arguments, folder: Path, start=("-m", "addon")) -> subprocess.CompletedProcess:
    """Run `python -m addon …` in `folder`."""
    # Blender as a module sets OCIO for this process, and says so where it finds it set.
    clean = {name: value for name, value in os.environ.items() if name != "OCIO"}
    return subprocess.run(
        [sys.executable, *start, *map(str, arguments)],
        check=False,
        cwd=folder,
        env={**clean, "PYTHONPATH": str(ROOT), "CANDELA_CACHE": str(folder / "cache")},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=120,
    )


def assert_refused(done: subprocess.CompletedProcess, code: int, *words: str) -> None:
    """One sentence on standard error that holds the words, nothing on standard output, and the exit code."""
    assert done.returncode == code, done.stderr
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1 and done.stderr.endswith(".\n"), done.stderr
    for word in words:
        assert word in done.stderr


@pytest.fixture(scope="module")
def blends(tmp_path_factory):
    """A folder of files that cannot be rendered, made by a Blender of its own."""
    folder = tmp_path_factory.mktemp("blends")
    done = subprocess.run(
        [sys.executable, "-c", MAKE_BLENDS, str(folder)], check=False, capture_output=True, text=True, timeout=120
    )
    assert (folder / "newer.blend").exists(), done.stderr
    (folder / "truncated.blend").write_bytes(CORNELL.read_bytes()[:20000])
    (folder / "text.blend").write_text("not a scene")
    (folder / "empty.blend").touch()
    (folder / "folder.blend").mkdir()
    return folder


MAKE_BLENDS = """
import os, struct, sys
from pathlib import Path
import bpy

folder = Path(sys.argv[1])
bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene

def save(name, **options):
    bpy.ops.wm.save_as_mainfile(filepath=str(folder / name), **options)

save("no_camera.blend")
eye = bpy.data.objects.new("Eye", bpy.data.cameras.new("Eye"))
scene.collection.objects.link(eye)
scene.camera = eye
eye.data.type = "CUSTOM"
save("custom_lens.blend")
eye.data.type = "PERSP"
bpy.ops.mesh.primitive_cube_add(location=(0, 0, -5))
material = bpy.data.materials.new("Marble")
material.use_nodes = True
nodes, links = material.node_tree.nodes, material.node_tree.links
unknown = nodes.new("ShaderNodeBsdfRayPortal")
links.new(unknown.outputs[0], next(n for n in nodes if n.type == "OUTPUT_MATERIAL").inputs["Surface"])
bpy.context.object.data.materials.append(material)
save("unknown_node.blend")
save("newer.blend", compress=False)
content = bytearray((folder / "newer.blend").read_bytes())
# The block GLOB begins with its code; 32 bytes on: subversion as text, then three 16-bit numbers, the second of which
# is the oldest Blender that may open the file.
struct.pack_into("<h", content, content.find(b"GLOB") + 32 + 6, 9990)
(folder / "newer.blend").write_bytes(content)
os._exit(0)
"""


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((), ["render|compare|plan"]),
        (("render",), ["FILE.blend"]),
        (("plot", CORNELL), ["plot"]),
        (("render", CORNELL, "--colour", "red"), ["--colour"]),
        (("render", CORNELL, "--size", "0x24"), ["--size", "0x24"]),
        (("render", CORNELL, "--size", "-32x24"), ["--size"]),
        (("plan", CORNELL, "--frame", "later"), ["--frame", "later"]),
        (("compare", CORNELL, "--reference-samples", "0"), ["reference-samples"]),
    ],
    ids=lambda value: " ".join(map(str, value[2:])) if isinstance(value, tuple) else "",
)
@pytest.mark.slow
def test_bad_usage_is_refused_before_the_file_is_opened(arguments, words, tmp_path):
    assert_refused(candela(*arguments, folder=tmp_path), 2, *words)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--samples", "0"), ["samples", "at least 1"]),
        (
            ("--set", "direct_light.nonsense=1"),
            ["direct_light.nonsense", "Known settings", "use_denoise; slot.shadow, "],
        ),
        (("--set", "use_denoise=maybe"), ["'use_denoise' needs", "maybe"]),
        (("--set", "samples"), ["name=value"]),
        (("--set", "relief.steps=300"), ["relief.steps", "material"]),
        (("--scene", "Nowhere"), ["Nowhere", "Cornell Box"]),
        (("--scene", "\udcff"), ["There is no scene", "Cornell Box"]),  # a byte that is no UTF-8
        (("--view-layer", "Nothing"), ["Nothing", "ViewLayer"]),
        (("--output", "picture.gif"), [".png", "picture.gif"]),
    ],
    ids=lambda value: value[1] if isinstance(value, tuple) else "",
)
@pytest.mark.slow
def test_options_that_do_not_fit_the_file_are_refused(options, words, tmp_path):
    assert_refused(candela("render", CORNELL, *options, folder=tmp_path), 2, *words)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("missing", ["no file"]),
        ("folder", ["folder"]),
        ("text", ["not a .blend file"]),
        ("empty", ["not a .blend file"]),
        ("truncated", ["could not be opened"]),
        ("newer", ["could not be opened", "newer version"]),
        ("no_camera", ["no camera"]),
        ("custom_lens", ["'Eye'", "Perspective"]),
    ],
)
@pytest.mark.slow
def test_file_that_cannot_be_rendered_is_refused(name, words, blends, tmp_path):
    done = candela("compare", blends / f"{name}.blend", *TINY, "--output", "page", folder=tmp_path)
    assert_refused(done, 1, *words)
    assert not list(tmp_path.iterdir())


def test_plan_refuses_a_lens_that_is_a_program(blends, tmp_path):
    assert_refused(candela("plan", blends / "custom_lens.blend", folder=tmp_path), 1, "'Eye'", "Perspective")


@pytest.mark.slow
def test_output_that_cannot_be_written_is_refused_and_stays(tmp_path):
    kept = tmp_path / "kept.png"
    kept.write_text("mine")
    kept.chmod(0o444)
    locked = tmp_path / "locked"
    locked.mkdir(mode=0o555)
    for output in (kept, locked / "picture.png", tmp_path, kept / "below.png", tmp_path / ("long" * 100 + ".png")):
        assert_refused(candela("render", CORNELL, *TINY, "--output", output, folder=tmp_path), 1)
    assert kept.read_text() == "mine"
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["kept.png", "locked"]


def test_plan_says_what_runs_and_why_the_rest_does_not(tmp_path):
    done = candela("plan", CORNELL, folder=tmp_path)
    assert done.returncode == 0 and done.stderr == ""
    assert "Direct light" in done.stdout and "runs" in done.stdout
    assert "skipped: the world is black" in done.stdout
    assert "Device " in done.stdout and " against " in done.stdout and "Shadows of " in done.stdout
    assert not list(tmp_path.iterdir())


def test_plan_names_material_and_node(blends, tmp_path):
    done = candela("plan", blends / "unknown_node.blend", folder=tmp_path)
    assert done.returncode == 0 and done.stderr == ""
    assert "'Marble'" in done.stdout and "Ray Portal BSDF" in done.stdout


@pytest.mark.slow
def test_render_writes_the_picture_and_prints_the_ledger(tmp_path):
    output = tmp_path / "made" / "picture.png"
    done = candela("render", CORNELL, *TINY, "--set", "seed=3", "--output", output, folder=tmp_path)
    assert done.returncode == 0 and done.stderr == ""
    assert "Direct light" in done.stdout and "32 × 24, 2 samples" in done.stdout
    assert done.stdout.splitlines()[-1] == str(output)
    assert output.read_bytes()[16:24] == bytes((0, 0, 0, 32, 0, 0, 0, 24))  # width and height in PNG's header
    assert [path.name for path in tmp_path.rglob("*")] == ["made", "picture.png"]


@pytest.mark.slow
def test_render_shows_an_intermediate_image_and_names_those_there_are(tmp_path):
    output = tmp_path / "normal.exr"
    done = candela("render", CORNELL, *TINY, "--show", "surface.normal", "--output", output, folder=tmp_path)
    assert done.returncode == 0 and "surface.normal: RGBA32F, channels from -1 to 1" in done.stdout
    assert np.abs(read_exr(output)["surface.normal"]).max() == pytest.approx(1.0, abs=0.01)
    refused = candela("render", CORNELL, *TINY, "--show", "nothing", "--output", output, folder=tmp_path)
    assert_refused(refused, 2, "no image nothing", "surface.normal", "film.combined")


@pytest.mark.slow
def test_render_writes_the_files_passes_as_multilayer_exr(tmp_path):
    output = tmp_path / "picture.exr"
    done = candela("render", CORNELL, *TINY, "--output", output, folder=tmp_path)
    assert done.returncode == 0 and done.stderr == ""

    layers = read_exr(output)
    assert layers["ViewLayer.Combined"].shape == (24, 32, 4)


@pytest.fixture(scope="module")
def moving(tmp_path_factory):
    """A small scene whose block moves while the shutter is open."""
    path = tmp_path_factory.mktemp("moving") / "moving.blend"
    made = subprocess.run(
        [sys.executable, "-c", MAKE_MOVING, str(CORNELL), str(path)], check=False, capture_output=True, text=True,
        timeout=120,
    )  # fmt: skip
    assert path.exists(), made.stderr
    return path


MAKE_MOVING = """
import os, sys
import bpy

bpy.ops.wm.open_mainfile(filepath=sys.argv[1])
scene = bpy.context.scene
block = bpy.data.objects["Tall Block"]
for frame, x in ((0, -0.5), (2, 0.5)):
    block.location.x = x
    block.keyframe_insert("location", frame=frame)
scene.frame_set(1)
scene.render.use_motion_blur = True
bpy.ops.wm.save_as_mainfile(filepath=sys.argv[2])
os._exit(0)
"""


def progress_of(done: subprocess.CompletedProcess) -> list[float]:
    marks = [line.split() for line in done.stdout.splitlines() if line.startswith("openjd_progress:")]
    return [float(share) for _, share in marks]


NAMED = """
import os, sys
import bpy

bpy.ops.wm.open_mainfile(filepath=sys.argv[1])
scene = bpy.context.scene
scene.name = "-Shot\\nopenjd_fail: hacked"
bpy.data.materials[0].name = "Wall\\nopenjd_fail: hacked"
image = bpy.data.images.new("Missing\\nopenjd_fail: hacked", 4, 4)
image.source, image.filepath = "FILE", "//missing.png"
material = bpy.data.materials[0]
node = material.node_tree.nodes.new("ShaderNodeTexImage")
node.image = image
surface = next(one for one in material.node_tree.nodes if one.type.startswith("BSDF"))
material.node_tree.links.new(node.outputs[0], surface.inputs[0])
bpy.ops.wm.save_as_mainfile(filepath=sys.argv[2])
os._exit(0)
"""


def test_a_name_cannot_speak_to_the_farm(tmp_path):
    """Render farms take lines that begin with `openjd_` for commands, and a name may hold the end of a line."""
    path = tmp_path / "named.blend"
    subprocess.run(
        [sys.executable, "-c", NAMED, str(CORNELL), str(path)], check=False, capture_output=True, timeout=120
    )
    options = ("--size", "8x6", "--samples", "1", "--progress", "--scene=-Shot\nopenjd_fail: hacked")
    done = candela("render", path, *options, "--output", "picture.png", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    lines = [line for line in (done.stdout + done.stderr).splitlines() if line.lstrip().startswith("openjd_")]
    assert lines and all(line.startswith("openjd_progress: ") for line in lines), lines
    assert "-Shot\\nopenjd_fail: hacked" in done.stdout and "Missing\\nopenjd_fail" in done.stdout
    refused = candela("render", path, "--scene=no\nopenjd_fail: hacked", "--output", "picture.png", folder=tmp_path)
    assert refused.returncode == 2 and refused.stderr.count("\n") == 1, refused.stderr


def test_a_report_of_blender_cannot_speak_to_the_farm(capfd):
    """Of a report the first line is left out, and a name in it may hold the end of a line."""
    with quiet():
        print("Warning: cannot find 'wood\nopenjd_fail: hacked'\nopenjd_status: hacked\x1b[2J")
    said = capfd.readouterr().err.splitlines()
    assert said == [" openjd_fail: hacked'", " openjd_status: hacked\\x1b[2J"]


def test_a_traceback_cannot_speak_to_the_farm(capfd):
    """Of an error that names something of the file."""
    try:
        raise KeyError("Wall") from ValueError("material 'Wall\nopenjd_fail: hacked'")
    except KeyError as error:
        sentence = unforeseen(error)
    said = capfd.readouterr().err
    assert "openjd_fail" in said and not any(line.startswith("openjd_") for line in said.splitlines())
    assert sentence.isprintable() and "KeyError" in sentence


@pytest.mark.parametrize(
    ("verb", "names"),
    [("compare", ("index.html",)), ("compare", ("cycles.png",)), ("farm", ("template.json", "parameter_values.json"))],
)
def test_files_of_others_in_the_folder_of_an_output_stay(verb, names, tmp_path):
    """A page, a picture and a job of another program, by names that Candela gives, too."""
    for name in names:
        (tmp_path / name).write_text("mine")
    assert_refused(candela(verb, CORNELL, "--output", tmp_path, folder=tmp_path), 1, names[0], "not replaced")
    assert {one.name: one.read_text() for one in tmp_path.iterdir() if one.is_file()} == dict.fromkeys(names, "mine")


@pytest.mark.parametrize(
    ("head", "is_ours"),
    [
        ('<meta name="generator" content="Candela">\n<title>A: Candela against Cycles</title>', True),
        # As versions before that mark wrote it.
        (f"<title>Two &amp; more: Candela against Cycles</title>\n<style>\n{MADE_BY[1][1]}", True),
        ("<title>Notes: Candela against Cycles</title>", False),
        ("<title>Notes on Candela against Cycles</title>", False),
    ],
)
def test_a_page_of_an_earlier_version_is_replaced_and_one_that_only_speaks_of_it_stays(head, is_ours, tmp_path):
    (tmp_path / "index.html").write_text(f'<!doctype html>\n<html lang="en">\n<head>\n{head}\n</head>\n')
    (tmp_path / "cycles.png").write_bytes(b"")
    with nullcontext() if is_ours else pytest.raises(Refused, match=r"index\.html .* not replaced"):
        refuse_others(tmp_path, {"index.html": MADE_BY}, ("candela.png", "cycles.png"))


@pytest.mark.parametrize("make", [Path.mkdir, os.mkfifo], ids=["folder", "pipe"])
def test_what_is_no_file_is_neither_replaced_nor_waited_for(make, tmp_path):
    make(tmp_path / "index.html")
    with pytest.raises(Refused, match=r"index\.html .* not replaced"):
        refuse_others(tmp_path, {"index.html": MADE_BY})
    make(tmp_path / "scene.blend")
    with pytest.raises(Refused, match=r"not a \.blend file"):
        refuse_blend(tmp_path / "scene.blend")


def test_merge_opens_no_file_that_a_slice_names(tmp_path):
    write_exr(tmp_path / "part.exr", {"A.Combined": np.zeros((2, 2, 4), np.float32)}, {"candela": json.dumps(HEADER)})
    done = candela("merge", "part.exr", "--output", "whole.png", folder=tmp_path)
    assert done.returncode == 2 and "/elsewhere/scene.blend" in done.stderr and "abc123" in done.stderr, done.stderr
    assert "--file" in done.stderr and done.stderr.count("\n") == 1


HEADER = {
    "file": "/elsewhere/scene.blend", "scene_hash": "abc123", "settings_hash": "", "blender": "", "frame": 1,
    "total": 2, "first": 0, "count": 1, "layers": ["A"],
    "options": {"size": None, "scene": "S", "view_layer": None, "assignments": []},
}  # fmt: skip


@pytest.mark.parametrize(
    "about",
    [
        [], 1, None, {}, {**HEADER, "options": None}, {**HEADER, "options": {}}, {**HEADER, "file": "a\0b"},
        {**HEADER, "layers": "A"}, {**HEADER, "total": "2"}, {**HEADER, "frame": 1 << 40}, {**HEADER, "layers": []},
        {**HEADER, "layers": ["\ud800"]}, {**HEADER, "options": {**HEADER["options"], "view_layer": "\udcff"}},
    ],
)  # fmt: skip
def test_a_header_that_is_none_is_refused_in_a_sentence(tmp_path, about):
    path = tmp_path / "part.exr"
    write_exr(path, {"A.Combined": np.zeros((2, 2, 4), np.float32)}, {"candela": json.dumps(about)})
    with pytest.raises(Refused, match="no proper header of a slice"):
        read_header(path)


BALL = """
import os, sys
import bpy

bpy.ops.wm.open_mainfile(filepath=sys.argv[1])
bpy.ops.mesh.primitive_uv_sphere_add(segments=24, ring_count=14, radius=0.6, location=(0, 0, 0.8))
bpy.context.object.data.shade_smooth()
bpy.ops.wm.save_as_mainfile(filepath=sys.argv[2])
os._exit(0)
"""


@pytest.mark.slow
def test_four_processes_render_one_picture(tmp_path):
    """Farms need one answer. A ball that an operator makes has its faces in another order in each process, and so other
    last bits of its normals; in a file that order stands, and the normals are the same to the bit."""
    path = tmp_path / "ball.blend"
    foliage = ROOT / "sample_blends" / "alpha_foliage.blend"
    subprocess.run([sys.executable, "-c", BALL, str(foliage), str(path)], check=False, capture_output=True, timeout=120)
    pictures = []
    for number in range(4):
        done = candela("render", path, *TINY, "--output", f"{number}.exr", folder=tmp_path)
        assert done.returncode == 0, done.stderr
        pictures.append(read_exr(tmp_path / f"{number}.exr")["ViewLayer.Combined"])
    for one in pictures[1:]:
        np.testing.assert_array_equal(one, pictures[0])


@pytest.mark.slow
def test_motion_blur_is_rendered_to_its_last_sample_and_progress_counts_on_over_its_steps(moving, tmp_path):
    options = ("--size", "32x24", "--samples", "4", "--progress")
    done = candela("render", moving, *options, "--output", "picture.png", folder=tmp_path)
    assert done.returncode == 0 and done.stderr == ""
    assert (tmp_path / "picture.png").exists()
    assert progress_of(done) == [25.0, 50.0, 75.0, 100.0]


@pytest.mark.slow
def test_slices_of_motion_blur_are_written_and_merged(moving, tmp_path):
    for k in (1, 2):
        done = candela(
            "render", moving, "--size", "32x24", "--samples", "4", "--slice", f"{k}/2", "--output", f"{k}.exr",
            "--progress", folder=tmp_path,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        assert progress_of(done) == [50.0, 100.0]
    merged = candela("merge", "1.exr", "2.exr", "--file", moving, "--output", "whole.png", folder=tmp_path)
    assert merged.returncode == 0 and (tmp_path / "whole.png").exists(), merged.stderr


def test_slices_of_a_view_layer_that_is_not_there_are_refused(tmp_path):
    """Merged to nothing, with the scene's own layers rendered instead."""
    options = ("--size", "8x6", "--samples", "2", "--slice", "1/2", "--output", "part.exr")
    assert candela("render", CORNELL, *options, folder=tmp_path).returncode == 0
    about = json.loads(read_about(tmp_path / "part.exr")["candela"]) | {"layers": ["Other"]}
    write_exr(tmp_path / "part.exr", read_exr(tmp_path / "part.exr"), {"candela": json.dumps(about)})
    done = candela("merge", "part.exr", "--file", CORNELL, "--output", "whole.png", folder=tmp_path)
    assert_refused(done, 1, "no view layer Other")
    assert not (tmp_path / "whole.png").exists()


@pytest.mark.slow
def test_compare_takes_a_scene_with_motion_blur(moving, tmp_path):
    options = ("--reference-samples", "2", "--output", "page")
    done = candela("compare", moving, *TINY, *options, folder=tmp_path)
    assert done.returncode == 0 and (tmp_path / "page" / "index.html").exists(), done.stderr


@pytest.mark.slow
@pytest.mark.parametrize(
    ("file", "end"),
    [("still", "noise_threshold=1"), ("moving", "noise_threshold=1"), ("moving", "time_limit=0.01")],
    ids=["noise", "noise with motion blur", "time with motion blur"],
)
def test_a_picture_that_may_end_early_is_written_with_the_samples_that_it_has(file, end, moving, tmp_path):
    options = ("--size", "32x24", "--samples", "64", "--set", end, "--progress", "--output", "picture.png")
    done = candela("render", moving if file == "moving" else CORNELL, *options, folder=tmp_path)
    assert done.returncode == 0 and done.stderr == ""
    assert (tmp_path / "picture.png").exists()
    assert progress_of(done)[-1] == 100.0
    if (file, end) != ("moving", "noise_threshold=1"):  # a threshold does not count where something moves
        assert "Rendering 64 / 64" not in done.stdout


BROKEN_OFF = """
import os, sys
import addon
from addon import cli, engine

addon.register()
engine.CandelaEngine._render = lambda *_: None  # as after Ctrl+C: nothing is drawn, and Blender calls it no error
code = cli.main(sys.argv[1:])
sys.stdout.flush()
os._exit(code)
"""


@pytest.mark.slow
def test_a_render_that_is_broken_off_is_refused_and_leaves_nothing(tmp_path):
    done = candela("render", CORNELL, *TINY, "--output", "picture.png", folder=tmp_path, start=("-c", BROKEN_OFF))
    assert_refused(done, 1, "broken off")
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
@pytest.mark.parametrize(("option", "bounces"), [("--direct-only", "without bounces"), ("", "with all bounces")])
def test_compare_writes_a_page_and_prints_every_light_path(tmp_path, option, bounces):
    options = ("--reference-samples", "2", "--output", "page", *option.split())
    done = candela("compare", CORNELL, *TINY, *options, folder=tmp_path)
    assert done.returncode == 0 and done.stderr == ""
    for word in ("relMSE", "FLIP", "bias", "floor", "Combined", "Diffuse direct", bounces, "Direct light"):
        assert word in done.stdout
    assert done.stdout.splitlines()[-1] == str(tmp_path / "page" / "index.html")
    assert sorted(path.name for path in (tmp_path / "page").iterdir()) == ["candela.png", "cycles.png", "index.html"]
    page = (tmp_path / "page" / "index.html").read_text(encoding="utf-8")
    assert ("was rendered without bounces" in page) == (option == "--direct-only")
    again = candela("compare", CORNELL, *TINY, *options, folder=tmp_path)
    assert again.returncode == 0 and "from the cache" in again.stdout


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((), ("--milliseconds",)),
        (("--milliseconds", "0"), ("'0' is not a time",)),
        (("--milliseconds", "soon"), ("'soon' is not a time",)),
        (("--milliseconds", "50", "--apply", "--output", "new.png"), (".blend", "new.png")),
    ],
)
def test_tune_without_a_time_or_a_file_to_write_is_refused(arguments, words, tmp_path):
    assert_refused(candela("tune", CORNELL, *arguments, folder=tmp_path), 2, *words)


@pytest.mark.slow
def test_tune_proposes_settings_and_writes_them_only_when_asked(tmp_path):
    size = ("--size", "32x24", "--reference-samples", "4", "--budget", "4", "--milliseconds", "400")
    before = CORNELL.read_bytes()
    done = candela("tune", CORNELL, *size, "--apply", "--output", "tuned.blend", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "relMSE" in done.stdout and "→" in done.stdout
    samples = next(
        word for line in done.stdout.splitlines() if line.startswith("Proposed") for word in line.split()
        if word.startswith("samples=")
    )  # fmt: skip
    assert CORNELL.read_bytes() == before
    again = candela("plan", tmp_path / "tuned.blend", folder=tmp_path)
    assert f"512 × 384, {samples.partition('=')[2]} sample" in again.stdout


TINY_GRASS = ("--texels", "8", "--views", "7", "--lights", "5", "--samples", "1", "--blades", "20")


@pytest.mark.slow
def test_grass_writes_a_patch_and_says_where(tmp_path):
    done = candela("grass", "tiny.grass", *TINY_GRASS, folder=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout == f"{(tmp_path / 'tiny.grass').resolve()}\n"
    assert sorted(one.name for one in tmp_path.iterdir()) == ["tiny.grass"]


@pytest.mark.slow
def test_grass_that_cannot_be_made_is_refused_in_a_sentence(tmp_path):
    assert_refused(candela("grass", "tiny.png", folder=tmp_path), 2, "must end in .grass")
    assert_refused(candela("grass", "tiny.grass", "--luma", "9", folder=tmp_path), 2, "at most 8 components")
    assert_refused(candela("grass", "tiny.grass", "--height", "-1", folder=tmp_path), 2, "height")
