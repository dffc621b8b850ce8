"""Terminal output: progress on one line, without Blender's own messages."""

from __future__ import annotations

import contextlib
import ctypes
import io
import os
import sys
from collections.abc import Iterator
from typing import TextIO

from ..snapshot.scene import one_line

STDOUT, STDERR = 1, 2
REPORTS = ("Error:", "Warning:", "Info:")  # how Blender's reports begin; those that matter are said otherwise


def progress(terminal: TextIO, line: str) -> None:
    if terminal.isatty():
        print(f"\r\x1b[K{line}", end="", file=terminal, flush=True)


@contextlib.contextmanager
def quiet(verbose: bool = False) -> Iterator[TextIO]:
    """What Blender and the GPU driver print goes nowhere, unless `verbose`; gives the real standard error.

    Blender as a module prints its reports through Python. Whatever else Python printed comes out at the end: it is a
    script's own, or says what went wrong inside.
    """
    if verbose:
        yield sys.stderr
        return
    flush()
    kept = {descriptor: os.dup(descriptor) for descriptor in (STDOUT, STDERR)}
    nowhere, said = os.open(os.devnull, os.O_WRONLY), io.StringIO()
    try:
        for descriptor in kept:
            os.dup2(nowhere, descriptor)
        with (
            os.fdopen(kept[STDERR], "w", errors="replace", closefd=False) as terminal,
            contextlib.redirect_stdout(said),
            contextlib.redirect_stderr(said),
        ):
            yield terminal
    finally:
        flush()
        for descriptor, copy in kept.items():
            os.dup2(copy, descriptor)
            os.close(copy)
        os.close(nowhere)
        for line in said.getvalue().splitlines():
            if not line.startswith(REPORTS):  # of a report whose name holds the end of a line the rest may come here
                said_here = one_line(line)
                print(f" {said_here}" if said_here.startswith("openjd_") else said_here, file=sys.stderr, flush=True)


def flush() -> None:
    """Empty the buffers of Python and of C, so that what was printed before comes out before."""
    sys.stdout.flush()
    sys.stderr.flush()
    with contextlib.suppress(OSError, AttributeError, TypeError):  # Windows has no handle of the process's own C
        ctypes.CDLL(None).fflush(None)
