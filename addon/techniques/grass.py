"""Grass from a bidirectional texture function: a material shows a field of blades that were rendered once.

A tile of real blades, rendered by Cycles from V directions under L lights (addon/grass), stands for the field: for
each pixel the colour for its place in the tile, the direction of view and that of each light is reconstructed from
the principal components of the view's pictures, and a depth map of that view says how far down the blade is. So
things stand in the grass, its outline is of blades, and any number of them takes the same time. Source: M. Shah,
J. Konttinen, S. Pattanaik, "Real-time rendering of realistic-looking grass", GRAPHITE 2005; Shah's thesis, 2007.

The mesh is the ground; what is drawn is the plane on top of the blades, `height` above it along its normals. Tiles
lie along the object's X and Y axes, or by a UV map, whose gradients say how the tile lies and how large it is.
Lamps, the world and meshes that shine light it in one loop (lighting/loop.py), with shadows of other things where
the blade is; indirect light takes its albedo under a uniform sky. In depth maps it is a layer
(lighting/visibility.py): blades as the light sees them, which shadow everything but grass.

| cost | |
|---|---|
| surface pass, per pixel of grass and sample | 1 view of four, 1 texel: up to 12 fetches of rings, 9 of the patch |
| light loop, per light and pixel of grass | 25 fetches of pictures and means, up to 11 of rings |
| depth maps, per texel of grass | as the surface pass; where grass is shown, lamps have maps and no rays |
| memory | 32 bytes for each texel and view: 7 MiB for 64 x 64 and 57 views |

Bias: colours are interpolated between sampled directions; pictures of two views are hardly alike, so that blades
dissolve into each other as the view moves. Left out: wind, shadows of grass in filtered (soft) maps and for rays,
what reflections and indirect light see of blades (they meet the ground), sides of a field where its mesh ends, and
blades nearer than five times their height, which need geometry. A flat-shaded mesh leaves gaps in the plane on top:
shade it smooth.
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from ..film.points import OwnPoint
from ..frame.picture import Frame
from ..frame.reads import Reads
from ..frame.settings import Settings
from ..frame.technique import MATERIAL, Param, Technique, own_value
from ..gfx import images
from ..gfx.library import Program
from ..grass.patch import Patch, PatchError, kept
from ..grass.table import Field, table_of
from ..lighting.grass import TABLE, GrassTable
from ..lighting.visibility import Layer, Layers
from ..materials.estimate import srgb_decode
from ..scene import uv_placed
from ..snapshot.scene import Material, Note, Snapshot
from ..surfaces.draw import StandIns

NONE, MEADOW, FILE = "NONE", "MEADOW", "FILE"
AXES, UV = "AXES", uv_placed.UV
MAPS = "density_map", "height_map"
SHIPPED = Path(__file__).resolve().parent.parent / "grass" / "meadow.grass"


@cache
def grass_program(surface: Program, uv: int = -1) -> Program:
    """The program that draws a material's surface, for grass on it; `uv`: its attribute that places tiles."""
    glsl = '#include "grass/surface.glsl"\n'
    others = tuple(one for one in surface.snippets if one[0] != "generated/own_surface")
    return replace(
        surface, name=f"{surface.name} grass", vertex="grass/surface.vert.glsl",
        textures=(*surface.textures, TABLE), constants=(*surface.constants, ("INT", "grass_entry")),
        defines=(*surface.defines, ("OWN_CLOSURES", ""), *_placed(uv)),
        snippets=(("generated/own_surface", glsl), *others), writes_depth=True,
    )  # fmt: skip


@cache
def grass_caster(caster: Program, uv: int = -1) -> Program:
    """The program that draws blades into depth maps, of one that draws a material that lets light pass."""
    glsl = '#include "grass/surface.glsl"\n'
    others = tuple(one for one in caster.snippets if one[0] != "generated/own_surface")
    # Vectors first: each begins at a multiple of 16 bytes, and there are 128.
    constants = sorted((*caster.constants, ("INT", "grass_entry")), key=lambda one: one[0] != "VEC4")
    own = (
        ("OWN_CLOSURES", ""),
        ("CASTS_WHOLE", ""),
        ("LAYER", ""),
        ("GRASS_SAMPLE", "caster_sample"),
        ("GRASS_SEED", "0"),
        *_placed(uv),
    )
    return replace(
        caster, name=f"{caster.name} grass", vertex="grass/surface.vert.glsl",
        textures=(*caster.textures, TABLE), constants=tuple(constants),
        defines=(*caster.defines, *own), snippets=(("generated/own_surface", glsl), *others), writes_depth=True,
    )  # fmt: skip


def _placed(uv: int) -> tuple[tuple[str, str], ...]:
    return (("GRASS_UV", str(uv)),) if uv >= 0 else ()


