"""Implicit visibility: light between surfels, where the shortest link of a direction is the one that is not hidden.

Every side of a surfel has a half ball of direction bins. A bin keeps the link to the nearest surfel that it finds, so
that making links is testing depth: no shadow map, no rays through triangles. Light then runs along the links,

    E_k(x) / pi = mean over bins of  L_k-1(link),      L_k = rho (E_direct + E_k) / pi,        k = 1 .. bounces

and pixels show a linear fit over the surfels around (shaders/implicit_visibility/). The solution belongs to the
surfaces, not to the picture: a camera that moves costs the fit alone, changed lights or materials keep the links, and
what moves makes links anew.

Bins are a square folded onto the half ball so that all have the same projected solid angle (Shirley and Chiu 1997):
weights are equal, and 21 x 21 are as many as a cube map of 6 x 12 x 12 has. They are turned and shifted differently for
every surfel and in each of `orientations` solutions, one for each sample of a picture, so that errors average out.
Links are found bin by bin down the tree of surfels: nodes are opened until they look no larger than the bin, and the
nearest disc in the bin's direction is kept (the source's refinement, push-down and weight E2 in one pass).

Source: Dong, Kautz, Theobalt and Seidel, "Interactive Global Illumination Using Implicit Visibility", Pacific Graphics
2007; Dong, PhD thesis, Saarland University 2011, chapter 4.

| cost, R receivers | |
|---|---|
| surfels, when surfaces change | CPU, scene/surfels.py; 200,000 rays and a readback, scene/seen.py |
| links, for each solution, when surfaces change | R bins^2 walks down the tree; 4 R bins^2 bytes are kept |
| light, for each solution, when it changes | lighting/surfels.py; a bounce fetches 2 R bins^2 texels |
| each sample | 1 pass, about 150 nodes per pixel of 2 fetches |

Bias (diffuse indirect light): silhouettes, contacts and slits narrower than a surfel are blurred. Rough diffuse and
gloss that surfels send count as even, glass and alpha as what they cover. Fails: light through
gaps, and on things, smaller than a surfel (`surfels` sets the number). Gloss is one ray per pixel, as in ssdo.py.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from ..frame.picture import Frame
from ..frame.run import lights_key
from ..frame.settings import Settings
from ..frame.technique import Param, Technique
from ..gfx import images, passes
from ..gfx.interface import answered
from ..gfx.library import Program
from ..lighting import surfels as surfel_light
from ..lighting.asked import lit_at_hits
from ..lighting.media import MEDIA, MediaService
from ..lighting.surfels import SurfelLight
from ..lighting.virtual_lights import VirtualLights
from ..scene import acceleration
from ..scene.seen import SEES
from ..scene.surfels import Surfels
from ..snapshot.scene import Snapshot
from ..surfaces.draw import ANY_SURFACE, LIT_SURFACES, MARKS, SURFACE_TEXTURES, surface_bindings
from .instant_radiosity import INDIRECT_WRITES, no_indirect_light
from .ssdo import GLOSSY

COLUMNS = 8  # receivers side by side in an image of links
REFINE = 1.0  # bins that a ball about a node may cover to stand for its surfels: 1 / this
MOST_BOUNCES = 16
REACH = 2.5  # radii of a surfel within which pixels take light from it
STIFF = 0.03  # how much the slope of the fit is held back where few surfels tell it
TREE = (("RGBA32F", "surfel_nodes"),)
IN_TREE = (("SURFEL_TREE", "1"),)
WIDE = (("COLUMNS", str(COLUMNS)),)
LINKS = passes.fullscreen_program(
    "links of surfels",
    "implicit_visibility/links.frag.glsl",
    textures=(*TREE, ("RGBA32F", "receivers")),
    constants=(
        ("INT", "receiver_count"), ("INT", "node_count"), ("INT", "bins"), ("INT", "solution"), ("INT", "link_seed"),
        ("FLOAT", "refine"),
    ),
    defines=(*IN_TREE, *WIDE),
    outputs=(("FLOAT", "out_link"),),
)  # fmt: skip
SEND = passes.fullscreen_program(
    "direct light that surfels send",
    "implicit_visibility/send.frag.glsl",
    textures=(("RGBA32F", "reflectance"), ("RGBA32F", "direct")),
    outputs=(("VEC4", "out_sent"),),
)
PULL = passes.fullscreen_program(
    "light of groups of surfels",
    "implicit_visibility/pull.frag.glsl",
    textures=(*TREE, ("RGBA32F", "surfel_leaves"), ("RGBA32F", "sent")),
    constants=(("INT", "node_count"),),
    defines=IN_TREE,
    outputs=(("VEC4", "out_radiance"),),
)
GATHER = passes.fullscreen_program(
    "bounce between surfels",
    "implicit_visibility/gather.frag.glsl",
    textures=(("R32F", "bin_links"), ("RGBA32F", "node_radiance"), ("RGBA32F", "reflectance"), ("RGBA32F", "direct")),
    constants=(("INT", "receiver_count"), ("INT", "bins")),
    defines=WIDE,
    outputs=(("VEC4", "out_arriving"), ("VEC4", "out_sent")),
)
GATHER_IN_MEDIA = answered(
    replace(
        GATHER, textures=(*GATHER.textures, *TREE, ("RGBA32F", "receivers")),
        defines=(*GATHER.defines, *IN_TREE, ("PLACES", "1")),
    ),
    (MEDIA,),
)  # fmt: skip
SHOW = passes.fullscreen_program(
    "light of surfels at pixels",
    "implicit_visibility/show.frag.glsl",
    textures=(
        *SURFACE_TEXTURES,
        *TREE,
        *(("RGBA32F", name) for name in ("surfel_leaves", "receivers", "arriving", "free_a", "free_b")),
    ),
    constants=(("INT", "node_count"),),
    defines=(*IN_TREE, ("REACH", str(REACH)), ("STIFF", str(STIFF))),
    outputs=(("VEC4", "out_diffuse"),),
)
PROGRAMS = (LINKS, SEND, PULL, GATHER, SHOW)


@dataclass
class Solution:
    """Links of one orientation, R32F, and what arrives at receivers by them, with what both were made for."""

    links: images.Image | None = None
    arriving: images.Image | None = None
    linked_for: object = None
    lit_for: object = None


class ImplicitVisibility(Technique):
    name = "implicit_visibility"
    label = "Implicit visibility"
    fills = ("indirect",)
    params = (
        Param("surfels", "Surfels", 4096, "Number of discs that represent all surfaces, both sides counted", 64, 65536),
        Param(
            "bins", "Bins", 21,
            "Directions along each side of the square that is mapped to a surfel's hemisphere; 21 are as fine as "
            "cube maps of 12 texels",
            4, 32,
        ),
        Param(
            "orientations", "Orientations", 8,
            "Number of solutions with differently rotated bins; each sample shows one of them",
            1, 64,
        ),
    )  # fmt: skip
    reads = LIT_SURFACES
    writes = INDIRECT_WRITES

    def __init__(self):
        self._light = SurfelLight()
        self._solutions: dict[int, Solution] = {}
        self._glossy = VirtualLights()
        self._shadows: tuple = ()

    def skip(self, snapshot: Snapshot, settings: Settings) -> str | None:
        return no_indirect_light(snapshot, settings) or acceleration.too_many_copies(snapshot)

    def programs(self, snapshot: Snapshot, settings: Settings) -> tuple[Program, ...]:
        return (SEES, *PROGRAMS, *surfel_light.PROGRAMS)

    def begin(self, frame: Frame) -> None:
        if frame.receivers is None or not len(frame.receivers.distance):
            return
        surfels = frame.kept(Surfels)
        made = surfels.update(frame, frame.settings.get(self, "surfels"), frame.typical_distance)
        frame.count(self, "surfels made" if made else "surfels kept", len(surfels.cells))
        for number in [k for k in self._solutions if k >= frame.settings.get(self, "orientations")]:
            self._give(self._solutions.pop(number))
        if not surfels.receiver_count:
            return
        self._light.begin(frame)
        # What else that light depends on, which holds shadows.
        self._shadows = tuple((one.links, one.visibility) for one in frame.snapshot.instances)
        if frame.materials.glossy:
            self._glossy.begin(frame)

    def sample(self, frame: Frame) -> Iterator[None]:
        if frame.receivers is None or not len(frame.receivers.distance):
            return
        surfels = frame.kept(Surfels)
        if not surfels.receiver_count:
            return
        number = frame.sample % frame.settings.get(self, "orientations")
        solution = self._solutions.setdefault(number, Solution())
        yield from self._link(frame, surfels, solution, number)
        yield from self._solve(frame, surfels, solution, number)
        target = frame.target("radiance.diffuse_indirect", depth=MARKS)
        for rows in frame.bands(self):
            passes.fullscreen(
                SHOW, target, blend="ADDITIVE_PREMULT", where=ANY_SURFACE, rows=rows,
                textures={
                    **surface_bindings(frame), **_tree(surfels), "surfel_leaves": surfels.leaves,
                    "receivers": surfels.receivers, "arriving": solution.arriving, **self._light.free,
                },
                constants={"node_count": surfels.node_count},
            )  # fmt: skip
            yield
        frame.count(self, "passes")
        if frame.materials.glossy:
            yield from self._add_gloss(frame)

    def _link(self, frame: Frame, surfels: Surfels, solution: Solution, number: int) -> Iterator[None]:
        bins = frame.settings.get(self, "bins")
        wanted = (surfels.changes, bins, frame.settings.seed)
        count = surfels.receiver_count * bins * bins
        if solution.linked_for == wanted:
            frame.count(self, "links kept", count)
            return
        size = (COLUMNS * bins * bins, -(-surfels.receiver_count // COLUMNS))
        if solution.links is None or solution.links.size != size:
            if solution.links is not None:
                images.pool.give(solution.links)
            solution.links = images.pool.take(*size, "R32F")
        solution.linked_for = solution.lit_for = None  # until all of them are there
        target = images.Target((solution.links,))
        for rows in _parts(size[1], frame):
            passes.fullscreen(
                LINKS, target, rows=rows, textures={**_tree(surfels), "receivers": surfels.receivers},
                constants={
                    "receiver_count": surfels.receiver_count, "node_count": surfels.node_count, "bins": bins,
                    "solution": number, "link_seed": frame.settings.seed, "refine": REFINE,
                },
            )  # fmt: skip
            yield
        solution.linked_for = wanted
        frame.count(self, "links made", count)
        frame.count(self, "passes")

    def _solve(self, frame: Frame, surfels: Surfels, solution: Solution, number: int) -> Iterator[None]:
        bounces = min(frame.settings.bounces, MOST_BOUNCES)
        media = frame.service(MediaService)
        wanted = (
            solution.linked_for, lights_key(frame.snapshot), frame.environment, frame.materials.fingerprint(), bounces,
            self._shadows, media and media.media.changes,
        )  # fmt: skip
        if _same(solution.lit_for, wanted):
            frame.count(self, "light kept", surfels.receiver_count)
            return
        shaded = self._light.update(frame, self, surfels)
        frame.count(self, "surfels shaded" if shaded else "shading kept", surfels.receiver_count)
        size = SurfelLight.size(surfels)
        if solution.arriving is None or solution.arriving.size != size:
            if solution.arriving is not None:
                images.pool.give(solution.arriving)
            solution.arriving = images.pool.take(*size, "RGBA32F")
        solution.lit_for = None
        direct, other, *sent = (images.pool.take(*size, "RGBA32F") for _ in range(4))
        radiance = images.pool.take(images.LIST_WIDTH, -(-2 * surfels.node_count // images.LIST_WIDTH), "RGBA32F")
        try:
            self._light.add_direct(frame, self, surfels, images.Target((direct, other)), number)
            yield
            known = {"reflectance": self._light.reflectance, "direct": direct}
            passes.fullscreen(SEND, images.Target((sent[0],)), textures=known)
            constants = {"receiver_count": surfels.receiver_count, "bins": frame.settings.get(self, "bins")}
            gather, links = GATHER, {"bin_links": solution.links}
            if media is not None:
                gather = GATHER_IN_MEDIA
                links |= {**_tree(surfels), "receivers": surfels.receivers, **media.bindings}
            for bounce in range(bounces):
                before, after = sent[bounce % 2], sent[1 - bounce % 2]
                passes.fullscreen(
                    PULL, images.Target((radiance,)),
                    textures={**_tree(surfels), "surfel_leaves": surfels.leaves, "sent": before},
                    constants={"node_count": surfels.node_count},
                )  # fmt: skip
                passes.fullscreen(
                    gather, images.Target((solution.arriving, after)),
                    textures={**known, **links, "node_radiance": radiance}, constants=constants,
                )  # fmt: skip
                yield
        finally:
            for image in (direct, other, *sent, radiance):
                images.pool.give(image)
        solution.lit_for = wanted
        frame.count(self, "light made", surfels.receiver_count)
        frame.count(self, "passes", 1 + 2 * bounces)

    def _add_gloss(self, frame: Frame) -> Iterator[None]:
        self._glossy.draw_sources(frame)
        bindings = self._glossy.path_bindings(frame)
        bindings["constants"] |= {"fan_count": 0, "step_count": 0, "farthest": 0.0, "thickness": 0.0}
        program = lit_at_hits(frame, GLOSSY, bindings["textures"])
        target = frame.target("radiance.glossy_indirect", depth=MARKS)
        for rows in frame.bands(self, "gloss"):
            passes.fullscreen(program, target, blend="ADDITIVE_PREMULT", where=ANY_SURFACE, rows=rows, **bindings)
            yield
        frame.count(self, "passes")

    @staticmethod
    def _give(solution: Solution) -> None:
        for image in (solution.links, solution.arriving):
            if image is not None:
                images.pool.give(image)

    def release(self) -> None:
        for solution in self._solutions.values():
            self._give(solution)
        self._solutions = {}
        self._light.release()
        self._glossy.release()


def _tree(surfels: Surfels) -> dict[str, images.Image]:
    return {"surfel_nodes": surfels.nodes}


def _parts(height: int, frame: Frame) -> list[tuple[int, int]]:
    """Rows of links that are made at a time: all, or eighths where other work waits."""
    step = height if frame.shared_out is None else max(-(-height // 8), 1)
    return [(first, min(first + step, height)) for first in range(0, height, step)]


def _same(known: tuple | None, wanted: tuple) -> bool:
    """Whether light was made for the same; the environment is an object, the same one while the world is."""
    return known is not None and known[2] is wanted[2] and (*known[:2], *known[3:]) == (*wanted[:2], *wanted[3:])
