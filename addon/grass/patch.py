"""The file of a grass patch: what a tile shows for all directions of view and light, compressed.

A zip of numpy arrays (.grass). Components and heights are 16-bit integers with 11 and 12 bits of meaning, stored as
planes of high and low bytes, which deflate better; coefficients and means are 32-bit floats. A file is checked before
anything of it is used: sizes first, then shapes, ranges and finite numbers.
"""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from ..whole_files import DAMAGED, replacing
from .compression import LUMA, components, decoded, encoded, mean_ratio, white_of
from .directions import Rings

SUFFIX = ".grass"
FORMAT, VERSION = "Candela grass patch", 1
PART_STEPS, HEIGHT_STEPS, MEAN_STEPS = 2047.0, 4095.0, 4095.0
PIXEL, FAR_PIXEL = 1.0, 4.0  # texels, standard deviation of the filter at which contrast is compared, near and far away
MOST_BYTES = 1 << 30  # of all arrays of a file, unpacked
MOST_TEXELS, MOST_DIRECTIONS, MOST_RINGS = 256, 1024, (8, 5)
MOST_LUMA, MOST_CHROMA = 8, 2


class PatchError(ValueError):
    """A file that is no grass patch, or one that could not be written; the message is a sentence."""


@dataclass(frozen=True)
class Patch:
    """V views, L lights, N texels along a side, K components of luma and C of each difference of colour.

    Each view has P = L + 1 pictures: under each light, and under a uniform sky of radiance 1. `mean` (V, N, N, 3) of
    encoded pictures over lights; `parts` (V, N, N, K + 2C) within -1..1; `weights` (V, K + 2C, P); `picture_mean` and
    `ratio` (V, P, 3): linear mean of a picture, and what the mean of the decoded one is multiplied by to become that;
    `contrast` (V, P): the same of standard deviations of luminance. `excess` (V, P): of the mean where contrast is
    doubled and what is below 0 is cut off. `light_alike` and `view_alike` (V,): correlation of
    a view's pictures under neighbouring lights, and with those of neighbouring views, moved by their parallax.
    `view_alike_far`: where pixels are as wide as eight texels. Patches of earlier versions have neither it nor `finer`.
    `heights` (V, N, N): of what is seen, 0 the ground, 1 the top. Row 0 has the smallest y. `finer` (V, M, 3): linear
    means of the tile under the M lights of `finer_lights`, between those that pictures are of; without them M is 0.
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
    contrast: np.ndarray
    excess: np.ndarray
    light_alike: np.ndarray
    view_alike: np.ndarray
    heights: np.ndarray
    finer_lights: Rings | None = None
    finer: np.ndarray | None = None
    view_alike_far: np.ndarray | None = None

    @property
    def texels(self) -> int:
        return self.mean.shape[1]

    def pictures(self, view: int) -> np.ndarray:
        """(P, N, N, 3) linear pictures of a view, decoded: pi times radiance over the sun's irradiance head-on."""
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
        return self.picture_mean[:, -1]

    def mean_heights(self) -> np.ndarray:
        """(V,) of what each view sees, 0..1."""
        return self.heights.mean(axis=(1, 2))


