"""The artist's settings as plain data: sample count, technique per slot, parameters by technique."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from itertools import groupby

from .schedule import AT_REST, Schedule
from .technique import OF_A_PICTURE, Param, Technique

SAMPLES = Param("samples", "Samples", 64, "Number of samples averaged per pixel; error falls as it grows", 1, 65536)
SEED = Param(
    "seed", "Seed", 0, "Seed of the random numbers: another value changes the noise, not the mean", 0, 2**31 - 1
)
BOUNCES = Param(
    "bounces", "Bounces", 16,
    "Maximum number of reflections of indirect light before it reaches the visible surface; 0: direct light only",
    0, 64,
)  # fmt: skip
DRAFT_BOUNCES = 8
SAMPLE_OFFSET = Param(
    "sample_offset", "Sample Offset", 0,
    "First sample to render, where several machines share the samples of a picture",
    0, 65535,
)  # fmt: skip
SAMPLE_COUNT = Param(
    "sample_count",
    "Sample Count",
    0,
    "Number of samples to render from the sample offset on; 0: all remaining ones",
    0,
    65536,
)
TIME_LIMIT = Param(
    "time_limit", "Time Limit", 0.0,
    "Seconds after which a final render ends with the samples rendered so far; 0: no limit",
    0.0, 1e6,
)  # fmt: skip
NOISE_THRESHOLD = Param(
    "noise_threshold", "Noise Threshold", 0.0,
    "Relative error, before denoising, at which a final render ends, as its own samples tell it; 0: all are drawn",
    0.0, 1.0,
)  # fmt: skip
MOTION_STEPS = Param(
    "motion_steps", "Time Steps", 16,
    "Moments at which a final render with motion blur looks at the scene, at most one for each sample", 1, 256,
)  # fmt: skip
SCENE_PARAMS = (SAMPLES, SEED, BOUNCES, SAMPLE_OFFSET, SAMPLE_COUNT, TIME_LIMIT, NOISE_THRESHOLD, MOTION_STEPS)
PARTIAL = (SAMPLE_OFFSET, SAMPLE_COUNT, TIME_LIMIT, NOISE_THRESHOLD)  # those that leave samples out
AUTO = "AUTO"
OFF = "OFF"  # a slot that nothing fills


@dataclass(frozen=True)
class Settings:
    """Values override declared defaults; `slots` maps slot to technique name or AUTO."""

    samples: int = SAMPLES.default
    seed: int = SEED.default
    bounces: int = BOUNCES.default
    slots: dict[str, str] = field(default_factory=dict)
    values: dict[tuple[str, str], object] = field(default_factory=dict)
    passes: tuple[str, ...] | None = None  # names of the techniques of a pass tree, in its order; None: all, by slot
    schedule: Schedule = AT_REST
    sample_offset: int = SAMPLE_OFFSET.default  # `samples` stays the number of the whole picture, for all techniques
    sample_count: int = SAMPLE_COUNT.default
    time_limit: float = TIME_LIMIT.default  # s; the picture may end with fewer samples than it asks for
    noise_threshold: float = NOISE_THRESHOLD.default  # the same
    motion_steps: int = MOTION_STEPS.default  # asked of by the engine alone, where motion blur is on
    shows: frozenset[str] | None = None  # images of the frame that are asked for beside the picture; None: any may be
    takes: int = 1  # light groups whose pictures are added up: together they have the noise of one (film/takes.py)
    take: int = 0  # number of this one
    profile: bool = False  # wait for the GPU after each step, so that times are true

    def get(self, technique: Technique, name: str):
        """Value of a technique's parameter; KeyError if it is not declared."""
        for param in technique.params:
            if param.name == name:
                return self.value(technique.name, param)
        raise KeyError(f"Technique {technique.name} declares no parameter '{name}'.")

    def value(self, owner: str, param: Param):
        """Value of a parameter that the technique named `owner` declares."""
        value = self.values.get((owner, param.name), param.default)
        return min(value, param.draft) if self.schedule.is_draft and param.draft is not None else value

    @property
    def samples_to_draw(self) -> int:
        """Samples of this slice of the picture, at least 0: those from `sample_offset` on."""
        left = max(self.samples - self.sample_offset, 0)
        return min(self.sample_count, left) if self.sample_count else left

    @property
    def may_end_early(self) -> bool:
        """Whether nobody knows beforehand how many samples there will be."""
        return self.time_limit > 0.0 or self.noise_threshold > 0.0

    @property
    def is_slice(self) -> bool:
        """Whether other samples of the same picture are rendered elsewhere."""
        return self.samples_to_draw < self.samples

    def as_draft(self) -> Settings:
        """The same for a picture of a moment. Light of more bounces than eight is faint."""
        return replace(self, schedule=self.schedule.as_draft(), bounces=min(self.bounces, DRAFT_BOUNCES))

    def with_all_samples(self) -> Settings:
        """The same for a picture that is measured: no slice, and none that ends early."""
        return replace(self, **{param.name: param.default for param in PARTIAL})

    def of(self, technique: Technique) -> tuple:
        """All of a technique's values, for its key."""
        return tuple(self.get(technique, param.name) for param in technique.params)

    def override(
        self, techniques: Iterable[Technique], assignments: Iterable[str], others: Iterable[str] = ()
    ) -> Settings:
        """Settings changed by texts like `direct.rays=2`, `samples=16`, `slot.shadow=NAME`. ValueError if unknown, or
        of what a picture has many of. `others`: what else may be set, by whoever calls."""
        settings = self
        techniques = list(techniques)
        own = {param.name: param for param in SCENE_PARAMS}
        declared = {f"{t.name}.{p.name}": (t, p) for t in techniques for p in t.params}
        table = {name: (t, p) for name, (t, p) in declared.items() if p.scope in OF_A_PICTURE}
        slots: dict[str, list[str]] = {}
        for technique in techniques:
            for slot in technique.fills:
                slots.setdefault(f"slot.{slot}", [AUTO, OFF]).append(technique.name)
        for text in assignments:
            name, equals, value = text.partition("=")
            if not equals:
                raise ValueError(f"'{text}' is not of the form name=value.")
            if name in own:
                param = own[name]
                settings = replace(settings, **{name: param.check(value)})
            elif name in slots:
                if value not in slots[name]:
                    raise ValueError(f"'{name}' must be one of {', '.join(slots[name])}, not '{value}'.")
                settings = replace(settings, slots={**settings.slots, name.removeprefix("slot."): value})
            elif name in table:
                technique, param = table[name]
                settings = replace(
                    settings, values={**settings.values, (technique.name, param.name): param.check(value)}
                )
            elif name in declared:
                kind = declared[name][1].scope.lower()
                raise ValueError(
                    f"'{name}' is a setting of each {kind}, not of the picture: set it on the {kind} in the file."
                )
            else:
                known = [*own, *others, *slots, *table]
                near = difflib.get_close_matches(name.replace("_", ".", 1), known, 3) or difflib.get_close_matches(
                    name, [one.rpartition(".")[2] for one in known], 3
                )
                meant = f" Did you mean {' or '.join(near)}?" if near else ""
                groups = [", ".join(group) for _, group in groupby(known, lambda one: one.rpartition(".")[0])]
                raise ValueError(f"There is no setting '{name}'.{meant} Known settings: {'; '.join(groups)}.")
        return settings
