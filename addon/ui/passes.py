"""The render passes that Candela writes, under Blender's own names: those of light from frame/light_paths.py."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import bpy
import numpy as np

from ..film.aovs import places
from ..frame.ledger import Ledger
from ..frame.light_paths import LIGHT_PATHS
from ..frame.technique import CAMERA
from ..kernels import ranks
from ..snapshot.extract import aovs_of
from ..snapshot.scene import CRYPTO_DEFAULT, CRYPTOMATTES, Film, Snapshot
from . import light_groups
from .properties import block_of


@dataclass(frozen=True)
class RenderPass:
    """One of Blender's passes. `source` names the frame's image it is made from, and one to divide it by, if any."""

    switch: str  # property of the view layer
    name: str
    channels: str
    kind: str  # of the values, as Blender calls it
    source: str
    first: int = 0  # channel of the image

    @property
    def images(self) -> list[str]:
        """Names of the frame's images that it is made from."""
        return self.source.split(" / ")

    def pixels(self, arrays: dict[str, np.ndarray], exposure: float) -> np.ndarray:
        """The pass, (H, W, channels) float32, from the frame's mean images."""
        image, *color = self.images
        pixels = arrays[image][..., self.first : self.first + len(self.channels)]
        if image == "aov.vector":  # of a mean over samples that of those which have one
            return pixels / np.maximum(arrays[color[0]][..., :1], 1e-6)
        if color:
            pixels = divide_by_color(pixels, arrays[color[0]][..., :3])
        return pixels * exposure if image.startswith("radiance.") else pixels


# Switch of the view layer, Blender's name since 5.0 and before, channels, type, source, first channel if not 0.
_SURFACES = (
    ("use_pass_z", "Depth", "Depth", "Z", "VALUE", "film.depth"),
    ("use_pass_mist", "Mist", "Mist", "Z", "VALUE", "color.diffuse", 3),
    ("use_pass_position", "Position", "Position", "XYZ", "VECTOR", "film.position"),
    ("use_pass_normal", "Normal", "Normal", "XYZ", "VECTOR", "surface.normal_sum"),
    ("use_pass_vector", "Vector", "Vector", "XYZW", "VECTOR", "aov.vector / aov.values.0"),
    ("use_pass_uv", "UV", "UV", "UVA", "VECTOR", "aov.uv"),
    ("use_pass_diffuse_color", "Diffuse Color", "DiffCol", "RGB", "COLOR", "color.diffuse"),
    ("use_pass_glossy_color", "Glossy Color", "GlossCol", "RGB", "COLOR", "color.glossy"),
    ("use_pass_transmission_color", "Transmission Color", "TransCol", "RGB", "COLOR", "color.transmission"),
    ("use_pass_object_index", "Object Index", "IndexOB", "X", "VALUE", "film.index"),
    ("use_pass_material_index", "Material Index", "IndexMA", "X", "VALUE", "film.index", 1),
)
_LIGHT = tuple(
    (path.switch, path.label, path.before_5, "RGB", "COLOR", " / ".join(filter(None, (path.image, path.color))))
    for path in LIGHT_PATHS
)


_DATA = ("film.depth", "film.position", "surface.", "aov.")


def _in_blenders_order(rows: tuple) -> list:
    """Data passes, then each lobe's light followed by its colour, as Blender's panel lists them."""
    first = [row for row in rows if row[5].startswith(_DATA) or row[1] == "Mist"]
    last = [row for row in rows if row[5] == "film.index"]
    by_lobe = sorted((row for row in rows if row not in first and row not in last), key=lambda row: _place(row[1]))
    return [*first, *by_lobe, *last]


def _place(name: str) -> int:
    """Of a pass in Blender's list; those of lobes that it does not know stand behind it."""
    order = ("Diffuse", "Glossy", "Transmission", "Volume", "Emission", "Environment")
    parts = ("Direct", "Indirect", "Color")
    lobe = next((one for one in order if name.split(" ")[0] == one), None)
    part = next((place for place, one in enumerate(parts) if name.endswith(one)), 0)
    return 4 * (order.index(lobe) if lobe else len(order)) + part


PASSES = tuple(
    RenderPass(switch, name if bpy.app.version >= (5, 0) else old, channels, kind, source, *first)
    for switch, name, old, channels, kind, source, *first in _in_blenders_order((*_SURFACES, *_LIGHT))
)


