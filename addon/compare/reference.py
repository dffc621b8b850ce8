"""Rendering a scene through Blender and reading its passes back: the reference by Cycles, and Candela's own picture.

The only module of this package that knows bpy.

The render runs through `bpy.ops.render.render`, the way a user starts it, and its passes are read from a 32-bit
multilayer EXR. Settings are changed for the time of the render and put back afterwards, whatever happens.

What makes Cycles a reference here: no clamping, caustics as the scene says, no blurred gloss, no light threshold, no
adaptive sampling, no denoising, no fast GI, bounces far beyond what still adds light, a fixed seed. The pixel filter is
Blackman-Harris with the width of the scene's own filter size, so that both engines reconstruct alike.

A reference is kept on disk under a hash of what was rendered. `bpy.data.is_dirty` cannot tell whether the open file
was changed (scripts do not set it), so the scene itself is hashed, with the reference's settings in force: Blender
writes it with all it refers to into a temporary file (`bpy.data.libraries.write`: no save handlers run, nothing of
the interface is written, the open file stays as it is), and `content.py` hashes that file.
"""

from __future__ import annotations

import hashlib
import os
import platform
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import bpy
import numpy as np

from ..frame.settings import PARTIAL
from ..gfx import context
from ..gfx.user_folder import user_folder
from ..snapshot.exr import read_exr
from . import cache
from .cache import Reference
from .content import blend_hash
from .passes import IMAGE_OF_PASS, PASS_NAMES, Passes

MANY_BOUNCES = 32  # at albedo 0.8 the light left after 32 bounces is 0.08 %
MANY_TRANSPARENT_BOUNCES = 128  # foliage: a ray may cross that many see-through surfaces before Cycles ends it
SEEDS = (1, 2)
KEY_VERSION = 1  # to be raised when the reference's settings change, so that older references are not taken for it
EEVEE = ("BLENDER_EEVEE", "BLENDER_EEVEE_NEXT")  # 5.0 and later, 4.x


class RenderFailed(RuntimeError):
    """Blender could not render the scene; the message says why in a sentence."""


def render_passes(
    scene: bpy.types.Scene,
    engine: str,
    samples: int,
    seed: int = SEEDS[0],
    direct_only: bool = False,
    size: tuple[int, int] | None = None,
    view_layer: bpy.types.ViewLayer | None = None,
    bounces: int | None = None,
    diffuse_bounces: int | None = None,
    extra: Sequence[Setting] = (),
) -> Passes:
    """Render one view layer of `scene` with `engine` and return its passes.

    `size` is (width, height) in pixels before any render border; without it the scene's own resolution is used. With
    a render border the pictures hold the bordered rectangle only. `bounces` limits how often light is reflected on
    its way to the surface that is seen; None leaves it to Candela's own setting, and Cycles goes on until nothing is
    left. `direct_only` means none: the direct passes stay what they are in a full render, and Combined shows direct
    light, emission and world. EEVEE knows no such limit. `diffuse_bounces` limits Cycles' diffuse ones further, `extra`
    settings come after all others.
    Compositor and sequencer stay out of it. Blender's Render Result shows this render afterwards.
    Raises `RenderFailed`.
    """
    engine = engine_identifier(scene, engine)
    view_layer = view_layer or active_view_layer(scene)
    with tempfile.TemporaryDirectory(prefix="candela_") as folder:
        path = Path(folder) / "passes.exr"
        with overridden(
            [
                *render_settings(scene, view_layer, engine, samples, seed, 0 if direct_only else bounces, size),
                *([] if diffuse_bounces is None else [(scene.cycles, "diffuse_bounces", diffuse_bounces)]),
                *extra,
            ]
        ) as notes:
            transparent = scene.render.film_transparent
            start = time.perf_counter()
            try:
                state = bpy.ops.render.render(scene=scene.name, layer=view_layer.name)
            except RuntimeError as error:
                reason = " ".join(str(error).removeprefix("Error:").split()).rstrip(".")
                raise RenderFailed(f"{engine} could not render scene '{scene.name}': {reason}.") from error
            seconds = time.perf_counter() - start
            if "FINISHED" not in state:
                raise RenderFailed(f"The render of scene '{scene.name}' by {engine} was cancelled.")
            _save_render_result(scene, path)
        layers = read_exr(path)
        images = named_images(layers, view_layer.name)
    if "combined" not in images:
        raise RenderFailed(f"{engine} left no picture of view layer '{view_layer.name}' in scene '{scene.name}'.")
    prefix = view_layer.name + "."
    layers = {name.removeprefix(prefix): pixels for name, pixels in layers.items()}
    return Passes(images, engine, samples, seed, seconds, transparent, tuple(notes), layers)


