"""Temporal glare: the picture as a human eye sees it, with needles, halo and veil around bright pixels.

    lens = I - s w H + s (H * kernel)     H what exceeds white, kernel the eye's tail (addon/techniques/eye.py)

The linear picture, once its samples are summed up, is scattered by the point spread function of an eye that moves with
the scene's time (addon/eye/scatter.py): by Fourier transforms, or by billboards. Its core is left out, so that what is
below white stays as sharp as it was; what the tail takes from a pixel it brings to others. `film.combined` stays
linear and free of it, the result is an image and a render pass of its own, and what viewports show.

Skipped where nobody would see it, by the rule of the source: where no pixel is ten times as bright as white, or where
the veil, all that is scattered over the tail's area, stays below half a step of a display of 8 bits. The picture is
then the same to the bit; what was done is one reduction and one texel read back.

| 1024 x 1024, pattern 512, convolved at full size | passes | fetches per pixel |
|---|---|---|
| of fewer than 16 samples: what of it is plausible | 1 | 25 x 4 |
| measure; its colour where Spectrum is *By Colour* | 4 each | 1 |
| point spread, when the time or the eye changes | 16 to 18 | (addon/eye/point_spread.py) |
| scatter | 20 | 2.25 x (1 + 27 + 4 + 27) + 2 |

Bytes: 48 per padded texel (1536 x 1536 for 1024 x 1024) borrowed.

Of fewer than 16 samples an isolated pixel of indirect light dazzles by no more than its surroundings and the number of
samples hold plausible (`scatter.plausible`): one lucky path is no star. The rest of its light stays where it is.

Bias: light below white is not scattered (its veil is missing), what lies beyond the picture's borders casts no glare
into it, the kernel is the same all over the picture. Fails for pictures whose light was clipped before.

Source: Ritschel, Ihrke, Frisvad, Coppens, Myszkowski and Seidel, "Temporal glare", Eurographics 2009. The split into
core and tail, the threshold and the placement by magnification are ours.
"""

from __future__ import annotations

import weakref
from dataclasses import replace

import numpy as np

from ..eye import scatter
from ..eye.aperture import Aperture
from ..eye.optics import Scale
from ..eye.spectrum import WHITE
from ..film.resolve import COMBINED
from ..frame.picture import Frame
from ..frame.settings import Settings
from ..frame.technique import CAMERA, Param, Technique, Write
from ..gfx import images, passes
from ..snapshot.panorama import bends_lines
from ..snapshot.scene import Camera, Snapshot
from .eye import BILLBOARDS, GLARE, MODE, OFF, PointSpread

LENS = "film.lens"
# Sums over samples of what is seen straight: a lamp there is no matter of chance (shaders/glare/plausible.frag.glsl).
STRAIGHT = {
    "emission": "radiance.emission", "environment": "radiance.environment", "reflected": "radiance.glossy_direct",
}  # fmt: skip
RESOLUTIONS = (
    ("FULL", "Full", 1, "Every pixel of the picture"),
    ("HALF", "Half", 2, "Pixels of twice the side: about a quarter of the time"),
    ("QUARTER", "Quarter", 4, "Pixels of four times the side: about a sixteenth of the time"),
)
LEAST_CONTRAST = 10.0  # of the brightest pixel to white, below which nobody sees glare
LEAST_VEIL = 0.5 / 255.0  # of white
ORTHOGRAPHIC_DEGREES = 39.6  # of a lens of 50 mm before a sensor of 36 mm


