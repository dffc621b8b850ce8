"""Pictures put together of slices of their samples: passes that are no sums, and light groups, as in the whole."""

import numpy as np
import pytest

from addon import engine
from addon.frame import slices
from addon.kernels.ranks import ids_of

SAMPLES, SLICES = 6, 3


@pytest.fixture
def sliced(written):
    """The stage; `sliced.merged()` renders slices, and the picture of all of them."""
    stage, own = written, written.scene.candela
    layer = stage.layer.name

    def merged():
        parts = []
        try:
            for k in range(SLICES):
                own.sample_offset, own.sample_count = k * SAMPLES // SLICES, SAMPLES // SLICES
                engine.taken = {}
                stage.written("CANDELA", SAMPLES, bounces=1)
                parts.append(engine.taken[layer])
            own.sample_offset = own.sample_count = 0
            engine.taken = None
            engine.given[layer] = slices.merged(parts[::-1])
            return stage.written("CANDELA", SAMPLES, bounces=1)
        finally:
            engine.taken = None
            engine.given.clear()
            own.sample_offset = own.sample_count = 0

    stage.merged = merged
    return stage


def scene(stage):
    stage.scene.render.filter_size = 1.5
    stage.camera((0, -3.0, 4), (0.6, 0, 0), angle=0.9)
    shown = stage.diffuse(0.5)
    stage.floor(material=shown).name = "Floor"
    veil = stage.principled(Base_Color=(1, 1, 1, 1), Alpha=0.5)
    for k in range(3):
        box = stage.rectangle((-0.5, -0.5), (0.5, 0.5), material=veil if k else None,
                              location=(0.5 * k - 0.6, 0.2 * k, 0.4 + 0.2 * k), turn=(0.2 * k, 0.1, 0.3))  # fmt: skip
        box.name = f"Box {k}"
    stage.light("AREA", (-0.8, 0.3, 2.5), size=0.6, energy=40.0).lightgroup = "Key"
    stage.light("POINT", (0.9, -0.8, 2.2), energy=30.0)
    node = shown.node_tree.nodes.new("ShaderNodeOutputAOV")
    node.aov_name, node.inputs["Value"].default_value = "level", 2.0
    return ["Floor", "Box 0", "Box 1", "Box 2"]


def close(one: np.ndarray, other: np.ndarray, name: str) -> None:
    near = np.abs(other) < 1e9
    scale = max(float(np.abs(other[near]).max(initial=0.0)), 1e-6)
    assert np.abs(one - other)[near].max(initial=0.0) < 2e-5 * scale, name


@pytest.mark.slow
def test_ranks_are_merged_by_id_and_values_by_samples(sliced):
    stage = sliced
    names, layer = scene(stage), stage.layer
    layer.use_pass_cryptomatte_object = layer.use_pass_uv = layer.use_pass_vector = True
    layer.cycles.denoising_store_passes = True
    made = layer.aovs.add()
    made.name, made.type = "level", "VALUE"
    whole, merged = stage.written("CANDELA", SAMPLES, bounces=1), stage.merged()
    assert whole.keys() == merged.keys()
    for name in ("Combined", "level", "UV", "Vector", "Denoising Depth", "Denoising Albedo", "Denoising Normal"):
        close(merged[name], whole[name], name)
    for name in names:
        wanted = ids_of([name])[0]
        found = []
        for passes in (whole, merged):
            pairs = np.concatenate([passes[f"CryptoObject{k:02d}"] for k in range(3)], axis=-1)
            found.append(np.where(pairs[..., 0::2] == wanted, pairs[..., 1::2], 0.0).sum(axis=-1))
        assert found[0].max() > 0.3
        np.testing.assert_allclose(found[1], found[0], atol=2e-6)
    for field, text in whole["header"].items():
        if field.startswith("cryptomatte/"):
            assert merged["header"][field] == text


@pytest.mark.slow
def test_each_light_group_is_merged_for_itself(sliced):
    stage = sliced
    scene(stage)
    stage.layer.lightgroups.add(name="Key")
    stage.layer.use_pass_cryptomatte_object = True
    whole, merged = stage.written("CANDELA", SAMPLES, bounces=1), stage.merged()
    for name in ("Combined", "Combined_Key"):
        close(merged[name], whole[name], name)
    assert whole["Combined_Key"].mean() > 0.01
