"""Work lists: one compute pass appends pixels, a second one processes them; their order is undefined.

A pass that has work at a tenth of the pixels leaves most of a GPU's lanes idle; over a list of them all are busy.
Entries are packed into integers by who fills the list; shaders/lib/entry_list.glsl says where they lie. Not on backends
whose shaders cannot count in images (context.counts_in_images).
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from ..gfx import images

RUN = 64  # entries that lie side by side
DEFINES = (("RUN", str(RUN)),)
FILLED = (("entries", "R32UI", "UINT_2D", "WRITE"), ("entry_count", "R32UI", "UINT_2D_ATOMIC", "READ_WRITE"))
READ = (("UINT_2D", "entries"), ("UINT_2D", "entry_count"))  # as textures: images are few


def take(size: tuple[int, int], lists: int = 1) -> dict[str, images.Image]:
    """So many empty lists, one above the other, each with room for as many entries as a picture has pixels: images of
    the pool."""
    entries = images.pool.take(-(-size[0] // RUN) * RUN, size[1] * lists, "R32UI")
    count = images.pool.take(lists, 1, "R32UI")
    count.texture.clear(format="UINT", value=(0,))
    return {"entries": entries, "entry_count": count}


def columns(size: tuple[int, int], share: int) -> int:
    """Threads side by side for a list of a picture's `size`; each takes about `share` entries of a full one."""
    return -(-max(size[0] // share, 1) // RUN) * RUN


@contextmanager
def borrowed(size: tuple[int, int], lists: int = 1) -> Iterator[dict[str, images.Image]]:
    """Lists as `take` has them, whose images the pool gets back at the end."""
    held = take(size, lists)
    try:
        yield held
    finally:
        for image in held.values():
            images.pool.give(image)
