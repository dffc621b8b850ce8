"""Scenes that nobody thought of: drawn by hypothesis, rendered by every technique, held against what must be true.

`make test` draws a few; `make stress` draws CANDELA_STRESS (2000), in batches of 100 scenes. A batch is seeded by its
number, so that its scenes are the same on every machine with the same hypothesis. out/stress/clean.json names the
batches that ran clean and the commit at which they did: another run goes on with the rest. What fails is shrunk, and
the smallest failing scene is left as out/stress/<claim>.blend; moved to tests/stress/found it stays a test.
"""

from __future__ import annotations

import json
import os
import subprocess
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, seed, settings
from mathutils import Euler

from addon import engine
from addon.techniques import REGISTRY
from addon.techniques.shadows_by_light import FEW_LIGHTS
from tests.stress.scenes import SHAPES, Scene, build
from tests.stress.strategies import scenes

EXAMPLES = int(os.environ.get("CANDELA_STRESS", "0"))
SIZE = (24, 16)
FOUND = Path(__file__).parent / "found"
SLOTS: dict[str, list[str]] = {}
for _technique in REGISTRY:
    for _slot in _technique.fills:
        SLOTS.setdefault(_slot, []).append(_technique.name)

CLAIMS = 4
BATCH = min(100, EXAMPLES // CLAIMS) if EXAMPLES else 12  # the first ten of a batch are small
batches = pytest.mark.parametrize("batch", range(max(1, EXAMPLES // (CLAIMS * BATCH))))
long_run = pytest.mark.filterwarnings("ignore::DeprecationWarning")
OUT = Path(__file__).resolve().parents[2] / "out" / "stress"
CLEAN = OUT / "clean.json"


def hold(claim: str, batch: int, check) -> None:
    """Call `check(scene)` for every scene of a batch; in the long run, unless the batch is known to be clean."""
    clean = json.loads(CLEAN.read_text()) if EXAMPLES and CLEAN.exists() else {}
    key = f"{claim} {batch}"
    if key in clean:
        pytest.skip(f"clean at {clean[key]}: {CLEAN}")

    def held(scene):
        check(scene)

    drawn = settings(
        max_examples=BATCH, deadline=None, database=None, print_blob=False, suppress_health_check=list(HealthCheck)
    )
    drawn(seed(batch)(given(scene=scenes(SLOTS))(held)))()
    if EXAMPLES:
        OUT.mkdir(parents=True, exist_ok=True)
        CLEAN.write_text(json.dumps(clean | {key: commit()}, indent=1))


def commit() -> str:
    asked = ["git", "rev-parse", "--short", "HEAD"]
    return subprocess.run(asked, capture_output=True, text=True, cwd=FOUND.parent, check=False).stdout.strip()


@contextmanager
def kept(stage, scene: Scene, claim: str):
    """Build the scene; where the claim fails, leave it as a file. The last one written is the smallest."""
    build(stage, scene)
    try:
        yield
    except Exception:
        OUT.mkdir(parents=True, exist_ok=True)
        build(stage, scene)
        bpy.ops.wm.save_as_mainfile(filepath=str(OUT / f"{claim}.blend"), copy=True, check_existing=False)
        raise


def sound(images: dict[str, np.ndarray]) -> None:
    """Every value is a number and no light is negative."""
    for name, pixels in images.items():
        assert np.isfinite(pixels).all(), f"{name} is not finite"
        if name != "normal":
            assert pixels.min() >= 0, f"{name} is negative"
    assert images["combined"][..., 3].max() <= 1.0 + 1e-6


@pytest.mark.slow
@long_run
@batches
def test_every_picture_is_finite_and_comes_out_twice_the_same(kept_stage, batch):
    claim = "finite_and_same"

    def check(scene):
        with kept(kept_stage, scene, claim):
            first = kept_stage.render(scene.samples, SIZE, bounces=scene.bounces)
            sound(first)
            engine.free_sessions()
            again = kept_stage.render(scene.samples, SIZE, bounces=scene.bounces)
            for name in first:
                np.testing.assert_array_equal(first[name], again[name], err_msg=name)

    hold(claim, batch, check)


@pytest.mark.slow
@long_run
@batches
def test_eight_times_the_light_is_eight_times_the_picture(kept_stage, batch):
    """A power of two, so that nothing is rounded. Colour, depth and normals stay."""
    claim = "linear"

    def check(scene):
        assume(all(lamp.energy < 1e9 for lamp in scene.lamps) and (scene.world is None or scene.world[3] < 1e6))
        with kept(kept_stage, scene, claim):
            once = kept_stage.render(scene.samples, SIZE, bounces=scene.bounces)
            build(kept_stage, brighter(scene, 8.0))
            eight_times = kept_stage.render(scene.samples, SIZE, bounces=scene.bounces)
            for name in once:
                factor = 8.0 if name.endswith(("direct", "indirect", "emission", "environment")) else 1.0
                if name == "combined":
                    factor = np.array([8.0, 8.0, 8.0, 1.0], np.float32)  # alpha stays
                expected = once[name] * factor
                # Below 1e-30 GPUs may round to zero.
                tolerance = 1e-4 * float(np.abs(expected).max(initial=0.0)) + 1e-30
                np.testing.assert_allclose(eight_times[name], expected, rtol=1e-3, atol=tolerance, err_msg=name)

    hold(claim, batch, check)


def brighter(scene: Scene, factor: float) -> Scene:
    """The scene with all its light times `factor`."""
    lamps = tuple(replace(lamp, energy=lamp.energy * factor) for lamp in scene.lamps)
    world = None if scene.world is None else (*scene.world[:3], scene.world[3] * factor)
    surfaces = tuple(
        replace(
            surface,
            inputs=tuple(
                (name, value * factor if name == "Emission Strength" else value) for name, value in surface.inputs
            )
            + ((("Strength", factor),) if surface.node == "ShaderNodeEmission" else ()),
        )
        for surface in scene.surfaces
    )
    return replace(scene, lamps=lamps, world=world, surfaces=surfaces)


@pytest.mark.slow
@long_run
@batches
def test_order_and_names_of_objects_change_nothing(kept_stage, batch):
    claim = "order"

    def check(scene):
        assume(not coplanar(scene) and not chosen_at_random(scene) and not shine_together(scene))
        with kept(kept_stage, scene, claim):
            first = kept_stage.render(scene.samples, SIZE, bounces=scene.bounces)["combined"]
            build(kept_stage, replace(scene, shapes=scene.shapes[::-1], lamps=scene.lamps[::-1]))
            for k, thing in enumerate(kept_stage.scene.objects):
                thing.name = f"{997 * k % 1009:04d}"
            second = kept_stage.render(scene.samples, SIZE, bounces=scene.bounces)["combined"]
            assert same_but_for_edges(first, second)

    hold(claim, batch, check)


def same_but_for_edges(first: np.ndarray, second: np.ndarray) -> bool:
    """Sums depend on the order in the last digits, and with them what is seen at edges."""
    close = np.isclose(first, second, rtol=1e-3, atol=1e-4 * float(first.max(initial=0.0)))
    return close.all(axis=-1).mean() > 0.97


def coplanar(scene: Scene) -> bool:
    """Whether surfaces may lie in one plane, such as a box on the floor, where the order decides which one is seen."""
    standing = scene.shapes[1:]
    return len({shape.kind for shape in scene.shapes}) < len(scene.shapes) or any(
        shape.kind in ("twice", "floor") or shape.location[2] == 0.0 or shape.copies > 1 or 0.0 in shape.scale
        for shape in standing
    )


def chosen_at_random(scene: Scene) -> bool:
    """Whether a pixel may show, or a shadow map hold, one layer or lobe of several, chosen by a number that goes with
    the instance's place in the list or with the lamp: then noise is another, and the mean only stays. So are the points
    of an object below whose surface light scatters drawn (.0009 of the picture's mean, root mean square)."""
    lobes = ("Transmission Weight", "Coat Weight", "Sheen Weight", "Subsurface Weight")
    layers = (
        *("ShaderNodeBsdfTransparent", "ShaderNodeBsdfGlass", "ShaderNodeBsdfRefraction"),
        "ShaderNodeSubsurfaceScattering",
    )
    return any(
        surface.node in layers
        or any(
            (name in lobes and value > 0) or (name in ("Alpha", "Metallic") and 0 < value < 1)
            for name, value in surface.inputs
        )
        for surface in scene.surfaces
    )


def shine_together(scene: Scene) -> bool:
    """Whether several objects shine: points on them are drawn along the list of their triangles, in the order of the
    objects, so that noise is another then."""
    shines = {
        k
        for k, surface in enumerate(scene.surfaces)
        if surface.node == "ShaderNodeEmission" or any(n == "Emission Strength" and v > 0 for n, v in surface.inputs)
    }
    return sum(shape.copies for shape in scene.shapes if shape.material % len(scene.surfaces) in shines) > 1


def edge_on(scene: Scene) -> bool:
    """Whether a lamp stands in the plane of a surface. Its map draws that surface a thousandth of a texel wide: which
    texels' centres it covers is decided by the last digits, other ones in every place of the atlas."""
    normals, points = planes(scene)
    for lamp in scene.lamps:
        towards = np.array(Euler(lamp.turn).to_matrix())[:, 2]
        distance = (
            normals @ towards if lamp.kind == "SUN" else ((np.array(lamp.location) - points) * normals).sum(axis=1)
        )
        if (np.abs(distance) < 1e-4).any():
            return True
    return False


def planes(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """(N, 3) unit normals and (N, 3) points of the planes of all faces."""
    normals, points = [np.zeros((0, 3))], [np.zeros((0, 3))]
    for shape in scene.shapes:
        vertices, faces = SHAPES[shape.kind]()
        turn = np.array(Euler(shape.turn).to_matrix())
        for k in range(shape.copies):
            corners = np.array(vertices, float).reshape(-1, 3) * shape.scale @ turn.T + shape.place(k)
            first = corners[[face[:3] for face in faces]].reshape(-1, 3, 3)
            across = np.cross(first[:, 1] - first[:, 0], first[:, 2] - first[:, 0])
            length = np.linalg.norm(across, axis=1, keepdims=True)
            drawn = (length[:, 0] > 1e-12) & np.isfinite(first).all(axis=(1, 2))
            normals.append(across[drawn] / length[drawn])
            points.append(first[drawn, 0])
    return np.concatenate(normals), np.concatenate(points)


@pytest.mark.slow
@long_run
@batches
def test_a_lamp_is_two_lamps_of_half_its_power(kept_stage, batch):
    """Of direct light. Virtual lights share their points among lamps: in the mean only (test_instant_radiosity.py)."""
    claim = "halves"

    def check(scene):
        scene = replace(scene, bounces=0)
        assume(scene.lamps and not chosen_at_random(scene) and not edge_on(scene))
        # In pictures of one sample more lamps have coarser maps each.
        assume(scene.samples > 1 or 2 * len(scene.lamps) <= FEW_LIGHTS)
        with kept(kept_stage, scene, claim):
            # By itself the world draws fewer directions beside more lamps: other noise of the same light.
            kept_stage.scene.candela.environment_light_directions = 2
            whole = kept_stage.render(scene.samples, SIZE, bounces=scene.bounces)["combined"]
            halves = tuple(replace(lamp, energy=lamp.energy / 2) for lamp in scene.lamps for _ in range(2))
            build(kept_stage, replace(scene, lamps=halves))
            kept_stage.scene.candela.environment_light_directions = 2
            np.testing.assert_allclose(
                kept_stage.render(scene.samples, SIZE, bounces=scene.bounces)["combined"],
                whole,
                rtol=2e-3,
                atol=1e-4 * float(whole.max(initial=0.0)),
            )

    hold(claim, batch, check)
