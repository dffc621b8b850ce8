"""The three verbs, on a file that is opened with the options applied."""

from __future__ import annotations

import argparse
import contextlib
import os
import re
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import bpy

from .. import engine
from ..compare import compare_scene, metrics, png, reference, table, write_report
from ..compare.report import MADE_BY
from ..film import point_costs
from ..film.points import POINTS
from ..frame import device_probe
from ..frame import ledger as ledgers
from ..frame.plan import PlanError, make_plan
from ..frame.settings import SCENE_PARAMS
from ..frame.technique import Param
from ..gfx import context
from ..gfx.device import Device
from ..lighting.visibility import foreseen
from ..materials.compiler import compile_material
from ..snapshot import SnapshotCache, UnsupportedScene, take
from ..snapshot.scene import Note, Snapshot, one_line
from ..techniques import REGISTRY, make_registry
from ..ui.properties import put_values, settings_of
from . import slices, untrusted
from .files import output, placed_in, refuse_blend, refuse_others
from .intermediate import write_intermediate
from .refused import USAGE, Refused, reason
from .terminal import STDOUT, progress, quiet

DENOISE = Param("use_denoise", "Denoise", True, "")  # of the scene's panel: a technique's strength in settings

# ------------------------------------------------------------------------------------------------------ the open file


@dataclass(frozen=True)
class Job:
    """The opened file with the options applied, in memory."""

    options: argparse.Namespace
    scene: bpy.types.Scene
    layer: bpy.types.ViewLayer | None  # None: all that are rendered
    held_back: tuple[str, ...] = ()  # what the file would have done beside being rendered, as sentences

    @property
    def title(self) -> str:
        render = self.scene.render
        width, height = (
            edge * render.resolution_percentage // 100 for edge in (render.resolution_x, render.resolution_y)
        )
        layer = f", view layer {self.layer.name}" if self.layer else ""
        samples = self.scene.candela.samples
        return one_line(
            f"{self.options.file.name}, scene {self.scene.name}{layer}, frame {self.scene.frame_current}, "
            f"{width} × {height}, {samples} {'sample' if samples == 1 else 'samples'}"
        )


def open_job(options: argparse.Namespace) -> Job:
    """Check the file, open it and apply the options. Raises Refused."""
    expect(getattr(options, "expect", None))
    refuse_blend(options.file)
    with quiet(options.verbose):
        why = open_mainfile(options.file, options.run_scripts)
        held_back = untrusted.contain(getattr(options, "compositing", False))
    if why:
        raise Refused(f"{options.file} could not be opened: {why}.")
    scene = _named("scene", options.scene, bpy.data.scenes) or bpy.context.scene
    layer = _named("view layer", options.view_layer, scene.view_layers)
    try:
        _apply_settings(scene, options)
    except ValueError as error:
        raise Refused(str(error), USAGE) from None
    if options.size:
        scene.render.resolution_x, scene.render.resolution_y = options.size
        scene.render.resolution_percentage = 100
    scene.render.engine = engine.ENGINE
    scene.render.use_sequencer = scene.render.use_multiview = False  # strips and stereo are not Candela's pictures
    if options.frame is not None:
        with quiet(options.verbose):
            scene.frame_set(options.frame)
    if scene.camera is None:
        raise Refused(f"Scene '{scene.name}' in {options.file} has no camera: add one, or make one active.")
    return Job(options, scene, layer, tuple(held_back))


def expect(version: str | None) -> None:
    """Raise Refused unless this Blender has the version, compared in as many places as are given ("5.2")."""
    here = ".".join(map(str, bpy.app.version))
    if version is not None and f"{here}.".find(f"{version}.") != 0:
        raise Refused(f"This is Blender {here}, and the job was made for {version}: install that version on this node.")


def open_mainfile(path: Path, run_scripts: bool = False) -> str:
    """Open the file in Blender; why it could not be opened, or an empty string."""
    full = str(path.resolve())
    try:
        bpy.ops.wm.open_mainfile(filepath=full, use_scripts=run_scripts)
    except RuntimeError as error:
        if bpy.data.filepath != full:  # else it is open, and only something that it links to is missing
            return reason(error)
    return ""


def _named(kind: str, name: str | None, among):
    if name is None:
        return None
    for thing in among:  # not `name in among`, which takes no bytes that are no UTF-8
        if thing.name == name:
            return thing
    known = ", ".join(f"'{thing.name}'" for thing in among)
    raise Refused(f"There is no {kind} '{name}'; there is {known}.", USAGE)


