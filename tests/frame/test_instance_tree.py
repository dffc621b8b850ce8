"""Instances below an upper tree: rays meet what they meet where all is expanded, and what brute force finds."""

import numpy as np
import pytest

from addon.gfx import images, passes
from addon.gfx.library import Program
from addon.scene import acceleration
from addon.scene.acceleration import Tree, Trees
from addon.scene.instance_tree import Copies, inverses, parted
from addon.scene.traced_triangles import FRONT_ALONE, _cofactors, _packed_normals
from addon.snapshot.scene import Instance

RAYS, OPAQUE = 2048, 2047 * 2049
ORIGIN = np.array([10.0, -20.0, 5.0])
MAIN = """
#include "trace/bundle.glsl"
void main()
{
  int ray = int(gl_GlobalInvocationID.x);
  if (ray >= RAYS) {
    return;
  }
  vec3 origin = sent_fetch(ivec2(0, ray)).xyz;
  vec3 direction = sent_fetch(ivec2(1, ray)).xyz;
  ivec2 hit;
  float t = trace_nearest(origin, direction, 1e30, 0u, hit);
  vec4 no_ray = vec4(direction, 1e-9);
  mat4 rays = mat4(vec4(direction, t * 0.999), vec4(direction, t * 1.001), no_ray, no_ray);
  uint clear = clear_bundle(origin, rays, 3u);
  vec4 facts = vec4(t, -1.0, -1.0, float(clear));
  vec4 normal = vec4(0.0);
  vec4 shading = vec4(0.0);
  vec4 emitted = vec4(0.0);
  if (hit.x >= 0) {
    vec3 position = origin + t * direction;
    facts.y = float(triangle_material(hit));
    emitted.rgb = triangle_emission(hit, direction, normal.xyz);
    emitted.w = triangle_place(hit, position).x;
    shading.xyz = triangle_shading_normal(hit, position);
    normal.w = triangle_place(hit, position).y;
#ifdef INSTANCED
    if (HIT_RECORD(hit) != 0) {
      facts.z = node_texel(HIT_RECORD(hit) * NODE_TEXELS + 3).y;
    }
#endif
  }
  imageStore(found, ivec2(0, ray), facts);
  imageStore(found, ivec2(1, ray), normal);
  imageStore(found, ivec2(2, ray), shading);
  imageStore(found, ivec2(3, ray), emitted);
}
"""
PROGRAM = Program(
    name="rays among instances",
    compute="generated/main",
    textures=(*acceleration.HIERARCHY_TEXTURES, ("RGBA32F", "sent")),
    images=(("found", "RGBA32F", "FLOAT_2D", "WRITE"),),
    snippets=(("generated/main", MAIN),),
    defines=(("RAYS", str(RAYS)),),
    group=(64, 1, 1),
)


def turned(rng) -> np.ndarray:
    return np.linalg.qr(rng.normal(size=(3, 3)))[0]


def matrices(rng, kind: str, count: int) -> list[np.ndarray]:
    """Where instances stand, within a few metres of ORIGIN, by how they are scaled."""
    found = []
    for _ in range(count):
        matrix = np.eye(4)
        scales = {
            "rigid": np.ones(3), "stretched": rng.uniform(0.2, 3.0, 3), "flat": np.array([1.0, 1.0, 1e-3]),
            "mirrored": rng.uniform(0.3, 1.0, 3) * (-1, 1, 1), "tiny": np.full(3, 1e-4), "huge": np.full(3, 1e5),
        }[kind]  # fmt: skip
        matrix[:3, :3] = turned(rng) @ np.diag(scales) @ turned(rng)
        spread = {"tiny": 2e-4, "huge": 2e5}.get(kind, 3.0)
        matrix[:3, 3] = ORIGIN + rng.uniform(-spread, spread, 3)
        found.append(matrix)
    return found


