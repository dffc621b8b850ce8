"""Light below surfaces by random walks from pixels, as Cycles' methods of that name (subsurface/walk.frag.glsl).

    leaving = mean over walks of  sum over steps k of  w_k exp(-d_k / free path) E(where the walk would leave)

The interface, albedo inversion and free paths are those of Cycles; anisotropy is taken up by similarity. A walk goes
through the hierarchy of triangles, in the object that it entered alone. Light where it leaves is that of the nearest
point of the mesh (scene/scatter_points.py), which is lit by all that lights points; what leaves within the window of
pixels on the same side and faces the viewer, by the mean over those (subsurface/gather.frag.glsl).

| cost | per sample |
|---|---|
| rays | a pixel: `walks` times about 2 / (1 - albedo)^(1/2) + 2, none longer than 12 free paths |
| walks | a pixel: 8 over the samples, or 1024 a square free path over the samples; 1 to 16 in each |
| bytes per pixel | 96 while it runs |

Bias: light where walks leave is even within a point's cell; after 256 steps the rest leaves by diffusion.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack

from ..frame.picture import Frame
from ..frame.technique import Technique
from ..gfx import images, passes
from ..scene import acceleration
from ..scene.materials import SCATTER_IMAGES
from ..scene.scatter_points import RANGE, ScatterPoints
from ..scene.view import VIEW
from ..surfaces.hits import Hits

FEW_WALKS = 8  # of a pixel, in a picture of one sample
MOST_WALKS = 16  # of a pixel in a sample, in small pictures
FEW_DENSE, DENSE = 64, 1024  # walks a square free path: at most in a sample, and over all samples
NAMES = ("direct", "indirect", "near")
PICTURE = ("surface_position", "surface_normal", "spread_length", "scatter_share", "spread_entry", "scatter_walk")
WALK = passes.fullscreen_program(
    "subsurface walk",
    "subsurface/walk.frag.glsl",
    textures=(
        *acceleration.HIERARCHY_TEXTURES,
        ("RG32F", "trace_owners"),
        *(("RGBA32F", name) for name in (
            "cell_direct", "cell_indirect", "cell_shapes", *PICTURE, "scatter_objects", "scatter_near", "walk_lobes",
        )),
    ),
    blocks=((VIEW, "film_view"),),
    constants=(
        ("INT", "first_object"), ("INT", "first_leaf"), ("INT", "walks"), ("INT", "most_walks"),
        ("FLOAT", "dense_walks"), ("FLOAT", "offset_size"),
    ),
    defines=(("WALK_LOBES", "1"), ("RANGE", str(RANGE))),
    outputs=tuple(("VEC4", f"out_{name}") for name in NAMES),
)  # fmt: skip
SMOOTH = passes.fullscreen_program(
    "subsurface walks, smooth",
    "subsurface/smooth.frag.glsl",
    textures=tuple(
        ("RGBA32F", name)
        for name in (
            *(f"walked_{name}" for name in NAMES), "surface_position", "surface_normal", "scatter_share",
            "spread_length", "scatter_objects",
        )
    ),
    blocks=((VIEW, "film_view"),),
    constants=(
        ("INT", "first_object"), ("INT", "walks"), ("INT", "most_walks"), ("FLOAT", "dense_walks"), ("INT", "samples"),
    ),
    defines=(("RANGE", str(RANGE)), ("FEW_WALKS", str(FEW_WALKS))),
    outputs=tuple(("VEC4", f"out_{name}") for name in NAMES),
)  # fmt: skip
PROGRAMS = (WALK, SMOOTH)


def walks_of(frame: Frame) -> dict[str, float]:
    """Of a pixel in a sample, at least and at most, and of a square free path: small pictures have more of a pixel
    (subsurface/walked.glsl), fewer in each sample the more samples are planned."""
    if frame.settings.schedule.is_draft:
        return {"walks": 1, "most_walks": 1, "dense_walks": 1.0}
    samples = frame.settings.samples
    least = max(FEW_WALKS // samples, 1)
    return {"walks": least, "most_walks": MOST_WALKS, "dense_walks": float(min(FEW_DENSE, DENSE / samples))}


def walk(
    frame: Frame, technique: Technique, points: ScatterPoints, lit: dict[str, images.Image], lobes: images.Image,
    smooth: list[images.Image],
) -> Iterator[None]:  # fmt: skip
    """Draw into images by NAMES light over color that walks bring from points, and the weight, over color, of what
    leaves where pixels tell the light. w: the part of a pixel's light that is walks'. `lit`: images of the points.
    Yields after each band of rows."""
    hierarchy = frame.hierarchy("shadow")
    owners, first_leaf = frame.kept(Hits).owners(frame, hierarchy)
    shown = frame.images
    picture = (
        shown["surface.position"], shown["surface.normal"],
        *(shown[f"surface.scatter_{name}"] for name in SCATTER_IMAGES),
    )  # fmt: skip
    with ExitStack() as stack:  # also where a viewport drops the sample
        made = [stack.enter_context(images.borrowed(*smooth[0].size, "RGBA32F")).colors[0] for _ in NAMES]
        for rows in frame.bands(technique, "walks"):
            passes.fullscreen(
                WALK, images.Target(tuple(made)), rows=rows,
                textures={
                    **hierarchy.textures, "trace_owners": owners, **lit, **dict(zip(PICTURE, picture)),
                    "scatter_objects": points.table, "scatter_near": points.near, "walk_lobes": lobes,
                },
                blocks={"film_view": frame.view_block},
                constants={
                    "first_object": points.first_object, "first_leaf": first_leaf, "offset_size": frame.offset_size,
                    **walks_of(frame),
                },
            )  # fmt: skip
            yield
        passes.fullscreen(
            SMOOTH, images.Target(tuple(smooth)),
            textures={
                **{f"walked_{name}": image for name, image in zip(NAMES, made)}, "scatter_objects": points.table,
                **{
                    name: image for name, image in zip(PICTURE, picture)
                    if name not in ("spread_entry", "scatter_walk")
                },
            },
            blocks={"film_view": frame.view_block},
            constants={
                "first_object": points.first_object, "samples": frame.settings.samples, **walks_of(frame),
            },
        )  # fmt: skip