def _apply_settings(scene: bpy.types.Scene, options: argparse.Namespace) -> None:
    """Put the given settings into the properties of the scene, its world and its cameras. Raises ValueError with a
    sentence."""
    given = list(options.assignments)
    if options.samples is not None:
        given.append(f"samples={options.samples}")
        for layer in scene.view_layers:
            layer.samples = 0  # its own number of samples would count
    group = scene.candela
    for text in [text for text in given if text.startswith(f"{DENOISE.name}=")]:
        group.use_denoise = DENOISE.check(text.partition("=")[2])
        given.remove(text)
    settings = replace(settings_of(scene, viewport=False), values={}).override(REGISTRY, given, (DENOISE.name,))
    for param in SCENE_PARAMS:
        setattr(group, param.name, getattr(settings, param.name))
    for slot, technique in settings.slots.items():
        setattr(group, f"slot_{slot}", technique)
    put_values(scene, settings.values)


# ------------------------------------------------------------------------------------------------------------- render


def render(job: Job) -> None:
    """One picture, or one for each frame; a slice of it with --slice."""
    options, scene = job.options, job.scene
    path = output(options.output or Path(f"{options.file.stem}.png"), folder=False)
    if path.suffix.lower() not in (".png", ".exr"):
        raise Refused(f"The output must end in .png or .exr, and {path.name} does not.", USAGE)
    frames = getattr(options, "frames", None)
    if getattr(options, "slice", None):
        _share_out(job, path)
    paths = {frame: numbered(path, frame, frames is not None) for frame in frames or [scene.frame_current]}
    untrusted.refuse_inputs(list(paths.values()))
    if getattr(options, "skip_existing", False):
        there = [one for one in paths.values() if one.exists()]
        paths = {frame: one for frame, one in paths.items() if one not in there}
        if there:
            print(f"{'1 picture is' if len(there) == 1 else f'{len(there)} pictures are'} there already: left as is.")
    for place, (frame, one) in enumerate(paths.items()):
        if frame != scene.frame_current:
            with quiet(options.verbose):
                scene.frame_set(frame)
        _render_picture(job, one, place / len(paths), 1 / len(paths))


def numbered(path: Path, frame: int, several: bool) -> Path:
    """The path with the frame's number in place of its last row of #; where it has none but there are several frames,
    the number is added to the name."""
    name = path.name
    if "#" not in name:
        if not several:
            return path
        name = f"{path.stem}_####{path.suffix}"
    marks = re.findall("#+", name)[-1]
    head, _, tail = name.rpartition(marks)
    return path.with_name(f"{head}{frame:0{len(marks)}d}{tail}")


def _share_out(job: Job, path: Path) -> None:
    """Set the samples of the slice that is asked for. Raises Refused."""
    slices.check_output(path)
    slices.check_layers(job.scene)
    group = job.scene.candela
    try:
        group.sample_offset, group.sample_count = slices.bounds(job.options.slice, group.samples)
    except ValueError as error:
        raise Refused(str(error), USAGE) from None


def _render_picture(job: Job, path: Path, begun: float, share: float) -> None:
    """Render the scene's frame into a file; `begun` and `share` say which part of the whole work that is."""
    options, scene = job.options, job.scene
    target = {"layer": job.layer.name} if job.layer else {}
    sliced = scene.candela.sample_offset > 0 or scene.candela.sample_count > 0
    about = slices.about_slice(job) if sliced else {}
    with placed_in(path.parent, path.name) as folder:
        engine.taken = {} if sliced else None
        try:
            with untrusted.file_outputs_held(scene, path.parent, folder) as muted, _watched(job, "", begun, share):
                try:
                    bpy.ops.render.render(scene=scene.name, **target)
                except RuntimeError as error:
                    raise Refused(f"{options.file} could not be rendered: {reason(error)}.") from None
            shown = getattr(options, "show", None)
            if shown:
                print(write_intermediate(scene, shown, folder / path.name))
            elif sliced:
                slices.write(folder / path.name, about | {"device": context.describe()}, engine.taken)
        finally:
            engine.taken = None
        if not (sliced or shown):
            _choose_format(scene.render.image_settings, path.suffix.lower(), scene.render.film_transparent)
            with quiet(options.verbose):
                result = next(image for image in bpy.data.images if image.type == "RENDER_RESULT")
                result.save_render(str(folder / path.name), scene=scene)
        if not (folder / path.name).is_file():
            raise OSError(None, "Blender wrote no file")
        held_back = [*job.held_back, *muted, *untrusted.leave_what_stands(folder, path.parent, path.name)]
    print(job.title)
    _print_ledger()
    _print_held_back(held_back)
    saved = one_line(str(path))
    print(f"Saved: '{saved}'" if getattr(options, "progress", False) else saved, flush=True)


