"""Light paths that nobody looks at apart: one sum before the film filter, and the same picture."""

from dataclasses import replace

import bpy
import numpy as np
import pytest

from addon.frame.light_paths import TOGETHER
from addon.frame.run import Renderer
from addon.snapshot import SnapshotCache, take
from addon.techniques import make_registry
from addon.ui.properties import settings_of

SIZE = (24, 24)
ROUNDING = 2e-6  # of a pixel, and of the mean of the picture
COLORS = frozenset(("color.diffuse", "color.glossy", "color.transmission", "surface.normal_sum"))


def drawn(stage, shows, samples=1, names=("film.combined",), **values):
    """The images of these names, and the frame, of a picture of which `shows` is looked at."""
    settings = replace(settings_of(stage.scene, viewport=False), samples=samples, shows=shows)
    settings = replace(settings, values={**settings.values, **{("film", name): one for name, one in values.items()}})
    stage.scene.render.resolution_x, stage.scene.render.resolution_y = SIZE
    renderer = Renderer(make_registry)
    try:
        frame = renderer.begin(take(bpy.context.evaluated_depsgraph_get(), SnapshotCache(), *SIZE), settings)
        for _ in range(samples):
            renderer.advance(frame)
        renderer.show(frame)
        return renderer.finish(frame, names), frame, set(frame.images)
    finally:
        renderer.release()


def same_picture(stage, shows=frozenset(), **options):
    """Both pictures are the same; returns the names of the images of the one whose paths are summed."""
    apart, _, _ = drawn(stage, None, **options)
    summed, _, held = drawn(stage, shows, **options)
    one, other = apart["film.combined"], summed["film.combined"]
    assert one[..., :3].mean() > 0
    np.testing.assert_allclose(other, one, rtol=ROUNDING, atol=ROUNDING * np.abs(one[..., :3]).mean())
    return held


def lit_room(stage):
    """Something of each: diffuse, glossy and glass, a lamp, a light that is seen, a world, edges."""
    stage.scene.render.filter_size = 1.5
    stage.scene.candela.use_denoise = False
    stage.floor(half=2.0, material=stage.principled(Base_Color=(0.8, 0.4, 0.2, 1), Roughness=0.3))
    stage.rectangle((-1, -1), (0, 1), 0.7, material=stage.principled(Transmission_Weight=1.0, Roughness=0.0))
    stage.rectangle((0.2, -1), (1.2, 1), 0.9, material=stage.principled(Emission_Strength=2.0), turn=(0, 0.4, 0))
    stage.light("AREA", (0, 0, 3), size=0.5)
    stage.world((0.2, 0.3, 0.5))
    stage.camera((0, -3, 2.5), (0.9, 0, 0))


@pytest.mark.slow
@pytest.mark.parametrize("samples", [1, 4])
@pytest.mark.parametrize("transparent", [False, True])
def test_the_sum_is_the_same_picture(stage, samples, transparent):
    lit_room(stage)
    stage.scene.render.film_transparent = transparent
    if transparent:
        stage.scene.cycles.film_transparent_glass = True
    held = same_picture(stage, samples=samples)
    assert TOGETHER in held and not held & {"film.diffuse_direct", "radiance.emission", *COLORS}


@pytest.mark.slow
def test_denoise_keeps_the_paths_that_it_filters(stage):
    lit_room(stage)
    stage.scene.candela.use_denoise = True
    held = same_picture(stage, samples=4)
    assert {TOGETHER, "film.diffuse_direct", "film.diffuse_indirect", "color.diffuse"} <= held
    assert "radiance.emission" not in held and "color.transmission" not in held


@pytest.mark.slow
def test_what_passes_show_is_apart(stage):
    lit_room(stage)
    names = ("radiance.glossy_direct", "color.glossy", "radiance.environment")
    apart, _, _ = drawn(stage, None, names=names)
    asked, frame, _ = drawn(stage, frozenset(names), names=names)
    for name in names:
        np.testing.assert_array_equal(asked[name], apart[name])
    assert same_picture(stage, frozenset(names)) >= {TOGETHER, "film.glossy_direct", "radiance.environment"}
    assert "summed before the filter, but for Glossy Direct" in str(frame.ledger.row("film").choices)


@pytest.mark.slow
def test_a_picture_of_all_that_needs_no_light_sums_nothing(stage):
    """A pass draws into six images."""
    lit_room(stage)
    assert TOGETHER not in same_picture(stage, COLORS | {"radiance.emission", "radiance.environment"})


def absorbing_box(stage):
    fog = stage.material("ShaderNodeVolumeAbsorption", Density=0.2)
    nodes, links = fog.node_tree.nodes, fog.node_tree.links
    shader, output = (next(n for n in nodes if n.type == kind) for kind in ("VOLUME_ABSORPTION", "OUTPUT_MATERIAL"))
    links.new(shader.outputs[0], output.inputs["Volume"])
    links.remove(output.inputs["Surface"].links[0])
    corners = [(x, y, z) for z in (-0.5, 2) for y in (-2, 2) for x in (-2, 2)]
    sides = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    stage.mesh(corners, sides, material=fog)


@pytest.mark.slow
def test_media_dim_the_sum(stage):
    stage.scene.candela.use_denoise = False
    stage.scene.candela.bounces = 0
    stage.floor(half=2.0)
    stage.rectangle((-1, -1), (0, 1), 0.7, material=stage.principled(Transmission_Weight=1.0, Roughness=0.0))
    stage.light("SUN")
    stage.camera((0, -3, 2.5), (0.9, 0, 0))
    stage.scene.render.film_transparent = stage.scene.cycles.film_transparent_glass = True
    absorbing_box(stage)
    assert same_picture(stage) >= {TOGETHER, "film.transmission_direct"}


def test_fog_covers_once_with_the_world_apart_or_not(stage):
    absorbing_box(stage)
    stage.camera((0, -3, 1), (np.pi / 2, 0, 0))
    stage.scene.render.film_transparent = True
    stage.scene.candela.use_denoise = False
    name = "radiance.environment"
    alone, _, _ = drawn(stage, frozenset())
    apart, _, _ = drawn(stage, frozenset({name}))
    middle = alone["film.combined"][..., 3][SIZE[1] // 2, SIZE[0] // 2]
    assert middle == pytest.approx(1.0 - np.exp(-0.2 * (1.0 - 0.8) * 4.0), rel=0.01)  # what the node's grey lets pass
    np.testing.assert_allclose(apart["film.combined"][..., 3], alone["film.combined"][..., 3], atol=1e-5)


def test_a_path_that_is_not_held_is_an_error(stage):
    lit_room(stage)
    with pytest.raises(KeyError, match="diffuse_direct is not held apart"):
        drawn(stage, frozenset(), names=("film.combined", "radiance.diffuse_direct"))


@pytest.mark.slow
def test_a_final_render_asks_for_its_passes(stage):
    """Through Blender: Combined alone is one sum; with a pass its path is apart."""
    from addon import engine

    lit_room(stage)
    stage.scene.render.engine, stage.scene.candela.samples = "CANDELA", 1
    stage.scene.render.resolution_x, stage.scene.render.resolution_y = SIZE
    layer = stage.scene.view_layers[0]
    found = []
    for asked in (False, True):
        layer.use_pass_diffuse_direct = asked
        bpy.ops.render.render()
        found.append(set(engine.session(stage.scene, "final").renderer.frame.images))
    layer.use_pass_diffuse_direct = False
    assert TOGETHER in found[0] and "film.diffuse_direct" not in found[0] and "film.diffuse_direct" in found[1]