def compressed_patch(
    size: float, height: float, views: Rings, lights: Rings, pictures, heights: np.ndarray, luma: int = 8,
    chroma: int = 2, finer_lights: Rings | None = None, finer: np.ndarray | None = None,
) -> Patch:  # fmt: skip
    """A patch of pictures: `pictures(view)` gives (L, N, N, 3) linear ones, `heights` (V, N, N) in metres."""
    whole = [np.asarray(pictures(view), np.float32) for view in range(views.number)]
    white = white_of(np.concatenate([one[:, ::2, ::2] for one in whole]))
    luma, chroma = min(luma, lights.number), min(chroma, lights.number)
    cells = lights.solid_angles() / np.pi
    names = ("mean", "parts", "weights", "picture_mean", "ratio", "contrast", "excess", "light_alike")
    made: dict[str, list] = {name: [] for name in names}
    pairs = lights.neighbours()
    for light in whole:
        count, texels = light.shape[:2]
        flat = light.transpose(1, 2, 0, 3).reshape(-1, count, 3).astype(np.float64)
        found = [components(encoded(flat, white)[..., k], luma if k == 0 else chroma) for k in range(3)]
        flat = np.concatenate([flat, (flat * cells[None, :, None]).sum(axis=1, keepdims=True)], axis=1)
        sky = encoded(flat[:, -1], white)
        weights, back = [], []
        for k, one in enumerate(found):
            of_sky = np.linalg.lstsq(one.parts, sky[:, k] - one.mean, rcond=None)[0]
            weights.append(np.concatenate([one.weights, of_sky[:, None]], axis=1))
            back.append(one.mean[:, None] + one.parts @ weights[-1])
        shown = decoded(np.stack(back, axis=-1), white)
        ratio = np.clip(mean_ratio(flat, shown), 0.0, 100.0)
        true, kept_back = flat @ LUMA, (shown * ratio) @ LUMA
        made["mean"].append(np.stack([one.mean for one in found], axis=-1).reshape(texels, texels, 3))
        made["parts"].append(np.concatenate([one.parts for one in found], axis=1).reshape(texels, texels, -1))
        made["weights"].append(np.concatenate(weights))
        made["picture_mean"].append(flat.mean(axis=0))
        made["ratio"].append(ratio)
        true, kept_back = (_seen(one.T.reshape(-1, texels, texels)) for one in (true, kept_back))
        had, has = true.std(axis=(1, 2)), kept_back.std(axis=(1, 2))
        made["contrast"].append(np.clip(had / np.maximum(has, 1e-8), 0.5, 3.0))
        mean = flat.mean(axis=0)
        doubled = np.maximum(mean + 2.0 * (shown * ratio - mean), 0.0).mean(axis=0)
        made["excess"].append(np.clip(doubled @ LUMA / np.maximum(mean @ LUMA, 1e-8) - 1.0, 0.0, 2.0))
        # Of decoded pictures: what they have lost was alike in none, and it is their mean that loses contrast.
        made["light_alike"].append(np.mean([_alike(kept_back[a], kept_back[b]) for a, b in pairs]))
    arrays = {name: np.stack(values).astype(np.float32) for name, values in made.items()}
    below = np.clip(heights / height, 0, 1).astype(np.float32)
    patch = Patch(
        size, height, views, lights, white, luma, chroma, heights=below, finer_lights=finer_lights, finer=finer,
        view_alike=np.zeros(views.number), **arrays,
    )  # fmt: skip
    near, far = views_alike(patch, (PIXEL, FAR_PIXEL)).astype(np.float32)
    return replace(patch, view_alike=near, view_alike_far=far)


def _seen(pictures: np.ndarray, pixel: float = PIXEL) -> np.ndarray:
    """Pictures (..., N, N) as pixels of about two texels show them: what they lose is mostly finer than that."""
    texels = pictures.shape[-1]
    frequency = np.fft.fftfreq(texels)
    kept_waves = np.exp(-2.0 * (np.pi * pixel) ** 2 * (frequency[:, None] ** 2 + frequency[None, :] ** 2))
    return np.fft.ifft2(np.fft.fft2(pictures) * kept_waves).real


def _alike(a: np.ndarray, b: np.ndarray) -> float:
    """Correlation of two pictures, 0 to 1."""
    both = a.std() * b.std()
    return float(np.clip(((a - a.mean()) * (b - b.mean())).mean() / both, 0.0, 1.0)) if both > 1e-12 else 1.0