def _choose_format(image, suffix: str, transparent: bool) -> None:
    """Eight-bit PNG with the scene's view transform, or multilayer EXR in 32-bit float."""
    layers = suffix == ".exr"
    if hasattr(image, "media_type"):  # 5.0 and later: decides which formats may be set
        image.media_type = "MULTI_LAYER_IMAGE" if layers else "IMAGE"
    image.file_format = "OPEN_EXR_MULTILAYER" if layers else "PNG"
    image.color_mode = "RGBA" if layers or transparent else "RGB"
    image.color_depth = "32" if layers else "8"


def _print_ledger() -> None:
    ledger = ledgers.latest()
    print(ledger.text())
    _print_notes(ledger.notes)


def _print_held_back(sentences) -> None:
    if sentences:
        print("Blocked or left out of the file, for safety:")
    for sentence in dict.fromkeys(sentences):
        print(f"  {one_line(sentence)}")


def _print_notes(notes) -> None:
    texts = dict.fromkeys(str(note) for note in notes)
    if texts:
        print("Rendered differently from Cycles:")
    for text in texts:
        print(f"  {one_line(text)}")


# ------------------------------------------------------------------------------------------------------------ compare


PICTURES = ("candela.png", "cycles.png")


def compare(job: Job) -> None:
    options = job.options
    folder = output(options.output or Path(f"{options.file.stem}_compare"), folder=True)
    untrusted.refuse_inputs([folder / name for name in ("index.html", *PICTURES)])
    refuse_others(folder, {"index.html": MADE_BY}, PICTURES)
    try:
        with _watched(job, f"Cycles renders the reference, 2 × {options.reference_samples} samples"):
            data = compare_scene(
                job.scene,
                job.scene.candela.samples,
                options.reference_samples,
                direct_only=options.direct_only,
                use_cache=not options.no_cache,
                folder=options.cache,
                view_layer=job.layer,
                seed=job.scene.candela.seed,
                with_first_row=options.first_row,
            )
    except reference.RenderFailed as error:
        raise Refused(f"{options.file} could not be compared: {reason(error.__cause__ or error)}.") from None
    with placed_in(folder) as place:
        write_report(place / "index.html", data)
        combined = data.pictures[0]
        for name, pixels in zip(PICTURES, (combined.x, combined.reference)):
            if pixels is not None:
                shown = metrics.display(pixels[::-1])
                (place / name).write_bytes(png.png((shown * 255 + 0.5).astype("uint8")))
    bounces = "without bounces (direct light, emission and world)" if data.direct_only else "with all bounces"
    kept = ", from the cache" if data.reference_cached else ""
    print(job.title)
    print(f"Against Cycles {bounces}; 2 × {data.reference_samples} samples{kept}")
    print(table(data.errors))
    for one in data.opening:
        print(f"  {one.label:<32} {one.seconds:6.2f} s   relMSE {one.relmse:.2e}")
    print(f"Candela {data.seconds:.2f} s, Cycles {data.reference_seconds / 2:.2f} s per reference")
    print(ledgers.latest().text())
    _print_notes(data.notes)
    _print_held_back(job.held_back)
    print(one_line(str(folder / "index.html")))


# --------------------------------------------------------------------------------------------------------------- plan


class CandelaPlanEngine(bpy.types.RenderEngine):
    """Reads the scene as a final render would and draws nothing."""

    bl_idname = "CANDELA_PLAN"
    bl_label = "Candela plan"
    bl_use_shading_nodes_custom = False

    found: list[tuple[str, Snapshot]] = []  # view layer and what it holds
    refusal = ""

    def update(self, data, depsgraph):
        try:
            snapshot = take(
                depsgraph, SnapshotCache(), self.resolution_x, self.resolution_y, camera=self.camera_override
            )
            self.found.append((depsgraph.view_layer.name, snapshot))
        except UnsupportedScene as error:
            CandelaPlanEngine.refusal = str(error)

    def render(self, depsgraph):
        pass