class Grass(Technique):
    name = "grass"
    label = "Grass"
    params = (
        Param(
            "patch", "Patch", NONE, "Grass patch that covers the material's surface", scope=MATERIAL,
            items=(
                (NONE, "None", 0, "No grass"),
                (MEADOW, "Meadow", 1, "The meadow that comes with Candela"),
                (FILE, "File", 2, "A patch from a file"),
            ),
        ),
        Param("file", "File", "", "Grass patch file, made by Render > Candela Grass Patch", scope=MATERIAL, file=True),
        Param(
            "size", "Tile", 0.0,
            "Side length of a tile; 0: the patch's own",
            0.0, 1000.0, "DISTANCE", scope=MATERIAL,
        ),
        Param(
            "height", "Height", 0.0,
            "Height of the longest blades; 0: the patch's own, scaled with the tile",
            0.0, 1000.0, "DISTANCE", scope=MATERIAL,
        ),
        Param(
            "height_map", "Height Map", "",
            "Image that the height is multiplied by",
            scope=MATERIAL, image=True,
        ),
        Param(
            "placement", "Placement", AXES,
            "Coordinates along which grass tiles and maps are laid out",
            scope=MATERIAL,
            items=(
                (AXES, "Object Axes", 0, "X and Y axes of the object: ground"),
                (UV, "UV Map", 1, "The active UV map of the mesh, where it has one: any surface"),
            ),
        ),
        Param(
            "tiles", "Tiles", 10.0,
            "Tiles along each side of the UV map's square, for placement by UV map",
            0.001, 100000.0, scope=MATERIAL,
        ),
        Param(
            "varied", "Vary Tiles", False,
            "Shift the tile at random from place to place, so that repeats cannot be seen in large fields",
            scope=MATERIAL,
        ),
        Param(
            "density", "Density", 1.0,
            "Share of the ground that is covered by grass",
            0.0, 1.0, "FACTOR", scope=MATERIAL,
        ),
        Param(
            "density_map", "Density Map", "",
            "Image that the density is multiplied by",
            scope=MATERIAL, image=True,
        ),
        Param(
            "map_size", "Map Size", 10.0,
            "Side length of the square that maps cover around the object's origin, for placement by its axes; beyond "
            "it the image's rim goes on",
            0.001, 100000.0, "DISTANCE", scope=MATERIAL,
        ),
    )  # fmt: skip
    provides = (GrassTable,)

    def __init__(self):
        self._table: Reads[images.Image] = Reads(lambda fields: images.upload(table_of(fields), TABLE[0]))

    def skip(self, snapshot: Snapshot, settings: Settings) -> str | None:
        wanted = _wanted(snapshot)
        if not wanted:
            return "no material that is shown is covered with grass"
        why = []
        for material in wanted:
            try:
                kept(_file(snapshot.materials[material]))
            except PatchError as error:
                why.append(str(error).rstrip("."))
        return "; ".join(dict.fromkeys(why)) if len(why) == len(wanted) else None

    def begin(self, frame: Frame) -> None:
        fields, entries = [], {}
        for material in _wanted(frame.snapshot):
            try:
                fields.append(_field(frame.snapshot, frame.snapshot.materials[material]))
            except PatchError as error:
                told = Note(f"Material '{frame.snapshot.materials[material].name}'", f"its grass is missing: {error}")
                frame.ledger.notes = (*frame.ledger.notes, told)
                continue
            entries[material] = len(fields) - 1
        table = self._table.of(fields)
        stand_ins, layers = frame.shared(StandIns), frame.shared(Layers)
        for material, entry in entries.items():
            uv = uv_placed.map_of(frame.materials.compiled[material]) if fields[entry].tiles else -1
            program = grass_program(frame.materials.surface_program(material), uv)
            stand_ins.of[material] = (program, {TABLE[1]: table}, {"grass_entry": entry})
            caster = grass_caster(frame.materials.caster_program(material), uv)
            layers.of[material] = Layer(caster, {TABLE[1]: table}, {"grass_entry": entry}, fields[entry].height)
        frame.shared(OwnPoint).needed = True
        frame.provide(GrassTable(table))
        frame.count(self, "patches", len({id(one.patch) for one in fields}))
        frame.count(self, "bytes", table.bytes)

    def release(self) -> None:
        self._table.forget()


def _wanted(snapshot: Snapshot) -> list[int]:
    """Materials that are shown and covered with grass."""
    grown = [k for k, one in enumerate(snapshot.materials) if one.own and own_value(one.own, Grass, "patch") != NONE]
    if not grown:
        return []
    shown = snapshot.used_materials
    return [material for material in grown if material in shown]


def _file(material: Material) -> Path:
    """Raises PatchError."""
    if own_value(material.own, Grass, "patch") == MEADOW:
        return SHIPPED
    name = own_value(material.own, Grass, "file")
    if not name:
        raise PatchError(f"Material '{material.name}' names no file of a grass patch.")
    return Path(name)


def _map_key(snapshot: Snapshot, material: Material, name: str) -> Hashable:
    """Of one of MAPS; None without one."""
    image = snapshot.images.get(dict(material.own_images).get(f"{Grass.name}_{name}"))
    return None if image is None or image.missing else (image.key, image.version)


def _map(snapshot: Snapshot, material: Material, name: str) -> np.ndarray | None:
    """(H, W) means of the channels, scene-linear for images that are sRGB."""
    key = _map_key(snapshot, material, name)
    if key is None:
        return None
    image = snapshot.images[key[0]]
    colors = image.pixels[..., :3]
    return (srgb_decode(colors) if image.encoding == "SRGB" else colors).mean(axis=2)


def _field(snapshot: Snapshot, material: Material) -> Field:
    """Raises PatchError."""
    patch: Patch = kept(_file(material))
    size = own_value(material.own, Grass, "size") or patch.size
    height = own_value(material.own, Grass, "height") or patch.height * size / patch.size
    density, reach = (own_value(material.own, Grass, name) for name in ("density", "map_size"))
    varied = bool(own_value(material.own, Grass, "varied"))
    shares, heights = (_map(snapshot, material, name) for name in MAPS)
    tiles = own_value(material.own, Grass, "tiles") if uv_placed.asks(material.own) else 0.0
    return Field(patch, size, height, density, shares, reach, varied, heights, tiles)
