"""Profiles of subsurface scattering: closed forms, the specification's table, and the shader's against numpy's."""

from dataclasses import replace

import numpy as np
import pytest

from addon.gfx import context, images, passes
from addon.kernels import diffusion
from addon.kernels.diffusion import Medium
from addon.scene.envelope import AT_ONCE, normal_envelope
from addon.scene.pieces import octahedral_with_lift
from addon.scene.scatter_surface import Surface
from tests.numerics import trapezoid

THESIS = Medium(0.1, 2.0, 0.0, 1.2)
JENSEN = {
    "thesis": (THESIS, 0.4762, 0.7937, 0.44469, 0.33025, (2.290, 2.986, 4.648)),
    "marble red": (Medium(0.0021, 2.19, 0.0, 1.5), 0.4562, 0.1175, 0.83019, 0.39075, (7.44, 10.66, 19.53)),
    "marble blue": (Medium(0.0071, 3.00, 0.0, 1.5), 0.3326, 0.2531, 0.75261, 0.73189, (4.38, 6.08, 10.52)),
    "skin red": (Medium(0.032, 0.74, 0.0, 1.3), 1.2953, 0.2722, 0.43596, 0.04443, (6.61, 8.71, 13.67)),
    "skin green": (Medium(0.17, 0.88, 0.0, 1.3), 0.9524, 0.7318, 0.22733, 0.06282, (2.86, 3.71, 5.76)),
    "skin blue": (Medium(0.48, 1.01, 0.0, 1.3), 0.6711, 1.4648, 0.13100, 0.08926, (1.567, 1.980, 2.995)),
}  # fmt: skip


@pytest.mark.parametrize("name", JENSEN)
def test_the_dipole_has_the_constants_of_the_table(name):
    medium, depth, transport, total, middle, ranges = JENSEN[name]
    assert medium.depths[0] == pytest.approx(depth, rel=1e-3)
    assert medium.transport == pytest.approx(transport, rel=1e-3)
    assert diffusion.dipole_total(medium) == pytest.approx(total, rel=1e-3)
    assert float(diffusion.dipole(medium, 0.0)) == pytest.approx(middle, rel=1e-3)
    for missing, expected in zip((0.1, 0.05, 0.01), ranges):
        assert diffusion.dipole_range(medium, missing) == pytest.approx(expected, rel=2e-3)


def test_the_dipole_falls_off_as_the_specification_says():
    expected = [0.230100, 0.110724, 0.0291887, 0.00479810, 0.000317193]
    assert diffusion.dipole(THESIS, [0.25, 0.5, 1, 2, 4]) == pytest.approx(expected, rel=1e-4)


def test_the_dipole_integrates_to_its_closed_forms():
    r = np.linspace(0.0, 60.0, 400_001)
    profile = 2 * np.pi * r * diffusion.dipole(THESIS, r)
    assert trapezoid(profile, r) == pytest.approx(diffusion.dipole_total(THESIS), rel=1e-4)
    near = r <= 1.5
    assert trapezoid(profile[near], r[near]) == pytest.approx(float(diffusion.dipole_within(THESIS, 1.5)), rel=1e-3)


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_scaled_coefficients_scale_distances(factor):
    r = np.array([0.1, 1.0, 3.0])
    scaled = diffusion.dipole(THESIS.scaled(factor), r)
    assert scaled == pytest.approx(factor**2 * diffusion.dipole(THESIS, factor * r), rel=1e-12)


@pytest.mark.parametrize(
    "thickness, expected",
    [(0.5, (0.30766, 0.56174)), (1, (0.38481, 0.36508)), (2, (0.43271, 0.16152)), (4, (0.44419, 0.03285))],
)
def test_the_multipole_has_the_totals_of_the_table(thickness, expected):
    assert diffusion.multipole(THESIS, thickness) == pytest.approx(expected, rel=1e-3)


def test_a_thick_slab_is_the_dipole_and_a_clear_one_loses_nothing():
    reflected, transmitted = diffusion.multipole(THESIS, 200.0)
    assert float(reflected) == pytest.approx(diffusion.dipole_total(THESIS), rel=1e-6)
    assert float(transmitted) == pytest.approx(0.0, abs=1e-12)
    k = np.array([0.0, 0.5, 2.0])
    assert diffusion.multipole(THESIS, 200.0, k)[0] == pytest.approx(diffusion.dipole_hankel(THESIS, k), rel=1e-6)
    reflected, transmitted = diffusion.multipole(Medium(1e-9, 2.0, 0.0, 1.2), 1.0)
    # Absorption counts as a ten-thousandth of the extinction, so that the range is bounded.
    assert float(reflected + transmitted) == pytest.approx(1.0, abs=0.02)


def test_two_half_slabs_are_darker_than_none_and_thinner_than_one():
    half = diffusion.multipole(THESIS, 1.0)
    both = diffusion.stacked(half, half)
    assert both[0] > half[0] and both[1] < half[1] and both[0] + both[1] < 1.0


