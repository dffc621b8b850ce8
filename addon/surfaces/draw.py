"""Draws the surfaces that a view shows, as closures of their materials, into six images (the G-buffer)."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection
from contextlib import ExitStack
from functools import cache

import numpy as np

from ..frame.picture import Frame
from ..frame.technique import Technique
from ..gfx import images, passes
from ..gfx.library import Program
from ..gfx.struct import Block
from ..scene.culling import calls, entered
from ..scene.joint_draws import Joint, JointDraws
from ..scene.materials import FIRST_VALUE, SURFACE_IMAGES, AovLayout
from ..scene.view import VIEW
from .layers import add_in_order
from .tiles import clear_outside, draw_seen

STOCHASTIC, OPAQUE, LEFT_OUT, FROM_OPACITY = 0, 1, 2, 3
COLORED = -1  # STOCHASTIC, before the colours of what passes are drawn
TINTED = ("surface.diffuse", "surface.tint", "surface.emission")

SURFACES = tuple(f"surface.{name}" for name in SURFACE_IMAGES)
SURFACE_TEXTURES = tuple(("RGBA32F", f"surface_{name}") for name in SURFACE_IMAGES)
# Defines of the programs that light surfaces: without and with soft lobes, which few scenes have.
SOFT_DEFINES = ((), (("SOFT_LOBES", ""),))


def surface_bindings(frame: Frame) -> dict[str, images.Image]:
    """The surface images under the names that shaders/lib/gbuffer.glsl reads."""
    return {f"surface_{name}": frame.images[f"surface.{name}"] for name in SURFACE_IMAGES}


# Which pixels a pass that adds light is about: `where` of passes.fullscreen, with MARKS as depth of the target.
MARKS = "surface.marks"
ANY_SURFACE, NARROW_LOBE = "LESS_EQUAL", "LESS"
LIT_SURFACES = (*SURFACES, MARKS)


def refracts(frame: Frame) -> bool:
    """Whether light through glass is followed; else glass is a transparent layer."""
    return frame.plan.fills("transmission")


class BothWays(ABC):
    """What a technique is that may follow what smooth glass mirrors and what it lets pass in each sample."""

    @abstractmethod
    def follows_both_ways(self, frame: Frame) -> bool:
        """Whether it does in this picture, known before its first sample."""

    @abstractmethod
    def follows_coats(self, frame: Frame) -> bool:
        """The same of a thin coat and the lobe below it."""


def goes_both_ways(frame: Frame) -> bool:
    """Whether smooth glass that the camera sees is kept as one lobe that lets through and mirrors."""
    asked = (one for one in frame.plan.techniques if isinstance(one, BothWays))
    return refracts(frame) and any(one.follows_both_ways(frame) for one in asked)


def keeps_coats(frame: Frame) -> bool:
    """Whether a thin coat that the camera sees is kept beside the lobe below it."""
    return any(one.follows_coats(frame) for one in frame.plan.techniques if isinstance(one, BothWays))


def lobes_kept(frame: Frame) -> int:
    """`glass` of draw_surfaces for what the camera sees in a sample."""
    return (2 if goes_both_ways(frame) else int(refracts(frame))) + 4 * keeps_coats(frame)


def draw_surfaces(frame: Frame, technique: Technique, target: images.Target, mode: int, glass: int) -> None:
    """Draw what the camera sees into six surface images with a depth buffer. `mode` says what becomes of transparent
    layers: STOCHASTIC, COLORED, OPAQUE, LEFT_OUT, or FROM_OPACITY plus thousandths of opacity. `glass`: 1 it is drawn
    as a surface, and is no such layer; 2 so, as one lobe (goes_both_ways); 4 more: thin coats stay beside the lobe
    below them (keeps_coats)."""

    def draw(target: images.Target, view: Block, rows: np.ndarray) -> None:
        _draw_surfaces(frame, technique, target, mode, glass, view, rows)

    draw_seen(frame, target, draw)
    clear_outside(frame, target.colors[-1])


def _draw_surfaces(
    frame: Frame, technique: Technique, target: images.Target, mode: int, glass: int, view: Block, rows: np.ndarray
) -> None:
    target.clear((0.0, 0.0, 0.0, 0.0), 1.0)
    # What reaches the eye where nothing is hit:
    images.Target((target.colors[-1],)).clear((1.0, 1.0, 1.0, 0.0))
    with passes.drawing(target):
        _submit(frame, technique, frame.materials.surface_program, None, drawing_constants(mode, glass), view, rows)
    frame.count(technique, "passes")


def drawing_constants(mode: int, glass: int) -> dict[str, int]:
    """Of the programs that draw surfaces, beside the first instance."""
    return {"transparent_mode": mode, "glass_bends": int(glass), "index_shown": -1}


def layer_mode(frame: Frame) -> int:
    """What becomes of layers in samples of the picture: mist is about where they stop, coloured panes included."""
    return STOCHASTIC if frame.snapshot.film.mist else COLORED


def data_mode(frame: Frame) -> int:
    """What becomes of transparent layers in Depth, Position and index passes: as in Cycles they show layers that are as
    opaque as the view layer's alpha threshold, and thinner ones where the sample stops there."""
    if not any(material.transparent for material in frame.materials.compiled):
        return STOCHASTIC
    threshold = frame.snapshot.film.alpha_threshold
    return OPAQUE if threshold <= 0.0 else FROM_OPACITY + round(1000 * threshold)


