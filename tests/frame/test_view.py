"""The camera's projection rows against the formulas of a camera: where a point lands, and how deep it lies."""

import numpy as np
import pytest

from addon.sampling import sequence
from addon.scene.view import VIEW, View
from addon.snapshot.scene import Camera, Film

# Right, up and backward of a camera that looks somewhere between all axes, and where it stands.
TURN = np.linalg.qr(np.array([[1.0, 0.2, -0.4], [0.3, 1.0, 0.5], [-0.2, 0.7, 1.0]]))[0]
TURN *= np.sign(np.linalg.det(TURN))
PLACE = np.array([1e3, -2.0, 30.0])
ORIGIN = np.array([1e3, 0.0, 32.0])
FRAMES = {
    "centred": (-0.5, 0.5, -0.375, 0.375),
    "shifted": (-0.1, 0.9, -0.6, 0.15),
    "wide": (-50.0, 50.0, -40.0, 40.0),
}
BORDERS = {"whole": (0, 0, 64, 48), "border": (10, 5, 41, 30), "pixel": (63, 47, 64, 48)}


@pytest.fixture(params=[(f, b) for f in FRAMES for b in BORDERS], ids=lambda p: "-".join(p))
def frame_and_border(request):
    frame, border = request.param
    return FRAMES[frame], BORDERS[border]


def view_of(kind, frame, border, start=0.1, end=100.0):
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = TURN, PLACE
    return View(Camera(matrix, kind, frame, start, end), Film(64, 48, border), ORIGIN)


def seen_points(kind, frame, count=50):
    """World points, their place on the plane one unit before the eye, and their depth."""
    rng = np.random.default_rng(5)
    left, right, bottom, top = frame
    place = rng.uniform((left, bottom), (right, top), (count, 2))
    depth = 10.0 ** rng.uniform(-1, 2, count)
    across = place * depth[:, None] if kind == "PERSPECTIVE" else place
    local = np.column_stack([across, -depth])
    return local @ TURN.T + PLACE, place, depth


def projected(view, world, jitter=(0.0, 0.0), scene_size=10.0):
    """Pixel positions within the border, q and w of world points, as the shaders compute them."""
    values = view.values(3, 1, jitter, scene_size)
    VIEW.pack(**values)  # has exactly the fields of the struct
    h = np.column_stack([world - view.origin, np.ones(len(world))])
    x, y, w, q = (h @ values[row] for row in ("row_x", "row_y", "row_w", "row_q"))
    ndc = np.column_stack([x / w, y / w])
    return (ndc * 0.5 + 0.5) * view.size, q / w, w, values


@pytest.mark.parametrize("kind", ["PERSPECTIVE", "ORTHOGRAPHIC"])
def test_a_point_lands_on_the_pixel_that_the_frame_says(kind, frame_and_border):
    frame, border = frame_and_border
    world, place, _ = seen_points(kind, frame)
    left, right, bottom, top = frame
    full = (place - (left, bottom)) / (right - left, top - bottom) * (64, 48)
    found, *_ = projected(view_of(kind, frame, border), world)
    np.testing.assert_allclose(found, full - border[:2], atol=1e-6)


@pytest.mark.parametrize("kind", ["PERSPECTIVE", "ORTHOGRAPHIC"])
def test_film_offsets_move_the_sample_within_the_pixel(kind, frame_and_border):
    """A sample at +0.3 pixels sees what stands 0.3 pixels further, so points land 0.3 pixels earlier."""
    frame, border = frame_and_border
    world, *_ = seen_points(kind, frame)
    view = view_of(kind, frame, border)
    still, *_ = projected(view, world)
    moved, *_ = projected(view, world, jitter=(0.3, -1.2))
    np.testing.assert_allclose(moved, still - (0.3, -1.2), atol=1e-6)


@pytest.mark.parametrize("frame", FRAMES.values(), ids=FRAMES)
def test_the_depth_measure_of_a_perspective_camera_is_one_over_distance(frame):
    world, _, depth = seen_points("PERSPECTIVE", frame)
    _, q, w, _ = projected(view_of("PERSPECTIVE", frame, BORDERS["whole"]), world)
    np.testing.assert_allclose(w, depth, rtol=1e-9)
    np.testing.assert_allclose(q, 1 / depth, rtol=1e-9)


def test_the_depth_measure_of_an_orthographic_camera_falls_from_1_to_0_between_the_clip_planes():
    world, _, depth = seen_points("ORTHOGRAPHIC", FRAMES["centred"])
    view = view_of("ORTHOGRAPHIC", FRAMES["centred"], BORDERS["whole"], start=2.0, end=50.0)
    _, q, w, _ = projected(view, world)
    assert (w == 1).all()
    np.testing.assert_allclose(q, (50.0 - depth) / 48.0, rtol=1e-9)


@pytest.mark.parametrize("kind", ["PERSPECTIVE", "ORTHOGRAPHIC"])
@pytest.mark.parametrize("clip", [(1e-9, 1e12), (1.0, 1.0), (5.0, 1.0)])
def test_extreme_clip_planes_leave_finite_rows(kind, clip):
    view = view_of(kind, FRAMES["centred"], BORDERS["whole"], *clip)
    values = VIEW.pack(**view.values(0, 0, (0.0, 0.0), 1.0))
    for field in ("row_x", "row_y", "row_w", "row_q"):
        assert np.isfinite(values[field]).all()


def test_the_near_plane_follows_the_scene_where_the_clip_start_is_tiny():
    view = view_of("PERSPECTIVE", FRAMES["centred"], BORDERS["whole"], start=1e-9)
    assert view.values(0, 0, (0, 0), 1e6)["backward"][3] == pytest.approx(3.0)
    assert view.values(0, 0, (0, 0), 1.0)["backward"][3] == pytest.approx(3e-6)


@pytest.mark.parametrize("kind", ["PERSPECTIVE", "ORTHOGRAPHIC"])
def test_a_world_of_any_distance_from_the_origin_gives_the_same_rows(kind):
    """Positions reach the GPU relative to the render origin; the rows are the same wherever both lie."""
    near = view_of(kind, FRAMES["shifted"], BORDERS["border"])
    offset = np.array([2.0**20, -(2.0**21), 2.0**22])
    matrix = near.camera.matrix.copy()
    matrix[:3, 3] += offset
    far = View(Camera(matrix, kind, near.camera.frame, 0.1, 100.0), near.film, ORIGIN + offset)
    a, b = (view.values(0, 0, (0.0, 0.0), 1.0) for view in (near, far))
    for row in ("row_x", "row_y", "row_w", "row_q", "eye"):
        np.testing.assert_allclose(a[row], b[row], atol=1e-9)


def test_shaders_get_the_sequences_numbers_of_the_sample_itself():
    """Bits of one sample too many would be as even and end up in no picture's mean; here they are named."""
    view = view_of("PERSPECTIVE", FRAMES["centred"], BORDERS["whole"])
    for sample in (0, 1, 5, 63, 64):
        fields = view.values(sample, 0, (0.0, 0.0), 1.0)
        for name, dimension in (("bits_x", 0), ("bits_y", 1), ("bits_z", 5), ("bits_w", 6)):
            expected = sequence.bits(np.array(sample), dimension)
            assert np.uint32(np.int32(fields[name])) == np.uint32(expected)
