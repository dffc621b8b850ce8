"""Jobs for render farms, run by the runtimes that farms use: OpenJD's sessions dispatched by Dask, and Node.js."""

import argparse
import json
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from addon.cli import files
from addon.snapshot.exr import read_exr

ROOT = Path(__file__).resolve().parents[2]
FRAMES, SLICES = 6, 2
MAKE = """
import os, sys
import bpy
bpy.ops.wm.open_mainfile(filepath=sys.argv[1])
scene = bpy.context.scene
scene.frame_start, scene.frame_end = 1, 6
lamp = next(thing for thing in scene.objects if thing.type in ("LIGHT", "MESH"))
for frame in (1, 6):
    lamp.location.z -= 0.02 * frame
    lamp.keyframe_insert("location", frame=frame)
layer = scene.view_layers[0]
for name in ("z", "normal", "position", "diffuse_direct", "diffuse_indirect", "diffuse_color", "object_index", "emit"):
    setattr(layer, f"use_pass_{name}", True)
bpy.ops.wm.save_as_mainfile(filepath=sys.argv[2])
os._exit(0)
"""


def environment() -> dict[str, str]:
    return {name: value for name, value in os.environ.items() if name != "OCIO"} | {"PYTHONPATH": str(ROOT)}


def candela(*arguments, folder: Path) -> subprocess.CompletedProcess:
    return subprocess.run(
        [sys.executable, "-m", "addon", *map(str, arguments)], cwd=folder, env=environment(), check=False,
        stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=300,
    )  # fmt: skip


@pytest.fixture(scope="module")
def moving(tmp_path_factory):
    """An animated file with several passes."""
    path = tmp_path_factory.mktemp("scene") / "moving.blend"
    box = ROOT / "sample_blends" / "cornell_box.blend"
    made = subprocess.run(
        [sys.executable, "-c", MAKE, str(box), str(path)], check=False, capture_output=True, text=True
    )
    assert path.exists(), made.stderr
    return path


def job(folder, moving, *options):
    """A bundle in `folder`; its pictures go into folder/pictures."""
    done = candela(
        "farm", moving, "--size", "48x36", "--samples", "6", "--output", folder, *options, folder=folder.parent
    )
    assert done.returncode == 0, done.stderr
    return json.loads((folder / "template.json").read_text("utf-8"))


def same(one: Path, other: Path) -> float:
    """Largest difference of two files over the largest value of its pass."""
    first, second = read_exr(one), read_exr(other)
    assert first.keys() == second.keys() and len(first) > 5
    worst = 0.0
    for name, pixels in first.items():
        scale = max(float(np.abs(pixels[np.abs(pixels) < 1e9]).max(initial=0.0)), 1e-6)
        worst = max(worst, float(np.abs(pixels - second[name]).max()) / scale)
    return worst


# ------------------------------------------------------------------------------------------------------------ slices