def named_images(layers: dict, view_layer: str) -> dict:
    """Candela's names for the passes of one view layer of a multilayer file; passes without a name are left out."""
    prefix = view_layer + "."
    named = {}
    for name, pixels in layers.items():
        image = IMAGE_OF_PASS.get(name.removeprefix(prefix)) if name.startswith(prefix) else None
        if image:
            named[image] = pixels
    return named


def engine_identifier(scene: bpy.types.Scene, engine: str) -> str:
    """The engine's name in this Blender: EEVEE was called BLENDER_EEVEE_NEXT in 4.x. Raises `RenderFailed`."""
    if engine in EEVEE:
        engine = EEVEE[0] if bpy.app.version >= (5, 0) else EEVEE[1]
    before = scene.render.engine
    try:
        scene.render.engine = engine
    except TypeError:
        raise RenderFailed(f"The render engine {engine} is not available in this Blender; enable its add-on.") from None
    finally:
        scene.render.engine = before
    return engine


def active_view_layer(scene: bpy.types.Scene) -> bpy.types.ViewLayer:
    """The view layer that the user works in, when it belongs to the scene; else the first that is rendered."""
    current = getattr(bpy.context, "view_layer", None)
    if current is not None and getattr(bpy.context, "scene", None) == scene:
        return current
    return next((layer for layer in scene.view_layers if layer.use), scene.view_layers[0])


# The reference and its cache ------------------------------------------------------------------------------------------


def reference(
    scene: bpy.types.Scene,
    samples: int,
    direct_only: bool = False,
    size: tuple[int, int] | None = None,
    view_layer: bpy.types.ViewLayer | None = None,
    use_cache: bool = True,
    folder: Path | None = None,
    extra: Sequence[Setting] = (),
) -> Reference:
    """The scene by Cycles, twice with `samples` samples and different seeds, from the cache when it was made before.

    Arguments as in `render_passes`; `folder`: of the cache, if not `cache_folder()`. A reference that cannot be kept
    (disk full, no permission) is returned all the same. Raises `RenderFailed`.
    """
    view_layer = view_layer or active_view_layer(scene)
    folder = (folder or cache_folder()) if use_cache else None
    key = reference_key(scene, samples, direct_only, size, view_layer, extra) if folder else ""
    found = cache.load(folder, key) if folder else None
    if found:
        return found
    made = render_reference(scene, samples, direct_only, size, view_layer, key, extra)
    if folder:
        try:
            cache.save(folder, made)
        except OSError as error:
            print(error)  # the comparison does not depend on it
    return made


def render_reference(scene, samples: int, direct_only: bool, size, view_layer, key: str, extra=()) -> Reference:
    """The reference without the cache; arguments as in `reference`. Raises `RenderFailed`."""
    first, second = (
        render_passes(scene, "CYCLES", samples, seed, direct_only, size, view_layer, extra=extra) for seed in SEEDS
    )
    images, half = cache.two_seeds(first.images, second.images)
    return Reference(images, half, samples, first.seconds + second.seconds, first.film_transparent, False, key)


def cache_folder() -> Path:
    """Where references are kept: $CANDELA_CACHE if set, the extension's own folder if Candela is one, else a folder
    among the user's caches."""
    return user_folder("references")


def reference_key(
    scene: bpy.types.Scene,
    samples: int,
    direct_only: bool,
    size: tuple[int, int] | None,
    view_layer: bpy.types.ViewLayer,
    extra: Sequence[Setting] = (),
) -> str:
    """Name of the cache entry: a hash of the scene as it will be rendered. Frame, size and samples are part of it."""
    settings = render_settings(scene, view_layer, "CYCLES", samples, 0, 0 if direct_only else None, size)
    with overridden([*settings, *extra]):
        view_layer.update()  # evaluation writes into the data (animated values, bounds): always hash what it left
        content = scene_hash(scene)
    about = f"{KEY_VERSION} {SEEDS} {view_layer.name!r} {content}"
    return hashlib.blake2b(about.encode(), digest_size=20).hexdigest()


