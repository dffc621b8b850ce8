"""Figures of the benchmark, from invented curves whose answers are known."""

import json
from dataclasses import replace

import pytest

from bench import again, ages, figures, markdown, page, plots
from bench.figures import Point, Results, against, bias_floor, error_after, seconds_for, staircase, without_noise


def curve(error, seconds=lambda n: 0.1 * n, samples=(1, 2, 4, 8, 16, 32, 64)):
    return [Point(n, seconds(n), error(n)) for n in samples]


OWN = curve(lambda n: 0.1 / n)
SLOWER = curve(lambda n: 0.1 / n, lambda n: 1.0 * n)


def test_staircase_holds_what_nothing_beats():
    points = [Point(1, 1.0, 0.5), Point(2, 2.0, 0.6), Point(4, 3.0, 0.1), Point(8, 2.5, 0.1)]
    assert staircase(points) == [points[0], points[3]]


def test_between_points_time_and_error_follow_the_power_law():
    assert seconds_for(OWN, 0.1 / 3) == pytest.approx(0.3)
    assert error_after(OWN, 0.3) == pytest.approx(0.1 / 3)
    assert seconds_for(OWN, 1e-6) is None
    assert error_after(OWN, 0.01) is None
    assert seconds_for(OWN, 5.0) == OWN[0].seconds


def test_ten_times_slower_is_a_speed_up_of_ten_at_every_error():
    found = against(OWN, SLOWER, "peer")
    assert found.speed_up == pytest.approx(10)
    assert found.seconds == pytest.approx(1.6)
    assert found.gain == pytest.approx(10)
    assert against(SLOWER, OWN, "own").speed_up == pytest.approx(0.1)


def test_a_speed_up_is_a_bound_where_the_fastest_point_of_one_beats_the_best_of_the_other():
    far_above = curve(lambda n: 10.0 / n)
    assert against(OWN, SLOWER, "").bound == ""
    found = against(OWN, far_above, "")
    assert (found.bound, found.error) == (">", pytest.approx(10 / 64))
    assert against(far_above, OWN, "").bound == "<"
    assert page.vague(0.1, ">") and page.vague(3.0, "<")
    assert not page.vague(3.0, ">") and not page.vague(0.1, "<") and not page.vague(0.1, "")


def test_errors_are_compared_at_a_time_that_both_were_measured_at():
    short = curve(lambda n: 0.1 / n, lambda n: 0.01 * n, samples=(1, 4, 16))
    found = against(OWN, short, "")
    assert found.seconds == pytest.approx(0.16)  # not 1.6 s, of which nobody knows what the peer would make of it
    assert found.gain == pytest.approx((0.1 / 16) / (0.1 / 1.6))


def test_curves_that_cannot_be_compared_give_no_figure():
    assert against(OWN, [], "none").speed_up is None


def test_a_bias_is_found_and_a_falling_curve_has_none():
    assert bias_floor(curve(lambda n: 0.02 + 0.1 / n), 1e-4) == pytest.approx(0.02)
    assert bias_floor(curve(lambda n: 0.1 / n), 1e-4) is None
    assert bias_floor(curve(lambda n: max(0.1 / n, 0.01)), 0.01) is None  # that floor is the reference's noise


def results():
    """One scene, two series."""
    share = {"combined": 1.0, "diffuse_direct": 0.8, "diffuse_indirect": 0.2}
    floors = {name: {"relmse": 1e-4, "bias": 1e-4} for name in share}
    cells = []
    for label, points in (("Candela", OWN), ("EEVEE, ray traced", SLOWER), ("Cycles, denoised", SLOWER)):
        for point in points:
            error = {"relmse": point.error, "bias": 1.01}
            cells.append({
                "scene": "room", "series": {"label": label}, "samples": point.samples, "times": [point.seconds],
                "errors": {"combined": error, "diffuse_direct": error, "diffuse_indirect": error},
                "techniques": [{"label": "Film", "ms": 2.0, "counters": {"passes": 3}}],
            })  # fmt: skip
    about = {"date": "today", "size": [64, 48], "blender": "5", "device": "none", "cpu": "one", "reference_samples": 8}
    return Results(about, {"room": {"share": share, "floors": floors}}, cells, ["room, Cycles, 256"])


def test_error_below_the_noise_is_quoted_as_the_noise():
    found = results()
    found.references["room"]["floors"]["combined"]["relmse"] = 0.05
    assert min(point.error for point in found.curve("room", "Candela")) == 0.05


def test_noise_of_the_reference_that_both_errors_hold_is_taken_off():
    noise = 0.05
    noisy = [[Point(p.samples, p.seconds, p.error + noise) for p in points] for points in (OWN, SLOWER)]
    found = against(*(without_noise(points, noise) for points in noisy), "")
    assert against(*noisy, "").gain < 2.5  # of 10, which is what the errors without the noise say
    assert found.gain == pytest.approx(10)
    assert without_noise([Point(1, 1.0, noise)], noise)[0].error == pytest.approx(figures.RESOLVED * noise)


