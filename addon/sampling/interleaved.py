"""Pictures that are added up, as those of light groups, each drawn in one pixel of several in each sample.

All light of a picture costs G times as much where each of G groups has a picture of its own. If each draws one pixel of
n in a sample, with n times the weight, they cost n-ths of that, and their sum has the noise of one picture: that of G
groups which know nothing of each other, each with the n-th part of the places. In a block of n samples each pixel has
one; its place in the block moves on with the sum of the digits, base n, of the block's number: the last bits of a
sample's number say in which part of the first dimension it lies (sequence.py), and each pixel has all parts. Groups
begin at different pixels, so that their sum has about as much of each sample everywhere.
"""

from __future__ import annotations

from dataclasses import dataclass

FEWEST = 4  # samples of each pixel: two in each half, which techniques/denoise.py compares
MOST = 16  # pixels, one of which is drawn
# By the number of pixels, which one after the other: those side by side are drawn far apart in time.
_ORDERS = {
    2: (2, 1, ((0, 0), (1, 0))),
    4: (2, 2, ((0, 0), (1, 1), (1, 0), (0, 1))),
    8: (4, 2, ((0, 0), (2, 1), (2, 0), (0, 1), (1, 0), (3, 1), (3, 0), (1, 1))),
    16: (
        4, 4,
        ((0, 0), (2, 2), (2, 0), (0, 2), (1, 1), (3, 3), (3, 1), (1, 3),
         (1, 0), (3, 2), (3, 0), (1, 2), (0, 1), (2, 3), (2, 1), (0, 3)),
    ),
}  # fmt: skip


@dataclass(frozen=True)
class Interleaving:
    """One pixel of `count`, of rectangles of `columns` by `rows`, is drawn in a sample."""

    columns: int
    rows: int
    places: tuple[tuple[int, int], ...]
    first: int  # group, whose pixels come so much later

    @property
    def count(self) -> int:
        """Of pixels, and the weight of that which is drawn."""
        return len(self.places)

    def place(self, sample: int) -> tuple[int, int]:
        """Column and row, within its rectangle, of the pixel that is drawn in a sample."""
        block, turn = divmod(sample, self.count)
        while block:
            block, digit = divmod(block, self.count)
            turn -= digit
        return self.places[(turn + self.first) % self.count]

    def visit(self, sample: int) -> int:
        """How often a pixel that is drawn in this sample was drawn before it."""
        return sample // self.count

    def size(self, width: int, height: int) -> tuple[int, int]:
        """Of an image that holds one pixel of each rectangle."""
        return -(-width // self.columns), -(-height // self.rows)


def interleaving(groups: int, samples: int, first: int = 0) -> Interleaving | None:
    """Of pictures of `groups` that are added up, of so many samples; None where all pixels are drawn in each: for a
    single one, and where each pixel would not have FEWEST samples, as many in each half."""
    count = min(1 << max(groups - 1, 0).bit_length(), MOST)
    while count > 1 and (samples < FEWEST * count or samples % (2 * count)):
        count //= 2
    return Interleaving(*_ORDERS[count], first) if count > 1 else None