def views_alike(patch: Patch, pixels: Sequence[float]) -> np.ndarray:
    """(K, V), for each of K widths of pixels: how much the decoded pictures of a view are like those of its neighbours
    under the same lights, when what is at their mean height is laid over the same in theirs."""
    views, texels, slope = patch.views, patch.texels, patch.height / patch.size
    some = range(0, patch.lights.number, max(patch.lights.number // 7, 1))
    light = np.stack([patch.pictures(view)[some] @ LUMA for view in range(views.number)])
    slant = views.vectors[:, :2] / views.vectors[:, 2:]
    mean = patch.mean_heights()
    sums, numbers = np.zeros((len(pixels), views.number)), np.zeros(views.number)
    shown = [_seen(light, pixel) for pixel in pixels]
    for a, b in views.neighbours():
        below = 1.0 - 0.5 * (mean[a] + mean[b])
        x, y = (int(step) for step in np.rint(below * slope * (slant[b] - slant[a]) * texels))
        moved = [np.roll(one[b], (-y, -x), axis=(1, 2)) for one in shown]
        found = [np.mean([_alike(*pair) for pair in zip(one[a], other)]) for one, other in zip(shown, moved)]
        for view in (a, b):
            sums[:, view] += found
            numbers[view] += 1.0
    return sums / np.maximum(numbers, 1.0)


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
        "mean": _planes(patch.mean * MEAN_STEPS),
        "parts": _planes(patch.parts * PART_STEPS),
        "heights": _planes(patch.heights * HEIGHT_STEPS),
        "weights": patch.weights.astype("<f4"),
        "picture_mean": patch.picture_mean.astype("<f4"),
        "ratio": patch.ratio.astype("<f4"),
        "contrast": patch.contrast.astype("<f4"),
        "excess": patch.excess.astype("<f4"),
        "light_alike": patch.light_alike.astype("<f4"),
        "view_alike": patch.view_alike.astype("<f4"),
    }
    if patch.view_alike_far is not None:
        arrays["view_alike_far"] = patch.view_alike_far.astype("<f4")
    if patch.finer_lights is not None:
        about["finer_lights"] = [list(patch.finer_lights.polar), list(patch.finer_lights.counts)]
        arrays["finer"] = patch.finer.astype("<f4")
    arrays["about"] = np.frombuffer(json.dumps(about).encode(), np.uint8)
    write_arrays(path, arrays)


def write_arrays(path: Path, arrays: dict[str, np.ndarray]) -> None:
    """A zip of arrays that is there whole or not at all. Raises PatchError."""
    try:
        with replacing(path) as file, zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as packed:
            for name, array in arrays.items():
                content = io.BytesIO()
                np.lib.format.write_array(content, np.ascontiguousarray(array), allow_pickle=False)
                entry = zipfile.ZipInfo(f"{name}.npy")  # of 1980: equal patches are equal files
                entry.compress_type = zipfile.ZIP_DEFLATED
                packed.writestr(entry, content.getvalue())
    except OSError as error:
        raise PatchError(f"{path} could not be written: {error.strerror or error}.") from error


def read_arrays(path: Path) -> dict[str, np.ndarray]:
    """The arrays of such a zip. Raises PatchError."""
    if path.exists() and not path.is_file():  # to open a pipe would wait
        raise PatchError(f"{path} is no file.")
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
    except DAMAGED as error:
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
        finer = about.get("finer_lights")  # patches of earlier versions have none
        if finer is not None:
            finer = Rings(tuple(map(float, finer[0])), tuple(map(int, finer[1])))
            small, rings = small and finer.number <= MOST_DIRECTIONS, rings and len(finer.polar) <= MOST_RINGS[0]
        if not (small and rings and 1 <= luma <= MOST_LUMA and 1 <= chroma <= MOST_CHROMA):
            raise PatchError(f"{path} has more directions, texels or components than can be shown.")
        patch = Patch(
            float(about["size"]), float(about["height"]), views, lights, float(about["white"]), luma, chroma,
            _whole(arrays["mean"], (v, n, n, 3)) / MEAN_STEPS,
            _whole(arrays["parts"], (v, n, n, k)) / PART_STEPS,
            _floats(arrays["weights"], (v, k, lights.number + 1)),
            _floats(arrays["picture_mean"], (v, lights.number + 1, 3)),
            _floats(arrays["ratio"], (v, lights.number + 1, 3)),
            _floats(arrays["contrast"], (v, lights.number + 1)),
            _floats(arrays["excess"], (v, lights.number + 1)),
            _floats(arrays["light_alike"], (v,)),
            _floats(arrays["view_alike"], (v,)),
            _whole(arrays["heights"], (v, n, n)) / HEIGHT_STEPS,
            finer, None if finer is None else _floats(arrays["finer"], (v, finer.number, 3)),
            _floats(arrays["view_alike_far"], (v,)) if "view_alike_far" in arrays else None,
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