def draw_indices(frame: Frame, technique: Technique, target: images.Target) -> None:
    """Draw the pass indices of the objects and materials that data passes show in this sample into the first image of a
    target as of draw_surfaces; what the others hold then is of no use."""
    indices = [material.pass_index for material in frame.snapshot.materials]
    _draw_indices(frame, technique, target, indices, data_mode(frame))


def draw_numbers(frame: Frame, technique: Technique, target: images.Target) -> None:
    """The same of numbers: y of the material, z of the instance (a row of frame.geometry.placed), w 0 for none."""
    _draw_indices(frame, technique, target, list(range(len(frame.snapshot.materials))))


def _draw_indices(
    frame: Frame, technique: Technique, target: images.Target, indices: list[int], mode: int = STOCHASTIC
) -> None:
    constants = drawing_constants(mode, refracts(frame))

    def draw(target: images.Target, view: Block, rows: np.ndarray) -> None:
        target.clear((0.0, 0.0, 0.0, 0.0), 1.0)
        with passes.drawing(target):
            _submit(frame, technique, frame.materials.surface_program, None, constants, view, rows, indices=indices)

    draw_seen(frame, target, draw)


class StandIns:
    """What draws materials instead of their surface programs as the camera sees them (frame.shared): by material, the
    program, its textures and its constants beside those of the material's own. Set before surfaces are drawn."""

    def __init__(self):
        self.of: dict[int, tuple[Program, dict[str, images.Image], dict[str, object]]] = {}


class SurfaceStages:
    """What techniques do to surfaces once they are drawn (frame.shared): called with six surface images at each point
    of the film. The sample's own point, at which techniques run in order, is theirs."""

    def __init__(self):
        self.apply: list[Callable[[Frame, images.Target], None]] = []


def draw_sample(frame: Frame, technique: Technique, target: images.Target) -> None:
    """Draw what the camera sees in one sample into six surface images with a depth buffer."""
    _draw_sample(frame, technique, target)
    if target.colors[0] is not frame.images.get(SURFACES[0]):
        for apply in frame.shared(SurfaceStages).apply:
            apply(frame, target)


def _draw_sample(frame: Frame, technique: Technique, target: images.Target) -> None:
    def draw(target: images.Target, view: Block, rows: np.ndarray) -> None:
        _draw_layers(frame, technique, target, view, rows)

    draw_seen(frame, target, draw)
    clear_outside(frame, target.colors[-1])


