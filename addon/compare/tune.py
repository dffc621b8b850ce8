"""Tuning: which settings bring the least error on this scene and machine, within the time that a picture may take.

What Auto knows comes from other scenes and another machine. Here candidates are rendered and measured on the scene
itself, until a budget is spent:

1. The scene's own choices, Auto among them, and then each other choice of techniques by slot, are swept over 1, 2, 4,
   … samples up to the asked time; a choice that is clearly behind what is already known is not swept further. A slot
   that is off stays off.
2. The best choice is rendered at the number of samples that just fits.
3. Its techniques' numeric parameters of the scene are doubled and halved, one by one, the samples refitted to the time;
   what lowers the error stays, and is the start for the next.

Error is relMSE against a reference of the same scene, less the reference's own noise. Time is that of a whole render
with compiled programs. A trial's figures are those of one seed: differences of a few per cent are chance, so a
step must win by more than that.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Generator, Iterable, Sequence
from dataclasses import dataclass, replace

from ..frame.technique import SCENE, Technique

BEHIND = 2.0  # a choice whose error is so many times the best known one at its time is not swept further
WINS = 0.95  # a changed parameter must bring the error below this share of what it was


@dataclass(frozen=True)
class Candidate:
    """Settings to try: samples, technique by slot, and values of parameters by (technique, parameter)."""

    samples: int
    slots: tuple[tuple[str, str], ...] = ()
    values: tuple[tuple[tuple[str, str], float], ...] = ()

    def text(self) -> str:
        """As on the command line: `samples=16 slot.shadow=vssm instant_radiosity.rays=8`."""
        words = [f"samples={self.samples}", *(f"slot.{slot}={name}" for slot, name in self.slots)]
        return " ".join([*words, *(f"{'.'.join(name)}={value:g}" for name, value in self.values)])


@dataclass(frozen=True)
class Picture:
    """What a render of a candidate gave: seconds, relMSE, and the names of the techniques that ran."""

    seconds: float
    error: float
    ran: tuple[str, ...]


@dataclass(frozen=True)
class Trial:
    candidate: Candidate
    picture: Picture

    @property
    def seconds(self) -> float:
        return self.picture.seconds

    @property
    def error(self) -> float:
        return self.picture.error


class Spent(Exception):
    """The budget is used up: what was measured so far is the result."""


def search(
    slots: dict[str, Sequence[str]],
    techniques: Iterable[type[Technique]],
    values: dict[tuple[str, str], object],
    render: Callable[[Candidate], Picture],
    seconds: float,
    most_samples: int = 4096,
) -> list[Trial]:
    """All trials in the order in which they were made. `render` raises Spent when the budget is used up; the other
    arguments are those of `candidates`.
    """
    trials: list[Trial] = []
    asked = candidates(trials, slots, techniques, values, seconds, most_samples)
    try:
        candidate = next(asked)
        while True:
            candidate = asked.send(render(candidate))
    except (StopIteration, Spent):
        return trials


Asking = Generator[Candidate, Picture, Trial]


def candidates(
    trials: list[Trial],
    slots: dict[str, Sequence[str]],
    techniques: Iterable[type[Technique]],
    values: dict[tuple[str, str], object],
    seconds: float,
    most_samples: int = 4096,
) -> Generator[Candidate, Picture, None]:
    """Yields what to render next, and is sent what came out; `trials`, empty at first, grows by one each time.

    `slots` names what to choose from by slot, techniques and Auto, the scene's own choice first; `values` are the
    scene's own parameters; `seconds` is the time that a picture may take.
    """
    for choice in _choices(slots):
        yield from _sweep(trials, Candidate(1, choice), seconds, most_samples)
    best = proposal(trials, seconds)
    fitted = yield from _fitted(trials, best, seconds, most_samples)
    best = max(best, fitted, key=lambda trial: _worth(trial, seconds))
    yield from _step_parameters(trials, best, techniques, values, seconds, most_samples)


def _tried(trials: list[Trial], candidate: Candidate) -> Asking:
    """The candidate's trial, made now if it was not made before."""
    for trial in trials:
        if trial.candidate == candidate:
            return trial
    trials.append(Trial(candidate, (yield candidate)))
    return trials[-1]


def _choices(slots: dict[str, Sequence[str]]) -> list[tuple[tuple[str, str], ...]]:
    """The scene's own choice, then each other technique in one slot."""
    own = {slot: names[0] for slot, names in slots.items()}
    found = [tuple(own.items())]
    for slot, names in slots.items():
        found += [tuple({**own, slot: name}.items()) for name in names[1:]]
    return found


