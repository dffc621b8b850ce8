"""Soft textured shadow volumes: which places of cards hide which points of a light."""

import bpy
import numpy as np
import pytest

from addon.lighting.textured_volumes import card_records

from .conftest import places
from .test_depth_complexity import by_edges, share  # noqa: F401  (a fixture)
from .test_opacity_maps import with_alpha


def lamp(stage):
    return stage.light("AREA", (0, 0, 4), size=1.0, shape="SQUARE")


def hide(stage, card):
    card.visible_camera = False
    return card


def test_projection_onto_a_card_is_where_a_ray_meets_it():
    """J of shaders/edges/cards.glsl from the records, against Moeller and Trumbore's solution, in random cases."""
    random = np.random.default_rng(4)
    corners = random.normal(size=(2000, 3, 3)).astype(np.float32)
    rows = card_records(corners, np.zeros((2000, 4))).astype(np.float64)
    p, s = random.normal(size=(2, 2000, 3)) * 2
    v0, e1, e2 = (corners[:, 0].astype(float), *(corners[:, k].astype(float) - corners[:, 0] for k in (1, 2)))
    to_corner = v0 - p
    k = np.einsum("nij,nj->ni", rows[:, :3, :3], to_corner)
    j = np.stack([
        rows[:, 0, :3] - (k[:, :1] / k[:, 2:]) * rows[:, 2, :3],
        rows[:, 1, :3] - (k[:, 1:2] / k[:, 2:]) * rows[:, 2, :3],
        rows[:, 2, :3] / k[:, 2:],
    ], axis=1)  # fmt: skip
    h = np.einsum("nij,nj->ni", j, s - p)
    found = (h[:, 0] >= 0) & (h[:, 1] >= 0) & (h[:, 2] - h[:, 0] - h[:, 1] >= 0) & (h[:, 2] > 1)
    solved = np.linalg.solve(np.stack([e1, e2, p - s], axis=2), (p - v0)[..., None])[..., 0]
    expected = (solved[:, 0] >= 0) & (solved[:, 1] >= 0) & (solved[:, :2].sum(axis=1) <= 1)
    expected &= (solved[:, 2] > 0) & (solved[:, 2] < 1)
    clear = (np.abs(solved) > 1e-4).all(axis=1) & (np.abs(1 - solved[:, 2]) > 1e-4)
    clear &= np.abs(1 - solved[:, :2].sum(axis=1)) > 1e-4
    assert expected.sum() > 30 and np.array_equal(found[clear], expected[clear])
    assert np.allclose((h[:, :2] / h[:, 2:])[expected], solved[expected][:, :2], atol=1e-3)


def test_the_ball_of_a_card_holds_its_corners():
    random = np.random.default_rng(6)
    corners = random.normal(size=(200, 3, 3)).astype(np.float32)
    corners[:100, 1] = corners[:100, 0] + 1e-3  # thin ones
    ball = card_records(corners, np.zeros((200, 4)))[:, 4]
    assert (np.linalg.norm(corners - ball[:, None, :3], axis=2) <= ball[:, None, 3] + 1e-6).all()


def test_cones_that_meet_a_ball_are_never_rejected():
    """cone_meets_ball of shaders/edges/card_record.glsl in numpy, for single receivers and for balls of them."""
    random = np.random.default_rng(8)
    missed = tested = 0
    for _ in range(20000):
        p, c, b = random.normal(size=(3, 3)) * (1, 1, 2)
        r, rho, reach = random.uniform(0.05, 0.6, 3)
        offset = random.normal(size=3)
        own = p + offset / np.linalg.norm(offset) * reach * random.random()
        s = random.normal(size=3)
        s = c + s / np.linalg.norm(s) * r * random.random()
        t = np.clip((b - own) @ (s - own) / max((s - own) @ (s - own), 1e-9), 0, 1)
        if np.linalg.norm(own + t * (s - own) - b) > rho:
            continue
        tested += 1
        for place, x in ((own, 0.0), (p, reach)):
            v, a = c - place, b - place
            quadratic = v @ v - (r - x) * abs(r - x) if x == 0 else v @ v - (r - x) ** 2
            if quadratic <= 0:
                continue
            linear = a @ v + (rho + x) * (r - x)
            u = np.clip(linear / quadratic, 0, 1)
            missed += quadratic * u * u - 2 * linear * u + a @ a - (rho + x) ** 2 > 1e-9
    assert tested > 300 and missed == 0


@pytest.mark.parametrize("opacity", (0.0, 1.0))
def test_a_whole_or_empty_card_is_a_sheet_or_nothing(by_edges, opacity):  # noqa: F811
    stage = by_edges
    stage.floor()
    half = with_alpha(stage, np.full((8, 8), opacity), "Closest")
    hide(stage, stage.card(half, 0, 1, location=(0.2, 0.1, 1.5), turn=(0.3, 0.2, 0.1), scale=(0.4, 0.4, 1)))
    lamp(stage)
    stage.camera_above()
    found = share(stage)
    stage.clear()
    stage.scene.candela.slot_shadow, stage.scene.candela.light_probes_maps = "depth_complexity", 0.0
    stage.floor()
    if opacity:
        stage.blocker((-1, -1), (1, 1), 0.0, location=(0.2, 0.1, 1.5), turn=(0.3, 0.2, 0.1), scale=(0.4, 0.4, 1))
    lamp(stage)
    stage.camera_above()
    expected = share(stage) if opacity else np.ones_like(found)
    assert np.abs(found - expected).max() < 1e-3
    assert opacity == 0.0 or found.min() < 0.1


