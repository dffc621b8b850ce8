"""The verb `tune`: measures settings on the scene of a file and proposes those with the least error under a time."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

import bpy

from ..compare import metrics, reference, tune
from ..frame import ledger as ledgers
from ..gfx import context
from ..snapshot.scene import one_line
from ..techniques import REGISTRY
from ..ui.properties import settings_of
from ..ui.tuning import AGAIN, SEED, apply, choices, properties
from . import untrusted
from .files import output
from .refused import USAGE, Refused, reason
from .terminal import progress, quiet
from .verbs import Job, open_mainfile


def tune_scene(job: Job) -> None:
    """Measure, print the curve and the proposal; with --apply, write it into the file."""
    options = job.options
    layer = job.layer or reference.active_view_layer(job.scene)
    path = output(options.output or options.file, folder=False) if options.apply else None
    if path is not None and path.suffix.lower() != ".blend":
        raise Refused(f"The output of tune must end in .blend, and {path.name} does not.", USAGE)
    if path is not None and path != options.file.resolve():
        untrusted.refuse_inputs([path])
    if job.scene.candela.pass_tree is not None:
        raise Refused("The scene renders by a pass tree, whose nodes decide; tune needs a scene without one.")
    seconds = options.milliseconds / 1000
    try:
        with quiet(options.verbose) as terminal:
            context.ensure()
            progress(terminal, f"Cycles renders the reference, 2 × {options.reference_samples} samples")
            truth = reference.reference(job.scene, options.reference_samples, False, None, layer, folder=options.cache)
            deadline = time.monotonic() + options.budget
            render = _renders(job, layer, truth, deadline, seconds, terminal)
            values = settings_of(job.scene, viewport=False).values
            trials = tune.search(choices(job.scene), REGISTRY, values, render, seconds)
            progress(terminal, "")
    except reference.RenderFailed as error:
        raise Refused(f"{options.file} could not be tuned: {reason(error.__cause__ or error)}.") from None
    except RuntimeError as error:
        raise Refused(str(error)) from None
    if not trials:
        raise Refused(f"Not one render was done within {options.budget:g} seconds; give tune a larger --budget.")
    best = tune.proposal(trials, seconds)
    print(job.title)
    print(f"{len(trials)} settings against Cycles, 2 × {options.reference_samples} samples; those that nothing beats:")
    print(tune.table(trials, best))
    if best.seconds > seconds:
        print(f"Nothing took less than {options.milliseconds:g} ms; the fastest is marked.")
    if path is not None:
        save(options.file, job.scene.name, best.candidate, path)
        print(one_line(str(path)))


def _renders(job: Job, layer, truth, deadline: float, seconds: float, terminal):
    """What renders a candidate for `tune.search`: warm, with its error; raises Spent after the deadline."""
    tried: set[tuple] = set()
    warm: set[tuple] = set()  # techniques that ran together, whose programs are compiled
    scene = job.scene
    half = truth.half["combined"]
    noise = metrics.compare_radiance("", truth.images["combined"], truth.images["combined"], half).floor

    def passes(candidate: tune.Candidate, seed: int):
        settings = [(scene.candela, name, value) for name, value in properties(candidate)]
        with reference.overridden(settings):
            made = reference.render_passes(scene, "CANDELA", candidate.samples, seed, view_layer=layer)
        ran = ledgers.latest().ran
        was_warm = ran in warm
        warm.add(ran)
        return made, ran, was_warm

    def render(candidate: tune.Candidate) -> tune.Picture:
        if time.monotonic() > deadline:
            raise tune.Spent
        progress(terminal, f"{deadline - time.monotonic():.0f} s left: {candidate.text()}")
        if candidate.slots not in tried:
            passes(replace(candidate, samples=1), SEED + 1)
            tried.add(candidate.slots)
        made, ran, was_warm = passes(candidate, SEED)
        if not was_warm:  # Auto, and Denoise, go by the number of samples
            made, ran, _ = passes(candidate, AGAIN)
        error = metrics.compare_radiance("", made.images["combined"], truth.images["combined"]).relmse
        return tune.Picture(made.seconds, max(error - noise, 1e-12), ran)

    return render


def save(file: Path, scene: str, candidate: tune.Candidate, path: Path) -> None:
    """Open the file anew, change nothing but Candela's settings of the scene and the samples of its view layers, and
    write it. Raises Refused."""
    try:
        with quiet():
            problem = open_mainfile(file)
            if problem:
                raise Refused(f"{file} could not be opened: {problem}.")
            apply(bpy.data.scenes[scene], candidate)
            bpy.ops.wm.save_as_mainfile(filepath=str(path), check_existing=False, compress=True)
    except RuntimeError as error:
        raise Refused(f"{path} could not be written: {reason(error)}.") from None
