"""Probes: points of what the picture shows, from whose view virtual lights are found; the same for cameras side by
side.

Space is cut into cells whose sides grow with the distance from the camera in steps of sqrt(2), such that a picture of
surfaces that face it shows FACTOR^-2 of them for each probe; surfaces that face another of six ways are other cells. A
grid of pixels, shifted in every sample, says which cells are seen. Each has a random number of its own; in a sample
those with the lowest ones have a probe: on the surface below a point of the cell, the first one of eight below which
the picture shows the surface; the first one follows the sample's numbers. Where a camera moves a little, a cell that
comes into view or leaves it exchanges one probe, and most others keep place, number and directions.

| pass | work for N pixels of the grid, P probes |
|---|---|
| keys | N loads |
| sort | 2 passes, kernels/ordered_lists.py |
| where cells begin; running sums | 3 passes |
| probes | P bisections; mirrors and glass that they see are followed |

Keeping the lowest numbers is bottom-k sampling (Cohen & Kaplan 2007). Bias: none; the density of what rays of probes
meet is summed over those that there are (virtual_lights.py). Fails: the render origin moves in steps where a scene is
large; cells are others then.
"""

from __future__ import annotations

from ..frame.picture import Frame
from ..gfx import images, passes
from ..kernels import ordered_lists
from ..scene import acceleration
from ..scene.view import VIEW
from ..sources import lights
from ..surfaces.draw import SURFACE_TEXTURES

LATTICE = 5  # pixels of the grid along each side of a probe's share of the picture
FACTOR = 1.3  # side of a cell over that of a probe's share of the picture

_LIST = ordered_lists.DEFINES
_CELLS = (("IVEC2", "lattice"), ("FLOAT", "cell_share"))
_PLACES = (("RGBA32F", "surface_position"),)
KEYS = passes.fullscreen_program(
    "keys of probes", "indirect/probe_keys.frag.glsl", textures=_PLACES, blocks=((VIEW, "film_view"),),
    constants=_CELLS, defines=_LIST, outputs=(("UINT", "out_key"),),
)  # fmt: skip
FIRST = passes.fullscreen_program(
    "first of probes", "indirect/probe_first.frag.glsl", textures=(("R32UI", "sorted_keys"),), constants=_CELLS,
    defines=_LIST, outputs=(("VEC2", "out_first"),),
)  # fmt: skip
PROBES = passes.fullscreen_program(
    "probes",
    "indirect/probe_find.frag.glsl",
    textures=(
        *acceleration.HIERARCHY_TEXTURES, *SURFACE_TEXTURES, ("RGBA32F", "energy_table"), ("RGBA32F", "reflectance"),
        ("R32UI", "sorted_keys"), ("R32UI", "sorted_order"), ("RG32F", "cells_before"),
    ),
    blocks=((VIEW, "film_view"), (lights.SOURCES, "sources")),
    constants=(("INT", "light_count"), ("FLOAT", "offset_size"), ("INT", "bounces"), *_CELLS),
    defines=_LIST,
    outputs=(("VEC4", "out_place"), ("VEC4", "out_normals")),
    leaves_out=(("leaving", "probes ask for no light"),),
)  # fmt: skip
TEXTURES = (("RGBA32F", "probe_places"), ("RGBA32F", "probe_normals"))  # what shaders/indirect/probe.glsl reads


def find(frame: Frame, grid: tuple[int, int], bindings: dict) -> dict[str, images.Image]:
    """Probes of this sample, as many as the `grid` over the picture has cells: TEXTURES of the pool, by name; columns
    without a probe receive nothing. `bindings`: VirtualLights.path_bindings."""
    lattice = (grid[0] * LATTICE, grid[1] * LATTICE)
    constants = {"lattice": lattice, "cell_share": FACTOR * (grid[0] * grid[1]) ** -0.5}
    textures, blocks = bindings["textures"], bindings["blocks"]
    size = ordered_lists.size_for(lattice[0] * lattice[1])
    found = {name: images.pool.take(grid[0] * grid[1], 1, image_format) for image_format, name in TEXTURES}
    with images.borrowed(*size, "R32UI") as keys, images.borrowed(*size, "RG32F") as first:
        passes.fullscreen(
            KEYS, keys, textures={"surface_position": textures["surface_position"]},
            blocks={"film_view": frame.view_block}, constants=constants,
        )  # fmt: skip
        sorted_keys, order = ordered_lists.take_sorted(keys.colors[0])
        passes.fullscreen(FIRST, first, textures={"sorted_keys": sorted_keys}, constants=constants)
        before = ordered_lists.take_running_sums(first.colors[0])
    listed = {"sorted_keys": sorted_keys, "sorted_order": order, "cells_before": before}
    passes.fullscreen(
        PROBES, images.Target(tuple(found.values())), textures={**textures, **listed}, blocks=blocks,
        constants={**bindings["constants"], **constants},
    )  # fmt: skip
    for image in listed.values():
        images.pool.give(image)
    return found
