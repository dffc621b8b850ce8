"""Reference renders in a second Blender process, so that the one with the window stays responsive and can cancel.

The open file is written to a temporary copy; a Blender without a window opens it, renders the reference into the cache
under the key that the open scene has, and ends. Cycles tells on its output how far it is.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import bpy

from . import cache
from .reference import RenderFailed, active_view_layer, cache_folder, reference, reference_key, render_reference

_SAMPLE = re.compile(r"Sample (\d+)/(\d+)")
DOING = "Cycles renders the reference"
_NOT_SAID = re.compile(r"^(?:Fra|Mem|Time|Remaining|Peak)\b|, ")  # of the columns of a line
MOST_SAID = 60  # letters of what Cycles says
LAST_LINES = 5  # of the other Blender's output, shown when it fails


def reference_steps(
    scene: bpy.types.Scene, samples: int, direct_only: bool = False, size=None, view_layer=None
) -> Iterator[tuple[float, str]]:
    """`reference` as a generator of (share done, sentence); returns the Reference. Closing it ends the other Blender.

    In background mode the reference is rendered here, in one step. Raises `RenderFailed`.
    """
    view_layer = view_layer or active_view_layer(scene)
    if bpy.app.background or not bpy.app.binary_path:
        yield 0.0, DOING
        return reference(scene, samples, direct_only, size, view_layer)
    key, folder = reference_key(scene, samples, direct_only, size, view_layer), cache_folder()
    layer = view_layer.name  # after a step the layer itself may be gone
    yield 0.0, DOING
    if not cache.entry(folder, key).exists():
        with tempfile.TemporaryDirectory(prefix="candela_") as temporary:
            path = Path(temporary) / "scene.blend"
            bpy.ops.wm.save_as_mainfile(filepath=str(path), copy=True, check_existing=False)
            job = {"scene": scene.name, "layer": layer, "samples": samples, "direct_only": direct_only,
                   "size": size, "key": key, "folder": str(folder.resolve())}  # fmt: skip
            yield from _watched(path, Path(temporary) / "output.txt", job)
    made = cache.load(folder, key)
    if made is None:
        raise RenderFailed(f"The reference could not be read from {folder}; is the disk full?")
    return made


def _watched(path: Path, output: Path, job: dict) -> Iterator[tuple[float, str]]:
    """Run the other Blender until it ends; yields the share of samples that its output tells."""
    program = f"import importlib; importlib.import_module({__name__!r}).run({json.dumps(job)!r})"
    # The file may have been opened as untrusted, of which its copy knows nothing: no scripts run there.
    # From 5.0 on Blender tells how far a render is only where that is asked for.
    command = [bpy.app.binary_path, "--background", "--disable-autoexec", "--log", "render", str(path)]
    command += ["--python-exit-code", "1", "--python-expr", program]
    renders = 2  # one for each seed
    with output.open("w") as file, subprocess.Popen(command, stdout=file, stderr=subprocess.STDOUT) as process:
        try:
            while process.poll() is None:
                yield progress_of(output.read_text(errors="replace"), job["samples"], renders)
        finally:
            if process.poll() is None:
                process.kill()
    if process.returncode != 0:
        lines = [line for line in output.read_text(errors="replace").splitlines() if line.strip()]
        raise RenderFailed(f"Cycles could not render the reference: {' '.join(lines[-LAST_LINES:])}")


def progress_of(text: str, samples: int, renders: int) -> tuple[float, str]:
    """Share of the samples that an output of Cycles tells, of so many renders, and a sentence about what it does."""
    told = [int(done) for done, _ in _SAMPLE.findall(text)]
    finished = sum(later < earlier for earlier, later in pairwise(told))
    which = f"{DOING}, {finished + 1} of {renders}"
    line = next((line for line in reversed(text.splitlines()) if "Fra:" in line), "")
    columns = [column.strip() for column in line[line.find("Fra:") :].split("|")]
    said = [column for column in columns if column and not _NOT_SAID.search(column)]
    share = (finished + told[-1] / samples) / renders if told else 0.0
    return share, f"{which}: {', '.join(said)[:MOST_SAID] or 'Blender starts'}"


def run(text: str) -> None:
    """In the other Blender: render the reference and keep it under the key it is given."""
    job = json.loads(text)
    scene = bpy.data.scenes[job["scene"]]
    layer = scene.view_layers[job["layer"]]
    size = tuple(job["size"]) if job["size"] else None
    made = render_reference(scene, job["samples"], job["direct_only"], size, layer, job["key"])
    cache.save(Path(job["folder"]), made)
    sys.stdout.flush()
