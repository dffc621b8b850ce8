"""A whole comparison, from the scene to rows and figures."""

from types import SimpleNamespace

import numpy as np
import pytest

from addon.compare.cache import Reference, two_seeds
from addon.compare.comparison import compare_passes, compare_scene, ledger_rows, missing_paths
from addon.compare.passes import ROWS, Passes


def passes_of(images):
    return Passes(images, "CANDELA", 1, 1, 0.1)


@pytest.fixture
def images():
    generator = np.random.default_rng(5)
    names = ("diffuse_direct", "diffuse_color", "glossy_direct", "glossy_color", "emission", "environment", "normal")
    made = {name: generator.random((6, 8, 3), np.float32) + np.float32(0.1) for name in names}
    made["combined"] = np.concatenate([made["emission"], np.ones((6, 8, 1), np.float32)], axis=-1)
    made["depth"] = np.full((6, 8, 1), 4, np.float32)
    return made


def test_equal_pictures_have_no_error_in_any_row(images):
    half = {name: np.zeros_like(image) for name, image in images.items()}
    rows = compare_passes(passes_of(images), Reference(images, half, 1, 0.0), with_flip=False)
    assert [picture.row.label for picture in rows] == [row.label for row in ROWS if row.always]
    for picture in rows:
        error = picture.error
        assert error.relmse == 0 or error.median == 0, error


def test_a_light_path_is_light_times_colour(images):
    """Halved light over doubled colour is another pass, but the same light path."""
    half = {name: np.zeros_like(image) for name, image in images.items()}
    changed = dict(images)
    changed["diffuse_direct"] = images["diffuse_direct"] / 2
    changed["diffuse_color"] = images["diffuse_color"] * 2
    errors = {p.row.label: p.error for p in compare_passes(passes_of(changed), Reference(images, half, 1, 0.0), False)}
    assert errors["Diffuse direct"].relmse == 0
    assert errors["Diffuse direct pass"].bias == pytest.approx(0.5)
    assert errors["Diffuse color"].bias == pytest.approx(2)


def test_the_noise_floor_of_a_path_is_that_of_the_two_seeds_products(images):
    other = {name: image * np.float32(1.1) for name, image in images.items()}
    mean, half = two_seeds(images, other)
    reference = Reference(mean, half, 1, 0.0)
    paths, half_paths = reference.paths()
    products = [i["diffuse_direct"] * i["diffuse_color"] for i in (images, other)]
    np.testing.assert_allclose(paths["diffuse_direct"], (products[0] + products[1]) / 2, rtol=1e-5)
    np.testing.assert_allclose(half_paths["diffuse_direct"], (products[0] - products[1]) / 2, rtol=1e-4)


def test_a_scene_against_itself_is_within_the_noise(room, tmp_path, monkeypatch):
    monkeypatch.setenv("CANDELA_CACHE", str(tmp_path))
    ledger = SimpleNamespace(
        rows=[SimpleNamespace(name="x", label="Technique", state="skipped", reason="no light", milliseconds=0.0)],
        times={"sync": 0.01},
        notes=("A note.",),
    )
    data = compare_scene(room, 256, 256, engine="CYCLES", ledger=ledger, with_flip=False, seed=7)
    assert data.size == (16, 12) and data.scene == room.name
    for label in ("Combined", "Direct light", "Diffuse direct", "Environment"):
        error = data.error(label)
        assert error.relmse < 6 * error.floor, label  # its own noise is twice that of the mean, and a sample of it
        assert error.bias == pytest.approx(1, abs=0.05)
    assert (data.ledger[0].name, data.ledger[0].reason) == ("Technique", "no light")
    assert data.times == {"sync": 0.01} and data.notes == ("A note.",)
    assert data.versions["Blender"] and data.device
    with pytest.raises(KeyError, match="no row 'Fog'"):
        data.error("Fog")


def test_no_ledger_is_an_empty_one():
    assert ledger_rows(None) == ()


def test_a_reference_that_is_not_finite_is_reported_and_not_averaged(images):
    images["emission"][0, 0] = np.inf
    images["diffuse_direct"][0, 0], images["diffuse_color"][0, 0] = np.inf, 0
    mean, half = two_seeds(images, images)
    errors = {p.row.label: p.error for p in compare_passes(passes_of(images), Reference(mean, half, 1, 0.0), False)}
    assert errors["Emission"].not_finite == errors["Diffuse direct"].not_finite == 1
    assert errors["Environment"].relmse == 0


def test_a_path_that_the_engine_lacks_is_named(images):
    other = {**images, "diffuse_indirect": images["diffuse_direct"], "glossy_indirect": images["glossy_direct"] * 0}
    reference = Reference(*two_seeds(other, other), 1, 0.0)
    assert missing_paths(passes_of(images), reference) == (
        "The reference has light in paths that Candela does not render: diffuse indirect.",
    )
    assert missing_paths(passes_of(other), reference) == ()


def test_what_a_technique_counted_stands_where_no_reason_is():
    row = SimpleNamespace(
        name="x", label="X", state="ran", reason="", milliseconds=1.0, counters={"views": 12, "passes": 4}
    )
    assert ledger_rows(SimpleNamespace(rows=[row]))[0].reason == "12 views, 4 passes"
