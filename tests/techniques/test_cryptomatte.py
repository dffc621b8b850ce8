"""Cryptomatte beside Cycles': coverage by name, manifest and metadata, as OpenEXR's own library reads them."""

import json

import bpy
import numpy as np
import pytest

from addon.frame.ledger import SKIPPED

ONE_STEP = 1.0 / 255.0
KINDS = ("Object", "Material", "Asset")


def ask(stage, levels=6):
    for kind in KINDS:
        setattr(stage.layer, f"use_pass_cryptomatte_{kind.lower()}", True)
    stage.layer.pass_cryptomatte_depth = levels


def crowd(stage, opacity=1.0):
    """Turned boxes of several materials and parents before a floor, and a veil over some of them."""
    stage.scene.render.filter_size = 1.5
    stage.camera((0, -3.0, 4), (0.6, 0, 0), angle=0.9)
    materials = [stage.diffuse(0.2 + 0.2 * k) for k in range(3)]
    for k, material in enumerate(materials):
        material.name = f"Mat é {k}"
    glassy = stage.principled(Base_Color=(1, 1, 1, 1), Specular_IOR_Level=0.0, Alpha=opacity)
    glassy.name = "Veil"
    stage.rectangle((-3, -3), (3, 3)).name = "Floor"
    top, middle = (bpy.data.objects.new(name, None) for name in ("Top", "Middle"))
    for empty in (top, middle):
        stage.scene.collection.objects.link(empty)
    middle.parent = top
    for k in range(6):
        box = stage.rectangle((-0.35, -0.35), (0.35, 0.35), location=(k % 3 - 1, k // 3 - 0.6, 0.3 + 0.1 * k),
                              turn=(0.3 * k, 0.2, 0.5 * k), material=materials[k % 3])  # fmt: skip
        box.name = f"Box {k}"
        box.parent = middle if k < 3 else None
    veil = stage.rectangle((-1, -1), (0.2, 0.5), 1.0, material=glassy)
    veil.name = "Veil of glass"
    return [*(f"Box {k}" for k in range(6)), "Floor", "Veil of glass"]


def assert_like_cycles(stage, objects, samples, most, in_the_mean):
    """Coverage by name: at most so far from Cycles' in a pixel, and in the mean over the picture's pixels."""
    ask(stage)
    stage.scene.render.film_transparent = True
    own, cycles = stage.both(samples, 4096, bounces=8)
    names = {
        "Object": objects,
        "Material": ["Mat é 0", "Mat é 1", "Mat é 2", "Veil", "default_surface"],
        "Asset": ["Top", "Box 3", "Box 4", "Box 5", "Floor", "Veil of glass"],
    }
    worst, mean = 0.0, 0.0
    assert {key for key in own if key.startswith("Crypto")} == {key for key in cycles if key.startswith("Crypto")}
    for kind in KINDS:
        total = np.zeros((40, 48))
        for name in names[kind]:
            ours, theirs = stage.coverage(own, kind, name), stage.coverage(cycles, kind, name)
            assert ours.max() > 0.05, name
            worst = max(worst, np.abs(ours - theirs).max())
            mean = max(mean, np.sqrt(((ours - theirs) ** 2).mean()))
            assert abs(ours.mean() - theirs.mean()) < 0.1 * ONE_STEP, (kind, name)
            total += ours
        np.testing.assert_allclose(total, own["Combined"][..., 3], atol=2e-3)
    print(f"coverage differs by {worst:.4f} at most in a pixel, {mean:.5f} in the mean")
    assert worst < most and mean < in_the_mean
    for passes in (own, cycles):
        ranks = np.concatenate([passes[f"CryptoObject{k:02d}"] for k in range(3)], axis=-1)[..., 1::2]
        assert (np.diff(ranks, axis=-1) <= 1e-6).all()  # the heaviest first


@pytest.mark.slow
def test_coverage_is_that_of_cycles(written):
    assert_like_cycles(written, crowd(written), 1024, 2 * ONE_STEP, 0.25 * ONE_STEP)


@pytest.mark.slow
def test_layers_cover_by_their_opacity(written):
    """Both engines choose layers at random: of Cycles' 4096 samples a pixel may be off by 0.02 for that alone."""
    assert_like_cycles(written, crowd(written, opacity=0.4), 512, 8 * ONE_STEP, 1.5 * ONE_STEP)


@pytest.mark.slow
def test_metadata_is_the_standards(written):
    stage = written
    objects = crowd(stage)
    ask(stage)
    own, cycles = stage.both(1)
    fields = {name: value for name, value in own["header"].items() if name.startswith("cryptomatte/")}
    theirs = {name: value for name, value in cycles["header"].items() if name.startswith("cryptomatte/")}
    assert fields.keys() == theirs.keys() and len(fields) == 12
    for name, value in fields.items():
        if name.endswith("/manifest"):
            ours, of_cycles = json.loads(value), json.loads(theirs[name])
            shared = ours.keys() & of_cycles.keys()
            assert len(shared) >= 5 and all(ours[one] == of_cycles[one] for one in shared)
        else:
            assert value == theirs[name]
    manifest = next(
        json.loads(fields[name.replace("/name", "/manifest")])
        for name, value in fields.items()
        if name.endswith("/name") and value.endswith("CryptoObject")
    )
    assert set(objects) <= set(manifest)


@pytest.mark.parametrize("levels", [1, 2, 5, 16])
def test_levels_are_those_asked_for(written, levels):
    stage = written
    crowd(stage)
    ask(stage, levels)
    own = stage.written("CANDELA", 2)
    assert sum(name.startswith("CryptoObject") for name in own) == (levels + 1) // 2


def test_names_beyond_the_levels_are_left_out(written):
    """Coverage of a name is never more than it covers: Cycles gives the last level what has no room."""
    stage = written
    objects = crowd(stage)
    ask(stage, 16)
    whole = stage.written("CANDELA", 16)
    ask(stage, 2)
    few = stage.written("CANDELA", 16)
    for name in objects:
        ours, all_of_it = stage.coverage(few, "Object", name), stage.coverage(whole, "Object", name)
        assert (ours <= all_of_it + 1e-5).all()


@pytest.mark.slow
def test_nothing_runs_where_none_is_asked_for_and_the_picture_is_the_same(written):
    stage = written
    crowd(stage)
    stage.light("POINT", (0.5, 0, 3))
    before = stage.written("CANDELA", 4)
    row = stage.ledger.row("cryptomatte")
    assert row.state == SKIPPED and "asks for no Cryptomatte" in row.reason
    ask(stage)
    after = stage.written("CANDELA", 4)
    np.testing.assert_array_equal(before["Combined"], after["Combined"])
    assert not any(name.startswith("Crypto") for name in before)
