"""Eye: how the observer's eye scatters a point of light, at the scene's time.

Provides the point spread function of a living eye (addon/eye): the pupil with its restlessness, particles and fibres of
the lens, which the ciliary muscle moves, the vitreous body, which swings after each jump of the eye, lids and lashes;
their diffraction pattern over 32 wavelengths and more, as a kernel over the picture's pixels. Nothing is computed until
a technique of the `show` stage asks for it, and nothing again while neither the time nor the eye has changed.

The state is a closed form of the time: frame 40 is the same whether it is rendered alone or after 39 others.

| pattern of N x N | passes | bytes borrowed |
|---|---|---|
| aperture to colours | 11 (256), 11 (512), 13 (1024) | 60 N^2 |
| kernel and its sums | 2 + 2 to 3 each | 16 per texel |

The pupil follows the picture's own mean luminance, without the second or so that real ones take: a frame does not know
the pictures before it. *Luminance Before* and *Light Changes At* tell of one change, after which it adapts. Bias and
sources: addon/eye/point_spread.py.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..eye import optics, point_spread, spectrum
from ..eye.aperture import Aperture, Eye, aperture_at
from ..frame.picture import Frame
from ..frame.settings import Settings
from ..frame.technique import CAMERA, Param, Service, Technique
from ..snapshot.scene import Snapshot

GLARE = "glare"  # the technique that asks for the point spread, and its choice of how
OFF, CONVOLUTION, BILLBOARDS = "OFF", "CONVOLUTION", "BILLBOARDS"
MODE = Param(
    "mode", "Glare", OFF, "Show glare as a human eye sees it",
    items=(
        (OFF, "Off", 0, "The picture as a camera takes it"),
        (CONVOLUTION, "Convolution", 1, "The light of every pixel is spread, by Fourier transform"),
        (BILLBOARDS, "Billboards", 2, "Only the brightest spots are spread, each as a picture of its own"),
    ),
    scope=CAMERA,
)  # fmt: skip
LUMINANCE_STEP = 0.02  # decades; as much as noise of the first samples changes the mean, and 0.02 mm of a pupil
DRAFT_SIDE = 256
AUTO = "AUTO"
ONE, THREE = "ONE", "THREE"
PLANES = (
    (ONE, "One", 0, "All in the plane of the pupil: fast"),
    (THREE, "Three", 1, "Cornea, lens and vitreous body, light carried from one to the next: about twice the time"),
)
SPECTRA = (
    (spectrum.EQUAL, "Equal Energy", 0, "All wavelengths alike"),
    (spectrum.BLACKBODY, "Blackbody", 1, "Of a temperature: candle 1900, bulb 2800, sun 5800 kelvin"),
    ("LED", "White LED", 2, "A blue line and a broad yellow"),
    ("FLUORESCENT", "Fluorescent", 3, "Lines of blue, green and red: needles have separate colours"),
    ("SODIUM", "Sodium", 4, "One yellow line: needles and rings without colours, and sharp"),
    (
        spectrum.COLOUR, "By Colour", 5,
        "A smooth spectrum of the colour of what dazzles; for lamps of a temperature nearly a blackbody's",
    ),
)  # fmt: skip
LEAST_SIDE, MOST_SIDE = 512, 2048  # of a pattern whose size follows from the brightness of the picture
SIDES = (
    (AUTO, "Automatic", 0, "As large as the brightest light needs, so that its glare ends where nobody sees it"),
    *(
        (str(side), f"{side} x {side}", side, f"The pattern has {side} texels along each side")
        for side in (128, 256, 512, 1024, 2048)
    ),
)


class PointSpread(Service):
    """The eye's aperture at the picture's time, and the kernel that it makes of a point of light."""

    name = "point spread"

    def __init__(self, technique: EyeModel):
        self._technique = technique
        self._pattern: tuple[object, point_spread.Pattern] | None = None
        self._kernel: tuple[object, point_spread.Kernel] | None = None
        self._side = LEAST_SIDE

    def aperture(self, frame: Frame, luminance: float) -> Aperture:
        """While the eye looks at a picture of this mean luminance, cd/m2."""
        decades = np.round(np.log10(max(luminance, 1e-6)) / LUMINANCE_STEP) * LUMINANCE_STEP
        return aperture_of(frame.settings, frame.snapshot.moment.seconds, 10.0**decades)

    def scale(
        self, frame: Frame, aperture: Aperture, degrees_per_pixel: float, magnification: float,
        is_seen: Callable[[optics.Scale], bool],
    ) -> optics.Scale:  # fmt: skip
        """How the pattern lies on pixels of this size. `is_seen`: whether the glare is still seen at the rim of a
        kernel; a pattern whose size is automatic grows as long as it is."""
        defocus = frame.settings.get(self._technique, "defocus")
        self._side, most = self._technique.sides(frame.settings)
        while True:
            longest = max(frame.size)
            scale = optics.scale_of(self._side, degrees_per_pixel, magnification, aperture.diameter, defocus, longest)
            if self._side >= most or scale.reach >= longest or not is_seen(scale):
                return scale
            self._side *= 2

    def needs_colour(self, frame: Frame) -> bool:
        """Whether the pattern depends on the colour of what dazzles."""
        return frame.settings.get(self._technique, "spectrum") == spectrum.COLOUR

    def pattern(self, frame: Frame, aperture: Aperture, colour=spectrum.WHITE) -> point_spread.Pattern:
        """Its channels have a mean of 1 for the light's own colour; drawn anew where aperture or spectrum differ. It is
        the service's own. `colour`: of what dazzles, linear Rec. 709."""
        settings, technique = frame.settings, self._technique
        side, defocus = self._side, settings.get(technique, "defocus")
        least = settings.get(technique, "wavelengths")
        light = technique.light(settings, colour)
        planes = settings.get(technique, "planes") == THREE
        key = (side, defocus, least, aperture.diameter, aperture.closed, aperture.strokes.tobytes(), light, planes)
        if self._pattern is None or self._pattern[0] != key:
            self._drop()
            self._pattern = (key, point_spread.make_pattern(aperture, side, defocus, least, light=light, planes=planes))
            frame.count(technique, "passes", point_spread.pass_count(side, planes))
            frame.count(technique, "obstacles", len(aperture.strokes))
        return self._pattern[1]

    def kernel(
        self, frame: Frame, aperture: Aperture, scale: optics.Scale, sharp: bool, colour=spectrum.WHITE
    ) -> point_spread.Kernel:
        """Over the picture's pixels; `sharp`: without the light that is not scattered. It is the service's own.
        `colour`: of what dazzles, where `needs_colour`."""
        pattern = self.pattern(frame, aperture, colour)
        key = (self._pattern[0], scale, sharp)
        if self._kernel is None or self._kernel[0] != key:
            if self._kernel is not None:
                self._kernel[1].release()
            self._kernel = (key, point_spread.make_kernel(pattern.colours, scale, sharp))
        return self._kernel[1]

    def leave(self, frame: Frame) -> None:
        """Nobody will ask for a kernel of this picture."""
        frame.account.leave(self._technique, "the picture has no light that would dazzle it")

    def _drop(self) -> None:
        for kept in (self._kernel, self._pattern):
            if kept is not None:
                kept[1].release()
        self._kernel = self._pattern = None

    def release(self) -> None:
        self._drop()