def _draw_layers(frame: Frame, technique: Technique, target: images.Target, view: Block, rows: np.ndarray) -> None:
    """Surfaces, and the colours of the layers before them."""
    glass = refracts(frame)
    mode = layer_mode(frame)
    _draw_surfaces(frame, technique, target, mode, lobes_kept(frame), view, rows)
    tinted = coloring(frame)
    if not tinted:
        return
    # Multiply what was hit by the colour of the layers before it that let this sample pass.
    drawn = dict(zip(SURFACES, target.colors))
    colors = images.Target(tuple(drawn[name] for name in TINTED))
    position = {"surface_position": drawn["surface.position"]}
    constants = {"glass_bends": int(glass), "transparent_mode": mode}
    with passes.drawing(colors, blend="MULTIPLY", depth_test="NONE", depth_write=False):
        _submit(frame, technique, frame.materials.tint_program, tinted, constants, view, rows, position)
    frame.count(technique, "passes")


def _draw_behind(frame: Frame, technique: Technique, target: images.Target, position: images.Image, draw, blend="NONE"):
    """As draw_seen, for what is drawn before surfaces that are known: `draw` is also given where they lie. Tiles of a
    panoramic camera draw them anew."""

    def known(target: images.Target, view: Block, rows: np.ndarray) -> None:
        draw(target, view, rows, position)

    def anew(target: images.Target, view: Block, rows: np.ndarray) -> None:
        with ExitStack() as stack:
            kinds = ("RGBA32F",) * len(SURFACE_IMAGES), ("DEPTH_COMPONENT32F",)
            seen, depth = (
                tuple(stack.enter_context(images.borrowed(*target.size, kind)).colors[0] for kind in some)
                for some in kinds
            )
            _draw_layers(frame, technique, images.Target(seen, depth[0]), view, rows)
            target.clear((0.0, 0.0, 0.0, 0.0), 1.0)
            draw(target, view, rows, seen[0])

    draw_seen(frame, target, anew if frame.tiles else known, blend)


def coloring(frame: Frame) -> set[int]:
    """Materials that colour what passes them."""
    return {k for k, material in enumerate(frame.materials.compiled) if material.colors_behind}


def draw_passed_layers(frame: Frame, technique: Technique, target: images.Target, position: images.Image) -> None:
    """Of layers that colour what passes them, and that this sample passes before the surfaces at `position`: where the
    nearest lies (w 0: there is none) and the colour of all of them, in the first two of a target of three images with a
    depth buffer; the third is of no use."""
    constants = {"glass_bends": int(refracts(frame)), "transparent_mode": layer_mode(frame)}
    program, layers = frame.materials.layer_program, coloring(frame)

    def draw(target: images.Target, view: Block, rows: np.ndarray, position: images.Image) -> None:
        read = {"surface_position": position}
        target.clear((0.0, 0.0, 0.0, 0.0), 1.0)
        with passes.drawing(target):
            _submit(frame, technique, program, layers, constants, view, rows, read)
        _, tint, other = target.colors
        images.Target((tint,)).clear((1.0, 1.0, 1.0, 1.0))
        with images.borrowed(*target.size, "RGBA32F") as places:
            every = images.Target((places.colors[0], tint, other))
            with passes.drawing(every, blend="MULTIPLY", depth_test="NONE", depth_write=False):
                _submit(frame, technique, program, layers, constants, view, rows, read)

    _draw_behind(frame, technique, target, position, draw)
    frame.count(technique, "passes", 2)