def test_a_half_plane_of_alpha_has_a_linear_penumbra(by_edges):  # noqa: F811
    stage = by_edges
    stage.floor()
    sheet = with_alpha(stage, np.arange(64)[None] * np.ones((64, 1)) < 32, "Closest")
    hide(stage, stage.card(sheet, 0, 1, location=(0, 0, 2), scale=(8, 8, 1)))
    lamp(stage)
    stage.camera_above(span=2.0)
    size = (64, 4)
    x, _ = places(size, 2.0)
    found = share(stage, size)
    assert np.abs(found - np.clip(0.5 + x, 0, 1)).mean() < 0.01  # cells of 2 mm after a texel of 25 cm


def test_a_fine_chequerboard_lets_half_the_light_pass(by_edges):  # noqa: F811
    stage = by_edges
    stage.floor()
    cells = np.add.outer(np.arange(256), np.arange(256)) % 2
    hide(stage, stage.card(with_alpha(stage, cells, "Closest"), 0, 1, location=(0, 0, 2), scale=(1.3, 1.3, 1)))
    lamp(stage)
    stage.camera_above(span=1.0)
    found = share(stage, (24, 24))
    assert abs(found.mean() - 0.5) < 0.03 and found.std() < 0.1


@pytest.mark.parametrize("opacity, expected", ((0.5, 0.25), (1.0, 0.0)))
def test_sheets_on_each_other_multiply_what_passes(by_edges, opacity, expected):  # noqa: F811
    stage = by_edges
    stage.floor()
    sheet = stage.see_through(opacity)
    if opacity == 1.0:
        sheet = with_alpha(stage, np.ones((4, 4)), "Closest")
    for _ in range(2):
        hide(stage, stage.card(sheet, 0, 1, location=(0, 0, 2), scale=(4, 4, 1)))
    lamp(stage)
    stage.camera_above(span=1.0)
    assert abs(share(stage, (24, 24)).mean() - expected) < 0.01


def test_a_card_edge_on_to_the_light_shadows_both_sides(by_edges):  # noqa: F811
    stage = by_edges
    stage.floor()
    sheet = with_alpha(stage, np.ones((4, 4)), "Closest")
    hide(stage, stage.card(sheet, 0, 1, location=(0, 0, 1.5), turn=(0, np.pi / 2, 0), scale=(0.5, 9, 1)))
    lamp(stage)
    stage.camera_above(span=1.0)
    size = (32, 4)
    x, _ = places(size, 1.0)
    expected = 1 - np.clip(3 * np.abs(x), 0, 0.5) + np.clip(np.abs(x), 0, 0.5)
    assert np.abs(share(stage, size) - expected).max() < 0.07


def test_a_mirrored_card_shows_its_picture_mirrored(by_edges):  # noqa: F811
    stage = by_edges
    stage.floor()
    left = np.arange(64)[None] * np.ones((64, 1)) < 16  # opaque at small u alone
    sheet = with_alpha(stage, left, "Closest")
    card = hide(stage, stage.card(sheet, 0, 1, location=(0, 0, 0.3)))
    lamp(stage)
    stage.camera_above(span=3.0)
    found = share(stage, (32, 32)).mean(axis=0)
    card.scale = (-1, 1, 1)
    mirrored = share(stage, (32, 32)).mean(axis=0)
    assert found[:16].mean() < 0.9 < found[16:].mean()
    assert np.abs(found - mirrored[::-1]).max() < 0.05


@pytest.mark.slow
def test_cards_beside_opaque_casters_hide_what_either_hides(by_edges):  # noqa: F811
    stage = by_edges
    stage.floor()
    fence = (np.arange(64) % 16 < 4)[:, None] | (np.arange(64) % 16 < 4)[None]
    hide(stage, stage.card(with_alpha(stage, fence, "Closest"), 0, 1, location=(0, 0, 1.0)))
    bpy.ops.mesh.primitive_cube_add(location=(0.3, 0, 0.5), size=0.3)
    bpy.context.object.visible_camera = False
    lamp(stage)
    stage.camera_above(span=2.0)
    found = share(stage, (32, 32), samples=2)
    settings = stage.scene.candela
    settings.slot_shadow, settings.accumulated_maps_by = "accumulated_maps", "RAYS"
    expected = share(stage, (32, 32), samples=256)
    assert abs((found - expected).mean()) < 4e-3
    assert np.sqrt(((found - expected) ** 2).mean()) < 0.03


def test_edges_of_a_card_are_not_counted_beside_it(by_edges):  # noqa: F811
    stage = by_edges
    stage.floor()
    hide(stage, stage.card(with_alpha(stage, np.zeros((4, 4)), "Closest"), 0, 1, location=(0, 0, 1.0)))
    stage.blocker((0.5, 0.5), (0.6, 0.6), 1.0)
    lamp(stage)
    stage.camera_above()
    stage.render()
    row = next(row for row in stage.ledger.rows if row.name == "depth_complexity")
    assert row.counters["edges"] <= 8  # of blocker and floor
