"""Error of a textured floor that recedes to the horizon, and bytes of a texture: `python -m bench textures`.

The floor is rendered with as many samples as `--samples` says, by lookups that average what a pixel sees, by lookups of
the point, and by Cycles, each against Cycles with many samples (relMSE); then bytes of a texture of 4096^2 texels.
"""

from __future__ import annotations

import argparse
from unittest.mock import patch

import numpy as np

from .shading import tree_of

SIZE = (128, 96)
SIDE = 256  # texels of the floor's image
LARGE = 4096


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--samples", type=int, nargs="*", default=[1, 4, 16, 64])
    parser.add_argument(
        "--reference", type=int, default=2048, help="Cycles' samples for what errors are measured against"
    )


def command(options: argparse.Namespace) -> int:
    import bpy

    import addon
    from addon.cli.terminal import quiet
    from addon.compare.metrics import relative_squared_error
    from addon.compare.reference import render_passes
    from addon.frame.picture import Frame
    from addon.gfx import context
    from addon.scene.textures import upload_texture
    from addon.snapshot.scene import Image

    addon.register()
    with quiet() as terminal:

        def picture(engine: str, samples: int, seed: int = 0) -> np.ndarray:
            return render_passes(scene, engine, samples, seed, size=SIZE, bounces=0).images["combined"][..., :3]

        for name, pixels in (("colours", _colours()), ("checker", _checker())):
            scene = _floor(bpy, pixels)
            reference = picture("CYCLES", options.reference, 1)

            def error(found: np.ndarray, reference=reference) -> float:
                return float(relative_squared_error(found, reference).mean())

            for samples in options.samples:
                scene.frame_set(1)
                averaged = error(picture("CANDELA", samples))
                with patch.object(Frame, "_footprints", lambda _: (0.0, 0.0)):
                    scene.objects["Floor"].location.x += 1e-9  # another version, so that nothing is reused
                    at_point = error(picture("CANDELA", samples))
                cycles = error(picture("CYCLES", samples, 3))
                print(f"{name}, samples {samples}: {averaged:.5f} by averages, {at_point:.5f} by points, "
                      f"Cycles {cycles:.5f}", file=terminal, flush=True)  # fmt: skip
        context.ensure()
        pixels = np.tile(_colours(), (LARGE // SIDE, LARGE // SIDE, 1))
        texture = upload_texture({"a": Image("a", 1, pixels, "SRGB", "NONE", bits=8)}, "a", levels=True)
        before = LARGE * LARGE * 16
        print(f"{LARGE}x{LARGE} texels of 8 bits with levels: {texture.bytes / 1e6:.1f} MB, as floats without levels "
              f"{before / 1e6:.1f} MB", file=terminal, flush=True)  # fmt: skip
    return 0


def _colours() -> np.ndarray:
    rng = np.random.default_rng(1)
    coarse = rng.integers(0, 256, (SIDE // 8, SIDE // 8, 3)).repeat(8, 0).repeat(8, 1)
    pixels = np.ones((SIDE, SIDE, 4), np.float32)
    pixels[..., :3] = np.round(np.clip(coarse + rng.integers(-40, 40, (SIDE, SIDE, 3)), 0, 255)) / 255
    return pixels


def _checker() -> np.ndarray:
    y, x = np.mgrid[0:SIDE, 0:SIDE] // 8
    pixels = np.ones((SIDE, SIDE, 4), np.float32)
    pixels[..., :3] = ((x + y) % 2)[..., None]
    return pixels


def _floor(bpy, pixels: np.ndarray):
    """A scene with a floor of 80 m that shows the image 40 times along each side and emits it."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    image = bpy.data.images.new("floor", SIDE, SIDE, alpha=True)
    image.pixels.foreach_set(pixels.ravel())
    image.update()
    material = bpy.data.materials.new("Floor")
    tree = tree_of(material)
    nodes, links = tree.nodes, tree.links
    nodes.clear()
    shown, emission = nodes.new("ShaderNodeTexImage"), nodes.new("ShaderNodeEmission")
    shown.image = image
    links.new(shown.outputs["Color"], emission.inputs["Color"])
    links.new(emission.outputs[0], nodes.new("ShaderNodeOutputMaterial").inputs["Surface"])
    mesh = bpy.data.meshes.new("Floor")
    mesh.from_pydata([(-40, -40, 0), (40, -40, 0), (40, 40, 0), (-40, 40, 0)], [], [(0, 1, 2, 3)])
    layer = mesh.uv_layers.new(name="UVMap")
    for corner, place in enumerate([(0, 0), (40, 0), (40, 40), (0, 40)]):
        layer.uv[corner].vector = place
    mesh.materials.append(material)
    camera = bpy.data.cameras.new("Camera")
    camera.angle = 1.0
    for name, data in (("Floor", mesh), ("Camera", camera)):
        scene.collection.objects.link(bpy.data.objects.new(name, data))
    scene.camera = scene.objects["Camera"]
    scene.camera.location, scene.camera.rotation_euler = (0, -35, 1.5), (np.pi / 2 - 0.12, 0, 0.05)
    return scene
