"""Errors for scenes that cannot be rendered at all; everything less becomes a Note."""


class UnsupportedScene(ValueError):
    """The scene cannot be drawn; the message is a sentence for the artist that names the thing and the remedy."""


def unforeseen(error: Exception) -> str:
    """The sentence for an error of Candela's own, whose traceback is printed."""
    return f"{type(error).__name__}: {error}. This is an error in Candela, whose details the console holds: report it."