LEAST_COLOR = 1e-6  # of a surface: light is not divided by less
CAMERA_AXES = "camera axes"  # (3, 3) beside the images that passes are made from: right, up, forward
# What things change of the light on shadow catchers: 1 where nothing (film/catcher.py).
CATCHER = RenderPass("cycles.use_pass_shadow_catcher", "Shadow Catcher", "RGB", "COLOR", "film.catcher")
OPEN = RenderPass(
    "use_pass_ambient_occlusion",
    "Ambient Occlusion" if bpy.app.version >= (5, 0) else "AO",
    "RGB",
    "COLOR",
    "film.open",
)
PASSES = (*PASSES, OPEN, CATCHER)

# The picture as it was before Denoise, with the other data that a denoiser is told.
NOISY = RenderPass("", "Noisy Image", "RGBA", "COLOR", "film.noisy")
# The picture as an eye sees it, beside a Combined that stays as it is; written where glare is on.
GLARE = RenderPass("", "Glare", "RGBA", "COLOR", "film.lens")


def wanted_passes(layer: bpy.types.ViewLayer, scene: bpy.types.Scene | None = None) -> list[RenderPass]:
    """The passes that a view layer asks for, and that of the scene's camera where it sees with an eye."""
    wanted = [render_pass for render_pass in PASSES if _ticked(layer, render_pass.switch)] + _aov_passes(layer)
    wanted += cryptomatte_passes(layer)
    split = scene is not None and scene.candela.split_light_groups
    wanted += [RenderPass("", name, "RGB", "COLOR", image) for name, image in light_groups.rows(layer, split)]
    return [*wanted, GLARE] if scene is not None and glare_is_on(scene) else wanted


def _aov_passes(layer: bpy.types.ViewLayer) -> list[RenderPass]:
    """Those that the view layer has by name."""
    aovs, kinds = aovs_of(layer), {"VALUE": ("X", "VALUE"), "COLOR": ("RGBA", "COLOR")}
    placed = list(zip(aovs, places(aovs)))
    named = [RenderPass("", aov.name, *kinds[aov.kind], *place) for aov, place in placed if aov.name]
    distance = [place for aov, place in placed if aov.kind == "DISTANCE"]
    if not distance:
        return named
    return [
        NOISY,
        DenoisingAlbedo("", "Denoising Albedo", "RGB", "COLOR", "color.diffuse color.glossy color.transmission"),
        DenoisingNormal("", "Denoising Normal", "XYZ", "VECTOR", "surface.normal_sum"),
        RenderPass("", "Denoising Depth", "Z", "VALUE", *distance[0]),
        *named,
    ]


class DenoisingAlbedo(RenderPass):
    """What a denoiser is told of the surfaces' colours: their sum."""

    @property
    def images(self) -> list[str]:
        return self.source.split()

    def pixels(self, arrays: dict[str, np.ndarray], exposure: float) -> np.ndarray:
        return np.sum([arrays[name][..., :3] for name in self.images], axis=0, dtype=np.float32)


class DenoisingNormal(RenderPass):
    """What a denoiser is told of the surfaces' normals: in the camera's space, which looks along +Z."""

    def pixels(self, arrays: dict[str, np.ndarray], exposure: float) -> np.ndarray:
        return (arrays[self.source][..., :3] @ arrays[CAMERA_AXES]).astype(np.float32)


@dataclass(frozen=True)
class CryptomattePass(RenderPass):
    """Two levels of a Cryptomatte: `first` counts them."""

    @property
    def images(self) -> list[str]:
        return self.source.split()

    def pixels(self, arrays: dict[str, np.ndarray], exposure: float) -> np.ndarray:
        key = f"ranked {self.source}"
        if key not in arrays:  # once for all passes of a matte
            arrays[key] = np.stack(ranks.ranked([arrays[name] for name in self.images]))
        return arrays[key][self.first]


def _matte(kind: str) -> str:
    return f"Crypto{kind.capitalize()}"


