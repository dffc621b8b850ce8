"""Pictures that are added up, as those of light groups, each drawn in one pixel of several in each sample.

All light of a picture costs G times as much where each of G groups has a picture of its own. If each draws one pixel of
n in a sample, with n times the weight, they cost n-ths of that, and their sum has the noise of one picture: that of G
groups which know nothing of each other, each with the n-th part of the places. In a block of n samples each pixel has
one; its place in the block moves on with the sum of the digits, base n, of the block's number: the last bits of a
sample's number say in which part of the first dimension it lies (sequence.py), and each pixel has all parts. Groups
begin at different pixels, so that their sum has about as much of each sample everywhere.

Each half of a picture's samples is interleaved as far as it has whole blocks; what it has beyond, at the middle of the
picture, is drawn in all pixels: denoising compares the halves (techniques/denoise.py).
"""

from __future__ import annotations

from dataclasses import dataclass

FEWEST = 4  # samples of each pixel: two in each half
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
    """One pixel of `count`, of rectangles of `columns` by `rows`, is drawn in a sample that is a `part`."""

    columns: int
    rows: int
    places: tuple[tuple[int, int], ...]
    first: int  # group, whose pixels come so much later
    samples: int  # of the picture

    @property
    def count(self) -> int:
        """Of pixels, and the weight of that which is drawn."""
        return len(self.places)

    @property
    def visits(self) -> int:
        """In how many such samples each pixel is drawn."""
        return 2 * (self.samples // 2 // self.count)

    def is_part(self, sample: int) -> bool:
        """Whether one pixel of each rectangle is drawn in a sample; else all are."""
        each = self.visits // 2 * self.count
        return sample < each or sample >= self.samples - each

    def place(self, sample: int) -> tuple[int, int]:
        """Column and row, within its rectangle, of the pixel that is drawn in a sample."""
        block, turn = divmod(self._number(sample), self.count)
        while block:
            block, digit = divmod(block, self.count)
            turn -= digit
        return self.places[(turn + self.first) % self.count]

    def visit(self, sample: int) -> int:
        """How often a pixel that is drawn in this sample was drawn before it."""
        return self._number(sample) // self.count

    def _number(self, sample: int) -> int:
        """Of a sample among those of which a part is drawn."""
        whole = self.samples - self.visits * self.count
        return sample - whole if 2 * sample >= self.samples else sample

    def size(self, width: int, height: int) -> tuple[int, int]:
        """Of an image that holds one pixel of each rectangle."""
        return -(-width // self.columns), -(-height // self.rows)


def interleaving(groups: int, samples: int, first: int = 0) -> Interleaving | None:
    """Of pictures of `groups` that are added up, of so many samples; None where all pixels are drawn in each: for a
    single one, and where each pixel would not have FEWEST samples."""
    count = min(1 << max(groups - 1, 0).bit_length(), MOST)
    while count > 1 and samples // 2 < FEWEST // 2 * count:
        count //= 2
    return Interleaving(*_ORDERS[count], first, samples) if count > 1 else None
