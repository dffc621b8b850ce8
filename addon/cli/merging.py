"""The verb `merge`: one picture, or one for each frame, of the slices that several machines have rendered.

It opens the same scene with the same options, and ends the picture as the render of all samples does: denoising,
passes, metadata and file format are those of `render`. Slices of another scene, other settings, another number of
samples, another size or another Blender are refused, and so is a picture of which samples are missing or there twice.
The .blend file is the one that the command line names, never one that a slice names: slices may come from anyone.
"""

from __future__ import annotations

import argparse
from pathlib import Path

from .. import engine
from ..compare.reference import scene_hash
from ..frame.slices import merged
from . import slices, verbs
from .refused import USAGE, Refused


def merge(options: argparse.Namespace) -> None:
    """The verb."""
    frames, output = options.frames, options.output
    if frames is None:
        _merge(options, options.slices, output)
        return
    if not all("#" in path.name for path in options.slices):
        raise Refused("With --frames the names of slices need #### in place of the frame's number.", USAGE)
    found = {frame: [verbs.numbered(path, frame, True) for path in options.slices] for frame in frames}
    missing = [path.name for paths in found.values() for path in paths if not path.is_file()]
    if missing:
        raise Refused(f"Slices are missing: {', '.join(missing)}.")
    for frame, paths in found.items():
        _merge(options, paths, verbs.numbered(output, frame, True))


def _merge(options: argparse.Namespace, paths: list[Path], output: Path) -> None:
    parts = [slices.read_header(path) for path in paths]
    slices.of_one_picture(parts)
    about = parts[0].about
    said = about["options"]
    if options.file is None:
        raise Refused(
            f"The slices say that they are of {about['file']} (scene {about['scene_hash'][:12]}); merge opens only "
            "a file that you name: give it by --file FILE.blend.",
            USAGE,
        )
    job = verbs.open_job(
        argparse.Namespace(
            **{
                **vars(options), "output": output, "frames": None,
                "samples": str(about["total"]), "frame": about["frame"], "size": said["size"], "scene": said["scene"],
                "view_layer": said["view_layer"], "assignments": said["assignments"],
            }
        )
    )  # fmt: skip
    if (scene_hash(job.scene), slices.settings_hash(job.scene)) != (about["scene_hash"], about.get("settings_hash")):
        raise Refused(f"{job.options.file} is not the file of which these are slices: it has been changed since.")
    unknown = [name for name in about["layers"] if name not in job.scene.view_layers]
    if unknown:  # the scene's own layers would be rendered, and nothing merged
        raise Refused(f"{job.options.file} has no view layer {', '.join(unknown)}, of which these are slices.")
    read = [slices.read_sums(part) for part in parts]
    try:
        engine.given.update({layer: merged([found[layer] for found in read]) for layer in about["layers"]})
        verbs.render(job)
    except ValueError as error:
        raise Refused(str(error)) from None
    finally:
        engine.given.clear()
