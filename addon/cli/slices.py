"""Slices of a picture as files.

A slice is a multilayer EXR: per view layer the sums that `frame/slices.py` takes, under "LAYER.sum NAME", beside
"LAYER.Combined", the picture of its own samples, which any viewer shows. What a merge must know stands in the header as
JSON, in the attribute `candela`: which samples, of which scene (a hash of all that it is made of, and one of Candela's
own settings, which that leaves out), and the options of the command line.
"""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, replace
from pathlib import Path

import bpy
import numpy as np

from ..compare.exr_write import read_about, write_exr
from ..compare.reference import scene_hash
from ..film import catcher
from ..frame import slices
from ..snapshot.exr import ExrError, read_exr
from ..snapshot.own_settings import all_settings
from ..ui.properties import GROUPS, settings_of
from .refused import USAGE, Refused

ABOUT = "candela"
SUM = "sum "
# What slices of one picture have in common.
ALIKE = ("scene_hash", "settings_hash", "frame", "total", "options", "blender", "layers")
UNLIKE = {  # how a person knows them
    "scene_hash": "scene (its contents differ)",
    "settings_hash": "settings of Candela",
    "total": "number of samples",
}


def _is_number(value: object) -> bool:
    return type(value) is int and abs(value) < 1 << 31


def _is_path(value: object) -> bool:
    return isinstance(value, str) and "\0" not in value


def _is_name(value: object) -> bool:
    """Surrogates stand for bytes of a path that are no UTF-8, which names in Blender do not have."""
    return _is_path(value) and not any("\ud800" <= letter <= "\udfff" for letter in value)


def _are_names(value: object) -> bool:
    return isinstance(value, list) and all(map(_is_name, value))


def _is_size(value: object) -> bool:
    return value is None or (isinstance(value, list) and len(value) == 2 and all(map(_is_number, value)))


# Of what kind each entry of a header is, and of its `options`.
HEADER = {
    "file": _is_path,
    **dict.fromkeys(("scene_hash", "settings_hash", "blender"), _is_name),
    **dict.fromkeys(("frame", "total", "first", "count"), _is_number),
    "layers": lambda value: _are_names(value) and value != [],
    "options": lambda value: isinstance(value, dict),
}
OPTIONS = {
    "size": _is_size,
    "scene": _is_name,
    "view_layer": lambda value: value is None or _is_name(value),
    "assignments": _are_names,
}


@dataclass(frozen=True)
class Part:
    """A slice's file: what its header says, and its sums by view layer once they are read."""

    path: Path
    about: dict


def bounds(text: str, total: int) -> tuple[int, int]:
    """First sample and number of samples of slice "K/N", N of them as equal as can be. ValueError with a sentence."""
    number, _, of = text.partition("/")
    try:
        k, n = int(number), int(of)
    except ValueError:
        k = n = 0
    if not 1 <= k <= n:
        raise ValueError(f"'{text}' is no slice: K/N is, such as 1/4, with K from 1 to N.")
    if n > total:
        raise ValueError(f"{total} samples cannot be split into {n} slices.")
    first, end = total * (k - 1) // n, total * k // n
    return first, end - first


def check_layers(scene: bpy.types.Scene) -> None:
    """Raise Refused where a view layer has a number of samples of its own: slices are parts of one number."""
    if any(layer.samples for layer in scene.view_layers):
        raise Refused(
            "View layers have numbers of samples of their own, and slices need one for all: set theirs to 0, or give "
            "--samples.",
            USAGE,
        )


def settings_hash(scene: bpy.types.Scene) -> str:
    """Hexadecimal hash of Candela's settings that a final picture of the scene depends on: its own and those of all
    data-blocks. Which samples are drawn is left out, and what does not count for slices."""
    settings = settings_of(scene, viewport=False)
    settings = replace(settings, sample_offset=0, sample_count=0, time_limit=0.0, noise_threshold=0.0)
    digest = hashlib.blake2b(f"{settings} {scene.candela.split_light_groups}".encode(), digest_size=20)
    for scope in GROUPS:
        used = [block for block in getattr(bpy.data, f"{scope.lower()}s") if block.users]
        for block in sorted(used, key=lambda block: block.name_full):
            digest.update(f"{scope} {block.name_full!r} {all_settings(block)}".encode())
    return digest.hexdigest()


