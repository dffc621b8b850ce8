"""Where values of surfaces that the view layer asks for (snapshot.scene.Aov) stand in images of the frame."""

from __future__ import annotations

from collections.abc import Sequence

from ..snapshot.scene import Aov

CHANNELS = 4  # values that share an image


def places(aovs: Sequence[Aov]) -> list[tuple[str, int]]:
    """Image and first channel of each: colours and UV have one of their own, numbers four together."""
    found, colors, values = [], 0, 0
    for aov in aovs:
        if aov.kind == "VALUE":
            found.append((f"aov.values.{values // CHANNELS}", values % CHANNELS))
            values += 1
        elif aov.kind == "UV":
            found.append(("aov.uv", 0))
        else:
            found.append((f"aov.color.{colors}", 0))
            colors += 1
    return found
