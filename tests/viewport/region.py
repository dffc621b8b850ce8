"""A viewport without a window, as Blender's 3D region would drive it, and clocks that tests turn."""

from dataclasses import replace

import bpy

from addon import viewport
from addon.gfx import images
from addon.snapshot import camera_of_scene, take
from addon.ui.properties import settings_of

SIZE = (96, 64)


class Clock:
    """Time that only passes when it is told to, plus a little with each look."""

    def __init__(self, tick=0.0):
        self.now, self.tick = 100.0, tick

    def __call__(self):
        self.now += self.tick
        return self.now


class Region:
    """A viewport over the scene of the test, as Blender's 3D region would ask for it."""

    def __init__(self, samples=4):
        self.viewport = viewport.Viewport()
        self.clock = Clock()
        self.reads = 0
        bpy.context.scene.candela.viewport_samples = samples
        self.camera = camera_of_scene(bpy.context.scene, self.depsgraph, *SIZE)

    @property
    def depsgraph(self):
        graph = bpy.context.evaluated_depsgraph_get()
        graph.update()
        return graph

    def source(self, camera, width, height):
        self.reads += 1
        return take(self.depsgraph, self.viewport.cache, width, height, view=camera)

    def draw(self, camera=None, size=SIZE):
        settings = settings_of(bpy.context.scene, viewport=True)
        return self.viewport.draw_frame(self.source, camera or self.camera, size, settings, self.clock)

    def rest(self):
        """Redraw until nothing is left to be done; the picture's pixels, (H, W, 4)."""
        self.draw()
        self.clock.now += 2 * viewport.REST_S
        for _ in range(100):
            picture = self.draw()
            if self.viewport.done:
                return images.read(picture)
        raise AssertionError("the viewport never comes to rest")

    def moved(self, distance):
        matrix = self.camera.matrix.copy()
        matrix[0, 3] += distance
        return replace(self.camera, matrix=matrix)
