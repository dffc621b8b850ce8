"""How often a technique is drawn: in proportion to the root of what it may bring to the picture's error.

The first sample of a picture shows how much light each part of a technique (a ray's bounce, say) brings, beside the
light of the picture at the same place:

    S = mean over tiles of  mean(g^2) / (r^2 + (r_mean / 10)^2),   g its light, r that of all surfaces, as luminances

S bounds the squared error, relative as compare/metrics.py has it, that one sample of the part leaves. A given time
leaves the least error if each part is drawn as often as the root of that over its cost says. So a part whose S is below
WHOLE / 4 is drawn in every second sample with twice the weight, below WHOLE / 16 in every fourth, and so on
(sampling/turns.py), which leaves the mean as it is.

Only for pictures of a known number of samples, at least FEWEST_SAMPLES, of which only the mean is shown.

| cost | in such a picture |
|---|---|
| passes | 1 for each part and 1 in the first sample; in those that have a turn, 1 for each run of parts of one weight |
| readback | 1 between the first and the second sample, of 16 bytes for each part and 16 x 16 pixels |

Fails: what single samples show of a light that is small and bright in few pixels, if the first one has missed it.
A picture that is stopped before its last sample has had too many or too few turns for its samples.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from functools import cache

import numpy as np

from ..gfx import images, passes
from ..gfx.library import Program
from ..gfx.readback import Reading, put
from ..sampling.turns import FEWEST, most_apart, turns
from .light_paths import LIGHT_PATHS
from .picture import Frame
from .technique import Technique

TILE = 16  # pixels
FEWEST_SAMPLES = 8
LITTLE = 1e-5  # S of what need not be seen to be as large in both halves of the samples
WHOLE = 0.2  # S from which a part is drawn in each sample: the relative squared error of a whole picture's sample


@cache
def square_program(count: int) -> Program:
    """Mean square (x) and mean (y) over a tile of the luminance of a sum of images."""
    names = [f"light{k}" for k in range(count)]
    return passes.fullscreen_program(
        "share of light",
        "film/share.frag.glsl",
        textures=tuple(("RGBA32F", name) for name in names),
        constants=(("IVEC2", "extent"),),
        defines=(("TILE", str(TILE)), ("LIGHT_OF_ALL", " + ".join(f"{name}_fetch(texel).rgb" for name in names))),
        outputs=(("VEC4", "out_share"),),
    )


@cache
def flush_program(names: tuple[str, ...]) -> Program:
    """Copies images, times a weight."""
    return passes.fullscreen_program(
        "light of a turn",
        "film/turn.frag.glsl",
        textures=tuple(("RGBA32F", name) for name in names),
        constants=(("FLOAT", "weight"),),
        defines=(("ALL", " ".join(f"out_{name} = weight * {name}_fetch(pixel);" for name in names)),),
        outputs=tuple(("VEC4", f"out_{name}") for name in names),
    )


DECLARED = square_program(2), flush_program(("first", "second"))


def apart_by(share: float, samples: int) -> int:
    """Samples from one turn to the next for a part of this S: a power of two."""
    most = most_apart(samples, FEWEST if share > LITTLE else 1)
    if not np.isfinite(share):
        return 1
    wanted = (WHOLE / max(share, 1e-12)) ** 0.5
    return int(min(2 ** int(np.log2(max(wanted, 1.0))), most))


def share_of(squares: np.ndarray, means: np.ndarray) -> float:
    """S of a part, from tiles' means of its light's square and of all light."""
    about = float(means.mean())
    if not about > 0.0:
        return 0.0 if not squares.any() else np.inf
    return float(np.mean(squares / (means**2 + (0.1 * about) ** 2)))


class Turns:
    """Turns of the parts of one technique in one picture. `begin` it with each picture."""

    def __init__(self, technique: Technique, most_parts: int = 1):
        self._technique, self._most = technique, most_parts
        self._tiles: images.Target | None = None
        self._reading: Reading | None = None
        self._measured = 0
        self._weights: list[Mapping[int, float]] | None = None
        self._asks = self._known = False

    def begin(self, frame: Frame, names: Sequence[str], may_rest: bool = True) -> None:
        """`names`: the images that the technique adds to; unless it `may_rest`, all samples have all of it."""
        self.drop()
        self._names = tuple(names)
        self._light = tuple(name for name in names if name.startswith("radiance."))
        self._known = may_rest and plans_samples(frame)
        self._asks = self._known and frame.settings.samples >= FEWEST_SAMPLES and not clamped(frame)

    def weight(self, frame: Frame, part: int = 0) -> float:
        """Of a part in this sample; 0: it is not drawn."""
        if self._asks and not frame.is_first and self._weights is None:
            self._decide(frame)
        if self._weights is None:
            return 1.0
        return self._weights[min(part, len(self._weights) - 1)].get(frame.sample, 0.0)

    @property
    def may_last(self) -> bool:
        """Whether what one sample makes may serve those behind it, too."""
        return self._known

    @property
    def may_rest(self) -> bool:
        """Whether samples of this picture may go without some part."""
        return self._asks or self._weights is not None

    def turn(self, frame: Frame) -> tuple[int, int]:
        """In how many samples the first part was drawn before this one, and how many there will be."""
        if self._weights is None:
            return frame.sample, frame.settings.samples
        taken = sorted(self._weights[0])
        return taken.index(frame.sample), len(taken)

    def renews(self, frame: Frame, apart: int) -> bool:
        """Whether what serves several samples once it is made is to be made anew in this one: in samples that have the
        first part, at least `apart` samples apart in the mean; in all of them of pictures whose mean is not all that
        is shown."""
        if self._weights is None:
            return not self._known or frame.sample % apart == 0
        return frame.sample in turns(self._samples, (*self._apart[:1], max(self._apart[0], self._most_apart(apart))))

    def _most_apart(self, apart: int) -> int:
        return min(apart, most_apart(self._samples))

    @contextmanager
    def drawing(self, frame: Frame) -> Iterator[Drawing]:
        """Where the parts of this sample add their light to; at the end all of it is in the picture."""
        with ExitStack() as stack:
            drawing = Drawing(self, frame, stack)
            yield drawing
            drawing.end()

    def _measure(self, frame: Frame, part: int, lights: Sequence[images.Image]) -> None:
        size = tuple(-(-side // TILE) for side in frame.size)
        if self._tiles is None:
            self._tiles = images.Target((images.pool.take(size[0], size[1] * (self._most + 1), "RGBA32F"),))
            self._tiles.clear()
        with images.borrowed(*size, "RGBA32F") as found:
            textures = {f"light{k}": image for k, image in enumerate(lights)}
            passes.fullscreen(
                square_program(len(lights)), found, textures=textures, constants={"extent": frame.size}
            )  # fmt: skip
            put(found.colors[0], self._tiles, 0, size[1] * part)
        frame.count(self._technique, "passes", 2)

    def _end_of_first(self, frame: Frame) -> None:
        """All light that the sample has up to now."""
        names = [*(path.image for path in LIGHT_PATHS), "surface.emission"]  # that the film adds after all others
        lights = [frame.images[name] for name in names if name in frame.images]
        self._measure(frame, self._most, lights)
        self._reading, self._tiles = frame.readback.later(self._tiles.colors[0]), None

    def _decide(self, frame: Frame) -> None:
        self._asks, self._samples = False, frame.settings.samples
        if self._reading is None:
            return
        tiles = self._reading.pixels().reshape(self._most + 1, -1, 4)
        self._reading = None
        means, apart, self._weights = tiles[-1, :, 1], [], []
        self._apart = apart
        shares = [share_of(tiles[k, :, 0], means) for k in range(self._measured)]
        for part in range(self._measured):
            least = apart_by(max(shares[part:]), self._samples)  # what comes behind it needs it
            apart.append(max(least, apart[-1]) if apart else least)
            self._weights.append(turns(self._samples, tuple(apart)))
        for part, (share, weights) in enumerate(zip(shares, self._weights)):
            if len(weights) < self._samples:
                which = f"bounce {part + 1}" if self._measured > 1 else "its light"
                often = f"in {len(weights)} of {self._samples} samples"
                frame.account.chose(
                    self._technique, which, f"{often}, because it may bring {_percent(share)} of the error"
                )

    def drop(self) -> None:
        """Forget the picture. What is to be read belongs to that."""
        if self._tiles is not None:
            images.pool.give(self._tiles.colors[0])
        self._tiles = self._reading = self._weights = None
        self._asks, self._measured = False, 0


class Drawing:
    """One sample: `target` says where a part draws to, `done` that the part is drawn."""

    def __init__(self, of: Turns, frame: Frame, stack: ExitStack):
        self._of, self._frame, self._stack = of, frame, stack
        self._own: dict[str, images.Image] = {}
        self._filled = 0.0  # weight of what the own images hold
        self._measures = of._asks and frame.is_first

    def images(self, part: int) -> dict[str, images.Image]:
        """Images to add to, by name: the picture's, or own ones that are added to it with the part's weight."""
        weight = self._of.weight(self._frame, part)
        if weight == 1.0 and not self._measures:
            self._flush()
            return {name: self._frame.images[name] for name in self._of._names}
        if not self._own:
            for name in self._of._names:
                target = self._stack.enter_context(images.borrowed(*self._frame.size, "RGBA32F"))
                self._own[name] = target.colors[0]
            self._clear()
        if weight != self._filled:
            self._flush()
        self._filled = weight
        return self._own

    def done(self, part: int) -> None:
        """The part has been drawn, whole."""
        if self._measures and part < self._of._most:
            self._of._measure(self._frame, part, [self._own[name] for name in self._of._light])
            self._of._measured = part + 1
            self._flush()

    def end(self) -> None:
        """All parts of the sample are drawn."""
        self._flush()
        if self._measures and self._of._measured:
            self._of._end_of_first(self._frame)

    def _flush(self) -> None:
        if not self._own or not self._filled:
            return
        shorts = tuple(name.replace(".", "_") for name in self._own)
        target = images.Target(tuple(self._frame.images[name] for name in self._own))
        passes.fullscreen(
            flush_program(shorts),
            target,
            blend="ADDITIVE_PREMULT",
            textures=dict(zip(shorts, self._own.values())),
            constants={"weight": self._filled},
        )
        self._frame.count(self._of._technique, "passes")
        self._filled = 0.0
        self._clear()

    def _clear(self) -> None:
        images.Target(tuple(self._own.values())).clear()


def plans_samples(frame: Frame) -> bool:
    """Whether it is known from the start how many samples there are, and that all are drawn, so that light of one may
    stand for that of others."""
    settings = frame.settings
    return settings.schedule.known_total and not settings.may_end_early and frame.numbers is None


def clamped(frame: Frame) -> bool:
    """Whether single samples are held below a limit, which more weight would reach sooner."""
    film = next((one for one in frame.plan.techniques if one.name == "film"), None)
    return film is not None and any(frame.settings.get(film, name) > 0 for name in ("clamp_direct", "clamp_indirect"))


def _percent(share: float) -> str:
    return f"{100 * share:.2g} %"
