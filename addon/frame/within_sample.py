"""How much of a sample is done while it is drawn, about: by what techniques take in usual scenes, and by the rows of
the pass that is drawn."""

from __future__ import annotations

from .picture import Frame

# What techniques take of a sample, about, in five sample scenes at 256x192 (`python -m bench left` shows what is told).
USUAL_WORK = {
    "instant_radiosity": 6.0, "multires_radiosity": 6.0, "micro_rendering": 6.0, "screen_space_photons": 3.0,
    "environment_light": 1.5, "shaded_reflections": 1.5, "direct_light": 1.2, "airlight": 3.0, "traced_refraction": 1.5,
    "image_space_subsurface": 1.5, "emissive_light": 1.0, "surfaces": 0.3,
}  # fmt: skip
LITTLE_WORK = 0.1
# What a later sample takes of that in the first, which finds what all of them use, about, in the same scenes.
LATER = {
    "light_probes": 0.0, "surfaces": 0.4, "shaded_reflections": 0.4, "environment_light": 0.6,
    "instant_radiosity": 0.75,
}  # fmt: skip
USUALLY_LATER = 0.85


class WithinSample:
    """The part of a frame's sample that is done; never less than it was."""

    def __init__(self, frame: Frame):
        self._frame = frame
        weights = [USUAL_WORK.get(technique.name, LITTLE_WORK) for technique in frame.plan.techniques]
        labels = [technique.label for technique in frame.plan.techniques]
        self._work = {label: (sum(weights[:k]), weights[k]) for k, label in enumerate(labels)}
        self._later = {technique.label: LATER.get(technique.name, USUALLY_LATER) for technique in frame.plan.techniques}
        self._whole = sum(weights)
        self._number, self._part = frame.samples_done, 0.0

    def look(self) -> None:
        """Take note of what is being drawn."""
        frame = self._frame
        before, own = self._work.get(frame.at, (0.0, 0.0))
        rows = frame.shared_out.part if frame.shared_out is not None else 0.0
        part = (before + own * rows) / self._whole
        self._part = max(part, self._part if self._number == frame.samples_done else 0.0)
        self._number = frame.samples_done

    def later(self, technique: str) -> float:
        """What a technique, by its label, takes of a later sample, as a share of what it takes of the first."""
        return self._later.get(technique, USUALLY_LATER)

    @property
    def done(self) -> float:
        """Samples that are done, with the part of the one that is drawn."""
        return self._frame.samples_done + self._part * (self._frame.samples_done == self._number)
