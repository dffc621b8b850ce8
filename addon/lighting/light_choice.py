"""Which candidates become virtual lights: sorted, shared, weighed and compacted on the GPU, without a readback.

Candidates (lighting/virtual_lights.py) are sorted by the side that they face and along a Morton curve. GROUP of them
that stand side by side then share what their paths met next. `wanted` are kept by systematic resampling in proportion
to radiance, along that order, by marks that start anew in every cell of an octree of each side which holds no more than
CELL of them: a candidate that another picture has or lacks changes what is kept nearby, not all that is kept. Few have
larger cells: each cell keeps one more or less than it should, which shows in the sum of few.

What is kept is as many as wanted up to what cells keep too much or too little, so there is room for some more
(`room_for`), and places that stay empty are virtual lights without light.

| pass | work for N candidates |
|---|---|
| bounds, keys | N points |
| sort | 2 passes, kernels/ordered_lists.py |
| radiances; sums of pairs | 2 GROUP N loads |
| running sums of importance, choice, running sums of the chosen | 5 passes; some bisections of log2 N each |
| slots | a bisection for each virtual light |

Source: as in lighting/virtual_lights.py; systematic resampling: Kitagawa 1996. Bias: none; rounding of the sums changes
what is expected of a candidate, and its weight with it.
"""

from __future__ import annotations

import math
from dataclasses import replace

from ..frame.picture import Frame
from ..gfx import images, passes
from ..gfx.interface import answered
from ..gfx.library import Program
from ..kernels import ordered_lists
from .media import MEDIA, MediaService

GROUP = 16  # candidates that share the next surfaces of their paths
FLOOR = 1.0  # share of the mean importance that every candidate keeps
CELL = 8  # virtual lights of a cell in which they are chosen by themselves
FEW = 2048  # at least, of the lights of a cell times all of them
PARTS = 64  # in which bounds are found
REACH = 32.0  # typical distances from what is seen, beyond which places are not told apart

_LIST = ordered_lists.DEFINES
_CHOICE = (("INT", "rays"), ("INT", "candidate_count"), ("VEC4", "seen_middle"))
_POINT, _NORMAL = ("RGBA32F", "candidate_point"), ("RGBA32F", "candidate_normal")


def _pass(name: str, file: str, textures, constants, outputs, *defines) -> Program:
    return passes.fullscreen_program(
        name, f"indirect/{file}.frag.glsl", textures=textures, constants=constants, outputs=outputs,
        defines=(*_LIST, *defines),
    )  # fmt: skip


BOUNDS = _pass(
    "bounds of candidates", "choice_bounds", (_POINT,), _CHOICE, (("VEC4", "out_low"), ("VEC4", "out_high")),
    ("PARTS", str(PARTS)),
)  # fmt: skip
KEYS = _pass(
    "keys of candidates", "choice_keys", (_POINT, _NORMAL, ("RGBA32F", "bounds_low"), ("RGBA32F", "bounds_high")),
    _CHOICE, (("UINT", "out_key"),), ("PARTS", str(PARTS)),
)  # fmt: skip
PAIR_SUMS = _pass(
    "sums of pairs", "pair_sums", (("R32F", "pairs"),), (), (("FLOAT", "out_sum"),), ("GROUP", str(GROUP))
)
_RADIANCE = (
    _POINT, ("RGBA32F", "candidate_radiance"), ("RGBA32F", "candidate_albedo"), ("RGBA32F", "next_radiance"),
    ("R32UI", "sorted_order"),
)  # fmt: skip
_RADIANCES = (("VEC4", "out_radiance"), ("VEC2", "out_importance"))
ALONE = _pass("radiances of candidates", "choice_radiance", _RADIANCE, _CHOICE, _RADIANCES)
SHARED = _pass(
    "shared radiances of candidates", "choice_radiance", (*_RADIANCE, ("R32F", "pairs"), ("R32F", "pair_sums")),
    _CHOICE, _RADIANCES, ("PAIRS", "1"), ("GROUP", str(GROUP)),
)  # fmt: skip
KEEP = _pass(
    "choice of candidates", "choice_keep", (("R32UI", "sorted_keys"), ("RG32F", "sums_before")),
    (("INT", "candidate_count"), ("INT", "wanted"), ("FLOAT", "most_of_cell"), ("FLOAT", "first_mark")),
    (("VEC2", "out_kept"),), ("FLOOR_SHARE", str(FLOOR)),
)  # fmt: skip
SLOTS = _pass(
    "candidates kept", "choice_slots",
    (("RG32F", "kept_before"), ("RG32F", "kept_list"), ("R32UI", "sorted_order")),
    (("INT", "candidate_count"),), (("VEC4", "out_slot"),),
)  # fmt: skip