def add_glow(frame: Frame, technique: Technique, position: images.Image, emission: images.Image) -> None:
    """Add to `emission` what layers emit that stand before the surfaces at `position` (of SURFACE_IMAGES), as seen from
    where the frame looks now."""
    glowing = {k for k, material in enumerate(frame.materials.compiled) if material.glows}
    if not glowing:
        return
    constants = {"glass_bends": int(refracts(frame))}
    layers = frame.materials.layers_in_order

    def draw(target: images.Target, view: Block, rows: np.ndarray, position: images.Image) -> None:
        if layers:

            def submit(behind: images.Image) -> None:
                read = {"surface_position": behind}
                colors = {**constants, "transparent_mode": layer_mode(frame)}
                _submit(frame, technique, frame.materials.layer_program, layers, colors, view, rows, read)

            frame.count(technique, "passes", add_in_order(target, position, submit))
            return
        with passes.drawing(target, blend="ADDITIVE_PREMULT", depth_test="NONE", depth_write=False):
            textures = {"surface_position": position}
            _submit(frame, technique, frame.materials.glow_program, glowing, constants, view, rows, textures)
        frame.count(technique, "passes")

    _draw_behind(frame, technique, images.Target((emission,)), position, draw, "ADDITIVE_PREMULT")


@cache
def motion_behind(layout: AovLayout) -> Program:
    """Draws the motion of the background into images of a layout that holds VECTOR and HIT."""
    outs = {kind: f"out_{k}" + (f".{'xyzw'[c]}" if kind == "HIT" else "")
            for k, held in enumerate(layout) for c, (_, kind) in enumerate(held)}  # fmt: skip
    none = " ".join(f"out_{k} = vec4(0.0);" for k in range(len(layout)))
    return passes.fullscreen_program(
        "motion behind all",
        "surface/motion_behind.frag.glsl",
        textures=(("RGBA32F", "motion_table"),),
        blocks=((VIEW, "film_view"),),
        defines=(("AOV_NONE", none), ("VECTOR_OUT", outs["VECTOR"]), ("HIT_OUT", outs["HIT"])),
        outputs=tuple(("VEC4", f"out_{k}") for k in range(len(layout))),
    )


MOTION_BEHIND = motion_behind(((("", "VECTOR"),), (("", "HIT"),)))


def draw_aovs(
    frame: Frame,
    technique: Technique,
    target: images.Target,
    layout: AovLayout,
    position: images.Image,
    motion: images.Image | None = None,
) -> None:
    """Draw what AOV Output nodes give of the surfaces that the camera sees now, before or at those at `position` (of
    SURFACE_IMAGES), into images of this layout with a depth buffer. `motion`: see shaders/surface/motion.glsl."""
    target.clear((0.0, 0.0, 0.0, 0.0), 1.0)

    def program_of(material: int) -> Program:
        return frame.materials.aov_program(material, layout)

    threshold = frame.snapshot.film.alpha_threshold
    textures = {}
    if any(kind == "VECTOR" for held in layout for _, kind in held):
        textures["motion_table"] = motion
        blocks = {"film_view": frame.view_block}
        passes.fullscreen(
            motion_behind(layout), images.Target(target.colors), textures={"motion_table": motion}, blocks=blocks
        )
    thin = {k for k, material in enumerate(frame.materials.compiled) if material.transparent and threshold > 0.0}

    def draw(target: images.Target, view: Block, rows: np.ndarray, position: images.Image) -> None:
        for layers, wanted in ((0, None), (1, thin)):
            if wanted is None or wanted:
                blend = "ADDITIVE_PREMULT" if layers else "NONE"
                with passes.drawing(target, blend=blend, depth_write=not layers):
                    constants = {"layers": layers, "alpha_threshold": threshold}
                    read = {**textures, "surface_position": position}
                    _submit(frame, technique, program_of, wanted, constants, view, rows, read)
                frame.count(technique, "passes")

    _draw_behind(frame, technique, target, position, draw)


def draw_scatter(
    frame: Frame, technique: Technique, target: images.Target, objects: images.Image, materials: set[int]
) -> None:
    """Draw how far light spreads below the surfaces of `materials`, where this sample's surface images show them, into
    SCATTER_IMAGES. `objects`: by instance, see scene/scatter_points.py."""
    target.clear((0.0, 0.0, 0.0, 0.0))
    constants = {"glass_bends": int(refracts(frame))}

    def draw(target: images.Target, view: Block, rows: np.ndarray, position: images.Image) -> None:
        textures = {"surface_position": position, "scatter_objects": objects}
        with passes.drawing(target, depth_test="NONE", depth_write=False):
            _submit(frame, technique, frame.materials.scatter_program, materials, constants, view, rows, textures)
        frame.count(technique, "passes")

    _draw_behind(frame, technique, target, frame.images["surface.position"], draw)


