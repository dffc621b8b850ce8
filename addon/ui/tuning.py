"""Tune: the settings with the least error within a time, found on the open scene and this machine, as an operator.

The search is that of compare/tune.py. A trial's time is the sum of its steps, without what Blender does between them,
and without compilation: the first render of a choice of techniques is done twice. The scene is not changed before the
artist applies what was found.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial

import bpy

from ..compare import metrics, tune
from ..compare.beside import reference_steps
from ..frame.settings import OFF
from ..frame.technique import identifier
from ..techniques import REGISTRY
from . import ENGINE, shown_otherwise
from .jobs import Job, depsgraph_of, draw_progress, layer_named, part
from .pass_run import Rendered, render_steps
from .properties import settings_of

SEED = 11  # of timed renders; programs are compiled by a render of another one
AGAIN = 13  # where that was found to have compiled programs after all; the same picture would not be drawn twice
REFERENCE_SHARE = 0.3  # of the progress
MOST_ROWS = 12  # of the curve, in the panel


def choices(scene) -> dict[str, list[str]]:
    """What to try by slot, the scene's own choice first: of a slot on Auto that is Auto itself. Slots without a choice
    stay away, and so do those that are off."""
    found: dict[str, list[str]] = {}
    for technique in REGISTRY:
        for slot in technique.fills:
            found.setdefault(slot, []).append(technique.name)
    chosen = {slot: getattr(scene.candela, f"slot_{slot}") for slot in found}
    return {
        slot: [chosen[slot], *(name for name in names if name != chosen[slot])]
        for slot, names in found.items()
        if len(names) > 1 and chosen[slot] != OFF
    }


def properties(candidate: tune.Candidate) -> list[tuple[str, object]]:
    """The candidate as properties of scene.candela."""
    own: list[tuple[str, object]] = [("samples", candidate.samples)]
    own += [(f"slot_{slot}", name) for slot, name in candidate.slots]
    return own + [(identifier(*name), value) for name, value in candidate.values]


def changes(scene, candidate: tune.Candidate) -> list[tuple[str, str, str]]:
    """What applying the candidate changes: name of the property, its value now, its value then."""
    found = []
    for name, value in properties(candidate):
        now = getattr(scene.candela, name)
        if now != value:
            declared = scene.candela.bl_rna.properties[name]
            found.append((declared.name, _worded(declared, now), _worded(declared, value)))
    for layer in scene.view_layers:
        if layer.samples:
            found.append((f"Samples of view layer {layer.name}", str(layer.samples), "the scene's"))
    return found


def apply(scene, candidate: tune.Candidate) -> None:
    """Set what the candidate says, and let it count: view layers give up numbers of samples of their own."""
    for name, value in properties(candidate):
        setattr(scene.candela, name, value)
    for layer in scene.view_layers:
        layer.samples = 0


def _worded(declared, value) -> str:
    """A value as the artist sees it."""
    if declared.type == "ENUM":
        return declared.enum_items[value].name if value in declared.enum_items else str(value)
    return f"{value:g}" if isinstance(value, float) else str(value)


@dataclass(frozen=True)
class Found:
    """What the last search measured, for one scene."""

    scene: int  # its session_uid
    trials: list[tune.Trial]
    best: tune.Trial
    seconds: float  # that a picture may take


_found: Found | None = None


def latest(scene) -> Found | None:
    """The last search, if it was one of this scene."""
    return _found if _found is not None and _found.scene == scene.session_uid else None


class CandelaTuning(bpy.types.PropertyGroup):
    """What Tune is asked for."""

    milliseconds: bpy.props.FloatProperty(
        name="Time", description="Time limit of a picture of the size below, in milliseconds", default=1000.0, min=1.0,
        soft_max=60000.0, precision=0,
    )  # fmt: skip
    percentage: bpy.props.IntProperty(
        name="Resolution", description="Size of the pictures, in percent of the render resolution",
        default=25, min=1, max=100,
        subtype="PERCENTAGE",
    )  # fmt: skip
    budget: bpy.props.IntProperty(
        name="Search", description="Duration of the search in seconds, after Cycles has rendered the reference",
        default=120, min=1,
        soft_max=600,
    )  # fmt: skip
    reference_samples: bpy.props.IntProperty(
        name="Reference Samples", description="Samples of each of the two renders by Cycles that error is measured by",
        default=128, min=1, max=65536,
    )  # fmt: skip


class CANDELA_OT_tune(Job, bpy.types.Operator):
    """Measure settings on this scene and propose those with the least error within the time. Changes nothing"""

    bl_idname = "candela.tune"
    bl_label = "Tune"

    def work(self, context) -> Iterator[tuple[float, str]]:
        scene, options = context.scene, context.window_manager.candela_tuning
        if scene.candela.pass_tree is not None:
            raise ValueError("The scene renders by a pass tree, whose nodes decide; Tune needs a scene without one.")
        share = scene.render.resolution_percentage * options.percentage / 10000
        size = tuple(max(int(side * share), 1) for side in (scene.render.resolution_x, scene.render.resolution_y))
        settings = settings_of(scene, viewport=False)
        layer = context.view_layer.name
        shown_otherwise.warn(self, context.view_layer)
        steps = reference_steps(scene, options.reference_samples, settings.bounces == 0, size, context.view_layer)
        truth = yield from part(steps, 0.0, REFERENCE_SHARE)
        trials: list[tune.Trial] = []
        render = partial(_timed, context, scene, layer, size)
        searching = self._search(render, scene, settings, truth, trials, options.milliseconds / 1000)
        yield from part(_within(searching, options.budget, trials), REFERENCE_SHARE, 1.0)
        global _found
        seconds = options.milliseconds / 1000
        _found = Found(scene.session_uid, trials, tune.proposal(trials, seconds), seconds)
        yield 1.0, "done"

    def _search(self, render, scene, settings, truth, trials, seconds) -> Iterator[str]:
        """Renders candidate after candidate in small steps; yields a sentence after each."""
        mean = truth.images["combined"]
        noise = metrics.compare_radiance("", mean, mean, truth.half["combined"]).floor
        asked = tune.candidates(trials, choices(scene), REGISTRY, settings.values, seconds)
        tried: set[tuple] = set()
        warm: set[tuple] = set()  # techniques that ran together, whose programs are compiled
        try:
            candidate = next(asked)
            while True:
                told = f"{len(trials)} settings measured; {candidate.samples} samples"
                if candidate.slots not in tried:
                    tried.add(candidate.slots)
                    first = replace(candidate, samples=1)
                    rendered, _ = yield from render(changed(settings, first, SEED + 1), told)
                    warm.add(rendered.ledger.ran)
                rendered, took = yield from render(changed(settings, candidate, SEED), told)
                if rendered.ledger.ran not in warm:  # Auto, and Denoise, go by the number of samples
                    warm.add(rendered.ledger.ran)
                    rendered, took = yield from render(changed(settings, candidate, AGAIN), told)
                error = metrics.compare_radiance("", rendered.passes().images["combined"], mean).relmse
                candidate = asked.send(tune.Picture(took, max(error - noise, 1e-12), rendered.ledger.ran))
        except StopIteration:
            pass


def changed(settings, candidate: tune.Candidate, seed: int):
    """The scene's settings with those of the candidate."""
    values = {**settings.values, **dict(candidate.values)}
    slots = {**settings.slots, **dict(candidate.slots)}
    return replace(settings, samples=candidate.samples, seed=seed, slots=slots, values=values)


