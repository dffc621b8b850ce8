"""The figures of the quick benchmark: made from times, checked by hand."""

import argparse
import json

import numpy as np
import pytest

from bench import quick


def results(candela=(0.5, 1.0, 0.6), eevee=(6.0, 4.8, 9.0)):
    """A scene with invented times."""
    stages = [{"sync": 0.1, "upload": 0.05, "passes": 0.2} for _ in candela]
    found = [quick.Result(entrant, cold=2.0, times=[1.0, 1.0, 1.0], cpu=[2.0]) for entrant in quick.ENTRANTS]
    found[0] = quick.Result(quick.CANDELA, 3.0, list(candela), [1.5], [0.01, 0.03, 0.02], [0.001], stages)
    found[1] = quick.Result(quick.EEVEE, 20.0, list(eevee), [9.0])
    return found


def test_median_and_p95_of_the_runs():
    result = quick.Result(quick.CANDELA, times=[0.5, 1.0, 0.6])
    assert result.median == 0.6
    assert result.p95 == pytest.approx(0.6 + 0.9 * 0.4)  # linear between the second and the third of three


def test_ratio_is_of_medians():
    assert quick.ratio(results()) == pytest.approx(10.0)
    assert quick.ratio(results(), cold=True) == pytest.approx(20 / 3)


def test_shares_sum_to_one_and_the_rest_is_other():
    own = results()[0]
    share = quick.shares(own.stages, own.times)
    assert sum(share.values()) == pytest.approx(1.0)
    assert share["sync"] == pytest.approx(0.3 / 2.1)
    assert share["other"] == pytest.approx(1 - (0.3 + 0.15 + 0.6) / 2.1)
    assert share["readback"] == 0


def test_error_stands_only_where_it_is_comparable():
    assert results()[0].error == pytest.approx(0.02)
    assert results()[1].error is None
    assert [entrant.label for entrant in quick.ENTRANTS if entrant.comparable] == ["Candela", "Cycles, no bounces"]


def test_report_holds_every_engine_and_the_ratio():
    text = quick.report({"garden": results()})
    for entrant in quick.ENTRANTS:
        assert entrant.label in text
    assert "10.0" in text and "2.0e-02" in text


def test_table_aligns_figures_to_the_right():
    lines = quick.table([("name", "s"), ("a", "10.5"), ("long", "–"), ("b", "2.25")]).splitlines()
    assert lines == ["name     s", "a     10.5", "long     –", "b     2.25"]


def test_json_can_be_read_back_and_holds_no_nan():
    found = results()
    found[2].cold = float("nan")
    about = {"size": [256, 192]}
    read = json.loads(quick.as_json({"garden": found}, about), parse_constant=pytest.fail)
    assert read["scenes"]["garden"]["eevee_over_candela"] == pytest.approx(10.0)
    assert read["scenes"]["garden"]["results"][2]["cold_s"] is None
    assert np.isclose(sum(read["scenes"]["garden"]["candela_shares"].values()), 1)


def test_picture_is_drawn(tmp_path):
    path = tmp_path / "made" / "quick.png"
    quick.draw({"garden": results(), "room": results()}, {"size": [256, 192], "device": "none"}, path)
    assert path.stat().st_size > 1000


@pytest.mark.parametrize("text", ["256", "0x10", "ax10", "-5x5", "10x"])
def test_size_that_is_none_is_refused(text):
    with pytest.raises(argparse.ArgumentTypeError):
        quick.size_of(text)
