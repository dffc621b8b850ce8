"""The verb `farm`: a job bundle that render farms run.

    template.json           Open Job Description, jobtemplate-2023-09: what Deadline Cloud and `openjd` run
    parameter_values.json   the values that the template's parameters have for this file
    asset_references.json   the files that a node needs, and the folder that it writes
    candela_NAME.js         a job type of Flamenco for this file, for its manager's folder of scripts

Steps: Render has a task for each chunk of frames and slice of samples; Assemble, where samples are split, merges each
chunk's slices when all of Render is done. A task is a call of the command line: it opens the file once, compiles once,
and puts each picture in place when it is whole. It ends at once on a node with another Blender. Nothing in a bundle
names this machine but the paths of the parameters, which farms map to those of their nodes.

Source: the wiki of github.com/OpenJobDescription/openjd-specifications ("2023-09 Template Schemas").
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import bpy

from ..snapshot.scene import one_line
from . import slices, untrusted
from .files import output, placed_in, refuse_others
from .refused import USAGE, Refused
from .verbs import Job

ROOT = Path(__file__).resolve().parents[2]
FLAMENCO = Path(__file__).with_name("candela_flamenco.js")
MOST_CHUNKS = 1024  # values that a parameter of tasks may have, by the specification
# What each file of a bundle holds, and hardly one of another program.
MARKS = {
    "template.json": (('"name": "Candela: ',),),
    "parameter_values.json": (('"BlendFile"',),),
    "asset_references.json": (('"assetReferences"',),),
}
FILE, FOLDER = "{{Param.BlendFile}}", "{{Param.OutputFolder}}"


def write_job(job: Job) -> None:
    """Write the bundle. Raises Refused."""
    options, scene = job.options, job.scene
    folder = output(options.output, folder=True)
    name = options.file.stem
    refuse_others(folder, MARKS | {f"candela_{name}.js": (("Candela",),)})
    results = (options.results or folder / "pictures").resolve()
    frames = options.frames
    if frames is None and options.frame is not None:
        frames = [options.frame]
    if frames is None:
        frames = list(range(scene.frame_start, scene.frame_end + 1, scene.frame_step))
    parts = chunks(frames, options.chunk)
    if len(parts) > MOST_CHUNKS:
        fitting = -(-len(frames) // MOST_CHUNKS)
        raise Refused(
            f"A job has at most {MOST_CHUNKS} chunks and this one {len(parts)}: --chunk {fitting} fits.", USAGE
        )
    if options.split_samples > 1:  # what every task would refuse
        slices.check_layers(scene)
    if options.split_samples > scene.candela.samples:
        raise Refused(f"{scene.candela.samples} samples cannot be split into {options.split_samples} slices.", USAGE)
    if "{{" in f"{name}{options.assignments}{options.scene}{options.view_layer}":
        raise Refused("Names with {{ have a meaning of their own in job templates; rename the file or the scene.")
    made = template(name, parts, launch(), options)
    values = {"BlendFile": str(options.file.resolve()), "OutputFolder": str(results), "Blender": launch()[0]}
    references = {
        "inputs": {"filenames": sorted(map(str, untrusted.inputs())), "directories": []},
        "outputs": {"directories": [str(results)]},
    }
    with placed_in(folder) as place:
        for file, content in (
            ("template.json", made),
            ("parameter_values.json", {"parameterValues": [{"name": k, "value": v} for k, v in values.items()]}),
            ("asset_references.json", {"assetReferences": references}),
        ):
            (place / file).write_text(json.dumps(content, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
        (place / f"candela_{name}.js").write_text(flamenco(name, options), encoding="utf-8")
    tasks = len(parts) * options.split_samples
    print(
        f"{len(frames)} frames in {len(parts)} chunks, {options.split_samples} slices of each: {tasks} tasks of Render"
    )
    print(one_line(str(folder / "template.json")))


def chunks(frames: list[int], size: int) -> list[str]:
    """Frames in groups of `size`, each as the command line takes them: "1-5" or "1,3,7"."""
    groups = [frames[k : k + size] for k in range(0, len(frames), size)]
    return [
        f"{group[0]}-{group[-1]}" if len(group) > 1 and group == list(range(group[0], group[-1] + 1))
        else ",".join(map(str, group))
        for group in groups
    ]  # fmt: skip


def launch() -> list[str]:
    """How the command line is called here, and will be on the nodes: by Blender, or by Python with the bpy module."""
    if (__package__ or "").startswith("bl_ext.") or bpy.app.binary_path:
        return ["blender", "--command", "candela"]
    return [sys.executable, "-m", "addon"]


def of_every_task(options) -> list[str]:
    """Options of the command line for tasks of every kind."""
    exact = 3 if options.split_samples > 1 else 2  # numbers of the version
    return ["--expect", ".".join(map(str, bpy.app.version[:exact]))] + ["--run-scripts"] * options.run_scripts


def of_rendering(options) -> list[str]:
    """Options of the command line for tasks that render."""
    chosen = ["--skip-existing"] * options.skip_existing
    for flag, value in (
        ("--samples", options.samples),
        ("--size", options.size and "x".join(map(str, options.size))),
        ("--scene", options.scene),
        ("--view-layer", options.view_layer),
        *(("--set", text) for text in options.assignments),
    ):
        chosen += [f"{flag}={value}"] if value is not None else []  # a name may begin with a dash
    return chosen


def flamenco(name: str, options) -> str:
    """The text of the job type of Flamenco for the file of this name, with what the job asks of its tasks."""
    text = FLAMENCO.read_text(encoding="utf-8")
    for of, arguments in (("OF_EVERY_TASK", of_every_task(options)), ("OF_RENDERING", of_rendering(options))):
        text = text.replace(f"const {of} = [];", f"const {of} = {json.dumps(arguments)};")
    # Last: a name may be a line of the script. An argument can hold no such label, whose quotes are escaped there.
    return text.replace('label: "Candela"', f"label: {json.dumps(f'Candela: {name}')}")


def template(name: str, parts: list[str], start: list[str], options) -> dict:
    """The job template, as plain data."""
    suffix, split = options.format, options.split_samples
    chosen, common = of_rendering(options), ["--progress", *of_every_task(options)]
    chunk = {"name": "Chunk", "type": "STRING", "range": parts}
    picture = f"{FOLDER}/{name}_####.{suffix}"
    render = ["render", FILE, *chosen, *common, "--frames={{Task.Param.Chunk}}"]
    if split == 1:
        steps = [_step("Render", [chunk], start, [*render, "--output", picture], options.gpu)]
    else:
        one, *every = (
            f"{FOLDER}/slices/{name}_####_{k}of{split}.exr" for k in ("{{Task.Param.Slice}}", *range(1, split + 1))
        )
        slices = {"name": "Slice", "type": "INT", "range": f"1-{split}"}
        shared = [*render, "--slice", f"{{{{Task.Param.Slice}}}}/{split}", "--output", one]
        merged = ["merge", *every, "--file", FILE, *common, "--frames={{Task.Param.Chunk}}", "--output", picture]
        steps = [_step("Render", [chunk, slices], start, shared, options.gpu)]
        steps += [_step("Assemble", [chunk], start, merged, options.gpu) | {"dependencies": [{"dependsOn": "Render"}]}]
    variables = {"BLENDER_SYSTEM_EXTENSIONS": options.extensions} if options.extensions else {}
    if start[1:] == ["-m", "addon"]:
        variables["PYTHONPATH"] = str(ROOT)
    made = {
        "specificationVersion": "jobtemplate-2023-09",
        "name": f"Candela: {name}"[:64],
        "parameterDefinitions": [
            {"name": "BlendFile", "type": "PATH", "objectType": "FILE", "dataFlow": "IN"},
            {"name": "OutputFolder", "type": "PATH", "objectType": "DIRECTORY", "dataFlow": "OUT"},
            {"name": "Blender", "type": "STRING", "default": start[0]},
        ],
        "steps": steps,
    }
    if variables:
        made["jobEnvironments"] = [{"name": "Candela", "variables": variables}]
    return made


def _step(name: str, parameters: list[dict], start: list[str], arguments: list[str], gpu: bool) -> dict:
    made = {
        "name": name,
        "parameterSpace": {"taskParameterDefinitions": parameters},
        "script": {"actions": {"onRun": {"command": "{{Param.Blender}}", "args": [*start[1:], *arguments]}}},
    }
    if gpu:
        made["hostRequirements"] = {"amounts": [{"name": "amount.worker.gpu", "min": 1}]}
    return made
