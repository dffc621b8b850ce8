"""Noise threshold: when a picture's own samples say that its error is as small as was asked.

The mean M of all samples is read at 4, 8, 16, … samples. What it changed by since it was read last tells its error, as
far as the errors of a mean and of what is added to it have nothing in common:

    D_n = rms over pixels of  (M_n - M_(n/2)) / luminance              error ~ n^-a,  2^a = D_(n/2) / D_n
    error_n = D_n / sqrt(4^a - 1),    a in 0.4 … 1

For independent samples (a = 1/2) that is the comparison of two halves by which Denoise knows noise; light that all
pixels take from one low-discrepancy sequence has errors that fall up to twice as fast, of which halves alone would say
too much. The number of samples at which the error will be the one asked for follows by the same power. As everywhere
here a tenth of the mean luminance is added to dark pixels' own, and the worst of a thousand pixels are left out.

| cost | |
|---|---|
| passes | the picture is resolved and read at each power of two: ten times in a thousand samples |
| memory | one picture on the CPU |

Bias: what all samples have wrong (light that a technique leaves out) is no noise. The picture is judged before Denoise,
which leaves less.
"""

from __future__ import annotations

import numpy as np

from ..frame.picture import Frame
from ..gfx import images
from .resolve import resolve

FEWEST = 4  # samples of the first look
LEAST_POWER, MOST_POWER = 0.4, 1.0
DARK = 0.1  # of the mean luminance, below which errors count as absolute
WORST = 0.001  # share of pixels that is left out
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])


class NoiseMeter:
    """Looks at a picture in the making. `enough` samples reach the error that was asked for; None: not yet known."""

    def __init__(self, asked: float):
        self.asked = asked
        self.error: float | None = None  # relative, as estimated by the last look
        self.enough: int | None = None
        self._mean: np.ndarray | None = None
        self._change: float | None = None

    def look(self, frame: Frame) -> bool:
        """Whether the samples so far are enough. Reads the picture at powers of two."""
        done = frame.samples_done
        if done >= FEWEST and done & (done - 1) == 0 and (self.enough is None or done < self.enough):
            self.learn(done, images.read(resolve(frame))[..., :3])
        return self.enough is not None and done >= self.enough

    def learn(self, done: int, mean: np.ndarray) -> None:
        """Take the mean of the first `done` samples, (H, W, 3); twice as many as before."""
        before, self._mean = self._mean, mean.astype(np.float64)
        if before is None:
            return
        change, last = relative_change(self._mean, before), self._change
        self._change = change
        if last is None:
            power = 0.5
        elif change <= 0.0:
            power = MOST_POWER
        else:
            power = float(np.clip(np.log2(max(last, 1e-30) / change), LEAST_POWER, MOST_POWER))
        self.error = change / np.sqrt(4.0**power - 1.0)
        if self.error <= self.asked:
            self.enough = done
        elif last is not None:
            wanted = done * (self.error / self.asked) ** (1.0 / power)
            self.enough = int(np.ceil(wanted)) if wanted < 2 * done else None


def relative_change(now: np.ndarray, before: np.ndarray) -> float:
    """Root mean square of what a picture has changed by, by its luminance; 0 of one that is black. Values that are not
    finite count as 0, as in the finished picture: one alone would make every figure here NaN."""
    now, before = (np.nan_to_num(one, nan=0.0, posinf=0.0, neginf=0.0) for one in (now, before))
    luminance = now @ LUMINANCE
    dark = DARK * abs(float(luminance.mean()))
    if not dark > 0.0:
        return 0.0
    squared = ((now - before) ** 2).mean(axis=-1) / (luminance**2 + dark**2)
    kept = max(squared.size - int(np.ceil(squared.size * WORST)), 1)  # of a single pixel it is the pixel
    return float(np.sqrt(np.partition(squared.ravel(), kept - 1)[:kept].mean()))