def _sweep(trials: list[Trial], start: Candidate, seconds: float, most: int) -> Generator[Candidate, Picture, None]:
    """1, 2, 4, … samples, as long as the next is likely to fit and the choice keeps up with the others."""
    samples = 1
    while samples <= most:
        trial = yield from _tried(trials, replace(start, samples=samples))
        if any(_is_alike(one, trial) for one in trials):
            return  # the choice makes no difference in this scene
        others = [one.error for one in trials if one.candidate.slots != start.slots and one.seconds <= trial.seconds]
        if trial.seconds * 1.5 > seconds or (others and trial.error > BEHIND * min(others)):
            return
        samples *= 2


def _is_alike(one: Trial, other: Trial) -> bool:
    """Whether two choices came to the same techniques. With other numbers of samples that says nothing: Auto chooses
    by them."""
    choices, samples = (one.candidate.slots, other.candidate.slots), (one.candidate.samples, other.candidate.samples)
    return choices[0] != choices[1] and samples[0] == samples[1] and one.picture.ran == other.picture.ran


def _fitted(trials: list[Trial], trial: Trial, seconds: float, most: int) -> Asking:
    """The same settings with as many samples as fit into the time, taking time to be in proportion to them."""
    samples = max(1, min(most, math.floor(trial.candidate.samples * seconds / trial.seconds)))
    return (yield from _tried(trials, replace(trial.candidate, samples=samples)))


def _step_parameters(
    trials: list[Trial], best: Trial, techniques, own: dict, seconds: float, most: int
) -> Generator[Candidate, Picture, None]:
    """Double and halve each numeric parameter of the scene of the techniques that ran; what wins is kept."""
    for technique in techniques:
        if technique.name not in best.picture.ran:
            continue
        for param in technique.params_of(SCENE):  # what is applied is applied to the scene
            if isinstance(param.default, bool | str | tuple):
                continue
            for factor in (2.0, 0.5):
                values = dict(best.candidate.values)
                name = (technique.name, param.name)
                value = _stepped(param, values.get(name, own[name]), factor)
                if value is None:
                    continue
                changed = replace(best.candidate, values=tuple({**values, name: value}.items()))
                trial = yield from _tried(trials, changed)
                trial = yield from _fitted(trials, trial, seconds, most)
                if trial.seconds <= seconds and trial.error < WINS * best.error:
                    best = trial
                    break


def _stepped(param, value: float, factor: float) -> float | None:
    """The value times the factor within the parameter's range; None where it would not change."""
    new = type(param.default)(value * factor)
    new = max(new, param.minimum) if param.minimum is not None else new
    new = min(new, param.maximum) if param.maximum is not None else new
    return None if new == value else new


def _worth(trial: Trial, seconds: float) -> tuple[float, ...]:
    """Larger is better: least error among those that fit, and of the same error the fastest; else least time."""
    return (1.0, -trial.error, -trial.seconds) if trial.seconds <= seconds else (0.0, -trial.seconds)


def proposal(trials: list[Trial], seconds: float) -> Trial:
    """The trial with the least error within the time; where none fits, the fastest."""
    return max(trials, key=lambda trial: _worth(trial, seconds))


def front(trials: list[Trial]) -> list[Trial]:
    """Trials that no other beats in time and error at once, by rising time: the curve that tuning found."""
    found: list[Trial] = []
    for trial in sorted(trials, key=lambda trial: (trial.seconds, trial.error)):
        if not found or trial.error < found[-1].error:
            found.append(trial)
    return found


def table(trials: list[Trial], chosen: Trial) -> str:
    """The curve as lines for a terminal; an arrow marks the proposal, which is written out below."""
    shown = [(trial, trial.candidate.text().split()) for trial in front(trials)]
    common = set.intersection(*(set(words) for _, words in shown)) if len(shown) > 1 else set()
    rows = [("", "ms", "relMSE", "settings")]
    for trial, words in shown:
        told = " ".join(word for word in words if word not in common)
        rows.append(("→" if trial is chosen else "", f"{1000 * trial.seconds:.0f}", f"{trial.error:.2e}", told))
    widths = [max(len(row[k]) for row in rows) for k in range(3)]
    lines = [f"{a:<{widths[0]}} {b:>{widths[1]}}  {c:>{widths[2]}}  {d}".rstrip() for a, b, c, d in rows]
    return "\n".join([*lines, f"Proposed: {chosen.candidate.text()}"])
