"""What a device costs is measured once, kept by driver, and decides between methods; its name decides nothing."""

import json
from dataclasses import asdict, replace

import numpy as np
import pytest

from addon.film import point_costs
from addon.frame import device_probe
from addon.gfx import context, device, images, passes
from addon.lighting import visibility
from addon.snapshot import SnapshotCache, take
from addon.ui import preferences
from addon.ui.properties import settings_of
from tests.techniques.conftest import Stage

SOFTWARE = device.MADE_UP["software"]
# Two cards that differ in one thing: on the first, rays cost next to nothing, on the second they are all it is bad at.
TRACER, RASTERISER = replace(SOFTWARE, ray_level=1e-3), replace(SOFTWARE, ray_level=1e4)


@pytest.fixture
def unknown(gpu_context, monkeypatch, tmp_path):
    """No figures yet, and a folder of its own for them."""
    monkeypatch.delenv(device.VARIABLE)
    monkeypatch.setenv("CANDELA_CACHE", str(tmp_path))
    before = device.current() if device.known() else None
    device.use(None)
    yield tmp_path
    device.use(before)


@pytest.fixture
def room(registered):
    stage = Stage()
    stage.clear()
    stage.floor(2.0)
    stage.blocker((-0.5, -0.5), (0.5, 0.5), 0.5)
    stage.lamp = stage.light("POINT", (0.4, 0.2, 2.0), energy=100.0)
    stage.camera_above(4.0)
    yield stage
    device.use(None)
    stage.clear()


def test_a_choice_differs_between_two_devices_and_the_ledger_says_why(room):
    said = {}
    for name, figures in (("tracer", TRACER), ("rasteriser", RASTERISER)):
        device.use(figures)
        room.render(2, seed=len(said))
        row = next(row for row in room.ledger.rows if row.choices)
        said[name] = row.choices[0]
        assert ("maps" in room.ledger.row("accumulated_maps").counters) == (name == "rasteriser")
    assert "rays, because" in said["tracer"] and "maps, because" in said["rasteriser"]
    assert all(sentence.endswith(" here") and " ms against " in sentence for sentence in said.values())
    assert said["tracer"] in room.ledger.text() or said["rasteriser"] in room.ledger.text()


@pytest.mark.parametrize(
    ("samples", "bounces", "gather"),
    [(2, 0, "denoise: level"), pytest.param(1, 1, "mean of neighbours", marks=pytest.mark.slow)],
)
def test_pixels_are_drawn_or_computed_alike_as_the_device_says(room, monkeypatch, samples, bounces, gather):
    """By fragments and by compute programs of the same body, in rows, too."""
    dispatched, found, own = [], {}, passes.compute

    def compute(program, *given, **named):
        dispatched.append(program.name)
        own(program, *given, **named)

    monkeypatch.setattr(passes, "compute", compute)
    for name, figure in (("drawn", SOFTWARE.fragment), ("computed", 0.1 * SOFTWARE.fragment)):
        device.use(replace(SOFTWARE, compute=figure))
        dispatched.clear()
        room.renderer.forget()
        found[name] = room.render(samples, (37, 23), bounces=bounces)
        for asked in ("film filter", gather):
            assert any(asked in program for program in dispatched) == (name == "computed")
    for name, image in found["drawn"].items():
        np.testing.assert_allclose(found["computed"][name], image, rtol=1e-5, atol=1e-6, err_msg=name)


@pytest.mark.parametrize("share", [1.0, 0.1])
def test_computed_pixels_are_those_of_some_rows(gpu_context, monkeypatch, share):
    dispatched, own = [], passes.compute
    monkeypatch.setattr(passes, "compute", lambda *given, **named: (dispatched.append(1), own(*given, **named)))
    device.use(replace(SOFTWARE, compute=share * SOFTWARE.fragment))
    try:
        with images.borrowed(9, 7, "RGBA32F") as target:
            target.clear()
            passes.each_pixel(device_probe.STEP, target, rows=(2, 5))
            drawn = images.read(target.colors[0])[..., 3]
    finally:
        device.use(None)
    assert bool(dispatched) == (share < 0.5)
    np.testing.assert_array_equal(drawn.sum(axis=1), [0, 0, 9, 9, 9, 0, 0])


