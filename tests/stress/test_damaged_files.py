"""Files that are damaged at random: each is read or refused in a sentence, within bounds of memory and time.

CANDELA_FUZZ=2000 tries that many of each kind; CANDELA_FUZZ_SEED=N others than usual.
"""

import json
import os
import struct
import threading
import time
import tracemalloc
import zipfile
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest

from addon.cli.refused import Refused
from addon.cli.slices import read_header, read_sums
from addon.compare import cache
from addon.compare.exr_write import read_about, write_exr
from addon.gfx import device
from addon.grass import patch
from addon.materials import ies
from addon.materials.reader import _profile
from addon.snapshot import own_settings, vdb_header
from addon.snapshot.exr import ExrError, read_exr
from addon.snapshot.scene import one_line
from addon.snapshot.volumes import openvdb

COUNT, SEED = int(os.environ.get("CANDELA_FUZZ", "100")), int(os.environ.get("CANDELA_FUZZ_SEED", "17"))
MOST_BYTES, MOST_SECONDS = 200 << 20, 2.0  # for one file of some kilobytes
PROFILE = """IESNA:LM-63-2002
TILT=NONE
1 1000 1 5 4 1 2 0 0 0
1 1 100
0 45 90 135 180
0 90 180 270
1 2 3 4 5 1 2 3 4 5 1 2 3 4 5 1 2 3 4 5
"""

HEADER = {
    "file": "/elsewhere/scene.blend", "scene_hash": "abc123", "settings_hash": "", "blender": "", "frame": 1,
    "total": 2, "first": 0, "count": 1, "layers": ["A"],
    "options": {"size": None, "scene": "S", "view_layer": None, "assignments": []},
}  # fmt: skip


def damaged(data: bytes, count: int):
    """The data cut, with bytes of chance, with runs of one byte, with extreme numbers, or with parts twice."""
    chance = np.random.default_rng(SEED)
    extremes = [struct.pack("<i", value) for value in (-1, 0, 2**31 - 1, -(2**31), 65536)] + [b"1e999", b"nan", b"-1 "]
    for _ in range(count):
        made = bytearray(data)
        for _ in range(int(chance.integers(1, 6))):
            at = int(chance.integers(0, max(len(made), 1)))
            what = int(chance.integers(0, 5))
            if what == 0:
                del made[at:]
            elif what == 1:
                made[at : at + 4] = chance.bytes(4)
            elif what == 2:
                made[at : at + 16] = bytes([int(chance.integers(0, 256))]) * 16
            elif what == 3:
                made[at : at + 4] = extremes[int(chance.integers(0, len(extremes)))]
            else:
                made[at:at] = made[at : at + int(chance.integers(1, 200))]
        yield bytes(made)


def bounded(work) -> None:
    """Do the work and hold it to memory and time."""
    tracemalloc.start()
    started = time.process_time()
    try:
        work()
    finally:
        taken, (_, most) = time.process_time() - started, tracemalloc.get_traced_memory()
        tracemalloc.stop()
    assert most < MOST_BYTES, f"{most >> 20} MiB"
    assert taken < MOST_SECONDS, f"{taken:.1f} s"


def test_damaged_exr_files_are_refused_in_a_sentence(tmp_path):
    path = tmp_path / "a.exr"
    pixels = np.random.default_rng(1).random((40, 30, 4)).astype(np.float32)
    write_exr(path, {"A.Combined": pixels, "A.Depth": pixels[..., :1]}, {"candela": json.dumps({"file": "x"})})

    def read():
        for reader in (read_exr, read_about):
            try:
                reader(path)
            except ExrError as error:
                assert str(path) in str(error)

    for data in damaged(path.read_bytes(), COUNT):
        path.write_bytes(data)
        bounded(read)


def test_a_window_that_the_file_cannot_hold_takes_no_memory(tmp_path):
    path = tmp_path / "a.exr"
    write_exr(path, {"A": np.zeros((4, 4, 4), np.float32)}, {})
    huge = struct.pack("<4i", 0, 0, 65535, 65535)
    path.write_bytes(path.read_bytes().replace(struct.pack("<4i", 0, 0, 3, 3), huge))

    def read():
        with pytest.raises(ExrError, match="more pixels than a file of its length can hold"):
            read_exr(path)

    bounded(read)


def test_headers_of_damaged_volumes_are_refused_or_hold_what_they_name(tmp_path):
    """What passes is read by OpenVDB, which takes minutes for lengths that no file can hold."""
    path, vdb = tmp_path / "a.vdb", openvdb()
    grid = vdb.FloatGrid()
    grid.name = "density"
    grid.copyFromArray(np.random.default_rng(1).random((6, 6, 6)).astype(np.float32))
    vdb.write(str(path), [grid])

    def read():
        try:
            vdb_header.check(path)
            vdb.readAll(str(path))
        except Exception as error:  # of OpenVDB: some thirty kinds
            assert str(error)

    read()
    for data in damaged(path.read_bytes(), COUNT):
        path.write_bytes(data)
        bounded(read)


