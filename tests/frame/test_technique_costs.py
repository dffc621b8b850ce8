"""Auto: the technique with the least error x time among those that the scene can use, by measured figures."""

import json

import pytest

from addon.frame import technique_costs as costs
from addon.frame.technique_costs import Cost
from addon.techniques import REGISTRY

TABLE = {
    "shadow": {
        "maps": {1: Cost(1, 1), 16: Cost(1, 1), 64: Cost(1, 1)},
        "moments": {1: Cost(0.5, 1.2), 16: Cost(0.8, 1.15), 64: Cost(1.5, 2.0)},
    }
}


@pytest.mark.parametrize(
    ("samples", "best"), [(1, "moments"), (2, "moments"), (16, "maps"), (64, "maps"), (999, "maps")]
)
def test_the_least_product_wins_at_the_nearest_number_of_samples(samples, best):
    """At 16 samples the gain of 8 % is less than figures scatter, and the first technique stays."""
    assert costs.preferred(TABLE, "shadow", ["maps", "moments"], samples) == best


def test_techniques_without_figures_stay_behind():
    assert costs.preferred(TABLE, "shadow", ["maps", "new"], 1) == "maps"
    assert costs.preferred({}, "shadow", ["one", "two"], 1) == "one"
    assert costs.preferred(TABLE, "shadow", ["moments"], 64) == "moments"


def test_figures_are_those_of_the_nearest_count_on_a_logarithmic_scale():
    assert costs.predicted(TABLE, "shadow", "moments", 3).error == 0.5
    assert costs.predicted(TABLE, "shadow", "moments", 5).error == 0.8


def test_the_committed_table_knows_only_what_the_registry_has():
    techniques = {(slot, technique.name) for technique in REGISTRY for slot in technique.fills}
    for slot, rows in costs.known().items():
        for name, by_samples in rows.items():
            assert (slot, name) in techniques
            assert all(cost.error > 0 and cost.seconds > 0 for cost in by_samples.values())


def test_what_the_benchmark_writes_is_what_auto_reads(tmp_path):
    from bench import costs as written
    from bench.figures import Results

    def cell(scene, name, error, seconds, other="one"):
        return {"scene": scene, "series": {"engine": "CANDELA", "bounces": None}, "samples": 4, "times": [seconds],
                "errors": {"combined": {"relmse": error}}, "techniques": [{"name": name}, {"name": other}]}  # fmt: skip

    about = dict.fromkeys(("date", "size", "blender", "device", "cpu"), "")
    cells = [
        cell("a", "maps", 0.1, 1.0), cell("a", "moments", 0.2, 2.0),
        cell("b", "maps", 0.1, 1.0), cell("b", "moments", 0.2, 8.0),
        cell("b", "moments", 9.0, 9.0, "other"), cell("c", "moments", 0.1, 1.0),
    ]  # fmt: skip
    results = Results(about, {}, cells, [])
    table = written.costs(results, {"shadow": ["maps", "moments"], "indirect": ["one", "other"]})
    path = tmp_path / "technique_costs.json"
    path.write_text(written.text(results, table), encoding="utf-8")
    read = costs.read(path)
    assert read["shadow"]["maps"][4] == Cost(1, 1)
    assert read["shadow"]["moments"][4] == Cost(2.0, 4.0)
    assert list(json.loads(path.read_text())["slots"]) == ["shadow"]