def test_peers_are_held_against_the_defaults_and_the_fast_preset_together():
    data = results()
    assert "10 ×" in markdown.table(page.summary(data)).splitlines()[2]
    for point in OWN:
        cell = data.cell("room", "Candela", point.samples)
        data.cells.append({**cell, "series": {"label": "Candela, Fast preset"}, "times": [point.seconds / 2]})
    column = page.summary(data)[0].index("EEVEE, ray traced: speed-up")
    assert page.summary(data)[1][column] == "20 ×"


def test_path_at_fault_weighs_error_by_the_square_of_its_light():
    assert figures.at_fault(results(), "room")[0] == ("diffuse_direct", pytest.approx(0.64 / 0.68))


def test_page_and_table_say_what_was_found(tmp_path):
    data = results()
    text = page.make_page(data, [], [], [], tmp_path).read_text(encoding="utf-8")
    assert "room" in text and "10 ×" in text and "room, Cycles, 256" in text
    table = markdown.table(page.summary(data)).splitlines()
    assert len(table) == 4 and "| 10 × | 10 × |" in table[2]
    assert "1 of 1 scenes" in page.claims(data)[0]


def test_generated_part_replaces_only_what_stands_between_the_marks(tmp_path):
    path, begin = tmp_path / "page.md", markdown.begin("command")
    path.write_text(f"before\n{begin}\nold\n{markdown.END}\nafter\n")
    markdown.put_between(path, "command", "new")
    made = ages.now()
    assert path.read_text() == f"before\n{begin}\n\n{made}\n\nnew\n\n{markdown.END}\nafter\n"
    markdown.put_between(path, "command", "plain", stamped=False)
    assert path.read_text() == f"before\n{begin}\n\nplain\n\n{markdown.END}\nafter\n"
    path.write_text("nothing")
    with pytest.raises(ValueError, match=r"page\.md lacks the marks"):
        markdown.put_between(path, "command", "new")


def test_readme_shows_the_means_of_every_peer():
    """With their number of scenes, denoised against denoised first; of fewer than five scenes none is shown."""
    part = page.readme_part(results())
    assert "| EEVEE, ray traced, over Candela | – (1 scene) | – (1 scene) |" in part
    assert "| EEVEE, over Candela" not in part
    data = results()
    many = replace(
        data, cells=[{**cell, "scene": f"room {k}"} for k in range(5) for cell in data.cells],
        references={f"room {k}": data.references["room"] for k in range(5)},
    )  # fmt: skip
    rows = [line for line in page.readme_part(many).splitlines() if "over Candela" in line]
    assert rows[0].startswith("| Cycles, denoised, over Candela | 10 × (5 scenes) | 10 × (5 scenes) |")
    assert page.mean_of([2.0] * 6, 2) == "2.0 × (6 scenes, 2 of them bounds)"


def test_a_repetition_of_another_run_is_left_out(tmp_path, capsys):
    (tmp_path / "again.json").write_text('{"run": "a", "rows": [{"scene": "room"}]}')
    assert page.repeated_rows(tmp_path / "bench.json", {"run": "a"}) == [{"scene": "room"}]
    assert page.repeated_rows(tmp_path / "bench.json", {"run": "b"}) == []
    assert "repeats another run" in capsys.readouterr().out
    (tmp_path / "again.json").write_text('{"rows": [{"scene": "room"}]}')
    assert page.repeated_rows(tmp_path / "bench.json", {}) == []


@pytest.mark.parametrize("path", [page.README, page.PERFORMANCE], ids=lambda path: path.name)
def test_pages_have_the_marks(path):
    text = path.read_text(encoding="utf-8")
    assert text.count(markdown.begin(page.COMMAND)) == 1
    assert text.count(markdown.END) == text.count("<!-- written by")


def test_what_denoising_brings_is_told_where_both_were_measured():
    data = results()
    assert page.denoising(data) == []
    for cell in [cell for cell in data.cells if cell["series"]["label"] == "Candela"]:
        errors = {"combined": {"relmse": 3 * cell["errors"]["combined"]["relmse"], "bias": 1.0}}
        raw = {"series": {"label": "Candela, raw"}, "times": [0.8 * cell["times"][0]], "errors": errors}
        data.cells.append({**cell, **raw})
    assert "divides the error of 16 samples by 3.00 and multiplies their time by 1.25" in page.denoising(data)[0]


def test_a_second_run_is_told_by_its_ratios():
    rows = again.rows_of("room", {"Candela": 1.0, "Cycles": 2.0}, {"Candela": 3.0, "Cycles": 6.6})
    assert again.difference(rows[0]) == pytest.approx(0.1)
    assert "1 of 1 ratios" in again.sentence(rows) and "Cycles on room" in again.sentence(rows)
    assert again.sentence(rows) in page.generated_part(results(), [], [], rows)


def test_growth_is_drawn(tmp_path):
    rows = [{"dial": "lights", "value": n, "seconds": 0.1 * n, "techniques": {"Film": 10.0 * n}} for n in (1, 4, 16)]
    plots.growth(rows, tmp_path / "growth.png")
    assert (tmp_path / "growth.png").stat().st_size > 1000


def test_results_are_read_as_they_are_written(tmp_path):
    from bench.run import write_results

    data = results()
    path = tmp_path / "bench.json"
    write_results(path, data.about, data.references, data.cells, data.left_out)
    assert figures.load(path) == data
    assert json.loads(path.read_text(encoding="utf-8"), parse_constant=pytest.fail)
