"""Files that come in and go out: refused in a sentence before anything is rendered, and never half-written."""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Iterator
from pathlib import Path

from .refused import Refused, reason

BLEND_STARTS = (b"BLENDER", b"\x28\xb5\x2f\xfd", b"\x1f\x8b")  # plain, compressed by zstd, by gzip (before 3.0)


def refuse_blend(path: Path) -> None:
    """Raise Refused unless the file can be read and begins as a .blend file does."""
    try:
        if path.is_dir():
            raise Refused(f"{path} is a folder, not a .blend file.")
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


def _stands(path: Path) -> bool:
    """As Path.exists, but a name that no file can have is an OSError."""
    try:
        path.stat()
    except FileNotFoundError:
        return False
    return True


@contextlib.contextmanager
def placed_in(folder: Path, last: str = "") -> Iterator[Path]:
    """A temporary folder, whose files are moved into `folder` at the end, that of the name `last` after all others.

    Raises Refused; then nothing is left.
    """
    made = [place for place in (folder, *folder.parents) if not place.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".writing_", dir=folder) as place:
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
