"""The pupil: its mean diameter by the luminance of the field, and its restless small changes (hippus).

    p = 4.9 - 3 tanh(0.4 (log10 L + offset))         mean diameter, mm; L in cd/m2
    h = p + a noise(t / p) (9 / p) sqrt(1 - p / 9)   with hippus; brighter: smaller pupil, larger and faster changes

The offset is 1 in the source; tables of the same curve elsewhere have 0. The source prints no amplitude a; with 1 the
diameter would become negative. 0.1 gives 0.32 mm at 2.4 mm and 0.06 mm at 7 mm.

With age pupils grow smaller: p + (age - 28.58) (0.02132 - 0.009562 p), and as they are at 20 for the young.

After a change of light the pupil goes to its new mean, from `LATENCY` on, as 1 - exp(-t / tau); it closes three times
as fast as it opens (Ellis 1981). `adapting` is that as a closed form of the time.

Sources: Ritschel 2009, equation 8.2 (after Moon and Spencer 1944); age: Watson and Yellott 2012.
"""

from __future__ import annotations

import numpy as np

from .noise import value_noise

LARGEST, SMALLEST = 9.0, 1.5  # mm
AMPLITUDE = 0.1
OFFSET = 1.0
LEAST_LUMINANCE = 1e-3  # cd/m2; what is darker does not open the pupil further
YOUNGEST, REFERENCE_AGE = 20.0, 28.58  # years
LATENCY, CLOSING, OPENING = 0.25, 0.4, 1.2  # seconds; the latter two are time constants
_HIPPUS = 1  # stream of noise


def mean_diameter(luminance, age: float = REFERENCE_AGE, offset: float = OFFSET) -> np.ndarray:
    """Millimetres, for the mean luminance of what is seen in cd/m2."""
    light = np.log10(np.maximum(luminance, LEAST_LUMINANCE)) + offset
    diameter = 4.9 - 3.0 * np.tanh(0.4 * light)
    older = max(age, YOUNGEST) - REFERENCE_AGE
    return np.clip(diameter + older * (0.02132 - 0.009562 * diameter), SMALLEST, LARGEST)


def adapting(seconds: float, before: float, after: float) -> float:
    """Mean diameter in mm so many seconds after light has changed, between those of both."""
    if seconds <= LATENCY:
        return before
    tau = CLOSING if after < before else OPENING
    return after + (before - after) * float(np.exp(-(seconds - LATENCY) / tau))


def diameter_at(seconds, mean: float, seed: int, restlessness: float = 1.0) -> np.ndarray:
    """Millimetres, at a time, around a mean diameter."""
    mean = float(np.clip(mean, SMALLEST, LARGEST))
    amount = restlessness * AMPLITUDE * (LARGEST / mean) * np.sqrt(1.0 - mean / LARGEST)
    return np.clip(mean + amount * value_noise(np.asarray(seconds) / mean, seed, _HIPPUS), SMALLEST, LARGEST)
