"""Tuning, on invented machines whose best settings are known."""

import pytest

from addon.compare import tune
from addon.compare.tune import Candidate, Picture, Spent, Trial
from addon.frame.technique import Param, Technique


class Maps(Technique):
    name, slot = "maps", "shadow"
    params = (Param("texels", "Texels", 8, "", 1, 16), Param("exact", "Exact", True, ""))


class Moments(Technique):
    name, slot = "moments", "shadow"


SLOTS = {"shadow": ["maps", "moments"]}
VALUES = {("maps", "texels"): 8, ("maps", "exact"): True}


def machine(candidate: Candidate) -> Picture:
    """Maps: error 1 / n, 10 ms per sample, texels of no use. Moments: error 0.1 for ever, 20 ms per sample."""
    technique, n = dict(candidate.slots)["shadow"], candidate.samples
    if technique == "moments":
        return Picture(0.02 * n, 0.1, ("moments",))
    texels = dict(candidate.values).get(("maps", "texels"), 8)
    return Picture(0.01 * n * texels / 8, 1.0 / n, ("maps",))


def search(seconds, render=machine):
    return tune.search(SLOTS, (Maps, Moments), VALUES, render, seconds)


def test_with_little_time_the_biased_technique_wins_and_with_more_the_one_that_converges():
    quick = tune.proposal(search(0.03), 0.03)
    assert dict(quick.candidate.slots) == {"shadow": "moments"}
    slow = tune.proposal(search(1.0), 1.0)
    assert dict(slow.candidate.slots) == {"shadow": "maps"}


def test_a_parameter_that_only_costs_is_turned_down_and_its_time_goes_into_samples():
    best = tune.proposal(search(1.0), 1.0)
    assert dict(best.candidate.values)["maps", "texels"] == 4
    assert best.candidate.samples == 200
    assert best.seconds == pytest.approx(1.0)


def test_no_proposal_is_slower_than_asked_unless_nothing_is_as_fast():
    for seconds in (0.05, 0.3, 2.0):
        assert tune.proposal(search(seconds), seconds).seconds <= seconds * (1 + 1e-9)
    trials = search(0.001)
    assert tune.proposal(trials, 0.001).seconds == min(trial.seconds for trial in trials)


def test_of_two_settings_with_the_same_picture_the_faster_is_proposed_and_is_on_the_curve():
    slow, fast = (Trial(Candidate(4, (("shadow", name),)), Picture(s, 0.1, ())) for name, s in (("a", 0.3), ("b", 0.2)))
    assert tune.proposal([slow, fast], 1.0) is fast
    assert tune.front([slow, fast]) == [fast]


def test_a_choice_that_stays_behind_is_not_swept():
    tried = [trial.candidate for trial in search(5.0) if dict(trial.candidate.slots)["shadow"] == "moments"]
    assert max(candidate.samples for candidate in tried) <= 16


def test_a_choice_that_makes_no_difference_costs_one_render():
    def alike(candidate):
        return Picture(0.01 * candidate.samples, 1.0 / candidate.samples, ("maps",))

    others = [t for t in search(1.0, alike) if dict(t.candidate.slots)["shadow"] == "moments"]
    assert len(others) == 1


def test_a_choice_is_swept_unless_it_comes_to_the_same_with_the_same_samples():
    def by_samples(candidate):
        """Auto takes maps for one sample and moments for more."""
        choice = dict(candidate.slots)["shadow"]
        taken = choice if choice != "AUTO" else "maps" if candidate.samples == 1 else "moments"
        return Picture(0.01 * candidate.samples, 1.0 / candidate.samples, (taken,))

    trials = tune.search({"shadow": ["AUTO", "maps", "moments"]}, (), {}, by_samples, 0.1)
    tried = {name: [] for name in ("AUTO", "maps", "moments")}
    for trial in trials:
        tried[dict(trial.candidate.slots)["shadow"]].append(trial.candidate.samples)
    assert tried["maps"] == [1]  # as Auto
    assert tried["moments"] == [1, 2]  # as Auto from two samples on


@pytest.mark.parametrize("scope", ["CAMERA", "WORLD", "LIGHT", "MATERIAL", "OBJECT"])
def test_only_numbers_of_the_scene_are_tuned(scope):
    class Elsewhere(Technique):
        name = "maps"
        params = (
            Param("age", "Age", 8.0, "", 1.0, 16.0, scope=scope),
            Param("tint", "Tint", (1.0, 1.0, 1.0), ""),
            Param("texels", "Texels", 8, "", 1, 16),
        )

    values = {("maps", "texels"): 8, ("maps", "tint"): (1.0, 1.0, 1.0)}
    trials = tune.search({"shadow": ["maps"]}, (Elsewhere,), values, machine, 1.0)
    assert {name for trial in trials for name, _ in trial.candidate.values} == {("maps", "texels")}


def test_when_the_budget_is_spent_what_was_measured_is_the_result():
    left = iter(range(5))

    def render(candidate):
        if next(left, None) is None:
            raise Spent
        return machine(candidate)

    assert len(search(10.0, render)) == 5


def test_curve_holds_what_nothing_beats_and_names_the_proposal():
    trials = [
        Trial(Candidate(n, (("shadow", "maps"),)), Picture(s, e, ())) for n, s, e in ((1, 1, 9), (2, 2, 9.5), (4, 3, 2))
    ]
    assert [trial.candidate.samples for trial in tune.front(trials)] == [1, 4]
    text = tune.table(trials, trials[2])
    assert "→ 3000  2.00e+00  samples=4" in text
    assert text.endswith("Proposed: samples=4 slot.shadow=maps")
