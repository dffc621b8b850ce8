"""What a run of the profile keeps of the one before it."""

import json

from bench.profile import joined, kept

ABOUT = {"device": "d", "cpu": "c", "samples": 16, "size": [64, 48]}


def test_a_run_of_some_scenes_leaves_the_others(tmp_path):
    results = tmp_path / "profile.json"
    results.write_text(json.dumps({"about": ABOUT, "rows": [{"scene": "b", "warm": 1}, {"scene": "c", "warm": 1}]}))
    rows = joined(kept(results, ABOUT), [{"scene": "b", "warm": 2}, {"scene": "a", "warm": 2}])
    assert [(row["scene"], row["warm"]) for row in rows] == [("a", 2), ("b", 2), ("c", 1)]


def test_rows_of_another_size_or_machine_are_dropped(tmp_path):
    results = tmp_path / "profile.json"
    assert kept(results, ABOUT) == []
    results.write_text(json.dumps({"about": ABOUT, "rows": [{"scene": "b"}]}))
    assert kept(results, ABOUT | {"size": [32, 24]}) == kept(results, ABOUT | {"cpu": "another"}) == []
