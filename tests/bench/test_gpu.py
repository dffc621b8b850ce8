"""The command that measures a device: what it counts, what its page says, and that it runs on any driver."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from bench import gpu, gpu_speed
from bench.counted import of_stats

ROOT = Path(__file__).resolve().parents[2]


def test_waits_are_no_readbacks_and_only_the_addon_counts_as_its_own_time():
    stats = {
        ("~", 0, "<method 'read' of 'GPUTexture' objects>"): (5, 5, 1.0, 1.0, {}),
        ("/somewhere/addon/gfx/images.py", 3, "finish"): (2, 2, 0.25, 1.0, {}),
        ("/somewhere/addon/frame/run.py", 3, "begin"): (1, 1, 0.5, 2.0, {}),
        ("/usr/lib/numpy/core.py", 3, "sum"): (9, 9, 4.0, 4.0, {}),
        ("~", 0, "<method 'draw_range' of 'GPUBatch' objects>"): (7, 7, 0.1, 0.1, {}),
        ("~", 0, "<built-in method gpu.compute.dispatch>"): (4, 4, 0.1, 0.1, {}),
    }
    found = of_stats(stats, 6)
    assert (found.readbacks, found.waits, found.draws, found.dispatches) == (3, 2, 7, 4)
    assert (found.framebuffers, found.own_ms) == (6, 750.0)


def test_a_run_that_was_cut_off_still_makes_a_page():
    stages = {"total": 9.0, "sync": 1.0, "begin": 2.0, "asking": 3.0, "waiting": 3.0, "compile": 1.0}
    about = {"device": "a card", "cpu": "c", "blender": "5", "python": "3", "size": [8, 4], "load": 1.0}
    row = {"scene": "cornell_box", "triangles": 30, "first": stages, "moved": stages, "rest": stages}
    text = gpu.page({"about": about, "scenes": [row], "by_hand": [], "left_out": ["scene instances"]})
    assert "| cornell box | 30 | 9.00 | 1.00 | 9.00 | 6.00 | 9.00 | – | – | – | – |" in text
    assert "Not measured: scene instances." in text


@pytest.mark.slow
def test_the_small_run_measures_everything_on_this_driver(tmp_path):
    results, page = tmp_path / "gpu.json", tmp_path / "gpu.md"
    command = [sys.executable, "-m", "bench", "gpu", "--small", "--results", str(results), "--page", str(page)]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True, timeout=600)
    found = json.loads(results.read_text(encoding="utf-8"))
    assert found["left_out"] == []
    assert [row["scene"] for row in found["scenes"]] == list(gpu.SMALL)
    for row in found["scenes"]:
        assert row["rest"]["total"] < row["moved"]["total"] < row["first"]["total"]
        assert row["counts"]["draws"] > 0 and row["counts"]["own_ms"] > 0
        assert row["techniques"]["surfaces"] > 0
        assert row["final_many"] > 0 and row["compiled"] and "eevee_many" not in row
    assert {row["steps"] for row in found["speeds"]} == set(gpu_speed.STEPS)
    assert all(row["fragment"] > 0 and row["compute"] > 0 for row in found["speeds"])
    assert found["about"]["device"] in page.read_text(encoding="utf-8")
