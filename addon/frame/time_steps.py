"""Motion blur: samples of one picture shared out over the moments at which the scene was read.

    sample i of the first half of n   looks at the shutter's time (i + 1/4) / (n/2)
    sample j of the second half                                   (j + 3/4) / (n/2)

so that both halves, which Denoise compares, see all of the motion. A step draws its samples as a slice of the picture
(slices.py): what is learned from the first sample is learned anew of its own scene, and its sums are added to those of
the steps before; coverage by name (kernels/ranks.py) goes on from theirs. The step in the middle comes last. In its
frame the picture is finished, so that depth, and the surfaces that Denoise goes by, are those of the middle of the
shutter. A slice without a sample of that step draws its surfaces all the same. The others come in an order that spreads
over the shutter: a time limit cuts motion coarsely rather than at its end.

| cost | |
|---|---|
| passes | for each step but the first sample's one more sample, in which it learns, and a copy of each sum |
| memory | sums twice, half the samples' sums once: 16 bytes a pixel each, about 20 of them |

Bias: motion is seen at so many moments. An object that moves by more than a pixel or two between two of them shows as
several; more steps cure it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from ..gfx import images
from ..gfx.context import turn
from ..gfx.readback import put
from ..snapshot.scene import Snapshot
from .picture import Frame
from .run import Renderer
from .settings import Settings
from .slices import HALF


@dataclass(frozen=True)
class Step:
    """Samples of the picture, by their numbers, that look at one snapshot."""

    snapshot: Snapshot
    numbers: tuple[int, ...]
    last: int  # of all samples that look at it, in whatever slice


def step_of(number: int, samples: int, steps: int) -> int:
    """The step that sample `number` of `samples` looks at."""
    half = samples // 2
    if samples == 1:
        share = 0.5
    elif number < half:
        share = (number + 0.25) / half
    else:
        share = (number - half + 0.75) / (samples - half)
    return min(int(share * steps), steps - 1)


def shared_out(snapshots: Sequence[Snapshot], steps: Sequence[int], settings: Settings) -> list[Step]:
    """The slice's samples by snapshot, in the order in which they are drawn; `steps`: number of each step's snapshot.

    A snapshot that none of the slice's samples looks at is left out, unless it is the middle one.
    """
    all_numbers: list[list[int]] = [[] for _ in snapshots]
    for number in range(settings.samples):
        all_numbers[steps[step_of(number, settings.samples, len(steps))]].append(number)
    seen = [k for k, numbers in enumerate(all_numbers) if numbers]
    middle = steps[len(steps) // 2]
    if middle not in seen:
        middle = seen[len(seen) // 2]
    own = range(settings.sample_offset, settings.sample_offset + settings.samples_to_draw)
    order = [k for k in _spread(seen) if k != middle] + [middle]
    made = [Step(snapshots[k], tuple(n for n in all_numbers[k] if n in own), all_numbers[k][-1]) for k in order]
    return [step for step in made[:-1] if step.numbers] + made[-1:]


def _spread(numbers: Sequence[int]) -> list[int]:
    """The same numbers in an order whose beginnings cover all of them: by bits, the lowest first (van der Corput)."""
    bits = max(len(numbers) - 1, 1).bit_length()
    return [numbers[k] for k in sorted(range(len(numbers)), key=lambda k: int(f"{k:0{bits}b}"[::-1], 2))]


class Sums:
    """Sums of the steps so far, by image, and those of the first half of the samples."""

    def __init__(self):
        self.whole: dict[str, images.Image] = {}
        self.half: dict[str, images.Image] = {}
        self.ranked: dict[str, images.Image] = {}  # pairs of ids and weights, which the next step's samples add to
        self.samples = 0
        self.in_half = 0
        self.seconds = 0.0

    def add(self, frame: Frame) -> None:
        """Take over what the samples of a step have summed up."""
        for name, image in sums_of(frame).items():
            _add(image, self.whole, name)
        for write in frame.held.writes:
            if write.ranked:
                _copy(frame.images[write.name], self.ranked, write.name)
        self.samples += frame.samples_done
        self.seconds += frame.drawn_s

    def add_half(self, frame: Frame) -> None:
        """The same of the images that Denoise compares, while only samples of the first half are in them."""
        for name in frame.images:
            if name.endswith(HALF):
                _add(frame.images[_halved(name)], self.half, name)
        self.in_half += frame.samples_done

    def put_into(self, frame: Frame) -> None:
        """Add the sums to those of the last step, whose samples then are those of all."""
        own = sums_of(frame)
        for name, image in self.whole.items():
            if name not in frame.images:  # no light of that kind at the last step's moment
                frame.images[name] = images.pool.take(*frame.size, image.format)
                frame.target(name).clear()
            if name not in own and name.startswith("film."):
                frame.held.shown[name.replace("film.", "radiance.")] = name
            put(image, frame.target(name), 0, 0, "ADDITIVE_PREMULT")
        for name, image in self.half.items():
            if name in frame.images:
                frame.target(name).clear()
                put(image, frame.target(name), 0, 0, "ADDITIVE_PREMULT")
        frame.drawn_s += self.seconds

    def release(self) -> None:
        for held in (self.whole, self.half, self.ranked):
            for image in held.values():
                images.pool.give(image)
            held.clear()


def sums_of(frame: Frame) -> dict[str, images.Image]:
    """Images in which the samples of a frame add up."""
    names = {frame.held.shown.get(name, name) for name in frame.held.sums}
    return {name: frame.images[name] for name in sorted(names) if name in frame.images}


def _halved(half: str) -> str:
    """The image whose first half `half` is."""
    return f"film.{half.rpartition('.')[2].removesuffix(HALF)}"


def _add(image: images.Image, to: dict[str, images.Image], name: str) -> None:
    if name in to:
        put(image, images.Target((to[name],)), 0, 0, "ADDITIVE_PREMULT")
    else:
        _copy(image, to, name)


def _copy(image: images.Image, to: dict[str, images.Image], name: str) -> None:
    if name not in to:
        to[name] = images.pool.take(*image.size, image.format)
    put(image, images.Target((to[name],)), 0, 0)


def drawn(
    renderer: Renderer,
    steps: Sequence[Step],
    settings: Settings,
    parts: Callable[[Renderer, Frame], Iterator[None]],
) -> Iterator[tuple[int, Callable[[], None]]]:
    """Draw all samples of all steps; `renderer.frame` is the first one's at the start, and the finished one at the end.

    Yields, between parts of samples, how many samples are done, and what ends the picture with these; nothing may be
    drawn after that. The sums are given back, however it ends.
    """
    sums, half = Sums(), settings.samples // 2
    stopped = False

    def stop() -> None:
        nonlocal stopped
        stopped = True
        with turn:
            _finish(renderer, sums, sums.samples + renderer.frame.samples_done)

    try:
        for place, step in enumerate(steps):
            if place:
                with turn:
                    renderer.forget()
                    renderer.begin(step.snapshot, settings, step.numbers)
            frame = renderer.frame
            frame.held.carried = sums.ranked
            first = sum(number < half for number in step.numbers)
            halved = first == 0
            for _ in parts(renderer, frame):
                if not halved and frame.samples_done == first:
                    halved = True
                    with turn:
                        sums.add_half(frame)
                yield sums.samples + frame.samples_done, stop
                if stopped:
                    return
            with turn:
                if not halved:
                    sums.add_half(frame)
                if step is not steps[-1]:
                    sums.add(frame)
        with turn:
            if not step.numbers:
                renderer.draw_surfaces(frame, step.last)
            _finish(renderer, sums, None if settings.is_slice else settings.samples)
    finally:
        with turn:
            sums.release()
            renderer.forget()


def _finish(renderer: Renderer, sums: Sums, samples: int | None) -> None:
    """Bring the picture to its end in the frame that was drawn last; `samples`: how many it is made of, None where
    those of other slices are still missing."""
    frame = renderer.frame
    done = sums.samples + frame.samples_done
    if samples is not None and samples < frame.settings.samples:
        frame.first_part = sums.in_half if sums.half and sums.in_half < done else 0
    sums.put_into(frame)
    renderer.end_with(frame, done, samples)