@pytest.mark.slow
def test_slices_make_the_picture_of_all_samples(moving, tmp_path):
    """Passes, denoising and file format included; a whole picture's picture is the mean of floats in another order."""
    options = ("--size", "48x36", "--samples", "6")
    assert candela("render", moving, *options, "--output", "whole.exr", folder=tmp_path).returncode == 0
    for k in (1, 2, 3):
        done = candela("render", moving, *options, "--slice", f"{k}/3", "--output", f"s{k}.exr", folder=tmp_path)
        assert done.returncode == 0, done.stderr
    done = candela("merge", "s3.exr", "s1.exr", "s2.exr", "--file", moving, "--output", "merged.exr", folder=tmp_path)
    assert done.returncode == 0 and done.stderr == ""
    difference = same(tmp_path / "whole.exr", tmp_path / "merged.exr")
    print(f"merged beside whole: {difference:.1e} of the largest value")
    assert difference < 1e-5

    other = tmp_path / "other.exr"
    for arguments, words in (
        (("s1.exr", "s2.exr"), "Samples 4 to 5 of 6 are missing"),
        (("s1.exr", "s1.exr", "s2.exr", "s3.exr"), "more than one slice"),
        (("s1.exr", "whole.exr"), "is no slice"),
        (("s1.exr", "nothing.exr"), "no file nothing.exr"),
        (("s1.exr", "s2.exr", "s3.exr", "--file", ROOT / "sample_blends" / "cornell_box.blend"), "has been changed"),
    ):
        done = candela("merge", "--file", moving, "--output", other, *arguments, folder=tmp_path)
        assert done.returncode == 1 and words in done.stderr and done.stderr.count("\n") == 1, done.stderr
        assert not other.exists()
    done = candela("render", moving, "--size", "32x24", "--samples", "6", "--slice", "3/3", "--output", "s3.exr",
                   folder=tmp_path)  # fmt: skip
    assert done.returncode == 0
    done = candela("merge", "s1.exr", "s2.exr", "s3.exr", "--file", moving, "--output", other, folder=tmp_path)
    assert done.returncode == 1 and "different pictures" in done.stderr
    (tmp_path / "s2.exr").write_bytes((tmp_path / "s2.exr").read_bytes()[:9000])
    done = candela("merge", "s1.exr", "s2.exr", "--file", moving, "--output", other, folder=tmp_path)
    assert done.returncode == 1 and "s2.exr" in done.stderr and done.stderr.count("\n") == 1, done.stderr


CHANGE = """
import os, sys
import addon, bpy
addon.register()
bpy.ops.wm.open_mainfile(filepath=sys.argv[1])
bpy.context.scene.candela.bounces = int(sys.argv[2])
bpy.ops.wm.save_as_mainfile(filepath=sys.argv[1])
os._exit(0)
"""


@pytest.mark.slow
def test_slices_of_other_settings_are_refused(moving, tmp_path):
    """The file is saved with fewer bounces between two slices."""
    file = tmp_path / "moving.blend"
    shutil.copy(moving, file)

    def saved(bounces):
        command = [sys.executable, "-c", CHANGE, str(file), str(bounces)]
        done = subprocess.run(command, check=False, env=environment(), capture_output=True, text=True)
        assert "Error" not in done.stderr, done.stderr

    def rendered(part):
        options = ("--size", "24x18", "--samples", "2", "--slice", f"{part}/2", "--output", f"s{part}.exr")
        assert candela("render", file, *options, folder=tmp_path).returncode == 0

    def refusal():
        done = candela("merge", "s1.exr", "s2.exr", "--file", file, "--output", "merged.exr", folder=tmp_path)
        return done.stderr if done.returncode else ""

    saved(4)
    for part in (1, 2):
        rendered(part)
    assert not refusal()
    saved(0)
    assert "has been changed since" in refusal()
    rendered(2)
    assert "different pictures: settings of Candela" in refusal()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--slice", "1/9"), "cannot be split into 9"),
        (("--slice", "0/2"), "no slice"),
        (("--slice", "1/2", "--output", "a.png"), ".exr"),
        (("--frames", "5-1"), "no frame"),
        (("--frames", "x"), "no frames"),
        (("--expect", "3.6"), "was made for 3.6"),
    ],
)
def test_what_cannot_be_rendered_so_is_refused(moving, tmp_path, options, words):
    done = candela("render", moving, "--samples", "4", "--output", "a.exr", *options, folder=tmp_path)
    assert done.returncode in (1, 2) and words in done.stderr and done.stderr.count("\n") == 1, done.stderr
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_frames_of_a_chunk_are_rendered_by_one_process_with_lines_for_farms(moving, tmp_path):
    done = candela("render", moving, "--size", "32x24", "--samples", "2", "--frames", "2-3", "--progress",
                   "--output", "made_###.png", folder=tmp_path)  # fmt: skip
    assert done.returncode == 0 and done.stderr == ""
    assert sorted(path.name for path in tmp_path.iterdir()) == ["made_002.png", "made_003.png"]
    lines = done.stdout.splitlines()
    assert [line for line in lines if line.startswith("Fra:")] == [
        f"Fra:{frame} | Cornell Box | Rendering {n} / 2 samples" for frame in (2, 3) for n in (1, 2)
    ]
    assert [line for line in lines if line.startswith("openjd_progress:")] == [
        f"openjd_progress: {share}" for share in ("25.0", "50.0", "75.0", "100.0")
    ]
    assert sum(line.startswith("Saved: ") for line in lines) == 2
    assert "Error:" not in done.stdout and "Warning" not in done.stdout