def scene_hash(scene: bpy.types.Scene) -> str:
    """Hexadecimal hash of the scene with everything it refers to: data-blocks, external files, unsaved pixels."""
    digest = hashlib.blake2b(digest_size=20)
    digest.update(f"{bpy.app.version_string} {bpy.app.build_hash!r} {scene.name!r}".encode())
    for thing in scene.objects:
        if thing.mode == "EDIT":
            thing.update_from_editmode()  # the edit is in the picture, so it must be in the hash
    with tempfile.TemporaryDirectory(prefix="candela_") as folder:
        path = Path(folder) / "scene.blend"
        bpy.data.libraries.write(str(path), {scene}, path_remap="NONE", fake_user=False, compress=False)
        digest.update(blend_hash(path.read_bytes()))
    for name in sorted(set(bpy.utils.blend_paths(absolute=True, packed=False, local=False))):
        for file in external_files(Path(name)):
            digest.update(file.name.encode())
            with file.open("rb") as stream:
                digest.update(hashlib.file_digest(stream, "blake2b").digest())
    for image in sorted(bpy.data.images, key=lambda image: image.name_full):
        if image.is_dirty and image.users and image.type not in ("RENDER_RESULT", "COMPOSITING"):
            pixels = np.empty(len(image.pixels), np.float32)  # painted and not saved: the file does not hold them
            image.pixels.foreach_get(pixels)
            digest.update(image.name_full.encode() + pixels.tobytes())
    return digest.hexdigest()


def external_files(path: Path) -> list[Path]:
    """The files behind a path that a scene refers to: itself, or the tiles of a path with a <UDIM> mark."""
    if path.is_file():
        return [path]
    if "<UDIM>" in path.name and path.parent.is_dir():
        return sorted(path.parent.glob(path.name.replace("[", "[[]").replace("<UDIM>", "[0-9][0-9][0-9][0-9]")))
    return []


# Settings ------------------------------------------------------------------------------------------------------------

Setting = tuple[object, str, object]  # owner, property, value


def combined_alone(view_layer: bpy.types.ViewLayer) -> list[Setting]:
    """Extra settings for `render_passes`: without any pass but Combined, as a picture is timed."""
    found: list[Setting] = []
    for row in PASS_NAMES:
        owner, _, name = row.switch.rpartition(".")
        if row.image != "combined":
            found.append((getattr(view_layer, owner, None) if owner else view_layer, name, False))
    return found


def render_settings(
    scene: bpy.types.Scene,
    view_layer: bpy.types.ViewLayer,
    engine: str,
    samples: int,
    seed: int,
    bounces: int | None,
    size: tuple[int, int] | None,
) -> list[Setting]:
    """All that is changed for a render, in the order in which it must be set (and put back)."""
    render, image = scene.render, scene.render.image_settings
    settings: list[Setting] = [
        (render, "engine", engine),
        (render, "use_compositing", False),
        (render, "use_sequencer", False),
        (render, "use_multiview", False),
        (render, "use_freestyle", False),
        (render, "use_persistent_data", False),
        (render, "use_lock_interface", True),
    ]
    if render.use_border:
        settings.append((render, "use_crop_to_border", True))  # else the file is full of pixels nobody rendered
    if size is not None:
        settings += [
            (render, "resolution_x", int(size[0])),
            (render, "resolution_y", int(size[1])),
            (render, "resolution_percentage", 100),
        ]
    settings += [
        (image, "media_type", "MULTI_LAYER_IMAGE"),  # 5.0 and later: decides which formats may be set
        (image, "file_format", "OPEN_EXR_MULTILAYER"),
        (image, "color_mode", "RGBA"),
        (image, "color_depth", "32"),
        (image, "exr_codec", "ZIP"),
        (image, "use_exr_interleave", True),
        (image, "use_preview", False),
        (image, "color_management", "FOLLOW_SCENE"),
    ]
    settings.append((view_layer, "samples", 0))  # its own number of samples would count
    for row in PASS_NAMES:
        owner, _, name = row.switch.rpartition(".")
        settings.append((getattr(view_layer, owner, None) if owner else view_layer, name, True))
    if engine == "CYCLES":
        settings += cycles_settings(scene, samples, seed, MANY_BOUNCES if bounces is None else bounces)
        if bounces is None:  # media scatter light as often in both: as often as the scene says
            own = getattr(getattr(scene, "candela", None), "airlight_bounces", -1)
            settings.append((scene.cycles, "volume_bounces", own if own >= 0 else scene.cycles.volume_bounces))
    elif engine in EEVEE:
        settings.append((scene.eevee, "taa_render_samples", samples))
    else:
        own = getattr(scene, engine.lower(), None)
        settings += [(own, "samples", samples), (own, "seed", seed)]
        settings += [(own, param.name, param.default) for param in PARTIAL]  # all samples that are asked for
        if bounces is not None:
            settings.append((own, "bounces", bounces))
            settings.append((getattr(scene, "cycles", None), "volume_bounces", bounces))  # Candela's where it has none
    return [setting for setting in settings if setting[0] is not None and hasattr(setting[0], setting[1])]