@pytest.mark.parametrize("lobes", [diffusion.burley(0.3), diffusion.walk(0.1, 0.2), diffusion.walk(0.7, 1.0)])
def test_lobes_have_the_total_of_one_and_a_half_at_an_edge(lobes):
    r = np.geomspace(1e-6, 200.0, 200_001)
    assert trapezoid(2 * np.pi * r * lobes.at(r), r) == pytest.approx(1.0, rel=1e-3)
    assert float(lobes.within(np.array(1e9))) == pytest.approx(1.0)
    assert float(lobes.hankel(np.array(0.0))) == pytest.approx(1.0)
    left, middle, right = lobes.edge([-0.4, 0.0, 0.4])
    assert middle == pytest.approx(0.5, abs=1e-6) and left + right == pytest.approx(1.0, abs=1e-9)


def test_the_walk_returns_its_albedo_of_light_from_all_sides():
    cosines = (np.arange(2000) + 0.5) / 2000
    for albedo in (0.1, 0.5, 0.8, 0.95):
        returned = diffusion.walk_returned(diffusion.walk_absorption(albedo), cosines)
        assert np.mean(2 * cosines * returned) == pytest.approx(albedo, abs=0.003)


def test_the_skin_scale_inverts_the_dipole():
    for albedo in (0.2, 0.5, 0.8):
        s = float(diffusion.skin_scale(albedo, 1.4))
        alpha = 1.0 - s * s / 3.0
        medium = Medium(1.0 - alpha, alpha, 0.0, 1.4)
        assert diffusion.dipole_total(medium) == pytest.approx(albedo, rel=1e-4)


PROBE = passes.fullscreen_program(
    "profile probe", "subsurface/probe.frag.glsl",
    textures=(("RGBA32F", "walk_lobes"),),
    constants=(("INT", "kind"), ("FLOAT", "free_path"), ("FLOAT", "albedo"), ("FLOAT", "step_m")),
    defines=(("WALK_LOBES", "1"),),
    outputs=(("VEC4", "out_profile"),),
    snippets=(("subsurface/probe.frag.glsl", """
#include "lib/math.glsl"
#include "subsurface/profile.glsl"
void main()
{
  float r = (gl_FragCoord.x) * step_m;
  Profile p = profile_of(kind, vec3(free_path), vec3(albedo));
  out_profile = vec4(profile_radial(p, r).x, profile_near(p, r).x, near_window(r, 32.0 * step_m), profile_reach(p));
}
"""),),
)  # fmt: skip


@pytest.mark.parametrize("kind, albedo", [(0, 0.5), (1, 0.3), (1, 0.8), (1, 0.97)])
def test_the_shader_has_the_same_profile(registered, kind, albedo):
    context.ensure()
    path, step = 0.05, 0.01
    with images.borrowed(64, 1, "RGBA32F") as target:
        passes.fullscreen(
            PROBE, target, textures={"walk_lobes": images.upload(diffusion.table())},
            constants={"kind": kind, "free_path": path, "albedo": albedo, "step_m": step},
        )  # fmt: skip
        found = images.read(target.colors[0])[0]
    lobes = diffusion.walk(float(diffusion.walk_absorption(albedo)), path) if kind else diffusion.burley(path)
    r = (np.arange(64) + 0.5) * step
    assert found[:, 0] == pytest.approx(2 * np.pi * r * lobes.at(r), rel=0.02)
    t = np.linspace(0.0, 1.0, 20_001)
    for k in (0, 5, 63):
        density = 2 * np.pi * np.maximum(t * r[k], 1e-9) * lobes.at(np.maximum(t * r[k], 1e-9))
        expected = trapezoid((1 - t * t) ** 2 * density, t * r[k])
        assert found[k, 1] == pytest.approx(expected, rel=0.02)
    assert np.diff(found[:, 1]).min() > 0.0


