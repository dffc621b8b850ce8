"""The light paths of a picture: one row for each, from which film, passes, panels and comparison derive theirs.

Radiance is split as Cycles splits its render passes, so that each path is compared with Cycles' own. Techniques add
the light of a path to the image `radiance.NAME`. Which paths a picture holds apart is asked of its frame
(Held.is_apart): those that its passes show or a technique looks at. The sum of all others is the image TOGETHER.

Some techniques take over a kind of *transport* as a whole (Technique.owns), whatever path it ends in: light that
mirrors and glass focus on surfaces, light in media, light below surfaces. What else would bring such light asks
`frame.plan.owns(kind)` and leaves it out, so that nothing is counted twice.
"""

from __future__ import annotations

from dataclasses import dataclass

TOGETHER = "radiance.together"  # the image of all paths that nobody looks at apart (film/together.py)
SURFACE, MEDIUM, SEEN = "surface", "medium", "seen"
DIRECT, INDIRECT = "direct", "indirect"


@dataclass(frozen=True)
class LightPath:
    """One path of light to the camera.

    `origin` says how film points have it (film/points.py): SURFACE light is carried over by the surfaces' colours,
    MEDIUM light is the pixel's own, and what is SEEN is collected anew at each point.
    """

    name: str  # of its image radiance.NAME, and in comparisons
    label: str  # of Blender's pass, since 5.0
    before_5: str  # of Blender's pass in 4.x
    switch: str  # property of the view layer that asks for the pass; "cycles.x" is property x of its Cycles settings
    origin: str
    order: str = DIRECT
    lobe: str = ""  # whose colour pass the light is divided by, as color.LOBE
    by_need: bool = False  # its image is made where a technique of the plan adds such light

    @property
    def image(self) -> str:
        """Name of the frame's image that sums it up."""
        return f"radiance.{self.name}"

    @property
    def color(self) -> str:
        """Name of the image of the colour that its pass is divided by; empty for none."""
        return f"color.{self.lobe}" if self.lobe else ""

    @property
    def description(self) -> str:
        """In words."""
        return f"{self.label}: light of this path, with the surfaces' colours"


LIGHT_PATHS = (
    LightPath("diffuse_direct", "Diffuse Direct", "DiffDir", "use_pass_diffuse_direct", SURFACE, DIRECT, "diffuse"),
    LightPath("glossy_direct", "Glossy Direct", "GlossDir", "use_pass_glossy_direct", SURFACE, DIRECT, "glossy"),
    LightPath(
        "transmission_direct", "Transmission Direct", "TransDir", "use_pass_transmission_direct",
        SURFACE, DIRECT, "transmission", by_need=True,
    ),
    LightPath(
        "diffuse_indirect", "Diffuse Indirect", "DiffInd", "use_pass_diffuse_indirect", SURFACE, INDIRECT, "diffuse",
    ),
    LightPath(
        "glossy_indirect", "Glossy Indirect", "GlossInd", "use_pass_glossy_indirect", SURFACE, INDIRECT, "glossy",
    ),
    LightPath(
        "transmission_indirect", "Transmission Indirect", "TransInd", "use_pass_transmission_indirect",
        SURFACE, INDIRECT, "transmission", by_need=True,
    ),
    LightPath("volume_direct", "Volume Direct", "VolumeDir", "cycles.use_pass_volume_direct", MEDIUM, by_need=True),
    LightPath(
        "volume_indirect", "Volume Indirect", "VolumeInd", "cycles.use_pass_volume_indirect", MEDIUM, INDIRECT,
        by_need=True,
    ),
    LightPath("emission", "Emission", "Emit", "use_pass_emit", SEEN),
    LightPath("environment", "Environment", "Env", "use_pass_environment", SEEN),
)  # fmt: skip


def surface_path(lobe: str, order: str) -> str:
    """Name of the first path of that lobe and order, by which others of it are carried over (film/points.py)."""
    return next(path.name for path in LIGHT_PATHS if (path.origin, path.lobe, path.order) == (SURFACE, lobe, order))


def named(origin: str) -> tuple[str, ...]:
    """Names of the paths of an origin, in the table's order."""
    return tuple(path.name for path in LIGHT_PATHS if path.origin == origin)


# Kinds of transport that a technique may own, each in words for the ledger.
LIGHT_SPECULAR_DIFFUSE = "light-specular-diffuse"
LIGHT_SPECULAR_MEDIUM = "light-specular-medium"
IN_MEDIA = "medium"
SUBSURFACE = "subsurface"
TRANSPORTS = {
    LIGHT_SPECULAR_DIFFUSE: "light that mirrors and glass focus on surfaces",
    LIGHT_SPECULAR_MEDIUM: "light that mirrors and glass focus in media",
    IN_MEDIA: "light that media scatter and absorb",
    SUBSURFACE: "light that is scattered below surfaces",
}