def cryptomatte_passes(layer: bpy.types.ViewLayer) -> list[RenderPass]:
    """Those of the mattes that a view layer asks for. Their channels are in lower case, so that no writer of files
    takes them for colours that may be compressed with losses."""
    found = []
    for kind in CRYPTOMATTES:
        if getattr(layer, f"use_pass_cryptomatte_{kind}"):
            names = Film(0, 0, (0, 0, 0, 0), cryptomatte_levels=layer.pass_cryptomatte_depth).cryptomatte_names(kind)
            found += [
                CryptomattePass(
                    f"use_pass_cryptomatte_{kind}", f"{_matte(kind)}{k:02d}", "rgba", "COLOR", " ".join(names), k
                )
                for k in range(len(names))
            ]
    return found


def cryptomatte_metadata(snapshots: Sequence[Snapshot], layer: str) -> dict[str, str]:
    """Fields of a file's header by which readers find the mattes of a view layer and the names in them, at whatever
    moment they are seen."""
    if not snapshots[0].film.cryptomattes:
        return {}
    shown, fields = [one for snapshot in snapshots for one in snapshot.instances], {}
    materials = [one.name for snapshot in snapshots for one in snapshot.materials[1:]]
    names = {
        "object": [one.object_name for one in shown],
        "material": [CRYPTO_DEFAULT, *materials],
        "asset": [one.asset or one.object_name for one in shown],
    }
    for kind in snapshots[0].film.cryptomattes:
        name = f"{layer}.{_matte(kind)}"
        key = f"cryptomatte/{ranks.murmur_hash(name):08x}"[:-1]
        fields |= {
            f"{key}/name": name, f"{key}/hash": "MurmurHash3_32", f"{key}/conversion": "uint32_to_float32",
            f"{key}/manifest": ranks.manifest(dict.fromkeys(names[kind])),
        }  # fmt: skip
    return fields


def render_metadata(layer: str, ledger: Ledger, seconds: float) -> dict[str, str]:
    """Fields of a file's header that tell of the render of a view layer, named and written as Cycles' are; `seconds`
    without the time of reading the scene."""
    sync = ledger.times.get("sync", 0.0)
    times = {"total_time": seconds + sync, "render_time": seconds, "synchronization_time": sync}
    return {
        f"candela.{layer}.samples": str(ledger.samples),
        **{f"candela.{layer}.{name}": _clock(time) for name, time in times.items()},
    }


def _clock(seconds: float) -> str:
    """As Blender writes times: MM:SS.hh, with hours before it where there are any."""
    minutes, rest = divmod(seconds, 60.0)
    hours, minutes = divmod(int(minutes), 60)
    return (f"{hours:02}:" if hours else "") + f"{minutes:02}:{rest:05.2f}"


def glare_is_on(scene: bpy.types.Scene) -> bool:
    """Whether pictures of the scene's camera are shown with glare."""
    camera = block_of(CAMERA, scene)
    return camera is not None and camera.candela.glare_mode != "OFF"


# Passes of Blender and Cycles that Candela does not write: switch of the view layer or of what it has of Cycles.
_OTHERS = (
    ("use_pass_shadow", "Shadow"),
    ("use_pass_subsurface_direct", "Subsurface Direct"), ("use_pass_subsurface_indirect", "Subsurface Indirect"),
    ("use_pass_subsurface_color", "Subsurface Color"),
)  # fmt: skip


def missing_passes(layer: bpy.types.ViewLayer) -> list[str]:
    """Names of the passes that a view layer asks for in vain, so that what reads them will find nothing."""
    return [name for switch, name in _OTHERS if _ticked(layer, switch)]


def _ticked(layer: bpy.types.ViewLayer, switch: str) -> bool:
    thing = layer
    for name in switch.split("."):
        thing = getattr(thing, name, False)
    return bool(thing)


def divide_by_color(light: np.ndarray, color: np.ndarray) -> np.ndarray:
    """Light over colour per channel, as Cycles writes its passes: a channel without colour takes the mean of others.

    So does one with next to none: at the far edge of a pixel's filter it would make thousands of a trace of light that
    Denoise has brought there.
    """
    has = np.abs(color) > LEAST_COLOR
    quotient = np.where(has, light / np.where(has, color, 1.0), 0.0)
    count = has.sum(axis=-1, keepdims=True)
    mean = quotient.sum(axis=-1, keepdims=True) / np.maximum(count, 1)
    return np.where(has, quotient, mean).astype(np.float32)
