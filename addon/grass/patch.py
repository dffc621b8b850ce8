"""The file of a grass patch: what a tile shows for all directions of view and light, compressed.

A zip of numpy arrays (.grass). Components and heights are 16-bit integers with 11 and 12 bits of meaning, stored as
planes of high and low bytes, which deflate better; coefficients and means are 32-bit floats. A file is checked before
anything of it is used: sizes first, then shapes, ranges and finite numbers.
"""

from __future__ import annotations

import contextlib
import io
import json
import zipfile
import zlib
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from .compression import components, decoded, encoded, mean_ratio, white_of
from .directions import Rings

SUFFIX = ".grass"
FORMAT, VERSION = "Candela grass patch", 1
PART_STEPS, HEIGHT_STEPS, MEAN_STEPS = 2047.0, 4095.0, 4095.0
MOST_BYTES = 1 << 30  # of all arrays of a file, unpacked
MOST_TEXELS, MOST_DIRECTIONS, MOST_RINGS = 256, 1024, (8, 5)
MOST_LUMA, MOST_CHROMA = 8, 2


class PatchError(ValueError):
    """A file that is no grass patch, or one that could not be written; the message is a sentence."""


@dataclass(frozen=True)
class Patch:
    """V views, L lights, N texels along a side, K components of luma and C of each difference of colour.

    `mean` (V, N, N, 3) of encoded pictures over lights; `parts` (V, N, N, K + 2C) within -1..1; `weights`
    (V, K + 2C, L); `picture_mean` and `ratio` (V, L, 3): linear mean of a picture, and what the mean of the decoded one
    is multiplied by to become that; `heights` (V, N, N): of what is seen, 0 the ground, 1 the top. Row 0 has the
    smallest y.
    """

    size: float  # m, of the tile's side
    height: float  # m, of the plane on top that texels lie in
    views: Rings
    lights: Rings
    white: float
    luma: int
    chroma: int
    mean: np.ndarray
    parts: np.ndarray
    weights: np.ndarray
    picture_mean: np.ndarray
    ratio: np.ndarray
    heights: np.ndarray

    @property
    def texels(self) -> int:
        return self.mean.shape[1]

    def pictures(self, view: int) -> np.ndarray:
        """(L, N, N, 3) linear pictures of a view, decoded: pi times radiance over the sun's irradiance head-on."""
        k, c = self.luma, self.chroma
        places = self.parts[view].reshape(-1, k + 2 * c)
        values = []
        for channel, (first, end) in enumerate(((0, k), (k, k + c), (k + c, k + 2 * c))):
            mean = self.mean[view, ..., channel].reshape(-1, 1)
            values.append(mean + places[:, first:end] @ self.weights[view, first:end])
        found = decoded(np.stack(values, axis=-1), self.white) * self.ratio[view]
        return found.reshape(self.texels, self.texels, -1, 3).transpose(2, 0, 1, 3)

    def albedo(self) -> np.ndarray:
        """(V, 3) of the tile from each view: what it reflects of a uniform sky."""
        cells = self.lights.solid_angles() / np.pi
        return np.einsum("l,vlc->vc", cells, self.picture_mean)

    def mean_heights(self) -> np.ndarray:
        """(V,) of what each view sees, 0..1."""
        return self.heights.mean(axis=(1, 2))


def compressed_patch(
    size: float, height: float, views: Rings, lights: Rings, pictures, heights: np.ndarray, luma: int = 8,
    chroma: int = 2,
) -> Patch:  # fmt: skip
    """A patch of pictures: `pictures(view)` gives (L, N, N, 3) linear ones, `heights` (V, N, N) in metres."""
    whole = [pictures(view) for view in range(views.number)]
    white = white_of(np.concatenate([one[:, ::2, ::2] for one in whole]))
    made: dict[str, list] = {"mean": [], "parts": [], "weights": [], "picture_mean": [], "ratio": []}
    for light in whole:
        count, texels = light.shape[:2]
        flat = light.transpose(1, 2, 0, 3).reshape(-1, count, 3).astype(np.float64)
        data = encoded(flat, white)
        found = [components(data[..., k], luma if k == 0 else chroma) for k in range(3)]
        back = decoded(np.stack([one.pictures() for one in found], axis=-1), white)
        made["mean"].append(np.stack([one.mean for one in found], axis=-1).reshape(texels, texels, 3))
        parts = np.concatenate([one.parts for one in found], axis=1)
        made["parts"].append(parts.reshape(texels, texels, -1))
        made["weights"].append(np.concatenate([one.weights for one in found]))
        made["picture_mean"].append(flat.mean(axis=0))
        made["ratio"].append(np.clip(mean_ratio(flat, back), 0.0, 100.0))
    arrays = {name: np.stack(values).astype(np.float32) for name, values in made.items()}
    luma, chroma = min(luma, lights.number), min(chroma, lights.number)
    return Patch(
        size, height, views, lights, white, luma, chroma, heights=np.clip(heights / height, 0, 1).astype(np.float32),
        **arrays,
    )  # fmt: skip


# The file ------------------------------------------------------------------------------------------------------------