def soup(rng, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Triangles of a mesh, (T, 3, 3), their looks but for normals, and normals of their corners."""
    corners = rng.uniform(-1, 1, (count, 1, 3)) + rng.uniform(-0.2, 0.2, (count, 3, 3))
    look = np.zeros((count, 8))
    look[:, 0], look[:, 1:4] = OPAQUE, rng.uniform(0.1, 1, (count, 3))
    look[:, 4] = np.arange(count) + rng.choice([0.0, FRONT_ALONE, -FRONT_ALONE], count)
    return corners.astype(np.float32), look, rng.normal(size=(count, 3, 3))


def expanded(matrix: np.ndarray, mesh) -> tuple[np.ndarray, np.ndarray]:
    """Triangles and looks of an instance in world space."""
    corners, look, normals = mesh
    world = corners.astype(float) @ matrix[:3, :3].T + (matrix[:3, 3] - ORIGIN)
    look = look.copy()
    look[:, 5:] = _packed_normals(normals @ _cofactors(matrix[None, :3, :3])[0].T)
    if np.linalg.det(matrix[:3, :3]) < 0:
        number = np.rint(look[:, 4])
        look[:, 4] = 2 * number - look[:, 4]  # the other side emits
    return world.astype(np.float32), look


def together(meshes, placed, world) -> Trees:
    """An upper tree over all instances in `placed` (mesh, matrices), beside triangles of world space."""
    copies, number = [], 0
    for mesh, some in zip(meshes, placed):
        corners, look, normals = mesh
        look = look.copy()
        look[:, 5:] = _packed_normals(normals)
        tree = Tree(corners, look)
        instances = [Instance("thing", "mesh", matrix, (0,)) for matrix in some]
        copies.append(Copies(tree, instances, list(range(number, number + len(some))), *tree.boxes.around(64)))
        number += len(some)
    return Trees(Tree(*world), copies=copies, origin=ORIGIN)


def followed(trees: Trees, origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """(RAYS, 4, 4) what the program finds."""
    found = images.create(4, RAYS, "RGBA32F")
    rays = np.zeros((RAYS, 2, 4), np.float32)
    rays[:, 0, :3], rays[:, 1, :3] = origins, directions
    textures = {**trees.hierarchy.textures, "sent": images.upload(rays)}
    passes.compute(PROGRAM, (RAYS, 1), textures=textures, images={"found": found})
    return images.read(found)


def brute_force(corners: np.ndarray, origins: np.ndarray, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Nearest distance of each ray, inf where it meets nothing, and which triangle that is, in float64."""
    corners = corners.astype(float)
    e1, e2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    best, which = np.full(len(origins), np.inf), np.full(len(origins), -1)
    for k in range(len(origins)):
        o, d = origins[k].astype(float), directions[k].astype(float)
        p = np.cross(d, e2)
        det = (e1 * p).sum(1)
        det = np.where(det == 0, np.nan, det)
        s = o - corners[:, 0]
        q = np.cross(s, e1)
        u, v, t = (s * p).sum(1) / det, (q @ d) / det, (e2 * q).sum(1) / det
        t = np.where((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 0), t, np.inf)
        which[k] = np.argmin(t)
        best[k] = t[which[k]]
    return best, which


@pytest.mark.parametrize("kind", ["rigid", "stretched", "flat", "mirrored", "tiny", "huge"])
def test_rays_meet_what_they_meet_where_all_is_expanded(gpu_context, kind):
    rng = np.random.default_rng(11)
    meshes = [soup(rng, 60), soup(rng, 3)]
    placed = [matrices(rng, kind, 12), matrices(rng, kind, 5)]
    size = {"tiny": 1e-4, "huge": 1e5}.get(kind, 1.0)
    around = expanded(np.diag([size, size, size, 1.0]) + np.pad(ORIGIN[:, None], ((0, 1), (3, 0))), soup(rng, 20))
    parts = [expanded(matrix, mesh) for mesh, some in zip(meshes, placed) for matrix in some]
    corners, look = (np.concatenate([part[k] for part in (*parts, around)]) for k in (0, 1))
    owner = np.repeat(np.arange(17), [60] * 12 + [3] * 5)
    trees, flat = together(meshes, placed, around), acceleration.build(corners, look)
    assert trees.hierarchy.leaves.defines == acceleration.INSTANCED and not flat.hierarchy.leaves.defines
    origins = (size * rng.uniform(-3, 3, (RAYS, 3))).astype(np.float32)
    aims = corners[rng.integers(len(corners), size=RAYS)].mean(axis=1) + size * rng.normal(size=(RAYS, 3)) * 0.05
    directions = aims - origins
    directions = (directions / np.linalg.norm(directions, axis=1, keepdims=True)).astype(np.float32)
    found, known = followed(trees, origins, directions), followed(flat, origins, directions)
    met, triangle = brute_force(corners, origins, directions)
    # A ray along an edge may pass on either side of it: one in some thousands.
    agree = np.where(
        np.isfinite(met), np.abs(found[:, 0, 0] / np.where(np.isfinite(met), met, 1) - 1) < 2e-4, found[:, 0, 0] == 1e30
    )
    assert agree.mean() > 0.998
    flat_agree = np.isclose(found[:, 0, 0], known[:, 0, 0], rtol=2e-4)
    assert flat_agree.mean() > 0.998
    hit = flat_agree & (known[:, 0, 0] < 1e29) & agree
    assert hit.mean() > 0.3
    same = hit & (found[:, 0, 1] == known[:, 0, 1])
    assert same.sum() > 0.998 * hit.sum()
    shown_by = np.append(owner, np.full(20, -1))[triangle]
    assert (found[same, 0, 2] == shown_by[same]).mean() > 0.998  # the instance
    # Bundles: a ray that ends before, one behind. Along an edge a driver may have either (one of 769 by Vulkan).
    assert (found[same, 0, 3] == known[same, 0, 3]).mean() > 0.998
    assert np.mean(found[same, 0, 3] == 1) > 0.99
    assert np.abs(found[same, 1, :3] - known[same, 1, :3]).max() < 1e-3  # normal
    turn = (found[same, 2, :3] * known[same, 2, :3]).sum(axis=1)
    assert np.quantile(turn, 0.002) > 0.999 or kind == "flat"  # 12 bits before the turn, not after
    assert np.quantile(np.abs(found[same][:, [1, 3], 3] - known[same][:, [1, 3], 3]), 0.998) < 1e-2  # place
    assert (found[same, 3, :3] == known[same, 3, :3]).all(axis=1).mean() > 0.998  # emission, and to which side
    assert (known[same, 3, 0] == 0).any() and (known[same, 3, 0] > 0).any()


def test_moved_instances_are_met_where_they_are(gpu_context):
    rng = np.random.default_rng(12)
    mesh = soup(rng, 40)
    placed = matrices(rng, "stretched", 300)
    nothing = np.zeros((0, 3, 3), np.float32), np.zeros((0, 8))
    trees = together([mesh], [placed], nothing)
    for k in (3, 170, 299):
        placed[k] = placed[k].copy()
        placed[k][:3, 3] += rng.uniform(-4, 4, 3)
    changed = {k: Instance("thing", "mesh", placed[k], (0,)) for k in (3, 170, 299)}
    before = trees.hierarchy.nodes
    assert trees.move(np.zeros(0, int), nothing, changed) and trees.hierarchy.nodes is before
    origins = rng.uniform(-4, 4, (RAYS, 3)).astype(np.float32)
    directions = rng.normal(size=(RAYS, 3))
    directions = (directions / np.linalg.norm(directions, axis=1, keepdims=True)).astype(np.float32)
    fresh = together([mesh], [placed], nothing)
    moved, anew = followed(trees, origins, directions), followed(fresh, origins, directions)
    assert np.isclose(moved[:, 0, 0], anew[:, 0, 0], rtol=1e-4).mean() > 0.999
    assert np.isin(moved[:, 0, 2], (3, 170, 299)).sum() > 3
    assert trees.upper.boxes.cost() > trees.upper.cost
    flat = np.diag([1.0, 1.0, 0.0, 1.0])
    assert not trees.move(np.zeros(0, int), nothing, {5: Instance("thing", "mesh", flat, (0,))})


def test_which_instances_have_a_way_back():
    def one(*scales):
        return Instance("thing", "mesh", np.diag([*scales, 1.0]), (0,))

    some = [one(1, 1, 1), one(1, 1, 0), one(0, 0, 0), one(1e-4, 1e-4, 1e-4), one(1e5, -1e5, 1e5), one(1, 1, 1e-3)]
    assert inverses([*some, one(1, 1, 1e-6), one(1, np.nan, 1)]).tolist() == [
        True, False, False, True, True, True, False, False,
    ]  # fmt: skip


class Counted:
    def __init__(self, triangles):
        self.triangle_count = triangles


def test_meshes_have_trees_of_their_own_where_that_saves_many_triangles():
    many = [Instance("tree", "tree", np.eye(4), (0,), pass_index=k % 2) for k in range(400)]
    flat = [Instance("sheet", "tree", np.diag([1, 1, 0, 1.0]), (0,))]
    few = [Instance("stone", "stone", np.eye(4), (0,)) for _ in range(50)]
    meshes = {"tree": Counted(10_000), "stone": Counted(100)}
    expanded, kinds = parted([*few, *many, *flat], meshes, lambda one: one.pass_index, 4_000_000)
    assert expanded == [*few, *flat]
    assert {kind: len(own) for kind, own in kinds.items()} == {0: 200, 1: 200} and kinds[0][:2] == [50, 52]
    assert parted(few, meshes, lambda one: 0, 4_000_000) == (few, {})
    # Where that would be too many, the small ones share trees, too.
    expanded, kinds = parted(few, meshes, lambda one: 0, 4000)
    assert not expanded and len(kinds[0]) == 50