@pytest.mark.slow
def test_pictures_that_are_there_are_left_if_asked(moving, tmp_path):
    there = tmp_path / "m_0002.png"
    there.write_bytes(b"finished before")
    done = candela("render", moving, "--size", "16x12", "--samples", "1", "--frames", "2-3", "--skip-existing",
                   "--output", "m_####.png", folder=tmp_path)  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert there.read_bytes() == b"finished before" and (tmp_path / "m_0003.png").stat().st_size > 100
    assert "1 picture is there already" in done.stdout


@pytest.mark.slow
def test_what_a_killed_process_was_writing_goes_with_the_next(moving, tmp_path):
    arguments = [sys.executable, "-m", "addon", "render", str(moving), "--size", "64x48", "--samples", "4000",
                 "--output", str(tmp_path / "out" / "a.png")]  # fmt: skip
    process = subprocess.Popen(arguments, cwd=tmp_path, env=environment(), stdout=subprocess.DEVNULL)
    end = time.monotonic() + 60
    while not list(tmp_path.glob("out/.writing_*")) and time.monotonic() < end:
        time.sleep(0.1)
    process.kill()
    process.wait()
    assert [path.name[:9] for path in (tmp_path / "out").iterdir()] == [".writing_"]
    done = candela("render", moving, "--size", "16x12", "--samples", "1", "--output", "out/a.png", folder=tmp_path)
    assert done.returncode == 0
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["a.png"]


def test_what_another_machine_of_the_same_name_is_writing_stays(tmp_path, monkeypatch):
    """Machines copied from one image have one name, and the first space of process numbers has one number on all."""
    monkeypatch.setattr(files, "_lives", lambda pid: False)
    place = tmp_path / f"{files.WRITING}{files._machine()}_4711_abc"
    place.mkdir()
    (tmp_path / "boot").write_text("another")
    with monkeypatch.context() as there:
        there.setattr(files, "BOOT", tmp_path / "boot")
        files._machine.cache_clear()
        files.clear_abandoned(tmp_path)
    files._machine.cache_clear()
    assert place.exists()
    files.clear_abandoned(tmp_path)
    assert not place.exists()


def test_what_another_machine_or_this_one_before_its_restart_was_writing_goes_after_a_week(tmp_path):
    """No process there can be asked. What a file was added to meanwhile is being written."""
    old = time.time() - 1.1 * files.ABANDONED_S
    names = {kind: f"{files.WRITING}0123abcd_{os.getpid()}_{kind}" for kind in ("a_b", "fresh", "growing")}
    names |= {"mine": ".writing_of_mine_too", "alive": f"{files.WRITING}{files._machine()}_{os.getpid()}_x"}
    for kind, name in names.items():
        (tmp_path / name).mkdir()
        (tmp_path / name / "a.exr").write_bytes(b"x")
        if kind != "growing":
            os.utime(tmp_path / name / "a.exr", (old, old))
        if kind != "fresh":
            os.utime(tmp_path / name, (old, old))
    files.clear_abandoned(tmp_path)
    assert {one.name for one in tmp_path.iterdir()} == {*names.values()} - {names["a_b"]}


# -------------------------------------------------------------------------------------------------------------- bundles


