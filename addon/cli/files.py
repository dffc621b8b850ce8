"""Input and output files: checked before anything is rendered, and never left incomplete."""

from __future__ import annotations

import contextlib
import functools
import hashlib
import os
import platform
import shutil
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from .refused import Refused, reason

WRITING = ".writing_"  # how the names of folders begin whose files are not in place yet
ABANDONED_S = 7 * 24 * 3600.0  # no picture takes so long of which nothing is written meanwhile
BOOT = Path("/proc/sys/kernel/random/boot_id")
MOST_MARKED = 1 << 16  # letters of a file in which its mark stands
BLEND_STARTS = (b"BLENDER", b"\x28\xb5\x2f\xfd", b"\x1f\x8b")  # plain, compressed by zstd, by gzip (before 3.0)


def refuse_blend(path: Path) -> None:
    """Raise Refused unless the file can be read and begins as a .blend file does."""
    try:
        if path.is_dir():
            raise Refused(f"{path} is a folder, not a .blend file.")
        if path.exists() and not path.is_file():  # to open a pipe would wait
            raise Refused(f"{path} is not a .blend file.")
        with path.open("rb") as file:
            start = file.read(max(map(len, BLEND_STARTS)))
    except FileNotFoundError:
        raise Refused(f"There is no file {path}.") from None
    except OSError as error:
        raise Refused(f"{path} could not be read: {error.strerror}.") from None
    if not start.startswith(BLEND_STARTS):
        raise Refused(f"{path} is not a .blend file.")


def output(path: Path, folder: bool) -> Path:
    """The path with links followed, when it can be written. Raises Refused before anything is rendered."""
    try:
        path = path.resolve()
        if path.exists() and path.is_dir() != folder:
            raise Refused(f"{path} is a {'file' if folder else 'folder'}, and cannot be written as output.")
        place = next(
            (parent for parent in (path, *path.parents) if _stands(parent) and (folder or parent != path)), None
        )
        if place is None:  # a drive that is not there
            raise Refused(f"{path} cannot be written: there is no {path.anchor or 'such folder'}.")
        for thing in (path, place, *([path / "index.html"] if folder else [])):
            if _stands(thing) and not thing.stat().st_mode & 0o222:  # meant to stay, also when the user is root
                raise Refused(f"{path} cannot be written: {thing} is write-protected.")
        with tempfile.TemporaryFile(dir=place):
            pass
    except (OSError, RuntimeError) as error:
        raise Refused(f"{path} cannot be written: {getattr(error, 'strerror', None) or error}.") from None
    return path


def refuse_others(folder: Path, marks: dict[str, tuple[tuple[str, ...], ...]], beside: tuple[str, ...] = ()) -> None:
    """Raise Refused where a file of one of these names stands in the folder and holds none of the marks that those have
    which Candela writes (a mark is there where all of its strings are); of the names `beside`, which bear no mark,
    where none of the marked ones stands."""
    for name, known in marks.items():
        place, text = folder / name, ""
        if not place.exists():
            continue
        if place.is_file():  # to open a pipe would wait
            with place.open(encoding="utf-8", errors="replace") as file:
                text = file.read(MOST_MARKED)
        if not any(all(part in text for part in mark) for mark in known):
            raise Refused(f"{place} was not written by Candela and is not replaced; choose another folder.")
    for name in beside:
        if (folder / name).exists() and not any((folder / one).exists() for one in marks):
            raise Refused(f"{folder / name} was there before and is not replaced; choose another folder.")


def _stands(path: Path) -> bool:
    """As Path.exists, but a name that no file can have is an OSError."""
    try:
        path.stat()
    except FileNotFoundError:
        return False
    return True


def clear_abandoned(folder: Path) -> None:
    """Delete what processes were writing there when they were killed: of this machine, as long as it is not started
    anew, at once; of any other, which cannot be asked, what has not been written to for a week."""
    for place in folder.glob(f"{WRITING}*_*_*"):
        machine, pid, _ = place.name.removeprefix(WRITING).split("_", 2)
        if not pid.isdigit() or place.is_symlink() or not place.is_dir():  # not of this kind
            continue
        # To ask elsewhere than on POSIX would end the process.
        asked = os.name == "posix" and machine == _machine()
        if not _lives(int(pid)) if asked else _idle_s(place) > ABANDONED_S:
            shutil.rmtree(place, ignore_errors=True)


def _idle_s(folder: Path) -> float:
    """Since something in the folder was written; 0 where that cannot be told."""
    try:
        return time.time() - max(one.lstat().st_mtime for one in (folder, *folder.rglob("*")))
    except OSError:
        return 0.0


def _lives(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True
    return True


@functools.cache
def _machine() -> str:
    """Of all processes whose numbers mean the same: this machine since it was started, or this container of it.
    Machines of a farm may share their name, and all have the same first space of numbers."""
    told = [platform.node()]
    with contextlib.suppress(OSError):
        told += [str(Path("/proc/self/ns/pid").readlink()), BOOT.read_text(encoding="ascii")]
    return hashlib.blake2b(" ".join(told).encode(), digest_size=4).hexdigest()


@contextlib.contextmanager
def placed_in(folder: Path, last: str = "") -> Iterator[Path]:
    """A temporary folder, whose files are moved into `folder` at the end, that of the name `last` after all others.

    Raises Refused; then nothing is left.
    """
    made = [place for place in (folder, *folder.parents) if not place.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        clear_abandoned(folder)
        with tempfile.TemporaryDirectory(prefix=f"{WRITING}{_machine()}_{os.getpid()}_", dir=folder) as place:
            yield Path(place)
            found = sorted(file for file in Path(place).rglob("*") if file.is_file())
            for file in sorted(found, key=lambda file: file.name == last):
                final = folder / file.relative_to(place)
                final.parent.mkdir(parents=True, exist_ok=True)
                file.replace(final)
    except BaseException as error:
        for place in made:
            with contextlib.suppress(OSError):
                place.rmdir()
        if isinstance(error, OSError | RuntimeError):
            why = getattr(error, "strerror", None) or reason(error)
            raise Refused(f"{folder} could not be written: {why}.") from None
        raise