def plan(job: Job) -> None:
    snapshots = _snapshots(job)
    print(job.title)
    figures = _figures(job.options.verbose)
    for layer, snapshot in snapshots:
        settings = settings_of(job.scene, viewport=False, layer=job.scene.view_layers[layer])
        try:
            found = make_plan(make_registry(), snapshot, settings)
        except PlanError as error:
            raise Refused(str(error)) from None
        triangles = sum(len(snapshot.meshes[instance.mesh].triangle_corners) for instance in snapshot.instances)
        print(
            f"View layer {one_line(layer)}: {len(snapshot.meshes)} meshes in {len(snapshot.instances)} places, "
            f"{triangles} triangles, {len(snapshot.materials)} materials, {len(snapshot.lights)} lights"
        )
        print(found.text())
        if figures is not None:
            sentences = []
            if found.runs("film"):
                points = settings.value("film", POINTS)
                sentences += point_costs.foreseen(snapshot, points, settings.samples, found.fills("indirect"))
            if found.runs("direct_light"):
                soft = found.filled.get("shadow") == "shadows_by_light"
                sentences += ledgers.some_of(tuple(foreseen(snapshot, settings, soft)))
            for sentence in sentences:
                print(f"  {one_line(sentence)}")
        _print_notes([*snapshot.notes, *_material_notes(snapshot)])


def _figures(verbose: bool) -> Device | None:
    """What the device costs, which is printed; None without a GPU, where nothing is foreseen."""
    try:
        with quiet(verbose):
            context.ensure()
            figures = device_probe.ensure()
    except RuntimeError:
        return None
    except ValueError as error:
        raise Refused(str(error)) from None
    print(f"Device {context.describe()}")
    for line in figures.lines():
        print(f"  {line}")
    return figures


def _snapshots(job: Job) -> list[tuple[str, Snapshot]]:
    """What each view layer holds in a final render. Raises Refused."""
    CandelaPlanEngine.found, CandelaPlanEngine.refusal = [], ""
    bpy.utils.register_class(CandelaPlanEngine)
    try:
        job.scene.render.engine = CandelaPlanEngine.bl_idname
        job.scene.render.use_compositing = False
        target = {"layer": job.layer.name} if job.layer else {}
        with quiet(job.options.verbose):
            bpy.ops.render.render(scene=job.scene.name, **target)
    except RuntimeError as error:
        raise Refused(f"{job.options.file} could not be read: {reason(error)}.") from None
    finally:
        job.scene.render.engine = engine.ENGINE
        bpy.utils.unregister_class(CandelaPlanEngine)
    if CandelaPlanEngine.refusal:
        raise Refused(CandelaPlanEngine.refusal)
    return CandelaPlanEngine.found


def _material_notes(snapshot: Snapshot) -> list[Note]:
    return [
        Note(f"Material '{material.name}'", text, material.name, node)
        for material in snapshot.materials
        for node, text in compile_material(material.name, material.graph, snapshot.images).fallbacks
    ]


# ----------------------------------------------------------------------------------------------- Blender, kept in check


def _duration(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 100 else f"{seconds / 60:.0f} min"


@contextlib.contextmanager
def _watched(job: Job, then: str = "", begun: float = 0.0, share: float = 1.0) -> Iterator[None]:
    """Candela renders inside: with progress on a terminal, without Blender's chatter, and to the last sample.

    `then` is said when the last sample is done. With --progress, lines for render farms are printed: of the whole work,
    `begun` was done before and this is `share` of it. Raises Refused when the render ended before its last sample.
    """
    lines = os.fdopen(os.dup(STDOUT), "w") if getattr(job.options, "progress", False) else None
    latest, reached, started = None, 0.0, time.monotonic()
    with contextlib.ExitStack() as stack:
        if lines is not None:
            stack.enter_context(lines)
        terminal = stack.enter_context(quiet(job.options.verbose))
        try:
            context.ensure()
        except RuntimeError as error:
            raise Refused(str(error)) from None

        def tell(news) -> None:
            nonlocal latest, reached, started
            latest = news
            if news.share is None:
                return
            if news.share == 0.0:  # of the next view layer, too
                reached, started = 0.0, time.monotonic()
            if news.share <= reached:
                return
            reached = news.share
            left = (time.monotonic() - started) / reached * (1.0 - reached)
            progress(terminal, f"{one_line(news.text)}, {_duration(left)} left" if reached < 1.0 else then)
            if lines is not None:
                print(
                    f"Fra:{job.scene.frame_current} | {one_line(f'{job.scene.name} | {news.text}')}\n"
                    f"openjd_progress: {100 * (begun + share * reached):.1f}",
                    file=lines, flush=True,
                )  # fmt: skip

        engine.told = tell
        try:
            yield
        finally:
            engine.told = None
            progress(terminal, "")
    if latest is not engine.FINISHED:
        how = f" at: {latest.text}" if latest is not None else ""
        raise Refused(f"The render of {job.options.file} was broken off{how}.")
