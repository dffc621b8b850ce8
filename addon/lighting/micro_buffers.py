"""Micro-buffers: what a place sees of a tree of discs, drawn into a small picture of its hemisphere.

shaders/micro/buffer.glsl fills one, by a thread that goes through the tree; shaders/micro/sum.glsl takes the mean of
the radiance of what it shows, which is the irradiance over pi, since its pixels are equal shares of cosine-weighted
solid angle. Here are the radiance of nodes (`NodeRadiance`), from that of the points up, and light that is reflected
again and again: every one of `groups` groups of points has one of its points gather for all that see it, for both
sides, and what arrives is reflected by each with its own albedo; at the last bounce gloss mirrors the part of it that
comes from one direction (shaders/micro/directed.glsl). What each sees does not change from one reflection to the next,
so its micro-buffer is drawn once a sample and summed once for each bounce (Ritschel 2009, chapter 6.4.3: Jacobi
iteration).

| cost | for n points, G groups, K x K pixels |
|---|---|
| micro-buffers of groups | up to 2 G trees walked (sides that see a surface), 4 K^2 bytes each, of the pool |
| who takes light from which group | 2 n rays, up to eight times as many where walls part groups |
| each bounce | 2 G K^2 fetches, 2 passes and, for each 7 levels of the tree, one more; 8 fetches a node |
| radiance | 64 bytes a point, twice |
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ..frame.picture import Frame
from ..frame.technique import Technique
from ..gfx import context, images, passes
from ..gfx.interface import answered
from ..gfx.library import Program
from ..scene import acceleration
from ..scene.point_tree import COVER
from ..scene.view import VIEW
from . import caustic_casters
from .media import MEDIA, MediaService
from .point_runs import CLIPS, ROW, TURN, PointRuns, Run

PULLED = 7  # levels of a pass
NODE_ROW = 128  # groups and sides side by side
SOFTWARE_LEAVES = 2048  # of a part of a tree, at GROUP_SIDE pixels
GROUP_SIDE = 8  # pixels of a micro-buffer of a group
FARTHEST, NEAREST = 2.0, 1e-6  # by the size of the scene: the range of depths that a pixel tells apart
BUFFER_TEXTURES = (("RGBA32F", "tree_nodes"), ("RGBA32F", "piece_clips"))
BUFFER_DEFINES = (("POINT_ROW", str(ROW)), ("TURN", TURN))
BUFFER_IMAGE = ("micro", "R32UI", "UINT_2D", "READ_WRITE")
BUFFER_CONSTANTS = (
    ("IVEC2", "part"), ("INT", "micro_side"), ("INT", "leaf_count"), ("INT", "id_bits"), ("FLOAT", "detail"),
    ("INT", "centre_test"), ("VEC2", "log_depths"), ("VEC4", "buffer_choice"),
)  # fmt: skip
OF_GROUPS = Program(
    name="micro-buffers of groups",
    compute="micro/nodes.comp.glsl",
    textures=(*BUFFER_TEXTURES, ("RGBA32F", "node_radiance"), ("RGBA32F", "gathering")),
    images=(BUFFER_IMAGE,),
    constants=(*BUFFER_CONSTANTS, ("INT", "group_count")),
    defines=(*BUFFER_DEFINES, ("NODE_ROW", str(NODE_ROW))),
)
ARRIVING = passes.fullscreen_program(
    "light arriving at groups",
    "micro/arriving.frag.glsl",
    textures=(("UINT_2D", "micro"), ("RGBA32F", "node_radiance")),
    constants=(("INT", "micro_side"), ("INT", "id_bits")),
    outputs=(("VEC4", "out_arriving"),),
)
ARRIVING_AT_PLACES = replace(
    ARRIVING, textures=(*ARRIVING.textures, BUFFER_TEXTURES[0]), defines=(("NODE_ROW", str(NODE_ROW)),),
    constants=(*ARRIVING.constants, ("INT", "leaf_count"), ("INT", "group_count"), ("VEC4", "buffer_choice")),
)  # fmt: skip
ARRIVING_WITH_WAYS = replace(  # for gloss, the mean direction that it comes from, too
    ARRIVING_AT_PLACES, name="light arriving at groups, and its ways",
    defines=(*ARRIVING_AT_PLACES.defines, ("WAYS", "1")), outputs=(*ARRIVING.outputs, ("VEC4", "out_way")),
)  # fmt: skip
ARRIVING_IN_MEDIA, ARRIVING_WITH_WAYS_IN_MEDIA = (
    answered(replace(one, defines=(*one.defines, ("PLACES", "1"))), (MEDIA,))
    for one in (ARRIVING_AT_PLACES, ARRIVING_WITH_WAYS)
)
SENT = passes.fullscreen_program(
    "light sent by points",
    "micro/leaf.frag.glsl",
    textures=(*(("RGBA32F", name) for name in ("tree_nodes", "direct", "albedo", "arriving")), ("R32F", "shares")),
    constants=(("INT", "leaf_count"), ("INT", "group_count")),
    defines=(("NODE_ROW", str(NODE_ROW)), ("POINT_ROW", str(ROW)), ("COVER", str(COVER))),
    outputs=(("VEC4", "out_sent"),),
)
SENT_APART = replace(  # without what gloss mirrors
    SENT, name="light sent by points, gloss apart",
    textures=(*SENT.textures, *(("RGBA32F", name) for name in ("gloss", "point_normal", "arriving_way"))),
    defines=(*SENT.defines, ("WAYS", "1")),
)  # fmt: skip
SHARES = passes.fullscreen_program(
    "groups that points take light from",
    "micro/shares.frag.glsl",
    textures=(*acceleration.HIERARCHY_TEXTURES, BUFFER_TEXTURES[0]),
    blocks=((VIEW, "film_view"),),
    constants=(("INT", "leaf_count"), ("INT", "group_count"), ("VEC4", "buffer_choice"), ("FLOAT", "offset_size")),
    defines=(("POINT_ROW", str(ROW)),),
    outputs=(("FLOAT", "out_share"),),
)
PULL_POINTS, PULL = (
    passes.fullscreen_program(
        f"radiance of nodes from {below}",
        "micro/pull.frag.glsl",
        textures=(("RGBA32F", "sent"),),
        constants=(("INT", "leaf_count"), ("INT", "known_level")),
        defines=(("PULLED", str(PULLED)), ("POINT_ROW", str(ROW)), *defines),
        outputs=(("VEC4", "out_radiance"),),
    )
    for below, defines in (("points", (("FIRST", ""),)), ("nodes", ()))
)
LOBES = passes.fullscreen_program(
    "light of gloss at points",
    "micro/lobes.frag.glsl",
    textures=tuple(("RGBA32F", name) for name in ("sent", "direct", "across", "ways", "gloss", "point_normal")),
    outputs=tuple(("VEC4", f"out_{name}") for name in ("flux", "ways", "thrown", "all")),
)
BOUNCED = passes.fullscreen_program(
    "bounced light of gloss at points",
    "micro/bounced.frag.glsl",
    textures=(
        *(("RGBA32F", name) for name in ("gloss", "point_normal", "arriving", "arriving_way")), ("R32F", "shares"),
    ),
    defines=(("NODE_ROW", str(NODE_ROW)),),
    outputs=(("VEC4", "out_flux"), ("VEC4", "out_ways")),
)  # fmt: skip
LOBE_TEXTURES = tuple(("RGBA32F", f"node_{name}") for name in ("flux", "ways", "thrown"))  # of gloss by direction
PROGRAMS = (CLIPS, OF_GROUPS, ARRIVING, SENT, SHARES, PULL_POINTS, PULL)
# Where the run has gloss apart; with more than two bounces ARRIVING, too.
DIRECTED_PROGRAMS = (*(one for one in PROGRAMS if one != ARRIVING), LOBES, ARRIVING_WITH_WAYS, SENT_APART, BOUNCED)


def parts(leaves: int, side: int) -> list[tuple[int, int]]:
    """Parts of a tree, one for each dispatch: constant `part`. All of it at once, but in software by pieces, the more
    the more pixels a buffer has: Mesa's rasteriser leaves a shader's loops after 65,536 rounds of all together."""
    most = max(SOFTWARE_LEAVES * GROUP_SIDE**2 // max(side, GROUP_SIDE) ** 2, 1)
    count = max(leaves >> (most.bit_length() - 1), 1) if context.masks_branches() else 1
    return [(number, count) for number in range(count)]


def _gathering(seen: np.ndarray, groups: int, choice: float) -> tuple[images.Image, int]:
    """The list of all sides of groups as 2 group + side + 1, those whose gathering point sees a surface from there
    first, negative for the others, so that threads that walk the tree do so together; and how many walk."""
    size = len(seen) // groups
    leaf = np.arange(groups) * size + min(int(np.float32(choice) * np.float32(size)), size - 1)
    walks = seen[leaf].reshape(-1)
    order = np.argsort(~walks, kind="stable")
    listed = np.zeros((2 * groups, 4), np.float32)
    listed[:, 0] = np.where(walks[order], order + 1, -(order + 1))
    return images.upload(listed.reshape(-1, min(NODE_ROW, 2 * groups), 4)), int(walks.sum())


def buffer_bindings(frame: Frame, run: Run, side: int, threshold: float, centre_test: bool, use: str) -> dict:
    """Constants of shaders/micro/buffer.glsl for micro-buffers of `side` pixels a side, in which nodes are drawn up to
    `threshold` pixels of solid angle."""
    turn, x, y = frame.random_volume(use)
    far = float(np.log2(FARTHEST * frame.geometry.size))
    near = float(np.log2(NEAREST * frame.geometry.size))
    return {
        "micro_side": side, "leaf_count": run.tree.leaves, "id_bits": (4 * run.tree.leaves - 1).bit_length(),
        "detail": 0.81 * float(np.sqrt(threshold)), "centre_test": int(centre_test), "log_depths": (near, far),
        "buffer_choice": (frame.uniform(use), turn, x, y),
    }  # fmt: skip


def _gloss(run: Run) -> dict[str, images.Image]:
    """Of the points of a run that is directed: albedo and roughness of gloss, and normals."""
    return {"gloss": run.shaded.colors[4], "point_normal": run.shaded.colors[1]}


class NodeRadiance:
    """Radiance of all nodes of a run's tree in this sample, and `lobes`, of what gloss sends by direction (flux, ways
    and, where mirrors throw caustics, what photons bring of it, shaders/micro/lobes.frag.glsl), where the run has gloss
    apart. A technique owns one."""

    def __init__(self):
        self.image: images.Image | None = None
        self._spare: images.Image | None = None
        self._of_lobes: list[images.Image] = []

    @property
    def lobes(self) -> dict[str, images.Image]:
        """Textures by the names of LOBE_TEXTURES; none where there are none."""
        return dict(zip((name for _, name in LOBE_TEXTURES), self._of_lobes))

    def update(
        self, frame: Frame, technique: Technique, points: PointRuns, run: Run, bounces: int, groups: int,
        threshold: float, centre_test: bool,
    ) -> Iterator[None]:  # fmt: skip
        """Direct light at the points, and what of it has been reflected up to `bounces` times, by `groups` groups."""
        leaves = run.tree.leaves
        found = caustic_casters.of(frame)
        thrown = found is not None and bool(found.mirrors)
        self._prepare(4 * leaves, (len(LOBE_TEXTURES) if thrown else 2) if run.directed else 0)
        lit = points.light(frame, technique, run)
        direct = lit[0]
        held = [images.pool.take(*run.size, "RGBA32F"), *lit]
        sent = held[0]
        try:
            yield
            lobes: list[images.Image] = []
            if run.directed:
                lobes = [images.pool.take(*run.size, "RGBA32F") for _ in LOBES.outputs]
                held += lobes
                self._draw_lobes(frame, technique, run, lit, sent, lobes)
                direct = lobes[-1] if bounces > 0 else direct
            self._send(frame, technique, run, sent, SENT, {"direct": direct, "arriving": direct, "shares": direct})
            if bounces > 0:
                groups = min(groups, leaves // 2)
                size = (NODE_ROW, max(2 * groups // NODE_ROW, 1))
                micro = images.pool.take(size[0] * GROUP_SIDE, size[1] * GROUP_SIDE, "R32UI")
                arriving = images.Target(tuple(images.pool.take(*size, "RGBA32F") for _ in range(1 + run.directed)))
                shares = images.pool.take(*run.size, "R32F")
                held += [micro, *arriving.colors, shares]
                constants = buffer_bindings(frame, run, GROUP_SIDE, threshold, centre_test, "micro groups")
                gathering, active = _gathering(run.seen, groups, constants["buffer_choice"][0])
                for part in parts(leaves, GROUP_SIDE):
                    passes.compute(
                        OF_GROUPS, size,
                        textures={
                            "tree_nodes": run.nodes, "piece_clips": run.clips, "node_radiance": self.image,
                            "gathering": gathering,
                        },
                        images={"micro": micro}, constants={**constants, "group_count": groups, "part": part},
                    )  # fmt: skip
                    yield
                passes.fullscreen(
                    SHARES, images.Target((shares,)), blocks={"film_view": frame.view_block},
                    textures={**frame.hierarchy("diffuse").textures, "tree_nodes": run.nodes},
                    constants={
                        "leaf_count": leaves, "group_count": groups, "buffer_choice": constants["buffer_choice"],
                        "offset_size": frame.offset_size,
                    },
                )  # fmt: skip
                frame.count(technique, "passes")
                frame.count(technique, "gathers of points", active)
                media = frame.service(MediaService)
                there = {} if media is None else media.bindings
                sums = ARRIVING if media is None else ARRIVING_IN_MEDIA
                constants |= {"group_count": groups}
                gathered = {"direct": direct, "arriving": arriving.colors[0], "shares": shares}
                for bounce in range(bounces):
                    into, program = images.Target(arriving.colors[:1]), SENT
                    if run.directed and bounce == bounces - 1:  # pixels see gloss by direction
                        sums = ARRIVING_WITH_WAYS if media is None else ARRIVING_WITH_WAYS_IN_MEDIA
                        into, program = arriving, SENT_APART
                        gathered |= {"direct": lit[0], "arriving_way": arriving.colors[1], **_gloss(run)}
                    textures = {"micro": micro, "node_radiance": self.image, "tree_nodes": run.nodes} | there
                    passes.fullscreen(
                        sums, into, textures={name: textures[name] for _, name in sums.textures},
                        constants={name: constants[name] for _, name in sums.constants},
                    )  # fmt: skip
                    self._send(frame, technique, run, sent, program, gathered, groups)
                if run.directed:
                    passes.fullscreen(
                        BOUNCED, images.Target(tuple(lobes[:2])), blend="ADDITIVE_PREMULT",
                        textures={name: gathered[name] for _, name in BOUNCED.textures},
                    )  # fmt: skip
                    frame.count(technique, "passes")
                frame.count(technique, "bounces", bounces)
            for k, image in enumerate(lobes[: len(self._of_lobes)]):
                self._of_lobes[k], drawn = self._pulled(leaves, image, self._of_lobes[k])
                frame.count(technique, "passes", drawn)
        finally:  # also where a viewport drops the sample
            for image in held:
                images.pool.give(image)

    def _send(
        self, frame, technique, run: Run, sent: images.Image, program: Program, textures: dict, groups: int = 0
    ) -> None:
        self._draw_sent(run, sent, program, textures, groups)
        self.image, drawn = self._pulled(run.tree.leaves, sent, self.image)
        frame.count(technique, "passes", drawn + 1)

    @staticmethod
    def _draw_sent(run: Run, sent: images.Image, program: Program, textures: dict, groups: int) -> None:
        passes.fullscreen(
            program, images.Target((sent,)), constants={"leaf_count": run.tree.leaves, "group_count": groups},
            textures={"tree_nodes": run.nodes, "albedo": run.albedo, **textures},
        )  # fmt: skip

    def _draw_lobes(self, frame, technique, run: Run, lit, sent: images.Image, lobes: list[images.Image]) -> None:
        """What gloss sends of direct light, into images of LOBES."""
        direct, across, ways = lit
        areas = {"direct": direct, "arriving": direct, "shares": direct}
        self._draw_sent(run, sent, SENT, areas, 0)
        passes.fullscreen(
            LOBES, images.Target(tuple(lobes)),
            textures={"sent": sent, "direct": direct, "across": across, "ways": ways, **_gloss(run)},
        )  # fmt: skip
        frame.count(technique, "passes", 2)

    def _pulled(self, leaves: int, sent: images.Image, image: images.Image) -> tuple[images.Image, int]:
        """Means of all nodes, in `image` or in the spare one, which takes its place; and how many passes."""
        level, program, source = leaves.bit_length() - 1, PULL_POINTS, sent
        drawn = 0
        while level > 0:
            passes.fullscreen(
                program, images.Target((self._spare,)), textures={"sent": source},
                constants={"leaf_count": leaves, "known_level": level},
            )  # fmt: skip
            image, self._spare = self._spare, image
            level, program, source = level - PULLED, PULL, image
            drawn += 1
        return image, drawn

    def _prepare(self, entries: int, lobes: int) -> None:
        height = max(-(-entries // images.LIST_WIDTH), 1)
        if self.image is None or self.image.height != height or len(self._of_lobes) != lobes:
            self.release()
            self.image, self._spare, *self._of_lobes = (
                images.pool.take(images.LIST_WIDTH, height, "RGBA32F") for _ in range(2 + lobes)
            )

    def release(self) -> None:
        """Give images back."""
        for image in (self.image, self._spare, *self._of_lobes):
            if image is not None:
                images.pool.give(image)
        self.image, self._spare, self._of_lobes = None, None, []
