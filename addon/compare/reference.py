"""Rendering a scene through Blender and reading its passes back: the reference by Cycles, and Candela's own picture.

The render runs through `bpy.ops.render.render`, the way a user starts it, and its passes are read from a 32-bit
multilayer EXR. Settings are changed for the time of the render and put back afterwards, whatever happens.

What makes Cycles a reference here: no clamping, caustics on, no blurred gloss, no light threshold, no adaptive
sampling, no denoising, no fast GI, bounces far beyond what still adds light, a fixed seed. The pixel filter is
Blackman-Harris with the width of the scene's own filter size, so that both engines reconstruct alike.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import bpy

from .exr import read_exr
from .passes import IMAGE_OF_PASS, PASS_NAMES, Passes

MANY_BOUNCES = 32  # at albedo 0.8 the light left after 32 bounces is 0.08 %
MANY_TRANSPARENT_BOUNCES = 128  # foliage: a ray may cross that many see-through surfaces before Cycles ends it
SEEDS = (1, 2)
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
) -> Passes:
    """Render one view layer of `scene` with `engine` and return its passes.

    `size` is (width, height) in pixels before any render border; without it the scene's own resolution is used. With
    a render border the pictures hold the bordered rectangle only. `direct_only` lets Cycles stop after the first
    surface: its direct passes stay what they are in a full render, and Combined shows direct light, emission and
    world. Compositor and sequencer stay out of it. Blender's Render Result shows this render afterwards.
    Raises `RenderFailed`.
    """
    engine = engine_identifier(scene, engine)
    view_layer = view_layer or active_view_layer(scene)
    with tempfile.TemporaryDirectory(prefix="candela_") as folder:
        path = Path(folder) / "passes.exr"
        with overridden(render_settings(scene, view_layer, engine, samples, seed, direct_only, size)):
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
        images = named_images(read_exr(path), view_layer.name)
    if "combined" not in images:
        raise RenderFailed(f"{engine} left no picture of view layer '{view_layer.name}' in scene '{scene.name}'.")
    return Passes(images, engine, samples, seed, seconds, transparent)


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


# Settings ------------------------------------------------------------------------------------------------------------

Setting = tuple[object, str, object]  # owner, property, value


def render_settings(
    scene: bpy.types.Scene,
    view_layer: bpy.types.ViewLayer,
    engine: str,
    samples: int,
    seed: int,
    direct_only: bool,
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
    for row in PASS_NAMES:
        owner, _, name = row.switch.rpartition(".")
        settings.append((getattr(view_layer, owner, None) if owner else view_layer, name, True))
    if engine == "CYCLES":
        settings += cycles_settings(scene, samples, seed, direct_only)
    elif engine in EEVEE:
        settings.append((scene.eevee, "taa_render_samples", samples))
    else:
        own = getattr(scene, engine.lower(), None)
        settings += [(own, "samples", samples), (own, "seed", seed)]
    return [setting for setting in settings if setting[0] is not None and hasattr(setting[0], setting[1])]


def cycles_settings(scene: bpy.types.Scene, samples: int, seed: int, direct_only: bool) -> list[Setting]:
    """What turns Cycles into an unbiased reference. Names that one Blender version lacks are skipped by the caller."""
    cycles = scene.cycles
    bounces = 0 if direct_only else MANY_BOUNCES
    values = {
        "device": "CPU",
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
        "caustics_reflective": True,
        "caustics_refractive": True,
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
def overridden(settings: list[Setting]) -> Iterator[None]:
    """Set the properties for the time of the block and put them back afterwards, also after an error.

    They are put back in the order in which they were set, not in reverse: Blender refuses a file format that does
    not belong to the current media type, and setting a format changes the depth, which comes after it.
    """
    before = [(owner, name, getattr(owner, name)) for owner, name, _ in settings]
    try:
        for owner, name, value in settings:
            setattr(owner, name, value)
        yield
    finally:
        failed = []
        for owner, name, value in before:
            try:
                setattr(owner, name, value)
            except (TypeError, AttributeError, ReferenceError) as error:
                failed.append(f"{name} ({error})")
        if failed:
            raise RenderFailed(f"These settings could not be put back after the render: {', '.join(failed)}.")


def _save_render_result(scene: bpy.types.Scene, path: Path) -> None:
    """Write all passes of the last render. Blender keeps it in an image of type RENDER_RESULT."""
    result = next((image for image in bpy.data.images if image.type == "RENDER_RESULT"), None)
    if result is None:
        raise RenderFailed("Blender kept no render result to read the passes from.")
    result.save_render(str(path), scene=scene)
