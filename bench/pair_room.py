"""The room of `python -m bench pairs`: a box of 4 x 4 x 3 metres, open in front, where the camera stands.

A softbox under the ceiling lights it, a plain block stands in the middle. A feature is a function that adds itself to
the room, so that two make a pair. One that needs an object puts it on the next free place; one that concerns a lamp
takes the lamp of the room, or the one that another feature has put in its place. What else must hold of Candela's
picture, a feature appends to `Room.checks`.
"""

from __future__ import annotations

import math
from collections.abc import Callable

PLACES = ((-1.0, 0.4, 0.0), (1.0, 0.3, 0.0), (0.1, -0.9, 0.0))  # on the floor, for what features bring
FEATURES: dict[str, Callable[[Room], None]] = {}


class Room:
    """The base scene and what features may ask of it."""

    def __init__(self, stage):
        self.stage, self.scene = stage, stage.scene
        stage.clear()
        self.scene.render.filter_size = 1.5
        self.scene.render.use_motion_blur = False
        self.scene.frame_set(1)
        self.checks: list[Callable[[dict], str]] = []  # of all layers of Candela's file by name: what is wrong, if any
        self.layer = stage.scene.view_layers[0]
        while len(self.layer.lightgroups):
            self.layer.lightgroups.remove(self.layer.lightgroups[0])
        while len(self.layer.aovs):
            self.layer.aovs.remove(self.layer.aovs[0])
        self._taken = 0
        self._has_own_lamp = False
        grey = lambda *color: stage.material("ShaderNodeBsdfDiffuse", Color=(*color, 1))  # noqa: E731
        self.floor = stage.rectangle((-2, -2), (2, 2), material=grey(0.7, 0.7, 0.7))
        self.floor.data.uv_layers.new(name="UVMap")
        white, red, green = grey(0.7, 0.7, 0.7), grey(0.65, 0.1, 0.08), grey(0.12, 0.5, 0.12)
        self.ceiling = stage.rectangle((-2, -2), (2, 2), 3.0, material=white)
        self.back = stage.rectangle((-2, 0), (2, 3), material=white, location=(0, 2, 0), turn=(math.pi / 2, 0, 0))
        for x, material in ((-2, red), (2, green)):
            stage.rectangle((-3, -2), (0, 2), material=material, location=(x, 0, 0), turn=(0, math.pi / 2, 0))
        self.block = self.box(grey(0.6, 0.55, 0.5), (0.0, 0.9, 0.0), 0.45, 1.1)
        self.lamp = stage.light("AREA", (0.3, -0.2, 2.9), size=0.8, energy=80.0)
        self.camera = stage.camera((0.0, -5.6, 1.5), (math.radians(90), 0, 0), angle=0.85)
        stage.world((0.0, 0.0, 0.0), 0.0)

    def place(self) -> tuple[float, float, float]:
        """The next free place on the floor."""
        self._taken += 1
        return PLACES[(self._taken - 1) % len(PLACES)]

    def box(self, material, at, half: float, height: float):
        """A block that stands at a place."""
        x, y, z = half, half, height
        corners = [(i, j, k) for i in (-x, x) for j in (-y, y) for k in (0.002, z)]
        faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
        return self.stage.mesh(corners, faces, material=material, location=at)

    def ball(self, material, at=None, radius: float = 0.45, smooth: bool = True):
        """A ball that lies at a place, smooth-shaded."""
        x, y, z = at or self.place()
        rings, segments = 12, 24
        points = [(0.0, 0.0, -radius)]
        for k in range(1, rings):
            up = math.pi * k / rings - math.pi / 2
            for j in range(segments):
                turn = 2 * math.pi * j / segments
                points.append((radius * math.cos(up) * math.cos(turn), radius * math.cos(up) * math.sin(turn),
                               radius * math.sin(up)))  # fmt: skip
        points.append((0.0, 0.0, radius))
        last = len(points) - 1
        faces = [(0, 1 + (j + 1) % segments, 1 + j) for j in range(segments)]
        for k in range(rings - 2):
            a, b = 1 + k * segments, 1 + (k + 1) * segments
            faces += [(a + j, a + (j + 1) % segments, b + (j + 1) % segments, b + j) for j in range(segments)]
        top = 1 + (rings - 2) * segments
        faces += [(top + j, top + (j + 1) % segments, last) for j in range(segments)]
        made = self.stage.mesh(points, faces, material=material, location=(x, y, z + radius + 0.01))
        made.data.polygons.foreach_set("use_smooth", [smooth] * len(made.data.polygons))
        return made

    def replace_lamp(self, kind: str, location, turn=(0.0, 0.0, 0.0), **settings):
        """A lamp of another kind in the place of the room's; a second one stands beside it."""
        if not self._has_own_lamp:
            self.stage.scene.collection.objects.unlink(self.lamp)
            self._has_own_lamp = True
        self.lamp = self.stage.light(kind, location, turn, **settings)
        return self.lamp

    def world_strength(self, color, strength: float):
        """Light of the world, which falls in from the open front."""
        return self.stage.world(color, strength)

    def volume(self, node: str, **inputs):
        """A material whose volume is this node alone."""
        material = self.stage.material(node, **inputs)
        tree = material.node_tree
        output = next(one for one in tree.nodes if one.type == "OUTPUT_MATERIAL")
        shader = next(one for one in tree.nodes if one is not output)
        tree.links.remove(tree.links[0])
        tree.links.new(shader.outputs[0], output.inputs["Volume"])
        return material


def feature(make: Callable[[Room], None]) -> Callable[[Room], None]:
    FEATURES[make.__name__.replace("_", " ")] = make
    return make