def draw_view(
    frame: Frame, technique: Technique, target: images.Target, view: Block, rows: np.ndarray, program_of,
    materials: Collection[int], constants: dict, depth_test: str = "LESS_EQUAL",
) -> None:  # fmt: skip
    """Draw `materials`, each with the program that `program_of` says, as any view sees them: its fields in a block of
    VIEW, and its `rows` x, y, w, q. The target, with a depth buffer, is not cleared."""
    with passes.drawing(target, depth_test=depth_test):
        _submit(frame, technique, program_of, materials, constants, view, rows)
    frame.count(technique, "passes")


def _submit(
    frame: Frame, technique: Technique, program_of, materials: Collection[int] | None, constants: dict, view: Block,
    rows: np.ndarray, textures=None, indices: list[int] | None = None,
) -> None:  # fmt: skip
    """Draw what a view may see of `materials` (None: of all), each with its own program. `indices`: by material, what
    is shown instead of where surfaces lie."""
    geometry, left = frame.geometry, None
    of_surfaces = program_of == frame.materials.surface_program
    stand_ins = frame.shared(StandIns).of if of_surfaces else {}
    if of_surfaces and indices is None and not stand_ins:
        joint = frame.kept(JointDraws).update(geometry, frame.materials)
        if joint is not None:
            whole, left = (None, joint.left) if materials is None else joint.of(materials)
            _submit_joint(frame, technique, joint, constants, view, rows, whole)
    if left is not None and not left.any():
        return
    seen = geometry.boxes.seen(rows) if left is None else geometry.boxes.seen(rows) & left
    material = None
    unseen = {k for k, one in enumerate(frame.materials.compiled) if one.bounds_alone}
    from_outside = entered(geometry.draws, geometry.boxes, rows)
    for call in calls(geometry.draws, np.flatnonzero(seen)):
        if call.draw.material in unseen or (materials is not None and call.draw.material not in materials):
            continue
        if call.draw.material != material:
            material = call.draw.material
            stand_in = stand_ins.get(material)
            program = stand_in[0] if stand_in else program_of(material)
            shader = passes.get(program)
            bindings, shown = frame.materials.drawing(material, program, geometry.instances)
            bindings["blocks"]["film_view"] = view
            bindings["textures"] |= textures or {}
            if indices is not None:
                shown["index_shown"] = indices[material]
            if stand_in:
                bindings["textures"] |= stand_in[1]
                shown |= stand_in[2]
            shader.bind(**bindings, constants={"first_instance": call.first, **constants, **shown})
            if from_outside:
                passes.set_culling("BACK" if material in from_outside else "NONE")
        shader.set_constant("first_instance", call.first)
        passes.draw(shader, call.draw.batch, call.count)
        frame.count(technique, "triangles", call.triangles)
    if from_outside:
        passes.set_culling("NONE")


def _submit_joint(
    frame: Frame, technique: Technique, joint: Joint, constants: dict, view: Block, rows, whole: frozenset[int] | None
) -> None:  # fmt: skip
    """The same of materials that are drawn together: of all parts, or of those with these leaders."""
    for part, runs in joint.calls(rows, whole):
        program = frame.materials.surface_program(part.leader)
        shader = passes.get(program)
        bindings, _ = frame.materials.drawing(part.leader, program, frame.geometry.instances)
        bindings["blocks"]["film_view"] = view
        shader.bind(**bindings, constants={**constants, "first_instance": 0, FIRST_VALUE: 0})
        for first, count in runs:
            passes.draw_range(shader, part.batch, first, count)
            frame.count(technique, "triangles", count)
