"""Reference renders on disk: one compressed .npz per reference, named by the hash of what was rendered.

References stand in a folder of their own, `candela_references`, below the one that the user names, and their names
begin with `candela_`: only such files are counted and deleted, whatever else lies there. An entry is written under a
temporary name and renamed, so that a reader never sees half of one. An entry that cannot be read is treated as if it
were not there, and is written again. When the entries outgrow their limit, those that were not used for the longest
time go first.
"""

from __future__ import annotations

import contextlib
import json
import os
import stat
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..whole_files import DAMAGED, clear_abandoned, replacing
from .passes import light_paths

LIMIT_BYTES = 2 << 30
FOLDER = "candela_references"  # below the folder that is named
MARK = "candela_"  # how names of entries begin
HALF_MAX = 65504.0  # largest float16: the half difference is kept in 16 bits, it only measures noise


@dataclass(frozen=True)
class Reference:
    """The mean of two renders that differ in nothing but their seed, and half their difference.

    `images` is the mean, `half` half the difference, both by Candela's names, (H, W, C) float32, bottom row first.
    Depth is taken from the first render alone: a mean of "here" and "nowhere" would be no depth.
    """

    images: dict[str, np.ndarray]
    half: dict[str, np.ndarray]
    samples: int  # of each of the two
    seconds: float  # wall time of both renders together, when they were made
    film_transparent: bool = False
    cached: bool = False  # found on disk instead of rendered
    key: str = ""
    engine: str = "CYCLES"

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        height, width = self.images["combined"].shape[:2]
        return width, height

    @np.errstate(over="ignore", invalid="ignore")
    def paths(self) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
        """Light paths as radiance: the mean of the two renders' paths, and half their difference."""
        first = light_paths({k: v + self.half[k] for k, v in self.images.items()}, self.film_transparent)
        second = light_paths({k: v - self.half[k] for k, v in self.images.items()}, self.film_transparent)
        mean = {name: (first[name] + second[name]) * np.float32(0.5) for name in first}
        half = {name: (first[name] - second[name]) * np.float32(0.5) for name in first}
        return mean, half


def two_seeds(first: dict[str, np.ndarray], second: dict[str, np.ndarray]) -> tuple[dict, dict]:
    """Mean and half difference of two renders, as `Reference` holds them."""
    images, half = {}, {}
    for name in first.keys() & second.keys():
        one, other = first[name], second[name]
        with np.errstate(over="ignore", invalid="ignore"):  # the metrics count what is not finite
            images[name] = one if name == "depth" else (one + other) * np.float32(0.5)
            half[name] = np.zeros_like(one) if name == "depth" else (one - other) * np.float32(0.5)
    return images, half


def entry(folder: Path, key: str) -> Path:
    """The file of that key. `folder` is the one that the user names, here and in what follows."""
    return folder / FOLDER / f"{MARK}{key}.npz"


def load(folder: Path, key: str) -> Reference | None:
    """The reference of that key, or None when there is none or it cannot be read."""
    path = entry(folder, key)
    try:
        with np.load(path, allow_pickle=False) as file:
            about = json.loads(str(file["about"]))
            images = {name[6:]: file[name] for name in file.files if name.startswith("image/")}
            half = {name[5:]: file[name].astype(np.float32) for name in file.files if name.startswith("half/")}
        made = Reference(images, half, about["samples"], about["seconds"], about["film_transparent"], True, key)
    except DAMAGED:
        return None
    if "combined" not in images or images.keys() != half.keys():
        return None
    with contextlib.suppress(OSError):
        os.utime(path)  # used now: the oldest go first when room is made
    return made


def save(folder: Path, reference: Reference) -> None:
    """Write the reference under its key. Raises `OSError` with a sentence when the folder cannot be written."""
    about = {
        "samples": reference.samples,
        "seconds": reference.seconds,
        "film_transparent": reference.film_transparent,
    }
    arrays = {f"image/{name}": pixels for name, pixels in reference.images.items()}
    for name, pixels in reference.half.items():
        arrays[f"half/{name}"] = np.clip(pixels, -HALF_MAX, HALF_MAX).astype(np.float16)
    try:
        with replacing(entry(folder, reference.key), ".npz") as file:
            np.savez_compressed(file, about=np.array(json.dumps(about)), **arrays)
    except OSError as error:
        raise OSError(f"The reference could not be kept in {folder}: {error.strerror or error}.") from error
    make_room(folder)


def make_room(folder: Path, limit: int = LIMIT_BYTES) -> None:
    """Delete the least recently used entries until together they are within the limit; the newest one stays.

    Files without the cache's mark and links are neither counted nor deleted. What another process is writing is left
    alone, unless that process must have ended long ago.
    """
    entries = []
    clear_abandoned(folder / FOLDER)
    for path in (folder / FOLDER).glob("*.npz"):
        with contextlib.suppress(OSError):
            about = path.lstat()
            if stat.S_ISREG(about.st_mode) and path.name.startswith(MARK):
                entries.append((about.st_mtime_ns, about.st_size, path))
    entries.sort(reverse=True)
    total = 0
    for number, (_, size, path) in enumerate(entries):
        total += size
        if total > limit and number > 0:
            with contextlib.suppress(OSError):
                path.unlink()
