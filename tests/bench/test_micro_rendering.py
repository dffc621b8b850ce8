"""Tables of micro-rendering beside its peers, from figures that are made up."""

from bench import micro_rendering


def kept(path, technique, samples, processor, error):
    figures = (str(2 * processor), str(processor), str(error), "1.000", str(error**0.5))
    micro_rendering.keep(path, (60, 40), ("cornell_box", technique, samples), figures)


def test_figures_are_kept_one_by_one_and_tables_are_of_one_size(tmp_path):
    path = tmp_path / "points.json"
    kept(path, "ssdo", 16, 2.0, 0.01)
    kept(path, "micro_rendering", 1, 1.0, 0.04)
    kept(path, "ssdo", 1, 0.5, 0.16)
    kept(path, "ssdo", 1, 0.5, 0.04)  # once more: the later one stays
    rows, made = micro_rendering.kept_rows(path, (60, 40))
    assert [row[1:3] for row in rows] == [("micro_rendering", "1"), ("ssdo", "1"), ("ssdo", "16")]
    assert [one.split(":")[0] for one in made] == ["micro_rendering", "ssdo"]
    assert micro_rendering.kept_rows(path, (96, 64))[0] == []
    # Halfway between .5 and 2 seconds in logarithms lies 1.
    assert micro_rendering.equal_time(rows)[0][3:] == ("0.04", "", "", "", "", "0.0200")
    assert micro_rendering.at_time([(3.0, 0.5)], 1.0) == "0.5000 in 3.00 s"


def test_the_floor_is_what_does_not_fall_with_samples(tmp_path):
    path = tmp_path / "points.json"
    for samples in (1, 16, 64):
        kept(path, "ssdo", samples, samples, 0.002 + 0.1 / samples)
    rows, _ = micro_rendering.kept_rows(path, (60, 40))
    assert micro_rendering.floors(rows)[0][-1] == "0.0020"