def _timed(context, scene, layer: str, size, settings, told: str) -> Iterator[str]:
    """A render in steps, each followed by `told`; returns `Rendered` and the seconds that the steps took together."""
    took = 0.0
    depsgraph = depsgraph_of(context, scene, layer_named(scene, layer))
    steps = render_steps(scene, depsgraph, size, settings, profile=False)
    try:
        while True:
            started = time.perf_counter()
            try:
                next(steps)
            except StopIteration as end:
                rendered: Rendered = end.value
                return rendered, took + time.perf_counter() - started
            took += time.perf_counter() - started
            yield told
    finally:
        steps.close()


def _within(steps: Iterator[str], budget: float, trials: list[tune.Trial]) -> Iterator[tuple[float, str]]:
    """The steps with the share of the budget that is spent, ended when all of it is; not before the first trial."""
    started = time.monotonic()
    try:
        for told in steps:
            spent = time.monotonic() - started
            if spent > budget and trials:
                return
            yield min(spent / budget, 1.0), told
    finally:
        steps.close()


class CANDELA_OT_tune_apply(bpy.types.Operator):
    """Apply these settings, after showing what they change"""

    bl_idname = "candela.tune_apply"
    bl_label = "Apply Tuned Settings"
    bl_options = {"REGISTER", "UNDO"}

    number: bpy.props.IntProperty(
        name="Row", description="Row of the curve, from the fastest on; the proposal by default", default=-1,
        options={"SKIP_SAVE"},
    )  # fmt: skip

    @classmethod
    def poll(cls, context):
        return latest(context.scene) is not None

    def _candidate(self, context) -> tune.Candidate:
        found = latest(context.scene)
        curve = tune.front(found.trials)
        return (curve[self.number] if 0 <= self.number < len(curve) else found.best).candidate

    def invoke(self, context, event):
        return context.window_manager.invoke_props_dialog(self, width=420, confirm_text="Apply")

    def draw(self, context):
        table = changes(context.scene, self._candidate(context))
        if not table:
            self.layout.label(text="Nothing changes: the scene is set like this.")
        column = self.layout.column(align=True)
        for name, now, then in table:
            row = column.split(factor=0.4)
            row.label(text=name)
            row.label(text=f"{now} → {then}")

    def execute(self, context):
        apply(context.scene, self._candidate(context))
        return {"FINISHED"}


