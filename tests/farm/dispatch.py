"""Tasks of a job template, run by Open Job Description's own runtime; what a worker of a farm does with them."""

from __future__ import annotations

import threading
from pathlib import Path


def job_of(bundle: Path, values: dict[str, str]):
    """The job of a bundle with these values of its parameters: (job, parameter values)."""
    import json

    from openjd.model import create_job, decode_job_template, preprocess_job_parameters

    template = decode_job_template(template=json.loads((bundle / "template.json").read_text("utf-8")))
    parameters = preprocess_job_parameters(
        job_template=template, job_parameter_values=values, job_template_dir=bundle, current_working_dir=bundle
    )
    return create_job(job_template=template, job_parameter_values=parameters), parameters


def tasks_of(bundle: Path, values: dict[str, str], step: str) -> int:
    """How many tasks a step has."""
    from openjd.model import StepParameterSpaceIterator

    job, _ = job_of(bundle, values)
    (found,) = (one for one in job.steps if one.name == step)
    return len(StepParameterSpaceIterator(space=found.parameterSpace))


def run_task(bundle: Path, values: dict[str, str], step: str, number: int) -> tuple[str, float | None, list[str]]:
    """Run one task in a session of its own: its state, its last progress in per cent, and its log."""
    import logging

    from openjd.model import StepParameterSpaceIterator
    from openjd.sessions import LOG, ActionState, Session, SessionState

    job, parameters = job_of(bundle, values)
    (found,) = (one for one in job.steps if one.name == step)
    task = StepParameterSpaceIterator(space=found.parameterSpace)[number]
    progress, ended, states, lines = [], threading.Event(), [], []

    def told(_, status):
        if status.progress is not None:
            progress.append(status.progress)
        if status.state != ActionState.RUNNING:
            states.append(status.state.name)
            ended.set()

    class Kept(logging.Handler):
        def emit(self, record):
            lines.append(record.getMessage())

    handler = Kept()
    LOG.addHandler(handler)
    LOG.setLevel(logging.INFO)
    try:
        with Session(session_id=f"{step}-{number}", job_parameter_values=parameters, callback=told) as session:
            for environment in job.jobEnvironments or ():
                session.enter_environment(environment=environment)
                while session.state == SessionState.RUNNING:
                    ended.wait(0.1)
            ended.clear()
            session.run_task(step_script=found.script, task_parameter_values=task)
            ended.wait(300)
    finally:
        LOG.removeHandler(handler)
    return (states or ["NONE"])[-1], (progress or [None])[-1], lines