def test_cells_of_a_box_share_no_edge():
    """Light of one face that meets another at an edge is no light of the other."""
    places = np.array([(x, y, z) for z in (0, 1) for y in (0, 1) for x in (0, 1)], float)
    faces = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    triangles = np.array([part for a, b, c, d in faces for part in ((a, b, c), (a, c, d))])
    corners = places[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    box = Surface(
        corners,
        np.repeat(normals[:, None], 3, axis=1),
        np.full(12, 0.5),
        np.zeros((12, 3, 2)),
        np.zeros(12, int),
        1.0,
        1.0,
    )
    face = box.cells(256)[2]
    assert np.einsum("crx,cx->cr", face, face[:, 0]).min() > 0.99


LIFTED = passes.fullscreen_program(
    "lift probe", "gbuffer/probe.frag.glsl",
    textures=(("RGBA32F", "stored"),),
    outputs=(("VEC4", "out_read"),),
    snippets=(("gbuffer/probe.frag.glsl", """
#include "lib/gbuffer.glsl"
void main()
{
  vec4 texel = stored_fetch(ivec2(gl_FragCoord.xy));
  out_read = vec4(octahedral_decode(texel.xy), lift_decode(texel.xy));
}
"""),),
)  # fmt: skip


def test_shaders_read_the_lift_that_is_stored_beside_a_direction(registered):
    """The last bits of most directions, left as they are, mean some length: light would begin that far off."""
    context.ensure()
    k = np.arange(64)
    height = 1.0 - 2.0 * (k + 0.5) / 64
    away = np.sqrt(1.0 - height**2)
    unit = np.stack([away * np.cos(2.4 * k), away * np.sin(2.4 * k), height], axis=1)
    lift = np.where(k % 4 == 0, 0.0, 10.0 ** (k % 7 - 4.0))
    stored = np.zeros((1, 64, 4), np.float32)
    stored[0, :, :2] = octahedral_with_lift(unit, lift)
    with images.borrowed(64, 1, "RGBA32F") as target:
        passes.fullscreen(LIFTED, target, textures={"stored": images.upload(stored)})
        found = images.read(target.colors[0])[0]
    assert found[:, :3] == pytest.approx(unit, abs=5e-5)
    assert (found[lift == 0.0, 3] == 0.0).all()
    assert found[:, 3] == pytest.approx(lift, rel=2e-3)


def test_points_of_a_smooth_ball_are_lifted_as_its_pixels_are():
    """Normals N = V / R of corners: the mean of V . N less the point's own is (R^2 - P^2) / |P|. Of a back side, which
    curves the other way, no more than its envelope says; none without the object's Geometry Offset."""
    radius = 2.0
    corner = radius * np.array([(1, 0, 0), (0, 1, 0), (0, 0, 1)], float)
    triangles = np.stack([corner * [x, y, z] for x in (1, -1) for y in (1, -1) for z in (1, -1)])
    area = np.full(8, np.sqrt(3.0) / 2 * radius**2)
    ball = Surface(triangles, triangles / radius, area, np.zeros((8, 3, 2)), np.zeros(8, int), 1.0, 1.0)
    place, normal, _, lift, *_ = ball.cells(64)
    reach = np.linalg.norm(place, axis=2)
    assert normal == pytest.approx(place / reach[..., None], abs=1e-6)
    assert lift == pytest.approx((radius**2 - reach**2) / reach, abs=1e-9)
    assert (replace(ball, normals=-ball.normals).cells(64)[3] < lift + 1e-9).all()
    assert not replace(ball, lifted=False).cells(64)[3].any()


def test_the_points_of_a_cell_are_all_over_it():
    """A square of two triangles in 16 cells: the points of each are apart from each other, and their mean is that of
    its part of the cloud."""
    square = np.array([[(0, 0, 0), (1, 0, 0), (1, 1, 0)], [(0, 0, 0), (1, 1, 0), (0, 1, 0)]], float)
    up = np.broadcast_to((0.0, 0.0, 1.0), (2, 3, 3))
    flat = Surface(square, up, np.full(2, 0.5), np.zeros((2, 3, 2)), np.zeros(2, int), 1.0, 1.0)
    place, *_, (cloud, _, cell) = flat.cells(16)
    for k, count in enumerate(np.bincount(cell)):
        assert len(np.unique(place[k, 1:], axis=0)) >= min(count, place.shape[1]) - 1
    mean = np.array([cloud[cell == k].mean(axis=0) for k in range(16)])
    assert np.linalg.norm(place[:, 1:].mean(axis=1) - mean, axis=1).mean() < 0.05  # a cell is .25 wide


def test_a_face_reaches_above_its_corners_as_far_as_all_three_normals_say():
    """Of a triangle in the plane z = 0 whose normals all lean by .1 along x, the corner furthest along x is .1 times
    the width above the corners at x = 0, and they are as far below it; upright normals say 0. The same wherever a
    triangle stands in a list that is cut in pieces."""
    places = np.array([(0, 0, 0), (2, 0, 0), (0, 1, 0)], float)
    lean = np.array([0.1, 0.0, np.sqrt(0.99)])
    one = normal_envelope(places, np.tile(lean, (3, 1)), np.array([[0, 1, 2]]))
    assert one == pytest.approx(np.array([(0.2, 0.0), (0.0, 0.2), (0.2, 0.0)]), abs=1e-7)
    assert not normal_envelope(places, np.tile([0.0, 0.0, 1.0], (3, 1)), np.array([[0, 1, 2]])).any()
    mixed = np.array([lean, (0, 0, 1), lean])
    assert not normal_envelope(places, mixed, np.array([[0, 1, 2]])).any()
    many = AT_ONCE + 1
    long = normal_envelope(np.tile(places, (many, 1)), np.tile(lean, (3 * many, 1)), np.arange(3 * many).reshape(-1, 3))
    assert (long.reshape(many, 3, 2) == one).all()
