"""What a real GPU cannot hide, counted: readbacks, framebuffers and draws of pictures with a moved camera."""

from collections import Counter

import bpy
import pytest

from addon import engine
from addon.gfx import images, library, passes
from addon.surfaces import hits

from ..viewport.region import Region

SCENES = ("cornell_box", "window_interior", "alpha_foliage", "soft_shadow_garden", "instances")
pytestmark = pytest.mark.usefixtures("gpu_context", "registered")


@pytest.fixture
def counted(monkeypatch):
    """Counts of what stops the queue. Waits that llvmpipe asks for before dispatches are no readbacks."""
    counts = Counter()
    read, finish = images.read, images.finish

    def counting_read(image):
        counts["reads"] += 1
        return read(image)

    def counting_finish():
        counts["waits"] += 1
        finish()

    monkeypatch.setattr(images, "read", counting_read)
    monkeypatch.setattr(images, "finish", counting_finish)  # `passes` has its own name for the one before dispatches
    return counts


def opened(name, samples):
    bpy.ops.wm.open_mainfile(filepath=f"sample_blends/{name}.blend")
    scene = bpy.context.scene
    scene.render.engine = "CANDELA"
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 16, 12, 100
    scene.candela.samples = samples
    return scene


def moved(scene):
    scene.camera.location.x += 1e-3
    bpy.ops.render.render()


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_a_picture_with_a_moved_camera_is_read_back_and_little_else(counted, name, monkeypatch):
    # On a GPU that keeps up: it is waited for between samples so that not more than this lies before it.
    monkeypatch.setattr(engine, "BEHIND_S", 1e9)
    scene = opened(name, 1)
    for _ in range(2):
        moved(scene)
    counted.clear()
    moved(scene)
    assert counted["reads"] + counted["waits"] <= 2
    scene.candela.samples = 3
    counted.clear()
    moved(scene)
    assert counted["reads"] + counted["waits"] <= 3


@pytest.mark.slow
def test_two_thousand_instances_are_few_draws(monkeypatch):
    """Of meshes: at each of eight points of the film, and into depth maps."""
    scene = opened("instances", 1)
    for _ in range(2):
        moved(scene)
    drawn = []
    for draw in ("draw", "draw_range"):
        original = getattr(passes, draw)
        monkeypatch.setattr(passes, draw, lambda *a, of=original: drawn.append(a) or of(*a))
    moved(scene)
    assert 0 < len(drawn) <= 100


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_a_turning_viewport_makes_no_framebuffer_after_the_third_frame_of_a_size(name):
    """Two sets of images of what the view remembers take turns; each is drawn to once before nothing is new."""
    opened(name, 1)
    region, made = Region(samples=1), []
    # Guided in each frame; otherwise the clock decides, and the guide's framebuffers come at some later frame.
    region.viewport.display.guides.scale = lambda pixels, scale, seconds: scale // 2
    for _ in range(8):
        region.camera = region.moved(1e-3)
        region.draw()
        made.append((region.viewport.scale, images.framebuffer_count))
    region.viewport.release()
    last = [count for scale, count in made if scale == made[-1][0]]
    assert len(last) > 4 and last[-1] == last[2], made


@pytest.mark.slow
@pytest.mark.parametrize("name", ("cornell_box", "soft_shadow_garden"))
def test_a_final_picture_makes_each_framebuffer_once(name, monkeypatch):
    """Blender makes a context for each of them, so they cannot stay longer."""
    scene = opened(name, 1)
    moved(scene)
    asked, over = set(), images._Framebuffers.over

    def counting(self, colors, depth):
        asked.add((*(image.number for image in colors), depth and -depth.number))
        return over(self, colors, depth)

    monkeypatch.setattr(images._Framebuffers, "over", counting)
    before = images.framebuffer_count
    moved(scene)
    assert images.framebuffer_count - before == len(asked)


@pytest.mark.slow
def test_the_first_picture_compiles_materials_that_rays_met_alone(monkeypatch):
    """Later ones compile what else rays may meet, and then never ask."""
    scene = opened("window_interior", 1)
    found, compiled = [], []
    ask = hits.Hits._to_shade

    def asked(self, frame, hierarchy, records, path):
        before = images.read
        reads = []
        images.read = lambda image: reads.append(image) or before(image)
        try:
            chosen = ask(self, frame, hierarchy, records, path)
        finally:
            images.read = before
        found.append((len(chosen), len(reads)))
        return chosen

    monkeypatch.setattr(hits.Hits, "_to_shade", asked)
    for _ in range(3):
        found.clear()
        moved(scene)
        compiled.append((max(count for count, _ in found), sum(reads for _, reads in found), library.compile_count))
    first, second, third = compiled
    assert first[1] > 0 and first[0] < second[0]
    assert second[1] == third[1] == 0 and third[2] == second[2]
