"""Panoramic cameras: their directions against closed forms, in Python and in shaders, and where tiles lie."""

import numpy as np
import pytest

from addon.gfx import images, passes
from addon.gfx.struct import Block
from addon.scene.panorama import ANSWERS, eye_of, look, tiles_of
from addon.scene.view import VIEW, View
from addon.snapshot.camera import mean_angle
from addon.snapshot.panorama import Panorama, Stereo
from addon.snapshot.scene import Aperture, Camera, Film

POLYNOMIAL = (-1.1735e-05, -0.019988736, -3.3525e-06, 3.0993e-06, -2.6065e-08)  # Blender's own
CAMERAS = {
    "equirectangular": Panorama("EQUIRECTANGULAR", (-np.pi, np.pi, -np.pi / 2, np.pi / 2)),
    "part of it": Panorama("EQUIRECTANGULAR", (-0.5, 1.0, 0.1, 0.9)),
    "equidistant": Panorama("FISHEYE_EQUIDISTANT", (np.pi,)),
    "equisolid": Panorama("FISHEYE_EQUISOLID", (np.pi, 10.5, 36.0, 27.0)),
    "polynomial": Panorama("FISHEYE_LENS_POLYNOMIAL", (np.pi, 0.0, 36.0, 27.0, *POLYNOMIAL)),
    "mirror ball": Panorama("MIRRORBALL"),
    "face of a cube": Panorama("EQUIANGULAR_CUBEMAP_FACE"),
    "cylinder": Panorama("CENTRAL_CYLINDRICAL", (-np.pi, np.pi, -1.0, 1.0)),
}
SIZE = (16, 12)
ASK = passes.fullscreen_program(
    "panorama asked",
    "asked",
    blocks=((VIEW, "film_view"),),
    snippets=(
        *ANSWERS,
        (
            "asked",
            """
#include "ask/view.glsl"
void main()
{
  vec3 way = view_direction(gl_FragCoord.xy);
  vec2 share;
  view_place(film_view.eye.xyz + 3.0 * way, share);
  out_way = vec4(way, 0.0);
  out_share = vec4(share * film_view.film.xy - gl_FragCoord.xy, view_sees(gl_FragCoord.xy) ? 1.0 : 0.0, 0.0);
}
""",
        ),
    ),
    outputs=(("VEC4", "out_way"), ("VEC4", "out_share")),
)


def view_of(panorama, size=SIZE, border=None, aperture=None):
    matrix = np.eye(4)
    matrix[:3, 3] = 1.0, 2.0, 3.0
    half = 0.5 * mean_angle(panorama, *size) * np.array(size)
    frame = (-half[0], half[0], -half[1], half[1])
    camera = Camera(matrix, "PANORAMIC", frame, 0.1, 100.0, aperture=aperture, panorama=panorama)
    return View(camera, Film(*size, border or (0, 0, *size)), np.zeros(3))


@pytest.mark.parametrize(
    ("camera", "place", "direction"),
    [
        ("equirectangular", (0.5, 0.5), (0, 0, 1)), ("equirectangular", (0.75, 0.5), (1, 0, 0)),
        ("equirectangular", (0.3, 1.0), (0, 1, 0)), ("part of it", (0.0, 0.0), (-0.4770, 0.0998, 0.8732)),
        ("equidistant", (1.0, 0.5), (1, 0, 0)), ("equidistant", (0.5, 0.75), (0, 0.5**0.5, 0.5**0.5)),
        ("equidistant", (0.0, 0.0), (0, 0, 0)), ("equisolid", (0.5 + 10.5 / 36.0, 0.5), (0.75**0.5, 0, 0.5)),
        ("mirror ball", (0.5 + 0.5**1.5, 0.5), (1, 0, 0)), ("mirror ball", (1.0, 0.5), (0, 0, -1)),
        ("face of a cube", (0.75, 0.5), (np.sin(np.pi / 8), 0, np.cos(np.pi / 8))),
        ("cylinder", (0.25, 1.0), (-(0.5**0.5), 0.5**0.5, 0)),
        ("polynomial", (0.5 + 10.0 / 36.0, 0.5), (np.sin(0.197384), 0, np.cos(0.197384))),
    ],
)  # fmt: skip
def test_a_place_of_the_film_sees_what_the_projection_says(camera, place, direction):
    """(right, up, forward), as the formulas of Cycles' camera/projection.h give it."""
    assert CAMERAS[camera].directions(*place) == pytest.approx(np.array(direction, float), abs=2e-4)


