"""Relief: displacement drawn in the image, on meshes too coarse to carry it (addon/scene/displacement.py has the rest).

A material whose displacement is a height is drawn as a shell of prisms over its mesh. Each fragment follows its ray
through its prism: a linear search finds the first interval in which the ray crosses the heights, then false position
shrinks it (Risser, Shah & Pattanaik 2007: interval mapping; here with Illinois' halving). Heights are the material's
own tree, evaluated where the ray is, so that images and procedurals, any UV map and any attribute do. What is found is
a point of the surface: it has a place, a depth, a slope and the attributes of where it stands, in the camera's picture,
in views of lights and in depth maps, so relief shadows itself and others, stands in front of or behind other geometry,
and has its own outline. Where the whole of it is less than a pixel high it fades into the bumped surface.

| cost | per fragment of the shell |
|---|---|
| heights evaluated | a step for each two pixels on the mesh, 8 to `steps`, + `refinements` + 3 for the slope |
| heights, safe | up to 8 times the steps, each as long as the steepest slope allows |
| fetches beside those of heights | 6 + 3 per attribute |
| draws | 8 triangles for each of the mesh; early depth tests are lost |
| bytes | 240 for a triangle's prism, 96 and 48 an attribute in its list |

Bias: what is thinner than a step may be missed (`safe` does not, where the steepest slope was found). Rays meet the
mesh at the lowest level of the relief; where they are shaded (mirrors, glass, points that send light on) the relief is
looked for from there (shaders/hits/relief.glsl), where they only ask what is hidden it is flat. Soft shadows that need
opaque meshes treat it as alpha.

Fails: heights above an edge of a mesh that is not smooth part from those of the next face; overhangs need a mesh.
"""

from __future__ import annotations

from dataclasses import dataclass

from ..frame.picture import Frame
from ..frame.settings import Settings
from ..frame.technique import MATERIAL, Param, Service, Technique
from ..scene import displacement
from ..snapshot.scene import Snapshot

MODES = (
    (displacement.AUTO, "Auto", 0, "As the material's Displacement setting says; on coarse meshes by relief"),
    (displacement.RELIEF, "Relief", 1, "Rays search the surface within a shell around the mesh"),
    (displacement.MESH, "Mesh", 2, "The mesh's vertices are moved"),
    (displacement.BUMP, "Bump", 3, "Only shading changes"),
)
SEARCHES = (
    (displacement.FALSE_POSITION, "False Position", 0, "By the slope between two steps: few refinements are enough"),
    (displacement.INTERVAL, "Interval Mapping", 1, "By where the ray and the slope meet, again and again"),
    (displacement.BISECTION, "Bisection", 2, "In the middle of each step: slow and sure"),
)
DEFAULTS = displacement.DEFAULTS


@dataclass(frozen=True)
class Shells(Service):
    """Which materials of the frame are drawn by a shell, and how many triangles those have."""

    name = "shells"
    materials: frozenset[int]
    triangles: int


class Relief(Technique):
    name = displacement.OWNER
    label = "Relief"
    provides = (Shells,)
    params = (
        Param(
            "mode", "Displacement", DEFAULTS["mode"],
            "How displacement is drawn; Auto: as the material's Cycles setting says, with relief on coarse meshes",
            items=MODES, scope=MATERIAL,
        ),
        Param(
            "search", "Search", DEFAULTS["search"],
            "Root-finding method that refines where a ray meets the surface",
            items=SEARCHES, scope=MATERIAL,
        ),
        Param(
            "steps", "Steps", DEFAULTS["steps"],
            "Maximum number of steps of a ray through one prism of the shell",
            3, 512, scope=MATERIAL,
        ),
        Param(
            "refinements", "Refinements", DEFAULTS["refinements"],
            "Root-finding steps after a ray has crossed the surface",
            1, 16, scope=MATERIAL,
        ),
        Param(
            "safe", "Thin Features", DEFAULTS["safe"],
            "Shorten steps to what the steepest slope needs, so that thin features are not missed; slower",
            scope=MATERIAL,
        ),
    )  # fmt: skip

    def skip(self, snapshot: Snapshot, settings: Settings) -> str | None:
        shown = snapshot.used_materials
        modes = {displacement.mode_of(snapshot.materials[index]) for index in shown}
        if modes & {displacement.AUTO, displacement.RELIEF}:
            return None
        if displacement.MESH in modes:
            return "what materials displace is moved in their meshes"
        return "no material displaces its surface"

    def begin(self, frame: Frame) -> None:
        drawn = [draw for draw in frame.geometry.draws if frame.materials.in_shell(draw.material)]
        shells = Shells(frozenset(draw.material for draw in drawn), sum(draw.triangles for draw in drawn))
        frame.provide(shells)
        frame.count(self, "shell triangles", shells.triangles)
