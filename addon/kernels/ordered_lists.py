"""Ordered lists in images of COLUMNS entries a row: sorting by key, and prefix sums.

Sorting is by rank: within a row an entry counts the smaller ones, among other rows it finds its place by bisection. It
is stable, so the same on every device. Sums are those of runs of entries, added up one after the other: their order is
fixed, too, and they never fall, rounding included.

| cost of N entries | passes | loads |
|---|---|---|
| sort | 2 | N (COLUMNS + N / COLUMNS log2 COLUMNS): 1.5 million for 4,224 |
| running sums | 2 | N (1 + N / RUN / 2 + RUN / 2): 0.3 million for 4,224 |

For lists of some thousand entries. Longer ones are better off with a radix sort and with sums of sums.
"""

from __future__ import annotations

from ..gfx import images, passes
from ..gfx.library import Program

COLUMNS = 128
RUN = 64
DEFINES = (("LIST_COLUMNS", str(COLUMNS)), ("LIST_RUN", str(RUN)))
SORT_ROWS = Program(
    name="sort rows",
    compute="sort/blocks.comp.glsl",
    textures=(("R32UI", "unsorted"),),
    images=tuple((name, "R32UI", "UINT_2D", "WRITE") for name in ("row_keys", "row_order")),
    defines=DEFINES,
    group=(64, 1, 1),
)
MERGE_ROWS = Program(
    name="merge rows",
    compute="sort/merge.comp.glsl",
    textures=(("R32UI", "row_keys"), ("R32UI", "row_order")),
    images=tuple((name, "R32UI", "UINT_2D", "WRITE") for name in ("sorted_keys", "sorted_order")),
    defines=DEFINES,
    group=(64, 1, 1),
)
SUMS = passes.fullscreen_program(
    "sums of runs", "sort/sums.frag.glsl", textures=(("RG32F", "listed"),), defines=DEFINES,
    outputs=(("VEC2", "out_sum"),),
)  # fmt: skip
RUNNING = passes.fullscreen_program(
    "running sums of a list", "sort/running.frag.glsl", textures=(("RG32F", "listed"), ("RG32F", "run_sums")),
    defines=DEFINES, outputs=(("VEC2", "out_before"),),
)  # fmt: skip


def size_for(count: int) -> tuple[int, int]:
    """Of an image that holds a list of `count` entries and one more."""
    return COLUMNS, count // COLUMNS + 1


def take_sorted(keys: images.Image) -> tuple[images.Image, images.Image]:
    """Keys (R32UI) in ascending order, and where each stood: images of the pool. Equal keys keep their order."""
    rows = {name: images.pool.take(*keys.size, "R32UI") for name in ("row_keys", "row_order")}
    found = {name: images.pool.take(*keys.size, "R32UI") for name in ("sorted_keys", "sorted_order")}
    passes.compute(SORT_ROWS, keys.size, textures={"unsorted": keys}, images=rows)
    passes.compute(MERGE_ROWS, keys.size, textures=rows, images=found)
    for image in rows.values():
        images.pool.give(image)
    return found["sorted_keys"], found["sorted_order"]


def take_running_sums(values: images.Image) -> images.Image:
    """For each entry of a list (RG32F) the sums of those before it: an image of the pool."""
    before = images.pool.take(*values.size, "RG32F")
    with images.borrowed(COLUMNS // RUN, values.height, "RG32F") as runs:
        passes.fullscreen(SUMS, runs, textures={"listed": values})
        textures = {"listed": values, "run_sums": runs.colors[0]}
        passes.fullscreen(RUNNING, images.Target((before,)), textures=textures)
    return before
