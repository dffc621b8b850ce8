"""Where values of surfaces that the view layer asks for (snapshot.scene.Aov) stand in images of the frame."""

from __future__ import annotations

from collections.abc import Sequence

from ..snapshot.scene import Aov

CHANNELS = 4  # values that share an image


def places(aovs: Sequence[Aov]) -> list[tuple[str, int]]:
    """Image and first channel of each: colours, UV and Vector have one of their own, numbers four together. Vector is
    the sum over what has one, whose number HIT counts."""
    found, colors, values = [], 0, 0
    for aov in aovs:
        if aov.kind in ("VALUE", "HIT", "DISTANCE"):
            found.append((f"aov.values.{values // CHANNELS}", values % CHANNELS))
            values += 1
        elif aov.kind in ("UV", "VECTOR"):
            found.append((f"aov.{aov.kind.lower()}", 0))
        else:
            found.append((f"aov.color.{colors}", 0))
            colors += 1
    return found
