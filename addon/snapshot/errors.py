"""What the snapshot raises when there is no picture to draw at all; everything less becomes a Note."""


class UnsupportedScene(ValueError):
    """The scene cannot be drawn; the message is a sentence for the artist that names the thing and the remedy."""
