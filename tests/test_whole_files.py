"""Files that are there whole or not at all."""

import os
import time

import pytest

from addon.whole_files import ABANDONED_S, WRITING, replacing


@pytest.mark.parametrize("mask", [0o022, 0o077, 0o002])
def test_a_file_has_the_permissions_of_any_new_file_of_the_user(mask, tmp_path):
    before = os.umask(mask)
    try:
        with replacing(tmp_path / "new" / "a") as file:
            file.write(b"whole")
    finally:
        os.umask(before)
    path = tmp_path / "new" / "a"
    assert path.read_bytes() == b"whole" and path.stat().st_mode & 0o777 == 0o666 & ~mask


@pytest.mark.parametrize("error", [OSError, MemoryError, KeyboardInterrupt])
def test_whatever_is_raised_the_old_file_stays_and_nothing_else(error, tmp_path):
    path = tmp_path / "a"
    path.write_bytes(b"old")
    with pytest.raises(error), replacing(path) as file:
        file.write(b"half")
        raise error
    assert path.read_bytes() == b"old" and [*tmp_path.iterdir()] == [path]


def test_what_was_abandoned_long_ago_is_deleted_and_nothing_of_others(tmp_path):
    old = time.time() - 2 * ABANDONED_S
    for name in (f"{WRITING}then", f"{WRITING}now", ".writing_mine"):
        (tmp_path / name).write_bytes(b"x")
    for name in (f"{WRITING}then", ".writing_mine"):
        os.utime(tmp_path / name, (old, old))
    (tmp_path / f"{WRITING}folder").mkdir()
    os.utime(tmp_path / f"{WRITING}folder", (old, old))
    with replacing(tmp_path / "a"):
        pass
    assert sorted(one.name for one in tmp_path.iterdir()) == [
        f"{WRITING}folder", f"{WRITING}now", ".writing_mine", "a",
    ]  # fmt: skip
