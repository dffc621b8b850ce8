"""Pictures of technique pages, scene by scene beside Cycles: `python -m bench strips`.

Each page has one picture: a row for each entrant, a column for each scene, written to docs/images/NAME.png. Scenes are
sample files or those of the page's own benchmark; all entrants of a scene share its exposure, by Cycles' picture.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
GAP = 4  # pixels between pictures


def sample_file(name: str) -> None:
    import bpy

    bpy.ops.wm.open_mainfile(filepath=str(ROOT / "sample_blends" / f"{name}.blend"))


@dataclass(frozen=True)
class Entrant:
    engine: str
    samples: int
    settings: tuple[tuple[str, object], ...] = ()
    made_by: Callable[[str], None] | None = None  # instead of the strip's own
    shows: str = ""  # an image of the frame in place of the picture


@dataclass(frozen=True)
class Strip:
    size: tuple[int, int]
    scenes: tuple[str, ...]
    make: Callable[[str], None] = sample_file  # leaves the scene of that name open
    entrants: tuple[Entrant, ...] = ()  # the last sets the exposure: Cycles, where it takes part
    bounces: int | None = None
    own_exposure: bool = True  # of each scene; else all have that of the first, as of a flight
    drawn: Callable[[str, tuple[int, int]], list[np.ndarray]] | None = None  # (H, W) in 0 to 1, instead of entrants


def _medium(name: str) -> None:
    from bench import media_scenes

    media_scenes.begin()
    (media_scenes.MEDIA | media_scenes.CAUSTICS)[name]()


def _reflection(name: str) -> None:
    from bench import reflection_scenes

    reflection_scenes.make(name)


def over_relief(frame: str) -> None:
    """A camera that flies low over stones, past a box that stands in them."""
    import bpy

    from bench import relief_scenes

    relief_scenes.build("box", "SUN", 0, "RELIEF")
    along = 0.4 * float(frame) + 1.0
    camera = bpy.context.scene.camera
    camera.location = (-0.7 + 0.2 * along, -1.9 + 0.1 * along, 0.75)
    camera.rotation_euler = (np.radians(70.0), 0.0, 0.2 - 0.1 * along)
    camera.data.angle = 0.8


def _stones_of_mesh(frame: str) -> None:
    """The same of a mesh with a face for each texel, as Cycles displaces it."""
    import bpy

    from bench import relief_scenes

    over_relief(frame)
    place, turn = (
        tuple(value) for value in (bpy.context.scene.camera.location, bpy.context.scene.camera.rotation_euler)
    )
    relief_scenes.build("box", "SUN", relief_scenes.SCENES["box"].detail)
    camera = bpy.context.scene.camera
    camera.location, camera.rotation_euler, camera.data.angle = place, turn, 0.8


def over_grass(name: str) -> None:
    """A camera that walks over the shipped meadow at eye height, 0.1 m from picture to picture; its tiles repeated, or
    varied."""
    frame, varied = name.split()[0], name.endswith("varied")
    import bpy

    from bench import grass

    grass.clear()
    grass.field(True, 40)
    bpy.data.materials["Soil"].candela.grass_varied = varied
    data = bpy.data.cameras.new("Camera")
    data.angle = 0.9
    camera = bpy.data.objects.new("Camera", data)
    bpy.context.scene.collection.objects.link(camera)
    bpy.context.scene.camera = camera
    camera.location = (0.0, -8.0 + 0.1 * float(frame), 1.7)
    camera.rotation_euler = (np.radians(72.0), 0.0, 0.0)


def _grass_by_map(name: str) -> None:
    """The shipped meadow on a ball or a ring, where their UV maps place it."""
    import bpy

    from bench import grass

    grass.clear()
    grass.field(True, 12)
    bpy.data.materials["Soil"].candela.grass_patch = "NONE"
    if name == "ball":
        bpy.ops.mesh.primitive_uv_sphere_add(segments=64, ring_count=32, radius=1.2, location=(0, 0, 1.25))
    else:
        bpy.ops.mesh.primitive_torus_add(
            major_segments=64, minor_segments=32, major_radius=1.2, minor_radius=0.5, location=(0, 0, 0.6)
        )
    shown = bpy.context.object
    bpy.ops.object.shade_smooth()
    material = bpy.data.materials["Soil"].copy()
    material.candela.grass_patch, material.candela.grass_placement = "MEADOW", "UV"
    material.candela.grass_tiles = 14.0 if name == "ball" else 6.0
    shown.data.materials.append(material)
    grass.camera((0.0, -5.5, 2.9), (np.radians(71.0), 0.0, 0.0), angle=0.7)


def _for_eevee(_: str) -> None:
    """A room as made for EEVEE: a blended pane, dithered leaves, a wall of which only the outside is to be seen, glass
    that refracts by ray tracing, a lamp with a custom distance."""
    from bench import media_scenes as scenes
    from bench.shading import one_shader

    scenes.begin()
    scenes.camera("Camera", (0.0, -6.5, 2.2), (np.radians(78.0), 0.0, 0.0), 0.75)
    scenes.floor(0.6, 5.0)
    pane = one_shader("Pane", "ShaderNodeBsdfPrincipled", Base_Color=(0.1, 0.4, 0.8, 1), Alpha=0.4, Roughness=0.4)
    leaves = one_shader("Leaves", "ShaderNodeBsdfPrincipled", Base_Color=(0.15, 0.5, 0.1, 1), Alpha=0.6, Roughness=0.8)
    wall = one_shader("Wall", "ShaderNodeBsdfDiffuse", Color=(0.8, 0.35, 0.2, 1))
    glass = one_shader("Glass", "ShaderNodeBsdfPrincipled", Transmission_Weight=1.0, Roughness=0.0, IOR=1.45)
    pane.surface_render_method, leaves.surface_render_method = "BLENDED", "DITHERED"
    wall.use_backface_culling = glass.use_raytrace_refraction = True
    scenes.box((-2.4, -0.02, 0.0), (-1.0, 0.02, 1.8), pane)
    scenes.box((1.0, 0.4, 0.0), (2.2, 0.42, 1.6), leaves)
    scenes.ball(0.6, glass, (0.0, -0.6, 0.6))
    front = scenes.box((-2.8, -2.5, 0.0), (2.8, 2.5, 3.2), wall)
    front.data.flip_normals()
    lamp = scenes.lamp("AREA", (1.5, -1.5, 3.0), 180.0, (np.radians(25.0), np.radians(20.0), 0.0), size=1.0)
    lamp.data.use_custom_distance, lamp.data.cutoff_distance = True, 40.0
    scenes.background().inputs["Color"].default_value = (0.15, 0.18, 0.24, 1)


def _edits(name: str) -> None:
    from bench import shown_scenes

    shown_scenes.edits(name)


def _unedited(name: str) -> None:
    from bench import shown_scenes

    shown_scenes.edits(name, edited=False)


def _edited(name: str) -> None:
    from bench import edited_scenes

    edited_scenes.make(name)


def _not_edited(name: str) -> None:
    from bench import edited_scenes

    edited_scenes.make(name, edited=False)


def _sun(name: str) -> None:
    from bench import shown_scenes

    shown_scenes.sun(name)


def _sheet(name: str) -> None:
    from bench import shown_scenes

    shown_scenes.sheet(name)


def _visibilities(family: str, size: tuple[int, int]) -> list[np.ndarray]:
    """Of the one light of a family of bench/soft_scenes.py."""
    from bench import edges, soft, soft_scenes

    scene = soft_scenes.build(family)
    return [soft.visibility(scene, one, size) for one in edges.SHOWN]


NO_BOUNCES = ("slot_indirect", "OFF")
CYCLES = Entrant("CYCLES", 128)
STRIPS = {
    "caustics": Strip(
        (240, 135),
        ("caustics_table", "caustics_pool", "caustics_rings"),
        sample_file,
        (
            Entrant("CANDELA", 8, (NO_BOUNCES, ("slot_caustics", "OFF"))),
            Entrant("CANDELA", 8, (NO_BOUNCES, ("slot_caustics", "screen_space_photons"))),
            CYCLES,
        ),
    ),
    "edits": Strip(
        (128, 96),
        ("head", "in a mirror", "glass ball"),
        _edits,
        (
            Entrant("CANDELA", 16, (("edit_heat_shown", True),), shows="film.turned"),
            Entrant("CANDELA", 16, made_by=_unedited),
            Entrant("CANDELA", 16),
        ),
    ),
    "edited_scenes": Strip(
        (256, 192),
        ("car", "room", "bottle"),
        _edited,
        (Entrant("CANDELA", 4, made_by=_not_edited), Entrant("CANDELA", 4)),
    ),
    "sun": Strip(
        (192, 128),
        ("sun", "lamp", "pupil of 3 mm"),
        _sun,
        (Entrant("CANDELA", 4, (NO_BOUNCES,), shows="film.lens"), Entrant("CANDELA", 4, (NO_BOUNCES,))),
    ),
    "edge_shadows": Strip((96, 72), ("foliage", "chain fence", "stacked blockers"), drawn=_visibilities),
    "sheet": Strip(
        (128, 96),
        ("sheet", "panes"),
        _sheet,
        (
            Entrant("CANDELA", 4, (NO_BOUNCES, ("slot_shadow", "penumbra_wedges"))),
            Entrant("CANDELA", 4, (NO_BOUNCES, ("slot_shadow", "depth_complexity"))),
            CYCLES,
        ),
        bounces=0,
    ),
    "grass_flight": Strip(
        (128, 96),
        tuple("012345"),
        lambda frame: over_grass(f"{frame} varied"),
        (Entrant("CANDELA", 8, (NO_BOUNCES,), over_grass), Entrant("CANDELA", 8, (NO_BOUNCES,))),
        own_exposure=False,
    ),
    "grass_by_map": Strip(
        (160, 112), ("ball", "ring"), _grass_by_map, (Entrant("CANDELA", 16, (NO_BOUNCES,)),), own_exposure=False
    ),
    "from_eevee": Strip(
        (240, 160),
        ("room",),
        _for_eevee,
        (
            Entrant("BLENDER_EEVEE", 32),
            Entrant("CYCLES", 64),
            Entrant("CANDELA", 16),
            Entrant("CANDELA", 16, (("use_backface_culling", True),)),
        ),
    ),
    "media": Strip(
        (128, 128),
        ("spot in fog", "window in haze", "VDB cloud", "fire", "W1 glass ball"),
        _medium,
        (Entrant("CANDELA", 1), Entrant("CANDELA", 16), Entrant("CYCLES", 256)),
    ),
    "relief_flight": Strip(
        (128, 96),
        tuple("0123456"),
        over_relief,
        (Entrant("CANDELA", 8, (NO_BOUNCES,)), Entrant("CYCLES", 64, made_by=_stones_of_mesh)),
        bounces=0,
        own_exposure=False,
    ),
    "reflections": Strip(
        (96, 72),
        ("corridor", "roughness map", "glass ball", "car paint", "window pane", "water"),
        _reflection,
        (Entrant("CANDELA", 1), Entrant("CANDELA", 16), CYCLES),
    ),
    "glass": Strip(
        (112, 84),
        ("softbox", "tumbler", "perfume", "ice", "layers", "screen"),
        _reflection,
        (Entrant("CANDELA", 1), Entrant("CANDELA", 4), Entrant("CANDELA", 16), CYCLES),
    ),
}


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(STRIPS)}; default all")


def command(options: argparse.Namespace) -> int:
    import addon

    addon.register()
    unknown = [name for name in options.names if name not in STRIPS]
    if unknown:
        print(f"No picture is called {', '.join(unknown)}: there are {', '.join(STRIPS)}.")
        return 2
    for name in options.names or STRIPS:
        path = ROOT / "docs" / "images" / f"{name}.png"
        strip, columns, exposure = STRIPS[name], [], None
        for scene in strip.scenes:
            column, own = _column(scene, strip, None if strip.own_exposure else exposure)
            exposure = own if exposure is None else exposure
            columns.append(column)
        write_picture(path, np.concatenate(columns, axis=1))
        print(path.relative_to(ROOT))
    return 0


def _column(scene: str, strip: Strip, exposure: float | None) -> tuple[np.ndarray, float]:
    """The scene by each entrant, from top to bottom, (H, W, 3) of displayed values, row 0 at the top, and its exposure
    where that is not given."""
    import bpy

    from addon.compare.metrics import display
    from addon.compare.reference import render_passes

    width, height = strip.size
    pictures = strip.drawn(scene, strip.size) if strip.drawn else []
    if pictures:
        return stacked([np.repeat(one[..., None], 3, axis=2) for one in pictures], width, height), 0.0
    for one in strip.entrants:
        (one.made_by or strip.make)(scene)
        settings = bpy.context.scene.candela
        for key, value in one.settings:
            setattr(settings, key, value)
        found = render_passes(bpy.context.scene, one.engine, one.samples, 1, size=strip.size, bounces=strip.bounces)
        pictures.append(_of_frame(one.shows) if one.shows else found.images["combined"][..., :3])
    if exposure is None:
        exposure = float(-np.log2(max(np.percentile(pictures[-1], 97), 1e-6)))
    return stacked([display(one, exposure) for one in pictures], width, height), exposure


def stacked(pictures: list[np.ndarray], width: int, height: int) -> np.ndarray:
    """Displayed values, row 0 at the bottom, one above the other with gaps below and to the right; row 0 at the top."""
    column = np.ones(((height + GAP) * len(pictures) - GAP, width + GAP, 3))
    for row, picture in enumerate(pictures):
        top = row * (height + GAP)
        column[top : top + height, :width] = picture[::-1]
    return column


def write_picture(path: Path, shown: np.ndarray) -> None:
    """Displayed values (H, W, 3), row 0 at the top, as a PNG; the gap at the right end is left out."""
    from addon.compare.png import png

    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(png((np.clip(shown[:, :-GAP], 0, 1) * 255 + 0.5).astype(np.uint8)))


def _of_frame(name: str) -> np.ndarray:
    """An image of the frame that was rendered last, (H, W, 3)."""
    import bpy

    from addon import engine
    from addon.gfx import images

    frame = engine.session(bpy.context.scene, "final").renderer.frame
    return images.read(frame.images[name])[..., :3]