def test_the_plan_foresees_the_same_choice(room):
    import bpy

    graph = bpy.context.evaluated_depsgraph_get()
    graph.update()
    snapshot = take(graph, SnapshotCache(), 64, 64)
    settings = settings_of(room.scene, viewport=False)
    for figures, method in ((TRACER, "rays"), (RASTERISER, "maps")):
        device.use(figures)
        (sentence,) = visibility.foreseen(snapshot, settings)
        assert f": {method}, because" in sentence


@pytest.mark.slow
def test_film_points_differ_between_two_devices_and_ledger_and_plan_say_why(room):
    """On one card triangles cost nothing, on the other all that there is."""
    import bpy

    room.scene.candela.film_points, room.scene.render.filter_size = 8, 1.5
    said = {}
    for drawer, count in ((replace(SOFTWARE, triangle=1e-3), 8), (replace(SOFTWARE, triangle=1e9), 4)):
        device.use(drawer)
        room.render(1, seed=count, bounces=1)
        assert room.ledger.row("film").counters["points"] == count
        snapshot = take(bpy.context.evaluated_depsgraph_get(), SnapshotCache(), 32, 32)
        (foreseen,) = point_costs.foreseen(snapshot, 8, 1, indirect=True)
        said[count] = foreseen.removeprefix("Film points: ")
        assert f"points: {said[count]}" in room.ledger.row("film").choices
    assert said[8].startswith("8 a sample; one takes ") and said[8].endswith(" of light here")
    assert said[4].startswith("4 a sample of 8, because one takes ")


def test_figures_are_measured_once_and_kept_for_this_driver(unknown):
    first = device_probe.ensure()
    assert device.known()
    (kept,) = json.loads((unknown / device.FILE).read_text(encoding="utf-8")).items()
    assert kept == (device.key(), asdict(first))
    device.use(None)
    device.measured_s = -1.0
    assert device_probe.ensure() == first
    assert device.measured_s == -1.0, "what is kept is not measured again"


@pytest.mark.parametrize("content", ["", "[]", "{", '{"KEY": {"texel": 1}}', '{"KEY": null}', '{"another": {}}'])
def test_figures_that_cannot_be_read_are_measured(unknown, content):
    (unknown / device.FILE).write_text(content.replace("KEY", device.key()), encoding="utf-8")
    assert device.read(unknown) is None


def test_a_made_up_device_is_taken_as_it_is(unknown, monkeypatch, tmp_path):
    monkeypatch.setenv(device.VARIABLE, "card")
    assert device_probe.ensure() == device.MADE_UP["card"]
    assert not (unknown / device.FILE).exists()
    device.use(None)
    path = tmp_path / "own.json"
    path.write_text(json.dumps(asdict(TRACER)), encoding="utf-8")
    monkeypatch.setenv(device.VARIABLE, str(path))
    assert device_probe.ensure() == TRACER
    device.use(None)
    monkeypatch.setenv(device.VARIABLE, "toaster")
    with pytest.raises(ValueError, match=r"toaster.*neither one of software, card"):
        device_probe.ensure()
    monkeypatch.delenv(device.VARIABLE)


def test_the_preferences_tell_the_figures(unknown):
    assert preferences.device_lines() == ["What this device does is measured when it first draws."]
    device.use(SOFTWARE)
    lines = preferences.device_lines()
    assert context.describe() in lines[0] and "triangle 130 ns" in lines[1]


@pytest.mark.timing
def test_measuring_takes_a_fifth_of_a_second_once_its_programs_are_compiled(unknown):
    device_probe.measure()
    seconds = []  # of the clock: what else the machine does can only add
    for _ in range(5):
        device_probe.measure()
        seconds.append(device.measured_s)
    assert min(seconds) < 0.2, seconds
