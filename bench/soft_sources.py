"""Soft shadow maps of every kind of light source: `python -m bench soft_sources`.

A lamp, an emissive mesh of the same shape and place, and a world with a bright disc light the same blockers
(bench/soft_scenes.py). The shadow slot is set by hand to variance maps (VSSM), to convolution maps (CSSM) and to
accumulated hard maps. The error is the root mean square of the visibility (direct diffuse light with blockers over that
without, as in bench/soft.py) against the mean of many accumulated maps. "Between" is the share of pixels whose
visibility lies between .05 and .95: a hard shadow has none, a soft one as many as the truth.
"""

from __future__ import annotations

import math

import bpy
import numpy as np

from . import markdown, soft, soft_scenes
from .quick import size_of, table
from .shading import one_shader, tree_of

COMMAND = "python -m bench soft_sources --page"
FAMILY = "stacked blockers"
ENTRANTS = (
    soft.Entrant("VSSM, 1 sample", soft.VSSM),
    soft.Entrant("CSSM, 1 sample", soft.CSSM),
    soft.Entrant("accumulated maps, 1 sample", soft.POINTS, soft.BY_MAPS),
    soft.Entrant("VSSM, 16 samples", soft.VSSM, samples=16),
    soft.Entrant("CSSM, 16 samples", soft.CSSM, samples=16),
    soft.Entrant("accumulated maps, 16 samples", soft.POINTS, soft.BY_MAPS, samples=16),
)
SEEDS = (1, 2, 3)
BETWEEN = (0.05, 0.95)
DISC, ELEVATION = math.radians(15.0), math.radians(60.0)  # angle from its middle to its edge; above the horizon


def lamp(scene: bpy.types.Scene) -> None:
    """The light of the family as it is."""


def emissive_mesh(scene: bpy.types.Scene) -> None:
    """A square mesh that shines downwards as the lamp does, in its place."""
    light = scene.objects["Light"]
    half = 0.5 * soft_scenes.LIGHT_SIZE
    mesh = bpy.data.meshes.new("Emitter")
    mesh.from_pydata([(-half, -half, 0), (-half, half, 0), (half, half, 0), (half, -half, 0)], [], [(0, 1, 2, 3)])
    # A lamp of `energy` watts sends energy / (pi area) to each side that it has.
    strength = light.data.energy / (math.pi * soft_scenes.LIGHT_SIZE**2)
    mesh.materials.append(one_shader("Emission", "ShaderNodeEmission", Strength=strength))
    emitter = bpy.data.objects.new("Emitter", mesh)
    emitter.location = light.location
    scene.collection.objects.link(emitter)
    bpy.data.objects.remove(light)


def world(scene: bpy.types.Scene) -> None:
    """An even sky with a bright disc, as an image of 256x128 pixels."""
    bpy.data.objects.remove(scene.objects["Light"])
    width, height = 256, 128
    azimuth = (np.arange(width) + 0.5) / width * 2.0 * np.pi
    elevation = (np.arange(height) + 0.5) / height * np.pi - 0.5 * np.pi
    cosine = np.sin(elevation)[:, None] * math.sin(ELEVATION)
    cosine = cosine + np.cos(elevation)[:, None] * math.cos(ELEVATION) * np.cos(azimuth - 2.0)[None]
    pixels = np.ones((height, width, 4), np.float32)
    pixels[..., :3] = np.where(cosine > math.cos(DISC), 20.0, 0.2)[..., None]
    image = bpy.data.images.new("Sky", width, height, float_buffer=True)
    image.pixels.foreach_set(pixels.ravel())
    image.update()
    scene.world = bpy.data.worlds.new("Sky")
    nodes = tree_of(scene.world).nodes
    nodes.clear()
    texture, shader, output = (
        nodes.new(f"ShaderNode{kind}") for kind in ("TexEnvironment", "Background", "OutputWorld")
    )
    texture.image = image
    scene.world.node_tree.links.new(texture.outputs["Color"], shader.inputs["Color"])
    scene.world.node_tree.links.new(shader.outputs[0], output.inputs["Surface"])


SOURCES = {"lamp": lamp, "emissive mesh": emissive_mesh, "world": world}


def build(source: str, family: str = FAMILY) -> bpy.types.Scene:
    """An empty Blender with the family's blockers and that source of light."""
    scene = soft_scenes.build(family)
    SOURCES[source](scene)
    return scene


def between(visibility: np.ndarray) -> float:
    """Share of the pixels that are neither lit nor in full shadow."""
    low, high = BETWEEN
    return float(((visibility > low) & (visibility < high)).mean())


def measure(source: str, entrants, size: tuple[int, int], maps: int) -> list[tuple[float, float]]:
    """RMS error and share of penumbra of each entrant, means of SEEDS, and at last those of the truth itself."""
    scene = build(source)
    values = (*soft.BY_MAPS, ("texels_per_pixel", soft.REFERENCE_TEXELS))
    expected = soft.visibility(scene, soft.Entrant("truth", soft.POINTS, values, maps), size)
    found = []
    for entrant in entrants:
        shown = [soft.visibility(scene, entrant, size, seed) for seed in SEEDS]
        error = np.mean([soft.rms(one, expected) for one in shown])
        found.append((float(error), float(np.mean([between(one) for one in shown]))))
    return [*found, (soft.rms(expected, expected), between(expected))]


def add_options(parser) -> None:
    parser.add_argument("--size", default="96x72", type=size_of, metavar="WxH")
    parser.add_argument("--maps", default=256, type=int, metavar="N", help="samples of the truth (default 256)")
    parser.add_argument("--page", action="store_true", help="write the table into docs/soft_shadows.md")


def command(options) -> int:
    import addon
    from addon.cli.terminal import quiet
    from addon.gfx import context

    addon.register()
    found = {}
    for source in SOURCES:
        with quiet():
            context.ensure()
            found[source] = measure(source, ENTRANTS, options.size, options.maps)
        print(f"{source} done", flush=True)
    rows = [("technique", *(f"{source}: {word}" for source in found for word in ("RMS", "between")))]
    for k, label in enumerate([*(entrant.label for entrant in ENTRANTS), f"{options.maps} accumulated maps"]):
        cells = (cell for source in found for cell in found[source][k])
        rows.append((label, *(f"{cell:.4f}" for cell in cells)))
    print(table(rows))
    if options.page:
        size = "x".join(map(str, options.size))
        markdown.put_between(soft.PAGE, COMMAND, f"{size} pixels, {FAMILY}.\n\n{markdown.table(rows)}")
    return 0