class EyeModel(Technique):
    name = "eye"
    label = "Eye"
    params = (
        Param(
            "age", "Age", 30.0,
            "Age of the observer in years: older lenses scatter more, older pupils are smaller",
            1.0, 110.0,
        ),
        Param(
            "pupil", "Pupil", 0.0,
            "Mean diameter of the pupil in mm; 0: by the luminance of the picture (Scene Luminance)", 0.0, 8.5,
        ),
        Param(
            "before", "Luminance Before", 0.0,
            "Mean luminance in cd/m² that the eye was used to before the light changed; 0: it is used to the picture",
            0.0, 1e8,
        ),
        Param(
            "changed", "Light Changes At", 0.0,
            "Second of the scene's time at which the light changes, from which on the pupil adapts: within a second "
            "where it closes, three where it opens",
        ),
        Param(
            "restlessness", "Hippus", 1.0,
            "Amplitude of the pupil's spontaneous fluctuations (hippus); 1: as measured",
            0.0, 5.0,
        ),
        Param("tremor", "Lens Tremor", 1.0, "Amplitude of the lens' movement by the ciliary muscle", 0.0, 10.0),
        Param("movement", "Eye Movement", 1.0, "Amplitude of the vitreous body's swing after eye movements", 0.0, 10.0),
        Param("speed", "Speed", 1.0, "Speed of the eye's motion relative to scene time; 0: no motion", 0.0, 10.0),
        Param(
            "scatter", "Scatter", 0.1,
            "Share of the pupil covered by scattering particles, at 25 years of age",
            0.0, 0.5, "FACTOR",
        ),
        Param(
            "fibres", "Lens Fibres", 0.3,
            "Opacity of the lens' radial fibres, which make a coloured ring where the pupil is wide",
            0.0, 1.0, "FACTOR",
        ),
        Param("lashes", "Eyelashes", 1.0, "Opacity of the eyelashes", 0.0, 1.0, "FACTOR"),
        Param("squint", "Squint", 0.0, "How far the lids are closed permanently", 0.0, 1.0, "FACTOR"),
        Param("blink", "Blink", 0.0, "Eyelid, for keyframes: 0 open, 1 shut; darkens the picture", 0.0, 1.0, "FACTOR"),
        Param(
            "blinks_per_minute", "Blinks per Minute", 0.0,
            "Spontaneous blinks per minute; people have 10 to 20",
            0.0, 60.0,
        ),
        Param(
            "defocus", "Defocus", 0.25,
            "Residual defocus of the eye in dioptres; widens the core of the glare",
            0.0, 1.0,
        ),
        Param(
            "side", "Pattern Size", AUTO,
            "Texels along each side of the diffraction pattern; twice as many reach twice as far. Drafts use at most "
            "256",
            items=SIDES,
        ),
        Param(
            "wavelengths", "Wavelengths", 32,
            "Minimum number of wavelengths summed for each texel; more are used further out",
            8, 256,
        ),
        Param(
            "spectrum", "Spectrum", spectrum.EQUAL,
            "Spectrum of the lamps that dazzle: how far their needles disperse into colours", items=SPECTRA,
        ),
        Param(
            "kelvin", "Temperature", 2800.0,
            "Colour temperature of the spectrum Blackbody, in kelvin",
            800.0, 20000.0,
        ),
        Param(
            "planes", "Planes", ONE,
            "Number of planes in the eye on which the particles that scatter light are placed", items=PLANES,
        ),
        Param("person", "Person", 0, "Seed of the observer's eye", 0, 2**20),
    )  # fmt: skip
    params = tuple(replace(param, scope=CAMERA) for param in params)
    provides = (PointSpread,)

    def __init__(self):
        self._service = PointSpread(self)

    def skip(self, snapshot: Snapshot, settings: Settings) -> str | None:
        if settings.value(GLARE, MODE) == OFF:
            return "nothing asks for the eye's point spread"
        return None

    def sides(self, settings: Settings) -> tuple[int, int]:
        """Texels along each side of the pattern: the least and the most."""
        side = settings.get(self, "side")
        found = (LEAST_SIDE, MOST_SIDE) if side == AUTO else (int(side), int(side))
        return tuple(min(one, DRAFT_SIDE) for one in found) if settings.schedule.is_draft else found

    def light(self, settings: Settings, colour=spectrum.WHITE) -> spectrum.Light:
        """The spectrum as set; `colour`: of what dazzles, linear Rec. 709."""
        kind = settings.get(self, "spectrum")
        known = {spectrum.BLACKBODY: settings.get(self, "kelvin"), spectrum.COLOUR: spectrum.rounded(colour)}
        return kind, known.get(kind)

    def show(self, frame: Frame) -> None:
        frame.provide(self._service)

    def release(self) -> None:
        self._service.release()


def aperture_of(settings: Settings, seconds: float, luminance: float) -> Aperture:
    """The observer as set, at a second of the scene's time, looking at a mean luminance in cd/m2."""
    names = (
        "age", "pupil", "before", "restlessness", "tremor", "movement", "scatter", "fibres", "lashes", "squint",
        "blink", "blinks_per_minute",
    )  # fmt: skip
    values = {param.name: settings.value(EyeModel.name, param) for param in EyeModel.params}
    own = seconds * values["speed"]
    changed = own - (seconds - values["changed"])  # it adapts in the scene's time, whether or not it moves by itself
    eye = Eye(seed=values["person"], changed=changed, **{name: values[name] for name in names})
    return aperture_at(eye, own, luminance)
