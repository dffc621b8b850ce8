"""Errors for scenes that cannot be rendered at all; everything less becomes a Note."""

import sys
import textwrap
import traceback

from .scene import one_line


class UnsupportedScene(ValueError):
    """The scene cannot be drawn; the message is a sentence for the artist that names the thing and the remedy."""


def unforeseen(error: Exception) -> str:
    """Print the traceback of an error of Candela's own that is being handled, and return a sentence about it.

    The traceback is indented: it may hold names of the file with ends of lines in them, and farms take lines that begin
    with `openjd_` for commands.
    """
    print(textwrap.indent(traceback.format_exc(), "  "), end="", file=sys.stderr, flush=True)
    said = f"{type(error).__name__}: {error}. This is an error in Candela, whose details the console holds: report it."
    return one_line(said)