@pytest.mark.parametrize("border", [(0, 0, *SIZE), (3, 2, 12, 9)], ids=["whole", "border"])
@pytest.mark.parametrize("name", CAMERAS)
def test_shaders_have_the_same_rays_and_find_their_pixels_again(name, border, gpu_context):
    view, jitter = view_of(CAMERAS[name], border=border), (0.3, -0.2)
    width, height = view.size
    target = images.Target(tuple(images.pool.take(width, height, "RGBA32F") for _ in range(2)))
    block = Block(VIEW, **view.values(0, 0, jitter, 10.0))
    passes.fullscreen(ASK, target, blocks={"film_view": block})
    way, share = (images.read(image) for image in target.colors)
    u = (np.arange(width) + 0.5 + jitter[0] + border[0]) / SIZE[0]
    v = (np.arange(height) + 0.5 + jitter[1] + border[1]) / SIZE[1]
    expected = CAMERAS[name].directions(u, v[:, None])
    assert way[..., :3] == pytest.approx(expected * (1.0, 1.0, -1.0), abs=2e-5)  # the camera looks along -Z
    seen = np.abs(expected).sum(axis=-1) > 0.0
    assert (share[..., 2] > 0.5).tolist() == seen.tolist()
    # Beyond a half turn a place of the film is not the only one; poles of a panorama have no longitude.
    inside = seen & (u < 1.0) & (u > 0.0) & (v[:, None] < 1.0) & (v[:, None] > 0.0) & (np.abs(expected[..., 1]) < 0.99)
    assert share[inside][:, :2] == pytest.approx(0.0, abs=2e-2)


@pytest.mark.parametrize("name", CAMERAS)
def test_every_pixel_looks_through_one_tile(name):
    view = view_of(CAMERAS[name])
    u, v = ((np.arange(side) + 0.5) / side for side in SIZE)
    seen = CAMERAS[name].directions(u, v[:, None])
    count = np.zeros(seen.shape[:2], int)
    for tile in tiles_of(view):
        local = seen @ tile.axes.T
        place = local[..., :2] / np.maximum(-local[..., 2:], 1e-9)
        left, right, bottom, top = tile.bounds
        own = (local[..., 2] < 0) & (place >= (left, bottom)).all(axis=-1) & (place <= (right, top)).all(axis=-1)
        rows = np.flatnonzero(own.any(axis=1))
        assert not len(rows) or (tile.rows[0] <= rows[0] and rows[-1] < tile.rows[1])
        left, right, bottom, top = tile.view.camera.frame
        assert (place[own] >= (left, bottom)).all()
        assert (place[own] <= (right, top)).all()
        count += own
    assert (count[np.abs(seen).sum(axis=-1) > 0.0] >= 1).all()
    assert (count <= 2).all()  # two on the edge of both


def test_the_solid_angle_of_a_pixel_is_that_of_the_sphere():
    """An equirectangular picture of 2 n x n pixels: pi / n at the equator, less by the root of the cosine elsewhere."""
    assert mean_angle(CAMERAS["equirectangular"], 128, 64) == pytest.approx(np.pi / 64 * 0.5**0.25, rel=0.02)


def test_the_lens_lies_across_each_direction_and_eyes_stand_beside_it():
    lens = view_of(CAMERAS["equirectangular"], aperture=Aperture(0.1, 2.0)).camera
    for seen in np.array([(0, 0, 1), (1, 0, 0), (0, 0.6, 0.8), (0.48, 0.6, 0.64)], float):
        begins = eye_of(lens, seen, (0.06, -0.02))
        assert begins @ seen == pytest.approx(0.0, abs=1e-12)
        assert np.linalg.norm(begins) == pytest.approx(np.hypot(0.06, 0.02))
    pair = Panorama("EQUIRECTANGULAR", CAMERAS["equirectangular"].values, Stereo(0.03, np.inf, 1.0, 1.2))
    eye = view_of(pair).camera
    assert eye_of(eye, np.array([1.0, 0.0, 0.0]), (0, 0)) == pytest.approx([0.0, 0.0, -0.03])
    assert eye_of(eye, np.array([0.0, 1.0, 0.0]), (0, 0)) == pytest.approx([0.0, 0.0, 0.0])
    above = np.array([0.0, np.sin(1.1), np.cos(1.1)])
    assert eye_of(eye, above, (0, 0)) == pytest.approx([0.03 * np.cos(np.pi / 4), 0.0, 0.0])


@pytest.mark.parametrize("turn", [0.0, 0.7])
def test_tiles_look_from_where_their_eye_stands(turn, gpu_context):
    """An eye of a pair, whose distance from the middle is the same in all directions of the horizon."""
    pair = Panorama("EQUIRECTANGULAR", CAMERAS["equirectangular"].values, Stereo(0.03))
    view = view_of(pair)
    view.camera.matrix[:3, :3] = [(np.cos(turn), 0, np.sin(turn)), (0, 1, 0), (-np.sin(turn), 0, np.cos(turn))]
    tiles = tiles_of(view)
    look(tiles, view, 0, 0, 10.0, (0.0, 0.0), (0.1, 0.1))
    right, up, back = view.camera.matrix[:3, :3].T
    for tile in tiles:
        x, _, z = tile.middle
        across = np.array([z, 0.0, -x]) / max(np.hypot(x, z), 1e-30)
        expected = (1.0, 2.0, 3.0) + 0.03 * (across[0] * right + across[1] * up - across[2] * back)
        assert tile.block.value("eye")[:3] == pytest.approx(expected, abs=1e-6)
    assert len({tuple(np.round(tile.block.value("eye"), 4)) for tile in tiles}) > 3