@pytest.mark.slow
def test_a_bundle_is_a_job_by_openjds_own_judgement(moving, tmp_path):
    pytest.importorskip("openjd.model")
    template = job(tmp_path / "job", moving, "--frames", "1-6", "--chunk", "4", "--split-samples", "2", "--gpu")
    assert sorted(path.name for path in (tmp_path / "job").iterdir()) == [
        "asset_references.json", "candela_moving.js", "parameter_values.json", "template.json",
    ]  # fmt: skip
    checked = subprocess.run(
        [sys.executable, "-m", "openjd", "check", str(tmp_path / "job" / "template.json")], check=False,
        capture_output=True, text=True,
    )  # fmt: skip
    assert checked.returncode == 0, checked.stdout + checked.stderr
    assert [step["name"] for step in template["steps"]] == ["Render", "Assemble"]
    assert template["steps"][0]["parameterSpace"]["taskParameterDefinitions"] == [
        {"name": "Chunk", "type": "STRING", "range": ["1-4", "5-6"]}, {"name": "Slice", "type": "INT", "range": "1-2"},
    ]  # fmt: skip
    references = json.loads((tmp_path / "job" / "asset_references.json").read_text("utf-8"))["assetReferences"]
    assert str(moving) in references["inputs"]["filenames"]