def cycles_settings(scene: bpy.types.Scene, samples: int, seed: int, bounces: int) -> list[Setting]:
    """What turns Cycles into an unbiased reference. Names that one Blender version lacks are skipped by the caller. The
    switches of caustics stay the scene's, since Candela follows them."""
    cycles = scene.cycles
    values = {
        "device": "CPU",
        "shading_system": False,  # Open Shading Language: scripts of the file, which may write files
        "feature_set": "SUPPORTED",
        "samples": samples,
        "seed": seed,
        "use_animated_seed": False,
        "use_sample_subset": False,
        "sample_offset": 0,
        "time_limit": 0.0,
        "use_layer_samples": "IGNORE",
        "sampling_pattern": "TABULATED_SOBOL",
        "auto_scrambling_distance": False,
        "scrambling_distance": 1.0,
        "use_adaptive_sampling": False,
        "use_denoising": False,
        "use_guiding": False,
        "light_sampling_threshold": 0.0,
        "min_light_bounces": 0,
        "min_transparent_bounces": 0,
        "caustics_reflective": cycles.caustics_reflective,
        "caustics_refractive": cycles.caustics_refractive,
        "blur_glossy": 0.0,
        "sample_clamp_direct": 0.0,
        "sample_clamp_indirect": 0.0,
        "use_fast_gi": False,
        "max_bounces": bounces,
        "diffuse_bounces": bounces,
        "glossy_bounces": bounces,
        "transmission_bounces": bounces,
        "volume_bounces": bounces,
        "transparent_max_bounces": MANY_TRANSPARENT_BOUNCES,
        "film_exposure": 1.0,
        "use_pixel_jitter": False,  # its default; when on, all samples after the first meet the same point of a pixel
        "pixel_filter_type": "BLACKMAN_HARRIS",
        "filter_width": scene.render.filter_size,
    }
    return [(cycles, name, value) for name, value in values.items()]


@contextmanager
def overridden(settings: list[Setting]) -> Iterator[list[str]]:
    """Set the properties for the time of the block and put them back afterwards, also after an error.

    What cannot be put back is named in the list that the block receives: a file may hold a value that this Blender
    does not know, such as the engine of an add-on that is not installed.

    They are put back in the order in which they were set, not in reverse: Blender refuses a file format that does
    not belong to the current media type, and setting a format changes the depth, which comes after it.
    """
    before = [(owner, name, getattr(owner, name), owner.is_property_set(name)) for owner, name, _ in settings]
    notes: list[str] = []
    try:
        for owner, name, value in settings:
            if isinstance(owner, bpy.types.PropertyGroup):
                owner.property_unset(name)  # a group holds what is set in the order of setting: make it always the same
            setattr(owner, name, value)
        yield notes
    finally:
        for owner, name, value, was_set in before:
            try:
                setattr(owner, name, value)
                if not was_set:  # a property of an add-on that still had its default: leave no trace in the file
                    owner.property_unset(name)
            except (TypeError, AttributeError, ReferenceError) as error:
                notes.append(f"The setting {name} could not be put back after the render: {error}.")


def _save_render_result(scene: bpy.types.Scene, path: Path) -> None:
    """Write all passes of the last render. Blender keeps it in an image of type RENDER_RESULT."""
    result = next((image for image in bpy.data.images if image.type == "RENDER_RESULT"), None)
    if result is None:
        raise RenderFailed("Blender kept no render result to read the passes from.")
    result.save_render(str(path), scene=scene)


def describe(scene: bpy.types.Scene) -> dict:
    """What a report says about where a picture comes from: file name, frame, Blender's version, device."""
    device = f"{platform.processor() or platform.machine()}, {os.cpu_count()} threads"
    if context.available():
        device = f"{context.describe()}; {device}"
    return {
        "file": Path(bpy.data.filepath).name,
        "frame": scene.frame_current,
        "blender": bpy.app.version_string,
        "device": device,
    }