def test_damaged_references_are_as_none(tmp_path):
    """Their pictures are packed: what unpacks to nothing is no reference, and is rendered again."""
    pixels = {"combined": np.random.default_rng(1).random((20, 20, 4)).astype(np.float32)}
    cache.save(tmp_path, cache.Reference(pixels, pixels, 4, 1.0, key="a"))
    path = cache.entry(tmp_path, "a")

    def read():
        found = cache.load(tmp_path, "a")
        assert found is None or found.images["combined"].ndim

    for data in damaged(path.read_bytes(), COUNT):
        path.write_bytes(data)
        bounded(read)


HEADS = {
    "terabytes": b"{'descr': '<f4', 'fortran_order': False, 'shape': (17592186044416,)}",
    "no end": b"{'descr': (",
}


@pytest.mark.parametrize("head", HEADS.values(), ids=HEADS)
def test_arrays_whose_head_says_what_cannot_be_are_refused(head, tmp_path):
    path = cache.entry(tmp_path, "a")
    path.parent.mkdir()
    with zipfile.ZipFile(path, "w") as packed:
        packed.writestr("about.npy", np.lib.format.magic(1, 0) + struct.pack("<H", len(head)) + head)
    assert cache.load(tmp_path, "a") is None
    with pytest.raises(patch.PatchError, match=r"no grass patch, or it is damaged\.$"):
        patch.load(path)


def a_profile(path):
    node = SimpleNamespace(mode="EXTERNAL", filepath=str(path), id_data=SimpleNamespace(library=None))
    return _profile(node).text


def a_patch(path):
    with pytest.raises(patch.PatchError):
        patch.load(path)


READERS = [a_profile, lambda path: own_settings._content(str(path)), a_patch]


@pytest.mark.parametrize("read", READERS, ids=["light profile", "content of a setting", "grass"])
def test_what_a_file_names_and_is_no_file_is_not_waited_for(read, tmp_path):
    """A pipe that nobody writes to."""
    os.mkfifo(tmp_path / "pipe")
    raised = []

    def tried():
        try:
            read(tmp_path / "pipe")
        except BaseException as error:  # also that of pytest.raises
            raised.append(error)

    work = threading.Thread(target=tried, daemon=True)
    work.start()
    work.join(5.0)
    if waits := work.is_alive():
        os.close(os.open(tmp_path / "pipe", os.O_WRONLY))
    assert not waits and not raised


@pytest.mark.parametrize("read", READERS[::2], ids=["light profile", "grass"])
def test_of_a_file_of_terabytes_no_more_is_read_than_such_a_file_may_have(read, tmp_path):
    with (tmp_path / "huge").open("wb") as file:
        file.truncate(1 << 40)  # takes no room on the disk
    bounded(lambda: read(tmp_path / "huge"))


def test_damaged_light_profiles_are_read_or_said_to_be_unreadable():
    def read(text):
        pixels, said = ies.profile_pixels(ies.Profile(text))
        assert np.isfinite(pixels).all() and (pixels >= 0).all()
        assert not said or "cannot be read" in said

    read(PROFILE)
    for data in damaged(PROFILE.encode(), COUNT):
        bounded(partial(read, data.decode("latin-1")))
    ies.profile_pixels.cache_clear()


def test_damaged_figures_of_devices_are_measured_anew(tmp_path, monkeypatch):
    monkeypatch.setattr(device, "key", lambda: "this driver")
    device.write(tmp_path, device.MADE_UP["card"])
    assert device.read(tmp_path) == device.MADE_UP["card"]
    whole = (tmp_path / device.FILE).read_bytes()
    broken = [
        *damaged(whole, COUNT),
        b"[" * 100_000,
        b"null",
        b"[]",
        b'{"this driver": {"fetch": 1' + b"0" * 500 + b"}}",
    ]
    for data in broken:
        (tmp_path / device.FILE).write_bytes(data)

        def read():
            found = device.read(tmp_path)
            assert found is None or isinstance(found, device.Device)

        bounded(read)


def test_damaged_headers_of_slices_are_refused_in_a_line(tmp_path):
    path = tmp_path / "part.exr"
    pixels, whole = {"A.Combined": np.zeros((2, 2, 4), np.float32)}, json.dumps(HEADER).encode()

    def read():
        try:
            read_sums(read_header(path))
        except Refused as error:
            assert path.name in str(error)

    for data in damaged(whole, COUNT):
        write_exr(path, pixels, {"candela": data.decode("latin-1")})
        bounded(read)


def test_names_of_chance_say_one_line_to_a_farm():
    for data in damaged(b"Shot\nopenjd_fail: hacked\r\x1b[2K", COUNT):
        said = one_line(data.decode("latin-1"))
        assert said.isprintable() and len(said.splitlines()) <= 1