@pytest.mark.slow
def test_a_farm_that_loses_a_worker_makes_what_one_process_makes(moving, tmp_path):
    """6 frames × 2 slices on three workers of Dask, each task by OpenJD's sessions; one worker is killed meanwhile."""
    pytest.importorskip("openjd.sessions")
    distributed = pytest.importorskip("distributed")
    import cloudpickle
    import psutil

    sys.path.insert(0, str(Path(__file__).parent))
    import dispatch

    cloudpickle.register_pickle_by_value(dispatch)
    bundle = tmp_path / "job"
    job(bundle, moving, "--frames", f"1-{FRAMES}", "--split-samples", SLICES)
    rows = json.loads((bundle / "parameter_values.json").read_text("utf-8"))["parameterValues"]
    values = {row["name"]: row["value"] for row in rows}
    slices = bundle / "pictures" / "slices"
    with (
        distributed.LocalCluster(
            n_workers=3, threads_per_worker=1, processes=True, dashboard_address=None, local_directory=str(tmp_path)
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        started = time.monotonic()
        tasks = [
            client.submit(dispatch.run_task, bundle, values, "Render", number, pure=False)
            for number in range(dispatch.tasks_of(bundle, values, "Render"))
        ]
        assert len(tasks) == FRAMES * SLICES
        while not list(slices.glob(".writing_*")):
            assert time.monotonic() - started < 120
            time.sleep(0.05)
        for pid in client.run(os.getpid).values():
            busy = psutil.Process(pid).children(recursive=True)
            if busy:
                for process in [*busy, psutil.Process(pid)]:
                    process.kill()
                break
        rendered = client.gather(tasks)
        assert {state for state, _, _ in rendered} == {"SUCCESS"}, rendered
        assert {progress for _, progress, _ in rendered} == {100.0}
        merged = client.gather(
            [
                client.submit(dispatch.run_task, bundle, values, "Assemble", number, pure=False)
                for number in range(dispatch.tasks_of(bundle, values, "Assemble"))
            ]
        )
        assert {state for state, _, _ in merged} == {"SUCCESS"}, merged
        shared = time.monotonic() - started
    started = time.monotonic()
    options = ("--size", "48x36", "--samples", "6", "--frames", f"1-{FRAMES}")
    assert candela("render", moving, *options, "--output", "whole_####.exr", folder=tmp_path).returncode == 0
    alone = time.monotonic() - started
    differences = [
        same(tmp_path / f"whole_{frame:04d}.exr", bundle / "pictures" / f"moving_{frame:04d}.exr")
        for frame in range(1, FRAMES + 1)
    ]
    print(f"farm {shared:.1f} s, one process {alone:.1f} s; largest difference {max(differences):.1e}")
    assert max(differences) < 1e-5
    assert not list((bundle / "pictures").glob(".writing_*"))


@pytest.mark.parametrize(
    "text", ["1-99999999999", "-99999999999-1", "1-99999999999:7", "99999999999-1", "1,1048575", "1-" + 5000 * "9"]
)
def test_frames_beyond_those_of_blender_are_refused_before_they_are_listed(text):
    from addon import cli

    with pytest.raises(argparse.ArgumentTypeError):
        cli._frames(text)


def test_ranges_that_overlap_are_frames_once_and_in_order():
    from addon import cli

    assert cli._frames("3, 1-7:2,-2--1") == [3, 1, 5, 7, -2, -1]
    assert len(cli._frames(",".join(20 * ["1-100000"]))) == 100000


def test_the_operator_writes_the_job_of_the_saved_file(registered, tmp_path):
    import bpy

    bpy.ops.wm.open_mainfile(filepath=str(ROOT / "sample_blends" / "cornell_box.blend"))
    bpy.context.scene.render.engine = "CANDELA"
    with pytest.raises(RuntimeError, match="cannot be split"):
        bpy.ops.candela.farm_job(directory=str(tmp_path / "job"), split_samples=10000)
    assert not list(tmp_path.iterdir())
    assert bpy.ops.candela.farm_job(directory=str(tmp_path / "job"), chunk=100, split_samples=2) == {"FINISHED"}
    template = json.loads((tmp_path / "job" / "template.json").read_text("utf-8"))
    assert [step["name"] for step in template["steps"]] == ["Render", "Assemble"]
    arguments = template["steps"][0]["script"]["actions"]["onRun"]["args"]
    assert "--scene=Cornell Box" in arguments
    bpy.ops.wm.read_factory_settings(use_empty=True)
    assert not bpy.ops.candela.farm_job.poll()


@pytest.fixture
def box(registered):
    """The scene of a saved file, drawn by Candela."""
    import bpy

    bpy.ops.wm.open_mainfile(filepath=str(ROOT / "sample_blends" / "cornell_box.blend"))
    bpy.context.scene.render.engine = "CANDELA"
    return bpy.context.scene


def written(folder, scene, layer=None, **given) -> list[str]:
    """The chunks of the job that `farm` writes of an open scene."""
    import bpy

    from addon.cli import _parser, farm
    from addon.cli.verbs import Job

    options = _parser("candela").parse_args(["farm", bpy.data.filepath, "--output", str(folder)])
    vars(options).update(given)
    farm.write_job(Job(options, scene, layer))
    template = json.loads((folder / "template.json").read_text("utf-8"))
    return template["steps"][0]["parameterSpace"]["taskParameterDefinitions"][0]["range"]


def test_a_job_of_slices_of_layers_with_samples_of_their_own_is_refused(box, tmp_path):
    import bpy

    from addon.cli.refused import Refused

    box.view_layers[0].samples = 64
    with pytest.raises(Refused, match="samples of their own"):
        written(tmp_path / "job", box, split_samples=2)
    with pytest.raises(RuntimeError, match="samples of their own"):
        bpy.ops.candela.farm_job(directory=str(tmp_path / "job"), split_samples=2)
    assert not list(tmp_path.iterdir())
    written(tmp_path / "job", box)
    box.view_layers[0].samples = 0
    written(tmp_path / "sliced", box, split_samples=2)


def test_a_job_may_split_a_picture_with_a_shadow_catcher(box, tmp_path):
    next(one for one in box.objects if one.type == "MESH").is_shadow_catcher = True
    written(tmp_path / "job", box, split_samples=2)


@pytest.mark.parametrize(
    ("given", "chunks"),
    [
        ({"frame": 7}, ["7"]),
        ({"frame": 0}, ["0"]),
        ({"frame": 7, "frames": [3, 4], "chunk": 2}, ["3-4"]),  # as for render
        ({"chunk": 2}, ["2-3", "4"]),
    ],
)
def test_a_job_is_of_the_frames_that_are_asked_for(box, tmp_path, given, chunks):
    box.frame_start, box.frame_end = 2, 4
    assert written(tmp_path / "job", box, **given) == chunks


FLAMENCO_STUBS = """
const fs = require("fs");
const made = [];
const author = {
    Task: (name, type) => ({ name, type, commands: [], needs: [],
        addCommand(command) { this.commands.push(command); },
        addDependency(task) { if (!made.includes(task)) throw "not in the job"; this.needs.push(task.name); } }),
    Command: (name, parameters) => ({ name, parameters }),
};
const frameChunker = (frames, size) => {
    const [first, last] = frames.split("-").map(Number), found = [];
    for (let k = first; k <= last; k += size) found.push(`${k}-${Math.min(k + size - 1, last)}`);
    return found;
};
const job = { settings: JSON.parse(process.argv[3]), addTask: (task) => made.push(task) };
eval(fs.readFileSync(process.argv[2], "utf-8") + "; compileJob(job); globalThis.type = JOB_TYPE");
console.log(JSON.stringify({ type, made }));
"""


def test_the_job_type_of_flamenco_asks_what_its_job_was_asked():
    from argparse import Namespace

    import bpy

    from addon.cli import farm

    options = Namespace(
        split_samples=2, run_scripts=True, skip_existing=True, samples=8, size=(64, 48), scene='-Shot "2"',
        view_layer=None, assignments=["use_denoise=0"],
    )  # fmt: skip
    text = farm.flamenco("shot", options)
    assert 'label: "Candela: shot"' in text
    version = ".".join(map(str, bpy.app.version))
    assert f'const OF_EVERY_TASK = ["--expect", "{version}", "--run-scripts"];' in text
    assert (
        'const OF_RENDERING = ["--skip-existing", "--samples=8", "--size=64x48", "--scene=-Shot \\"2\\"", '
        '"--set=use_denoise=0"];'
    ) in text
    named = farm.flamenco("const OF_RENDERING = [];", options)  # a file may be called so
    assert 'label: "Candela: const OF_RENDERING = [];"' in named and named.count('"--size=64x48"') == 1


@pytest.mark.parametrize(("split", "tasks"), [(1, 3), (2, 9)])
def test_the_job_type_of_flamenco_makes_the_same_tasks(tmp_path, split, tasks):
    node = shutil.which("node")
    if node is None:
        pytest.skip("there is no Node.js here")
    (tmp_path / "stubs.js").write_text(FLAMENCO_STUBS)
    settings = {
        "frames": "1-6", "chunk_size": 2, "split_samples": split, "format": "exr", "render_output_root": "/share/out/",
        "blendfile": "/share/moving.blend",
    }  # fmt: skip
    script = ROOT / "addon" / "cli" / "candela_flamenco.js"
    done = subprocess.run(
        [node, str(tmp_path / "stubs.js"), str(script), json.dumps(settings)],
        check=False,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert {one["key"] for one in found["type"]["settings"]} == settings.keys()
    assert len(found["made"]) == tasks
    first, last = found["made"][0], found["made"][-1]
    assert first["commands"][0]["parameters"]["exe"] == "{blender}"
    assert first["commands"][0]["parameters"]["args"][:4] == ["--command", "candela", "render", "/share/moving.blend"]
    if split > 1:
        assert last["needs"] == ["render-5-6-slice-1", "render-5-6-slice-2"]
        assert "/share/out/slices/moving_####_2of2.exr" in last["commands"][0]["parameters"]["args"]
    assert "/share/out/moving_####.exr" in last["commands"][0]["parameters"]["args"]
    from addon import cli

    for task in found["made"]:  # the command line understands each of them
        arguments = task["commands"][0]["parameters"]["args"][2:]
        assert cli._parser("candela").parse_args(arguments).frames