def save(patch: Patch, path: Path) -> None:
    """Write the file in one go: beside its place, then renamed. Raises PatchError where that fails."""
    about = {
        "format": FORMAT, "version": VERSION, "size": patch.size, "height": patch.height, "white": patch.white,
        "luma": patch.luma, "chroma": patch.chroma, "texels": patch.texels,
        "views": [list(patch.views.polar), list(patch.views.counts)],
        "lights": [list(patch.lights.polar), list(patch.lights.counts)],
    }  # fmt: skip
    arrays = {
        "about": np.frombuffer(json.dumps(about).encode(), np.uint8),
        "mean": _planes(patch.mean * MEAN_STEPS),
        "parts": _planes(patch.parts * PART_STEPS),
        "heights": _planes(patch.heights * HEIGHT_STEPS),
        "weights": patch.weights.astype("<f4"),
        "picture_mean": patch.picture_mean.astype("<f4"),
        "ratio": patch.ratio.astype("<f4"),
    }
    write_arrays(path, arrays)


def write_arrays(path: Path, arrays: dict[str, np.ndarray]) -> None:
    """A zip of arrays that is there whole or not at all. Raises PatchError."""
    unfinished = path.with_name(path.name + ".unfinished")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with zipfile.ZipFile(unfinished, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as packed:
            for name, array in arrays.items():
                content = io.BytesIO()
                np.lib.format.write_array(content, np.ascontiguousarray(array), allow_pickle=False)
                entry = zipfile.ZipInfo(f"{name}.npy")  # of 1980: equal patches are equal files
                entry.compress_type = zipfile.ZIP_DEFLATED
                packed.writestr(entry, content.getvalue())
        unfinished.replace(path)
    except OSError as error:
        with contextlib.suppress(OSError):
            unfinished.unlink()
        raise PatchError(f"{path} could not be written: {error.strerror or error}.") from error


def read_arrays(path: Path) -> dict[str, np.ndarray]:
    """The arrays of such a zip. Raises PatchError."""
    try:
        with zipfile.ZipFile(path) as packed:
            if sum(entry.file_size for entry in packed.infolist()) > MOST_BYTES:
                raise PatchError(f"{path} holds more than {MOST_BYTES >> 20} MiB: that is no grass patch.")
            return {
                entry.filename.removesuffix(".npy"): np.lib.format.read_array(
                    io.BytesIO(packed.read(entry)), allow_pickle=False
                )
                for entry in packed.infolist()
            }
    except PatchError:
        raise
    except OSError as error:
        raise PatchError(f"{path} could not be read: {error.strerror or error}.") from error
    except (zipfile.BadZipFile, zlib.error, ValueError, EOFError, KeyError, NotImplementedError, RuntimeError) as error:
        raise PatchError(f"{path} is no grass patch, or it is damaged.") from error


def load(path: Path) -> Patch:
    """Read and check a file. Raises PatchError with a sentence that names it."""
    arrays = read_arrays(path)
    try:
        about = json.loads(bytes(arrays["about"]))
        if about["format"] != FORMAT:
            raise PatchError(f"{path} is no grass patch.")
        if about["version"] != VERSION:
            raise PatchError(f"{path} is a grass patch of version {about['version']}; this Candela reads {VERSION}.")
        views, lights = (Rings(tuple(map(float, p)), tuple(map(int, c))) for p, c in (about["views"], about["lights"]))
        luma, chroma, n = (int(about[name]) for name in ("luma", "chroma", "texels"))
        k, v = luma + 2 * chroma, views.number
        small = max(v, lights.number) <= MOST_DIRECTIONS and 2 <= n <= MOST_TEXELS
        rings = len(views.polar) <= MOST_RINGS[0] and len(lights.polar) <= MOST_RINGS[1]
        if not (small and rings and 1 <= luma <= MOST_LUMA and 1 <= chroma <= MOST_CHROMA):
            raise PatchError(f"{path} has more directions, texels or components than can be shown.")
        patch = Patch(
            float(about["size"]), float(about["height"]), views, lights, float(about["white"]), luma, chroma,
            _whole(arrays["mean"], (v, n, n, 3)) / MEAN_STEPS,
            _whole(arrays["parts"], (v, n, n, k)) / PART_STEPS,
            _floats(arrays["weights"], (v, k, lights.number)),
            _floats(arrays["picture_mean"], (v, lights.number, 3)),
            _floats(arrays["ratio"], (v, lights.number, 3)),
            _whole(arrays["heights"], (v, n, n)) / HEIGHT_STEPS,
        )  # fmt: skip
        sizes = np.array([patch.size, patch.height, patch.white])
        if not (np.isfinite(sizes).all() and (sizes > 0.0).all()):
            raise ValueError("sizes")
    except PatchError:
        raise
    except (ValueError, KeyError, TypeError, AttributeError, OverflowError) as error:
        raise PatchError(f"{path} is no grass patch, or it is damaged.") from error
    return patch


@lru_cache(maxsize=8)
def _known(path: Path, changed: int, length: int) -> Patch:
    return load(path)


def kept(path: Path) -> Patch:
    """`load`, once for each content of a file."""
    try:
        state = path.stat()
    except OSError as error:
        raise PatchError(f"{path} could not be read: {error.strerror or error}.") from error
    return _known(path, state.st_mtime_ns, state.st_size)


def _planes(values: np.ndarray) -> np.ndarray:
    """Two planes of bytes, (2, ...), of numbers as 16-bit integers."""
    whole = np.clip(np.rint(values), -32768, 32767).astype("<i2")
    return np.moveaxis(whole[..., None].view(np.uint8), -1, 0)


def _whole(planes: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    if planes.dtype != np.uint8 or planes.shape != (2, *shape):
        raise ValueError("shape")
    return np.ascontiguousarray(np.moveaxis(planes, 0, -1)).view("<i2")[..., 0].astype(np.float32)


def _floats(values: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    if values.dtype != np.dtype("<f4") or values.shape != shape or not np.isfinite(values).all():
        raise ValueError("shape")
    return values
