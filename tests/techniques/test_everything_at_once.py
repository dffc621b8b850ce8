"""Pictures of one sample in which features meet that each are drawn alone elsewhere: programs that hold all of them."""

from itertools import zip_longest
from pathlib import Path

import bpy
import numpy as np
import pytest

from addon.frame import ledger
from addon.frame.ledger import RAN
from addon.lighting import shared_visibility
from addon.techniques import REGISTRY
from tests.techniques.foggy_stage import fog
from tests.techniques.test_grass import ground

SAMPLES = sorted(path.stem for path in (Path(__file__).resolve().parents[2] / "sample_blends").glob("*.blend"))
SIZE = (24, 18)


def filling(slot):
    return [one.name for one in REGISTRY if slot in one.fills]


@pytest.fixture(autouse=True)
def shared(monkeypatch):
    """Small pictures share look-ups of soft shadows as pictures of 400x300 do."""
    monkeypatch.setattr(shared_visibility, "MANY_PIXELS", 1)


@pytest.fixture
def meadow(stage):
    """Grass under fog, a mirror that stands in it, a lamp that leaves out the mirror, a glowing card, a world."""
    fog(stage, (0.2, 0.3, 0.4), Density=0.05)
    ground(stage)
    mirror = stage.rectangle((-0.5, 0.0), (0.5, 1.0), material=stage.principled(Metallic=1.0, Roughness=0.3))
    mirror.rotation_euler = (1.2, 0.0, 0.0)
    stage.rectangle((-1.0, -1.0), (-0.5, -0.5), 0.5, material=stage.material("ShaderNodeEmission", Strength=2.0))
    lamp = stage.light("AREA", (1.0, -1.0, 3.0), size=0.5)
    links = bpy.data.collections.new("Links")
    links.objects.link(mirror)
    links.collection_objects[0].light_linking.link_state = "EXCLUDE"
    lamp.light_linking.receiver_collection = links
    stage.camera((0.0, -5.0, 3.0), (1.05, 0.0, 0.0))
    yield stage
    bpy.data.collections.remove(links)


def drawn(stage, **slots):
    for slot, name in slots.items():
        setattr(stage.scene.candela, f"slot_{slot}", name)
    picture = stage.render(1, SIZE, bounces=2)["combined"][..., :3]
    assert np.isfinite(picture).all() and picture.max() > 0.0
    return {row.name for row in stage.ledger.rows if row.state == RAN}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("shadow", "indirect"), zip_longest(filling("shadow"), filling("indirect"), fillvalue="AUTO"), ids=str
)
def test_every_technique_of_shadows_and_bounces_draws_grass_fog_and_links(meadow, shadow, indirect):
    assert {shadow, indirect} - {"AUTO"} <= drawn(meadow, shadow=shadow, indirect=indirect)


@pytest.mark.slow
@pytest.mark.parametrize("name", SAMPLES)
def test_every_sample_scene_draws_with_one_sample(name, registered):
    bpy.ops.wm.open_mainfile(filepath=str(Path(__file__).resolve().parents[2] / "sample_blends" / f"{name}.blend"))
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = *SIZE, 100
    scene.candela.samples = 1
    bpy.ops.render.render()
    assert ledger.latest().samples == 1 and not ledger.latest().bad_pixels
    bpy.ops.wm.read_factory_settings(use_empty=True)