NEXT_POINT = ("RGBA32F", "next_point")
ALONE_IN_MEDIA, SHARED_IN_MEDIA = (
    answered(replace(one, textures=(*one.textures, NEXT_POINT), defines=(*one.defines, ("PLACES", "1"))), (MEDIA,))
    for one in (ALONE, SHARED)
)


def room_for(wanted: int) -> int:
    """Places for virtual lights of which about so many are kept."""
    return wanted + 2 * math.ceil(math.sqrt(wanted)) + 4


class Choice:
    """Choosing among the candidates of one sample. Images of the pool, which `release` gives back."""

    def __init__(self, rays: int, count: int, middle: tuple[float, float, float, float]):
        """`count` candidates, `rays` in a row of their images; `middle` of what is seen and, w, how far about it places
        are told apart."""
        self.rays, self.count = rays, count
        self._constants = {"rays": rays, "candidate_count": count, "seen_middle": middle}
        self._size = ordered_lists.size_for(count)
        self._held: list[images.Image] = []

    @property
    def last(self) -> tuple[int, int]:
        """Where, in running sums, that of all stands."""
        return self.count % ordered_lists.COLUMNS, self.count // ordered_lists.COLUMNS

    def _take(self, image_format: str, size: tuple[int, int] | None = None) -> images.Image:
        self._held.append(images.pool.take(*(size or self._size), image_format))
        return self._held[-1]

    def order(self, point: images.Image, normal: images.Image) -> images.Image:
        """Numbers of the candidates side by side in space, R32UI."""
        low, high = self._take("RGBA32F", (PARTS, 1)), self._take("RGBA32F", (PARTS, 1))
        textures = {"candidate_point": point}
        passes.fullscreen(BOUNDS, images.Target((low, high)), textures=textures, constants=self._constants)
        textures |= {"candidate_normal": normal, "bounds_low": low, "bounds_high": high}
        keys = self._take("R32UI")
        passes.fullscreen(KEYS, images.Target((keys,)), textures=textures, constants=self._constants)
        self.keys, self.numbers = ordered_lists.take_sorted(keys)
        self._held += [self.keys, self.numbers]
        return self.numbers

    def radiances(
        self, found: dict[str, images.Image], pairs: images.Image | None, media: MediaService | None = None
    ) -> images.Image:
        """Radiance of each candidate in that order, from the images of those. `pairs`: how densely each of a group
        (row) draws the next surface of each other (column); None: none is shared. `media`: between candidates and
        next surfaces."""
        radiance, self.importance = self._take("RGBA32F"), self._take("RG32F")
        textures = {name: found[name] for _, name in _RADIANCE if name in found} | {"sorted_order": self.numbers}
        program = ALONE_IN_MEDIA if media else ALONE
        if pairs is not None:
            sums = self._take("R32F")
            passes.fullscreen(PAIR_SUMS, images.Target((sums,)), textures={"pairs": pairs})
            textures |= {"pairs": pairs, "pair_sums": sums}
            program = SHARED_IN_MEDIA if media else SHARED
        if media:
            textures |= {"next_point": found["next_point"], **media.bindings}
        target = images.Target((radiance, self.importance))
        passes.fullscreen(program, target, textures=textures, constants=self._constants)
        return radiance

    def keep(self, wanted: int, mark: float) -> tuple[images.Image, images.Image]:
        """Places for about `wanted` candidates that are kept (RGBA32F: place in the order, number, how many it stands
        for, 1 if it is one), and running sums of those kept, whose `last` is how many they are. `mark`: a uniform
        number."""
        before = ordered_lists.take_running_sums(self.importance)
        kept = self._take("RG32F")
        passes.fullscreen(
            KEEP, images.Target((kept,)), textures={"sorted_keys": self.keys, "sums_before": before},
            constants={
                "candidate_count": self.count, "wanted": wanted, "most_of_cell": max(CELL, FEW / wanted),
                "first_mark": mark,
            },
        )  # fmt: skip
        kept_before = ordered_lists.take_running_sums(kept)
        slots = self._take("RGBA32F", (room_for(wanted), 1))
        passes.fullscreen(
            SLOTS, images.Target((slots,)),
            textures={"kept_before": kept_before, "kept_list": kept, "sorted_order": self.numbers},
            constants={"candidate_count": self.count},
        )  # fmt: skip
        self._held += [before, kept_before]
        return slots, kept_before

    def release(self) -> None:
        for image in self._held:
            images.pool.give(image)
        self._held = []


def seen_middle(frame: Frame) -> tuple[float, float, float, float]:
    """For Choice: the middle of the nearer half of what is seen."""
    receivers = frame.receivers
    near = receivers.distance <= receivers.typical_distance
    middle = ((receivers.low + receivers.high) / 2)[near].mean(axis=0)
    return (*map(float, middle), REACH * frame.typical_distance)
