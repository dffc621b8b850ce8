"""Presets of observers: values of `Eye` and of the diffraction (`defocus`) by name."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class Preset:
    """One observer; what it does not name is as by default."""

    label: str
    description: str
    values: dict[str, float] = field(default_factory=dict)


PRESETS = {
    "YOUNG": Preset(
        "Young Eye", "Clear lens, wide and lively pupil: fine needles, a coloured ring in the dark",
        {"age": 20.0, "scatter": 0.08, "restlessness": 1.0, "tremor": 1.2, "defocus": 0.1},
    ),
    "OLD": Preset(
        "Old Eye", "A clouded lens behind a small pupil: much veil, few colours",
        {"age": 75.0, "scatter": 0.12, "restlessness": 0.6, "tremor": 0.3, "movement": 1.5, "defocus": 0.4,
         "fibres": 0.15},
    ),
    "SQUINT": Preset(
        "Squint", "Lids half closed against the light: lashes draw broad coloured streaks",
        {"squint": 0.75, "lashes": 1.0},
    ),
    "CAMERA": Preset(
        "Camera", "A clean lens at rest: the rings of a round opening and a little dust, no fibres, no lashes",
        {"pupil": 4.0, "restlessness": 0.0, "tremor": 0.0, "movement": 0.0, "scatter": 0.03, "fibres": 0.0,
         "lashes": 0.0, "defocus": 0.0},
    ),
}  # fmt: skip
