"""Damaged OpenVDB files are refused before OpenVDB reads them; whole ones are walked to where their voxels begin."""

import struct

import pytest

from addon.snapshot import vdb_header
from addon.snapshot.volumes import openvdb

MATRIX = [[1, 0.5, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [3, 0, 0, 1]]
MAPS = {
    "affine": lambda vdb: vdb.createLinearTransform(MATRIX),
    "uniform scale": lambda vdb: vdb.createLinearTransform(0.5),
    "scale and shift": lambda vdb: vdb.createLinearTransform([[1, 0, 0, 0], [0, 2, 0, 0], [0, 0, 1, 0], [3, 0, 0, 1]]),
    "frustum": lambda vdb: vdb.createFrustumTransform((0, 0, 0), (10, 10, 10), 0.5, 2.0),
}


def written(path, grid) -> bytes:
    openvdb().write(str(path), [grid])
    return path.read_bytes()


def cloud():
    """A grid with a tile of the root, tiles below it and two leaves of voxels."""
    grid = openvdb().FloatGrid()
    grid.name = "density"
    grid.fill((8192, 0, 0), (12287, 4095, 4095), 1.0)
    grid.fill((512, 0, 0), (639, 127, 127), 1.0)
    grid.fill((4, 0, 0), (12, 6, 6), 0.5)
    return grid


def offsets_at(data: bytes) -> int:
    """Where the first grid's three offsets stand: behind its name, its type and an empty name."""
    at = data.index(b"Tree_")
    (length,) = struct.unpack_from("<I", data, at - 4)
    return at + length + 4


def tree_at(data: bytes, length: int, name: bytes = b"UniformScaleMap") -> int:
    """Where the tree begins: behind the map's name and its bytes."""
    return data.rindex(name) + len(name) + length


def cut(data: bytes, length: int) -> bytes:
    """The file as if its only grid ended there."""
    made = bytearray(data[:length])
    struct.pack_into("<q", made, offsets_at(data) + 16, length)
    return bytes(made)


def check_cut_at_voxels(path, grid):
    """What is not refused is all before the voxels and, for each leaf, its mask and a flag; of yes and no 140 bytes."""
    data = written(path, grid)
    vdb_header.check(path)
    _, voxels, _ = struct.unpack_from("<qqq", data, offsets_at(data))
    least = voxels + (140 if type(grid).__name__ == "BoolGrid" else 65) * grid.leafCount()
    path.write_bytes(cut(data, least))
    vdb_header.check(path)
    path.write_bytes(cut(data, least - 1))
    with pytest.raises(ValueError, match="before its end" if grid.leafCount() else "beyond its end"):
        vdb_header.check(path)


@pytest.mark.parametrize("half", (False, True))
@pytest.mark.parametrize("kind", ("Float", "Double", "Bool", "Int32", "Int64", "Vec3S", "Vec3I", "Vec3D"))
def test_trees_of_each_type_are_walked_to_their_voxels(tmp_path, kind, half):
    grid = getattr(openvdb(), kind + "Grid")()
    value = (1, 2, 3) if "Vec" in kind else kind == "Bool" or 2
    for low, high in (((8192, 0, 0), (12287, 4095, 4095)), ((512, 0, 0), (639, 127, 127)), ((0, 0, 0), (20, 9, 9))):
        grid.fill(low, high, value)
    grid.saveFloatAsHalf = half
    assert grid.leafCount()
    check_cut_at_voxels(tmp_path / "a.vdb", grid)


@pytest.mark.parametrize("kind", MAPS)
def test_trees_behind_each_map_are_walked_to_their_voxels(tmp_path, kind):
    grid = cloud()
    grid.transform = MAPS[kind](openvdb())
    check_cut_at_voxels(tmp_path / "a.vdb", grid)


def test_level_sets_are_walked_to_their_voxels(tmp_path):
    """Their inactive values are of two kinds, inside and outside."""
    check_cut_at_voxels(tmp_path / "a.vdb", openvdb().createLevelSetSphere(radius=12.0, voxelSize=1.0))


def test_several_grids_are_accepted(tmp_path):
    path, grids = tmp_path / "a.vdb", [cloud(), cloud()]
    grids.append(grids[0].copy())
    openvdb().write(str(path), grids)
    vdb_header.check(path)


def _shifted(data):
    at = tree_at(data, 16)
    return data[:at] + bytes([0xF0]) * 16 + data[at:]


def _patched(form, place, *values):
    def make(data):
        made = bytearray(data)
        struct.pack_into(form, made, place(data), *values)
        return bytes(made)

    return make


def _one_more_leaf(data):
    """One more bit of the children of the node above the leaves, and a mask for it."""
    made = bytearray(data)
    at = struct.unpack_from("<qqq", data, offsets_at(data))[1] - 2 * 64
    upper = tree_at(data, 136 + 17 + 12)
    (packed,) = struct.unpack_from("<q", data, upper + 2 * 4096 + 1)
    made[upper + 2 * 4096 + 9 + packed + 511] |= 0x80
    made[at:at] = bytes(64)
    for place, behind in ((offsets_at(data) + 8, 64), (offsets_at(data) + 16, 64)):
        struct.pack_into("<q", made, place, struct.unpack_from("<q", data, place)[0] + behind)
    return bytes(made)


def _count_of_grids(data):
    return offsets_at(data) - len(b"Tree_float_5_4_3") - 4 - 4 - 4 - len(b"density") - 4


DAMAGES = {
    "bytes within the map": (_shifted, "buffers"),
    "a map that there is not": (lambda data: data.replace(b"UniformScaleMap", b"UniformScaleMaq"), "kind"),
    "buffers": (_patched("<i", lambda data: tree_at(data, 120), 2), "2 buffers"),
    "tiles": (_patched("<I", lambda data: tree_at(data, 128), 2**31), "beyond its end"),
    "children": (_patched("<I", lambda data: tree_at(data, 132), 2**31), "damaged"),
    "children of a node": (_patched("<I", lambda data: tree_at(data, 136 + 17 + 12 + 64), 2**32 - 1), "damaged"),
    "a value's length": (lambda data: data.replace(b"int64\x08\0\0\0", b"int64\x09\0\0\0", 1), "int64 has 9 bytes"),
    "leaves in a list": (
        _patched("<I", lambda data: data.index(b"__delayedload") + len(b"__delayedload") + 4, 2**32 - 1),
        "more leaves",
    ),
    "leaves that no list has": (_one_more_leaf, "a grid has 3 leaves, and lists 2"),
    "a leaf's length": (
        _patched("<q", lambda data: data.index(b"__delayedload") + len(b"__delayedload") + 18, 2**40),
        "a leaf that goes beyond",
    ),
    "a list of leaves": (
        _patched("<I", lambda data: data.index(b"__delayedload") + len(b"__delayedload"), 6),
        "longer than it says",
    ),
    "a grid that goes on with itself": (
        lambda data: _patched("<q", lambda _: offsets_at(data) + 16, _count_of_grids(data) + 4)(
            _patched("<I", _count_of_grids, 2**31 - 1)(data)
        ),
        "one behind the other",
    ),
    "no offsets where there are": (_patched("<?", lambda data: 20, False), "one behind the other"),
}


@pytest.mark.parametrize("what", DAMAGES)
def test_damage_that_openvdb_would_believe_is_refused(tmp_path, what):
    path, (damage, said) = tmp_path / "a.vdb", DAMAGES[what]
    data = written(path, cloud())
    made = damage(data)
    assert made != data
    path.write_bytes(made)
    with pytest.raises(ValueError, match=said):
        vdb_header.check(path)