class TemporalGlare(Technique):
    name = GLARE
    label = "Temporal Glare"
    params = (
        MODE,
        Param("strength", "Strength", 1.0, "Strength of the glare; 1: physically correct", 0.0, 10.0),
        Param("white", "White", 1.0, "Pixel value that is displayed as white; brighter pixels cause glare", 0.0, 1e4),
        Param(
            "luminance", "Scene Luminance", 100.0,
            "Luminance of the pixel value 1, in cd/m²; the pupil adapts to it",
            1e-4, 1e8,
        ),
        Param(
            "magnification", "Size", 10.0,
            "Angular magnification of the glare; 10 puts the ring of the lens fibres at its natural 3 degrees",
            0.1, 100.0,
        ),
        Param("sharp", "Keep Sharp", True, "Leave out the core of the glare, which only blurs bright pixels"),
        Param(
            "resolution", "Resolution", "FULL",
            "Resolution of the convolution; lower ones have softer needles",
            items=RESOLUTIONS,
        ),
    )  # fmt: skip
    params = tuple(replace(param, scope=CAMERA) for param in params)
    reads = (COMBINED,)
    writes = (Write(LENS, "RGBA32F", "The picture as the eye sees it, premultiplied by alpha"),)
    requests = (PointSpread,)

    def __init__(self):
        self._scatter = scatter.Scatter()
        self._shown_for, self._shown, self._reason = (
            lambda: None,
            (),
            None,
        )  # the picture that film.lens is of, and why not

    def skip(self, snapshot: Snapshot, settings: Settings) -> str | None:
        if settings.get(self, "mode") == OFF:
            return "glare is off for this camera"
        if not settings.get(self, "strength"):
            return "its strength is 0"
        return bends_lines(snapshot)

    def programs(self, snapshot: Snapshot, settings: Settings) -> tuple:
        few = (scatter.PLAUSIBLE,) if self.looks_at(settings) else ()
        return scatter.MEASURE, scatter.BLOCKS, *few  # what else there is may never be needed

    def looks_at(self, settings: Settings) -> tuple[str, ...]:
        few = settings.samples < scatter.UNLIMITED or settings.schedule.shows_each or settings.schedule.is_draft
        return tuple(STRAIGHT.values()) if few else ()

    def show(self, frame: Frame) -> None:
        now = (frame.samples_done, frame.plan.shown_with(frame.snapshot, frame.settings))
        if self._shown_for() is not frame or self._shown != now:
            self._reason = self._show(frame)
            self._shown_for, self._shown = weakref.ref(frame), now
        if self._reason is None:
            frame.picture = LENS
        else:
            frame.account.leave(self, self._reason)
            service = frame.service(PointSpread)
            if service is not None:
                service.leave(frame)

    def _show(self, frame: Frame) -> str | None:
        """Draw the lens' image; or why not, as a sentence."""
        service = frame.service(PointSpread)
        if service is None:  # a pass tree without an eye
            return self._unseen(frame, "no eye brings a point spread: add the pass Eye to the tree")
        picture = frame.images[COMBINED]
        apart = all(frame.held.is_apart(name) for name in STRAIGHT.values())  # not where many samples end early
        if not apart or frame.samples_done >= scatter.UNLIMITED:
            return self._dazzled(frame, service, picture)
        with images.borrowed(*picture.size, "RGBA32F") as plausible:
            film = frame.snapshot.film
            straight = {kind: frame.held.to_show(name) for kind, name in STRAIGHT.items()}
            done = scatter.plausible(
                picture, straight, plausible, white=frame.settings.get(self, "white"),
                scale=film.exposure / (frame.samples_done + frame.part_done or 1.0),
                world=float(not film.transparent), samples=max(frame.samples_done, 1),
            )  # fmt: skip
            frame.count(self, "passes", done)
            return self._dazzled(frame, service, plausible.colors[0])

    def _dazzled(self, frame: Frame, service: PointSpread, dazzling: images.Image) -> str | None:
        """The same, of a picture of which no more scatters than `dazzling` holds."""
        picture = frame.images[COMBINED]
        white, strength, magnification, luminance, sharp = (
            frame.settings.get(self, name) for name in ("white", "strength", "magnification", "luminance", "sharp")
        )
        factor = {name: number for name, _, number, _ in RESOLUTIONS}[frame.settings.get(self, "resolution")]
        billboards = frame.settings.get(self, "mode") == BILLBOARDS
        factor = 1 if billboards else factor
        measured = scatter.measure(dazzling, white)
        frame.count(self, "passes", scatter.measure_passes(picture))
        aperture = service.aperture(frame, luminance * measured.mean)

        def is_seen(scale: Scale) -> bool:
            # Light falls as one over the distance to the third, so that the rim has this share of the mean.
            rim = 0.5 * scale.core / max(scale.reach, scale.core)
            return rim * veil(measured, aperture, scale, strength, factor) > LEAST_VEIL * white

        scale = service.scale(frame, aperture, factor * _pixel_angle(frame), magnification, is_seen)
        reason = needless(measured, aperture, scale, strength, white, factor)
        if reason and aperture.light == 1.0:
            return self._unseen(frame, reason)
        target = frame.target(LENS)
        if reason or aperture.light == 0.0:  # lids move, and there is nothing, or nobody, to be dazzled
            frame.count(self, "passes", scatter.dim(picture, target, aperture.light))
        else:
            colour = WHITE
            if service.needs_colour(frame):
                colour = scatter.colour(dazzling, white)
                frame.count(self, "passes", scatter.measure_passes(picture))
            kernel = service.kernel(frame, aperture, scale, sharp, colour)
            how = {"white": white, "strength": strength, "dimming": aperture.light, "dazzling": dazzling}
            if billboards:
                done = self._scatter.billboards(picture, kernel, target, **how)
            else:
                done = self._scatter.convolve(picture, kernel, target, factor=factor, **how)
            frame.count(self, "passes", done)
        return None

    def _unseen(self, frame: Frame, reason: str) -> str:
        """The picture is shown as it is; a render pass of the lens has to be the same."""
        if frame.settings.schedule.has_passes:
            passes.copy(frame.images[COMBINED], frame.target(LENS))
        return reason

    def release(self) -> None:
        self._scatter.release()


