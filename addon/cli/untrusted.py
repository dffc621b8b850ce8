"""Untrusted files: rendering one may read what it refers to, and nothing else.

A .blend file can come from anyone. Opening it must run none of its code, and rendering it must write what the command
line names and nothing besides. Blender itself asks neither. What could write or run, and what becomes of it here:

- texts that register themselves, handlers, drivers and Freestyle styles in Python: scripts are off, whatever the user's
  preferences say (verbs.py);
- the compositor's File Output nodes: the compositor is off, and with `--compositing` those that point out of the folder
  of the output are muted, and what the others write is placed there only where no file stands;
- disk caches of physics, which are written at each change of frame: caches stay in memory, and fluids that are
  simulated into a folder while the frame changes are hidden;
- Blender's cache of render results and its texture caches beside the images: off;
- the sequencer and stereo with its own files: off (verbs.py). Bakes and proxies start only from operators.

What is left: Blender itself writes the settings of such a fluid into its folder while it opens the file.

What an artist would miss is said in a sentence; what changes no picture is not.
"""

from __future__ import annotations

import contextlib
import re
from collections.abc import Iterator
from pathlib import Path

import bpy

from .refused import Refused

Sentences = list[str]
TRUST = "if you trust the file, --run-scripts runs them"


def contain(compositing: bool) -> Sentences:
    """Turn off whatever writes by itself in all scenes of the open file, before its frame changes."""
    said = []
    for scene in bpy.data.scenes:
        render = scene.render
        render.use_compositing &= compositing
        for name in ("use_render_cache", "use_auto_generate_texture_cache"):  # not in every Blender
            if getattr(render, name, False):
                setattr(render, name, False)
    for thing in bpy.data.objects:
        said += _without_disk_caches(thing)
    if bpy.app.autoexec_fail and not bpy.app.autoexec_fail_quiet:
        said.append(f"The file's scripts were not run ({bpy.app.autoexec_fail_message}); {TRUST}.")
    return said


def _without_disk_caches(thing) -> Sentences:
    caches = [modifier.point_cache for modifier in thing.modifiers if getattr(modifier, "point_cache", None)]
    caches += [system.point_cache for system in thing.particle_systems]
    caches += [
        surface.point_cache
        for modifier in thing.modifiers
        if modifier.type == "DYNAMIC_PAINT" and modifier.canvas_settings
        for surface in modifier.canvas_settings.canvas_surfaces
    ]
    for cache in caches:
        if cache.use_disk_cache and not (cache.is_baked or cache.use_external):
            cache.use_disk_cache = False
    said = []
    for modifier in thing.modifiers:
        domain = modifier.domain_settings if modifier.type == "FLUID" else None
        if domain and domain.cache_type == "REPLAY":
            modifier.show_viewport = modifier.show_render = False
            said.append(
                f"Object '{thing.name}': a fluid whose cache is of type Replay writes files whenever the frame"
                " changes, and was left out; bake it with the type All or Modular."
            )
    return said


# ------------------------------------------------------------------------------------------------------------- inputs


def inputs() -> set[Path]:
    """The open file and all files that it refers to."""
    names = [bpy.data.filepath, *bpy.utils.blend_paths(absolute=True, packed=False, local=False)]
    return {Path(name).resolve() for name in names if name}


def refuse_inputs(outputs: list[Path]) -> None:
    """Raise Refused where an output would replace a file that the open file is made of."""
    read = inputs()
    numbered = [
        Path(bpy.path.abspath(thing.filepath, library=thing.library)).resolve()
        for thing in (*bpy.data.images, *bpy.data.movieclips)
        if thing.source == "SEQUENCE" and thing.filepath
    ]
    for path in outputs:
        if path.resolve() in read or any(_of_sequence(path.resolve(), first) for first in numbered):
            raise Refused(f"{path} is an input of the scene and is not replaced; choose another output.")


def _of_sequence(path: Path, first: Path) -> bool:
    """Whether two names differ in nothing but their last number."""
    stem = re.sub(r"\d+(?=\D*$)", "", first.name)
    return path.parent == first.parent and path.name != stem and re.sub(r"\d+(?=\D*$)", "", path.name) == stem


# ---------------------------------------------------------------------------------------------------- File Output nodes


@contextlib.contextmanager
def file_outputs_held(scene, folder: Path, temporary: Path) -> Iterator[Sentences]:
    """The scene's File Output nodes write into `temporary` inside, as they would into `folder`; all others are mute.

    Afterwards they are as they were: the next frame has another temporary folder.
    """
    said, before = [], []
    folder = folder.resolve()
    try:
        for node in _file_outputs(_compositor(scene), set()):
            where, names = _target(node)
            before.append((node, where, node.mute))
            place = Path(bpy.path.abspath(where)).resolve() if where else folder
            wanders = any(".." in Path(name).parts or Path(name).is_absolute() for name in names)
            if wanders or "{" in where or not place.is_relative_to(folder):
                node.mute = True
                said.append(
                    f"File Output node '{node.name}' points to {where or names[0]}, not below {folder}; it was muted."
                )
            else:
                aimed = str(temporary / place.relative_to(folder))
                setattr(node, _place_of(node), f"{aimed}/" if _place_of(node) == "directory" else aimed)
        yield said
    finally:
        for node, where, mute in before:
            setattr(node, _place_of(node), where)
            node.mute = mute


def _compositor(scene):
    """The node tree that a render runs; None without one."""
    tree = scene.compositing_node_group if hasattr(scene, "compositing_node_group") else scene.node_tree
    return tree if scene.render.use_compositing else None


def _file_outputs(tree, seen: set) -> Iterator:
    if tree is None or tree.name_full in seen:
        return
    seen.add(tree.name_full)
    for node in tree.nodes:
        if node.bl_idname == "CompositorNodeOutputFile":
            yield node
        elif getattr(node, "node_tree", None):
            yield from _file_outputs(node.node_tree, seen)


def _target(node) -> tuple[str, list[str]]:
    """The folder and the names that are added to it."""
    if _place_of(node) == "directory":
        return node.directory, [node.file_name, *(item.name for item in node.file_output_items)]
    return node.base_path, [slot.path for slot in node.file_slots]


def _place_of(node) -> str:
    """The property that holds the folder; before Blender 5.0, of a multilayer file the file itself."""
    return "directory" if hasattr(node, "directory") else "base_path"


def leave_what_stands(temporary: Path, folder: Path, picture: str) -> Sentences:
    """Drop files in `temporary`, except the picture, whose names are taken in `folder`."""
    said = []
    for file in sorted(temporary.rglob("*")):
        final = folder / file.relative_to(temporary)
        if file.is_file() and file != temporary / picture and final.exists():
            file.unlink()
            said.append(f"{final} was there before and was left as it is.")
    return said
