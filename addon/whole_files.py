"""Files that are there whole or not at all: written under another name, then renamed."""

from __future__ import annotations

import contextlib
import secrets
import stat
import time
import tokenize
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

WRITING = ".writing_candela_"  # how names of files begin that some process is writing
ABANDONED_S = 24 * 3600.0  # what was not written to for so long belongs to a process that was ended
# What reading a damaged zip of arrays raises, from its table, its packed bytes, or the head of an array.
DAMAGED = (
    zipfile.BadZipFile, zlib.error, ValueError, EOFError, KeyError, NotImplementedError, RuntimeError, MemoryError,
    OSError, TypeError, tokenize.TokenError,
)  # fmt: skip


@contextlib.contextmanager
def replacing(path: Path, suffix: str = "") -> Iterator[BinaryIO]:
    """A file to be written, which takes the place of `path` at the end, with the permissions of any new file of this
    user (mkstemp would let only the owner read). Whatever is raised meanwhile, nothing is left of it, and `path` stays
    as it was. Its folder is made; what was abandoned there is deleted. OSError where that fails.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    clear_abandoned(path.parent)
    unfinished = path.with_name(f"{WRITING}{secrets.token_hex(8)}{suffix}")  # a name that nobody can foresee
    try:
        with unfinished.open("xb") as file:
            yield file
        unfinished.replace(path)
    except BaseException:
        with contextlib.suppress(OSError):
            unfinished.unlink()
        raise


def clear_abandoned(folder: Path) -> None:
    """Delete the files of a folder that processes were writing which must have ended long ago."""
    for path in folder.glob(f"{WRITING}*"):
        with contextlib.suppress(OSError):
            about = path.lstat()
            if stat.S_ISREG(about.st_mode) and time.time() - about.st_mtime > ABANDONED_S:
                path.unlink()
