"""Hashes of pictures, to show that a change of the code changes none: `python -m bench hashes write FILE`.

After the change: `python -m bench hashes compare FILE`. Pictures of two drivers differ in the last digits, and in what
depends on those: `--within` sets how far the combined picture may be off.

The sample scenes at 64 x 48 pixels with four samples and with one, every technique of every slot, and viewport drafts.
A picture is hashed with all its light paths. Pictures of one driver and one Blender are equal to the bit when the code
computes the same; where they differ, `compare` prints the largest difference relative to the picture's mean, so FILE
holds the pixels too (a compressed numpy archive of a few megabytes).
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
SIZE = (64, 48)
OF_TECHNIQUES = "cornell_box", "soft_shadow_garden", "hdri_product"  # scenes that show every slot between them
IMAGES = (
    "film.combined", "radiance.diffuse_direct", "radiance.diffuse_indirect", "radiance.glossy_direct",
    "radiance.glossy_indirect", "radiance.transmission_indirect", "radiance.emission", "radiance.environment",
    "color.diffuse", "surface.normal_sum", "film.depth",
)  # fmt: skip


def add_options(parser) -> None:
    parser.add_argument("verb", choices=("write", "compare"))
    parser.add_argument("file", type=Path, help="the archive of pictures, .npz")
    parser.add_argument("--only", default="", help="pictures whose name holds this")
    parser.add_argument(
        "--within", type=float, default=0.0, metavar="SHARE",
        help="compare: pictures count as equal if the root mean square of the difference is at most that of the mean",
    )  # fmt: skip


def command(options) -> int:
    if options.verb == "write":
        np.savez_compressed(options.file, **dict(pictures(options.only)))
        return 0
    known = np.load(options.file)
    changed = 0
    for name, pixels in pictures(options.only):
        if name not in known:
            print(f"{name:<52} new {digest(pixels)}", flush=True)
        elif digest(known[name]) == digest(pixels):
            print(f"{name:<52} equal {digest(pixels)}", flush=True)
        elif options.within and apart(known[name], pixels) <= options.within:
            print(f"{name:<52} within {apart(known[name], pixels):.3g}", flush=True)
        else:
            changed += 1
            print(f"{name:<52} DIFFERS {difference(known[name], pixels)}", flush=True)
    print(f"{changed} pictures differ.")
    return 1 if changed else 0


def digest(pixels: np.ndarray) -> str:
    """The first 16 hexadecimal digits of a hash of the picture's shape and bits."""
    return hashlib.blake2b(repr(pixels.shape).encode() + pixels.tobytes(), digest_size=8).hexdigest()


def apart(before: np.ndarray, after: np.ndarray) -> float:
    """Root mean square difference of two combined pictures, the first three channels, by the mean of the first."""
    one, other = (picture[..., :3].astype(np.float64) for picture in (before, after))
    return float(np.sqrt(np.square(one - other).mean()) / max(np.abs(one).mean(), 1e-30))


def difference(before: np.ndarray, after: np.ndarray) -> str:
    """The largest difference of two pictures relative to their mean, as a sentence."""
    if before.shape != after.shape:
        return f"in shape: {before.shape} and {after.shape}"
    most = np.abs(before.astype(np.float64) - after).max() / max(np.abs(before).mean(), 1e-30)
    return f"by at most {most:.3g} of the mean, RMS of the combined picture {apart(before, after):.3g}"


def pictures(only: str = "") -> Iterator[tuple[str, np.ndarray]]:
    """All pictures by name, (H, W, channels of all IMAGES) float32."""
    import bpy

    import addon
    from addon.gfx import device

    os.environ.setdefault(device.VARIABLE, "software")  # what this machine measures must turn no choice
    from addon.techniques import REGISTRY
    from addon.ui.properties import slots

    addon.register()
    for file in sorted((ROOT / "sample_blends").glob("*.blend")):
        kinds = [("4 samples", 4, {}, False), ("1 sample", 1, {}, False), ("draft", 1, {}, True)]
        if file.stem in OF_TECHNIQUES:
            kinds += [
                (f"{slot} by {technique.name}", 1, {slot: technique.name}, False)
                for slot in slots()
                for technique in REGISTRY
                if slot in technique.fills
            ]
        kinds = [kind for kind in kinds if only in f"{file.stem}, {kind[0]}"]
        if not kinds:
            continue
        bpy.ops.wm.open_mainfile(filepath=str(file))
        for title, samples, chosen, draft in kinds:
            yield f"{file.stem}, {title}", picture(bpy.context.scene, samples, chosen, draft)


def picture(scene, samples: int, chosen: dict[str, str], draft: bool) -> np.ndarray:
    """Render by the engine's own renderer; `chosen`: technique by slot."""
    from dataclasses import replace

    import bpy

    from addon.frame.run import Renderer
    from addon.snapshot import SnapshotCache, take
    from addon.techniques import make_registry
    from addon.ui.properties import settings_of

    for slot, technique in chosen.items():
        setattr(scene.candela, f"slot_{slot}", technique)
    settings = replace(settings_of(scene, viewport=draft), samples=samples)
    for slot in chosen:
        setattr(scene.candela, f"slot_{slot}", "AUTO")
    renderer = Renderer(make_registry)
    snapshot = take(bpy.context.evaluated_depsgraph_get(), SnapshotCache(), *SIZE)
    frame = renderer.begin(snapshot, settings.as_draft() if draft else settings)
    for _ in range(samples):
        renderer.advance(frame)
    renderer.show(frame)
    arrays = renderer.finish(frame, IMAGES)
    renderer.release()
    return np.concatenate([arrays[name] for name in IMAGES], axis=-1)