def needless(
    measured: scatter.Brightness, aperture: Aperture, scale: Scale, strength: float, white: float, factor: int
) -> str | None:
    """Why nobody would see glare, as a sentence; None where somebody may."""
    if measured.most < LEAST_CONTRAST * white or measured.excess == 0.0:
        return f"no pixel is {LEAST_CONTRAST:.0f} times as bright as white"
    dimmest = veil(measured, aperture, scale, strength, factor)
    if dimmest < LEAST_VEIL * white:
        return f"its veil would be {dimmest / max(white, 1e-30):.1e} of white, below half a step of a display"
    return None


def veil(measured: scatter.Brightness, aperture: Aperture, scale: Scale, strength: float, factor: int) -> float:
    """Mean radiance that bright pixels lay over the kernel's disc."""
    # By Babinet's principle the share of light that leaves the straight way is that of the pupil that is covered; the
    # pupil's edge diffracts 2 / (pi x) of it beyond the core, x in units of the Airy disc's first zero over 3.83.
    edge = 2.0 / (np.pi * 3.83 * max(scale.core * scale.per_pixel / (12.2 / aperture.diameter), 1.0))
    tail = min(strength * (aperture.obstructed + edge), 1.0)
    return tail * measured.excess / (np.pi * (factor * scale.reach) ** 2)


def _pixel_angle(frame: Frame) -> float:
    film = frame.snapshot.film
    return degrees_per_pixel(frame.snapshot.camera, film.width, film.height)


def degrees_per_pixel(camera: Camera, width: int, height: int) -> float:
    """In the middle of a picture of that many pixels; orthographic views have none, and take that of a common lens."""
    _, _, bottom, top = camera.frame
    if camera.kind == "ORTHOGRAPHIC":
        return ORTHOGRAPHIC_DEGREES / max(width, height)
    return float(np.degrees((top - bottom) / height))
