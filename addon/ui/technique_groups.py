"""How the techniques stand in the Render properties: grouped by what an artist wants, not by how it is done.

Each group is a panel with one choice for each of its slots; the parameters of its techniques stand below in a part
Advanced, in the panels of panels.py. What only experts can judge is hidden unless the extension's preferences show it.
"""

from __future__ import annotations

from dataclasses import dataclass

from ..frame.technique import SCENE, Technique
from ..techniques import REGISTRY


@dataclass(frozen=True)
class Group:
    """A panel: `slots` with the name that each choice has there; `techniques` without a slot that belong to it."""

    name: str
    label: str
    slots: tuple[tuple[str, str], ...]
    techniques: tuple[str, ...] = ()


GROUPS = (
    Group(
        "light", "Light and Shadows", (("shadow", "Shadows"), ("environment", "World Light")),
        ("direct_light", "emissive_light", "light_probes"),
    ),
    Group("bounced_light", "Bounced Light", (("indirect", "Technique"),)),
    Group(
        "reflections", "Reflections and Glass", (("reflection", "Reflections"), ("transmission", "Glass")),
        ("shaded_reflections", "edit_heat"),
    ),
    Group("caustics", "Caustics", (("caustics", "Caustics"),)),
    Group("fog", "Fog and Smoke", (("volume", "Fog"),), ("volume_caustics", "media")),
    Group("skin", "Skin and Wax", (("subsurface", "Subsurface"),)),
)  # fmt: skip
OTHERS = Group("others", "Others", ())

# Parameters that trade one error for another, or that only matter to who compares techniques.
EXPERT = {
    "bins", "by", "cells", "centre_test", "contacts", "cutoff", "edge_rays", "extent", "fans", "few_edges",
    "few_points", "groups", "guiding", "important", "interleaved", "levels", "lobe_side", "maps", "mode",
    "most_edges", "near_bounces", "order", "orientations", "prefilter", "refine", "rule", "smooth", "soft_maps",
    "sparse", "taps", "texels_per_pixel", "thickness", "threshold", "union",
}  # fmt: skip


def group_of(technique: Technique) -> Group:
    """The first group that names the technique or one of its slots."""
    for group in GROUPS:
        slots = {slot for slot, _ in group.slots}
        if technique.name in group.techniques or not slots.isdisjoint(technique.fills):
            return group
    return OTHERS


def members(group: Group) -> list[Technique]:
    """Techniques of a group that have parameters of the scene, in the registry's order."""
    return [one for one in REGISTRY if one.params_of(SCENE) and group_of(one) == group]


def is_expert(param) -> bool:
    """Whether a parameter is shown to experts alone."""
    return param.name in EXPERT
