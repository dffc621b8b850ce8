"""Slices: samples of one picture that several machines render, and their sums put together again.

A slice holds samples `sample_offset` … of a picture of `samples`. Sums over all slices are those of the whole picture,
but for the order in which floats were added. What is taken from a finished slice:

    sums      light by path, colours, coverage, normals: added up
    first     depth, positions and indices, which every slice has from the picture's first sample: of any slice
    last      what Denoise reads of the last sample (Frame.read_last), to tell surfaces apart: of the last slice
    ranked    pairs of ids and weights: weights added by id (kernels/ranks.py)
    halves    what Denoise compares: sums of the first half of the samples, of the slice in which that half ends

What techniques learn from sample to sample (how open the sky is above a pixel, environment_light.py) begins anew in
each slice: there the merged picture has other noise of the same mean, and no rounding tells it from the whole.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..gfx import images
from ..kernels import ranks
from ..snapshot.scene import RANKED
from .picture import Frame

HALF = "_half"
LAST = ("surface.position", "surface.lobe")
FIRST = ("film.depth", "film.position", "film.index")


@dataclass(frozen=True)
class Slice:
    """Samples `first` … `first + count - 1` of `total`, and the frame's images by name, (H, W, 4) float32."""

    first: int
    count: int
    total: int
    images: dict[str, np.ndarray]

    @property
    def end(self) -> int:
        return self.first + self.count


def taken(frame: Frame, part: str = "", before: Slice | None = None) -> Slice:
    """What a merge needs of a frame whose samples are drawn: of the `part` of a picture, beside those before it."""
    wanted = {frame.held.shown.get(name, name) for name in frame.held.sums} | set(FIRST) | frame.read_last
    wanted |= {name for name in frame.images if name.endswith(HALF) or name.startswith(RANKED)}
    read = {joined(part, name): images.read(frame.images[name]) for name in sorted(wanted) if name in frame.images}
    if before is not None:
        read = before.images | read
    settings = frame.settings
    return Slice(settings.sample_offset, frame.samples_done, settings.samples, read)


def merged(slices: Sequence[Slice]) -> dict[str, np.ndarray]:
    """The images of the whole picture. ValueError with a sentence where the slices are not exactly its samples."""
    slices = sorted(slices, key=lambda one: one.first)
    total, place = slices[0].total, 0
    for one in slices:
        if one.total != total:
            raise ValueError(f"The slices are of pictures of {total} and of {one.total} samples.")
        if one.images.keys() != slices[0].images.keys():
            odd = ", ".join(sorted(one.images.keys() ^ slices[0].images.keys()))
            raise ValueError(f"The slices hold different passes: {odd} are not in all of them.")
        for name, pixels in one.images.items():
            if pixels.shape != slices[0].images[name].shape:
                size, other = (f"{p.shape[1]} × {p.shape[0]}" for p in (slices[0].images[name], pixels))
                raise ValueError(f"The slices are of different sizes: {size} and {other} pixels.")
        if one.first < place:
            raise ValueError(f"Samples {one.first} to {min(place, one.end) - 1} are in more than one slice.")
        if one.first > place:
            raise ValueError(f"Samples {place} to {one.first - 1} of {total} are missing.")
        place = one.end
    if place < total:
        raise ValueError(f"Samples {place} to {total - 1} of {total} are missing.")
    parts = dict.fromkeys(part_of(name) for name in slices[0].images)
    if list(parts) != [""]:
        found = {}
        for part in parts:
            alone = [replace(one, images=images_of_part(one.images, part)) for one in slices]
            found |= {joined(part, name): pixels for name, pixels in merged(alone).items()}
        return found
    found = {name: _merged(name, slices) for name in slices[0].images if not name.startswith(RANKED)}
    mattes: dict[str, list[str]] = {}
    for name in slices[0].images:
        if name.startswith(RANKED):
            mattes.setdefault(name.rpartition(".")[0], []).append(name)
    for names in mattes.values():
        found |= zip(names, ranks.merged([[one.images[name] for name in names] for one in slices]))
    return found


# A slice holds the images of all takes of a picture (film/takes.py), those of one of several under its name.
def joined(part: str, name: str) -> str:
    return f"{part}:{name}" if part else name


def part_of(name: str) -> str:
    return name.partition(":")[0] if ":" in name else ""


def images_of_part(found: dict[str, np.ndarray], part: str) -> dict[str, np.ndarray]:
    """A part's images, by their own names."""
    return {name.removeprefix(f"{part}:"): pixels for name, pixels in found.items() if part_of(name) == part}


def _merged(name: str, slices: Sequence[Slice]) -> np.ndarray:
    if name in FIRST:
        return slices[0].images[name]
    if name in LAST:
        return slices[-1].images[name]
    half = slices[0].total // 2
    if not name.endswith(HALF):
        return _sum([one.images[name] for one in slices])
    path = name.rpartition(".")[2].removesuffix(HALF)
    before = [one.images[f"film.{path}"] for one in slices if one.end < half and f"film.{path}" in one.images]
    return _sum(before + [one.images[name] for one in slices if one.first < half <= one.end])


def _sum(parts: Sequence[np.ndarray]) -> np.ndarray:
    """In doubles, so that the order does not count."""
    return np.sum(parts, axis=0, dtype=np.float64).astype(np.float32)
