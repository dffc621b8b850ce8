"""Media: the light that fog, smoke and coloured solids absorb and scatter away, along the view and towards lights.

    T(a, b) = exp(-integral of the extinction of all media from a to b)

Beer and Lambert's law per channel, coefficients of overlapping media added. Where a medium is the same everywhere the
integral is a sum over the ray's intervals, exact; else it is a sum over up to 32 jittered steps of about a cell of its
grid (scene/media.py), another set for each pixel and sample. Intervals come from all crossings of the boundaries
(shaders/media/boundary.glsl), so that media may be nested, overlap, be of any shape, and hold the camera.

The film multiplies what each of its points sees by T from the eye (film/filter.py): emission, the world, colours and
light of surfaces alike, as Cycles' passes are. Passes that light surfaces multiply each light by T from there to the
light, direct or from other surfaces (lighting/media.py).

| cost | per film point | per light and pixel |
|---|---|---|
| passes | 1 | none of its own |
| fetches | 1, + 20 per leaf of boundaries on the ray, + 4 per step in a grid | the same |

Bias: of the exponential of a jittered sum, half its variance, at most some 1 % at 32 steps. Media behind glass and in
mirrors take nothing away but what glass itself absorbs.
"""

from __future__ import annotations

from ..frame.light_paths import IN_MEDIA
from ..frame.picture import Frame
from ..frame.settings import Settings
from ..frame.technique import Param, Technique
from ..lighting.media import AroundEye, MediaService
from ..scene.around_eye import absorbed_around_eye
from ..scene.media import Media, has_media
from ..snapshot.scene import Snapshot


class MediaAttenuation(Technique):
    name = "media"
    label = "Media"
    params = (
        Param(
            "resolution", "Resolution", 96,
            "Grid cells along the longest side of a volume whose density varies; OpenVDB objects keep their own "
            "voxels",
            4, 256, draft=48,
        ),
    )  # fmt: skip
    provides = (MediaService, AroundEye)
    owns = (IN_MEDIA,)

    def __init__(self):
        self.media = Media()

    def skip(self, snapshot: Snapshot, settings: Settings) -> str | None:
        return None if has_media(snapshot) else "the scene has no volume"

    def begin(self, frame: Frame) -> None:
        """Bring the media to the snapshot, and provide them."""
        resolution = frame.settings.get(self, "resolution")
        self.media.update(frame.snapshot, frame.materials.compiled, frame.geometry.origin, resolution)
        frame.ledger.notes = (*frame.ledger.notes, *(n for n in self.media.notes if n not in frame.ledger.notes))
        around = absorbed_around_eye(frame.snapshot, frame.materials.compiled)
        if around.any():
            frame.provide(AroundEye(tuple(around.tolist())))
        if self.media.found:
            frame.provide(MediaService(self.media))
        frame.account.note(self, {"media": len(self.media.found), "cells": self.media.cells})

    def release(self) -> None:
        self.media.release()