def about_slice(job) -> dict:
    """What a slice's header says; the same for all slices of a picture but for `first` and `count`."""
    options = job.options
    return {
        "scene_hash": scene_hash(job.scene),
        "settings_hash": settings_hash(job.scene),
        "file": str(options.file.resolve()),
        "frame": job.scene.frame_current,
        "total": job.scene.candela.samples,
        "blender": bpy.app.version_string,
        "options": {
            "size": options.size,
            "scene": job.scene.name,
            "view_layer": options.view_layer,
            "assignments": sorted(options.assignments),
        },
    }


def write(path: Path, about: dict, taken: dict[str, slices.Slice]) -> None:
    """The file of a slice. Its samples are those of its view layers, which all have the same."""
    one = next(iter(taken.values()))
    layers = {}
    for layer, found in taken.items():
        layers[f"{layer}.Combined"] = (
            found.images["film.combined"] if "film.combined" in found.images else _shown(found)
        )
        layers |= {f"{layer}.{SUM}{name}": pixels for name, pixels in found.images.items() if name != "film.combined"}
    about = about | {"first": one.first, "count": one.count, "layers": sorted(taken)}
    write_exr(path, layers, {ABOUT: json.dumps(about)})


def _shown(found: slices.Slice) -> np.ndarray:
    """The mean of a slice's light, for viewers."""
    light, covered = [], 1.0
    for name, pixels in found.images.items():
        if slices.part_of(name) in catcher.PLATES:
            continue
        name = name.removeprefix(f"{slices.part_of(name)}:")
        if name.startswith(("film.", "radiance.")) and name not in slices.FIRST:
            light.append(pixels)
        if name == "radiance.environment":
            covered = np.clip(pixels[..., 3] / found.count, 0.0, 1.0)
    total = np.sum(light, axis=0) / found.count
    total[..., 3] = covered
    return total.astype(np.float32)


def read_header(path: Path) -> Part:
    """Raises Refused where the file is no slice, or its header is not one that `write` makes."""
    try:
        about = json.loads(read_about(path)[ABOUT])
    except FileNotFoundError:
        raise Refused(f"There is no file {path}.") from None
    except ExrError as error:
        raise Refused(str(error)) from None
    except OSError as error:
        raise Refused(f"{path} could not be read: {error.strerror}.") from None
    except (KeyError, ValueError, RecursionError):
        raise Refused(f"{path} is no slice of Candela: `render --slice K/N --output NAME.exr` writes them.") from None
    wrong = _differs(about, HEADER) or _differs(about["options"], OPTIONS)
    if wrong:
        raise Refused(f"{path} has no proper header of a slice: {wrong}; render it again.")
    return Part(path, about)


def _differs(about: object, kinds: dict) -> str:
    """What is wrong with a part of a header that should hold values of these kinds; empty where nothing is."""
    if not isinstance(about, dict):
        return f"{type(about).__name__} in place of names and values"
    for name, is_right in kinds.items():
        if not is_right(about.get(name)):
            return f"'{name}' is missing or of another kind"
    return ""


def read_sums(part: Part) -> dict[str, slices.Slice]:
    """A file's slice of each view layer. Raises Refused."""
    try:
        layers = read_exr(part.path)
    except (ExrError, OSError) as error:
        raise Refused(f"{part.path} could not be read: {error}".rstrip(".") + ".") from None
    about, found = part.about, {}
    for layer in about["layers"]:
        prefix = f"{layer}.{SUM}"
        sums = {name.removeprefix(prefix): pixels for name, pixels in layers.items() if name.startswith(prefix)}
        found[layer] = slices.Slice(about["first"], about["count"], about["total"], sums)
    return found


def of_one_picture(parts: list[Part]) -> None:
    """Raise Refused where slices are of different pictures."""
    first = parts[0]
    for part in parts[1:]:
        for name in ALIKE:
            if part.about.get(name) != first.about.get(name):
                what = UNLIKE.get(name, name)
                raise Refused(f"{first.path.name} and {part.path.name} are slices of different pictures: {what}.")


def check_output(path: Path) -> None:
    if path.suffix.lower() != ".exr":
        raise Refused(f"A slice is written as .exr, and {path.name} does not end so.", USAGE)