class CANDELA_RENDER_PT_tune(bpy.types.Panel):
    """Settings with the least error within a time, found on this scene and machine"""

    bl_label = "Tune"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "render"
    bl_parent_id = "CANDELA_RENDER_PT_techniques"
    bl_options = {"DEFAULT_CLOSED"}
    COMPAT_ENGINES = {ENGINE}

    @classmethod
    def poll(cls, context):
        return context.engine in cls.COMPAT_ENGINES

    def draw(self, context):
        layout, options = self.layout, context.window_manager.candela_tuning
        column = layout.column()
        column.use_property_split, column.use_property_decorate = True, False
        column.prop(options, "milliseconds", text="Time (ms)")
        column.prop(options, "percentage")
        column.prop(options, "budget", text="Search (s)")
        column.prop(options, "reference_samples", text="Reference")
        layout.operator("candela.tune", icon="PLAY")
        draw_progress(layout)
        found = latest(context.scene)
        if found is not None:
            self._draw_curve(layout, found)

    def _draw_curve(self, layout, found: Found) -> None:
        """What nothing beats, by rising time; a click on a line applies it, the proposal is marked."""
        curve = tune.front(found.trials)
        if found.best.seconds > found.seconds:
            layout.label(text="Nothing was as fast; the fastest is marked.", icon="INFO")
        table = layout.column(align=True)
        _row(table, ("ms", "relMSE", "Samples"), "", -1)
        for number, trial in list(enumerate(curve))[-MOST_ROWS:]:
            told = f"{1000 * trial.seconds:.0f}", f"{trial.error:.1e}", str(trial.candidate.samples)
            icon = "CHECKMARK" if trial is found.best else "BLANK1"
            _row(table, told, icon, number)
        layout.operator("candela.tune_apply", text="Apply Proposal…", icon="CHECKMARK")


def _row(table, texts: tuple[str, ...], icon: str, number: int) -> None:
    """A line of the curve; with an icon, a button in front of it applies the settings of that number."""
    line = table.split(factor=0.12, align=True)
    if icon:
        line.operator("candela.tune_apply", text="", icon=icon, emboss=False).number = number
    else:
        line.label(text="")
    row = line.row(align=True)
    for text in texts:
        row.label(text=text)


_CLASSES = (CandelaTuning, CANDELA_OT_tune, CANDELA_OT_tune_apply, CANDELA_RENDER_PT_tune)


def register() -> None:
    for made in _CLASSES:
        bpy.utils.register_class(made)
    bpy.types.WindowManager.candela_tuning = bpy.props.PointerProperty(type=CandelaTuning)


def unregister() -> None:
    del bpy.types.WindowManager.candela_tuning
    for made in reversed(_CLASSES):
        bpy.utils.unregister_class(made)
