"""Runs inside a windowed Blender whose driver has compiled nothing: how long its viewport takes, and how long Blender
does not answer, when Rendered is chosen, and after edits that need programs which are not there yet."""

import sys
import time
from pathlib import Path

import bpy
from mathutils import Vector

sys.path.insert(0, str(Path(__file__).parent))

from stage import ENGINE, FOLDER, candela, library, picture, result, run, viewport_area, viewports, window

SAMPLES = 2
TIMEOUT_S = 400.0  # of one step
UNTIL_LIGHT, AFTER = "until_light", "after="  # as arguments
PAUSE_S = 0.02  # between two looks; more of them would take processors from what is measured


class Watch:
    """Blender's answers since it was made: a timer runs between its own redraws. Of the longest time without one also
    the programs that were compiled in it, or first drawn with, in their order."""

    def __init__(self):
        self.started = self.before = time.monotonic()
        self.began = self.worked = time.process_time()
        self.dearest = 0.0
        self.longest, self.longest_at, self.said = 0.0, "", set()
        self.draws = []  # seconds of Candela's own part of redraws
        self.programs, self.longest_programs = [], []
        self._draw, self._compile, self._bind = candela().draw, library()._compile, library().Shader.bind
        candela().draw, library()._compile = self._timed, self._compiling
        library().Shader.bind = lambda shader, *given, **named: self._binding(shader, *given, **named)

    def _compiling(self, program):
        self.programs.append(program.name)
        return self._compile(program)

    def _binding(self, shader, *given, **named):
        if shader._fresh:
            self.programs.append(f"draws {shader.program.name}")
        return self._bind(shader, *given, **named)

    def _timed(self, *arguments):
        before = time.perf_counter()
        try:
            self._draw(*arguments)
        finally:
            self.draws.append(time.perf_counter() - before)

    def look(self):
        now, worked = time.monotonic(), time.process_time()
        self.dearest, self.worked = max(self.dearest, worked - self.worked), worked
        if now - self.before > self.longest:
            self.longest, self.longest_at = now - self.before, viewports()[0].status() if viewports() else ""
            self.longest_programs = self.programs
        self.before, self.programs = now, []
        if viewports():
            self.said.add(viewports()[0].status().split(" (")[0].split(",")[0])

    @property
    def seconds(self):
        return time.monotonic() - self.started

    @property
    def work(self):
        """Seconds of the processor."""
        return time.process_time() - self.began

    def end(self):
        candela().draw, library()._compile, library().Shader.bind = self._draw, self._compile, self._bind
        return {
            "longest_s": self.longest, "dearest_s": self.dearest, "longest_at": self.longest_at,
            "longest_programs": self.longest_programs,
            "longest_draw_s": max(self.draws, default=0.0),
            "redraws": len(self.draws), "said": sorted(self.said),
        }  # fmt: skip


def until_rest(name, change, until_light=False):
    """Make a change, and wait until the viewport rests, or shows all light; what is noted stands in the result under
    the name."""
    watch = Watch()
    watched = viewports()[0] if viewports() else None
    old = watched.frame if watched else None
    change()
    watch.look()
    first = lit = whole = None
    work = {}
    while watch.seconds < TIMEOUT_S:
        yield PAUSE_S
        watch.look()
        if not viewports():
            continue
        one = viewports()[0]
        if one.error:
            raise RuntimeError(one.error)
        if first is None and one.picture is not None:
            first, work["first_work_s"] = watch.seconds, watch.work
        looks, direct = getattr(one, "looks", False), getattr(one, "direct", False)  # which older versions lack
        anew = one.frame is not None and one.frame is not old and one.frame.samples_done > 0
        if lit is None and anew and one.picture is not None and not looks:
            lit, work["lit_work_s"] = watch.seconds, watch.work
            picture(f"{name}_lit.png")
            watch.before, watch.worked = (
                time.monotonic(),
                time.process_time(),
            )  # the picture of the window takes its time
        if whole is None and lit is not None and anew and not direct and not looks:
            whole = watch.seconds  # with its indirect light
        if (lit is not None and one.done and not one.dirty) or (whole is not None and until_light):
            break
    result[name] = {
        "first_s": first,
        "lit_s": lit,
        "whole_s": whole,
        "rest_s": watch.seconds,
        "rest_work_s": watch.work,
    }
    result[name] |= {**work, **watch.end()}
    picture(f"{name}.png")
    yield 0.2


def steps():
    scene, space = window().scene, viewport_area().spaces.active
    scene.render.engine = ENGINE
    scene.candela.viewport_samples = SAMPLES
    space.overlay.show_overlays = space.show_gizmo = False
    space.region_3d.view_perspective = "CAMERA"
    given = sys.argv[sys.argv.index("--") + 1 : -1]
    yield next((float(one.removeprefix(AFTER)) for one in given if one.startswith(AFTER)), 1.0)

    def choose():
        space.shading.type = "RENDERED"

    def add_lamp():
        lamp = bpy.data.lights.new("New spot", "SPOT")
        lamp.energy, lamp.spot_size = 200.0, 1.0
        placed = bpy.data.objects.new("New spot", lamp)
        placed.matrix_world = scene.camera.matrix_world @ placed.matrix_world.Translation(Vector((0.3, 0.3, 0.0)))
        scene.collection.objects.link(placed)

    def add_material():
        material = bpy.data.materials.new("New glass")
        if not material.use_nodes:
            material.use_nodes = True
        tree = material.node_tree
        tree.nodes.clear()
        glass, output = tree.nodes.new("ShaderNodeBsdfGlass"), tree.nodes.new("ShaderNodeOutputMaterial")
        tree.links.new(glass.outputs[0], output.inputs["Surface"])
        shown = next(one for one in scene.objects if one.type == "MESH" and one.visible_get() and one.material_slots)
        shown.material_slots[0].material = material

    def border():
        scene.render.use_border = True
        scene.render.border_min_x = scene.render.border_min_y = 0.25
        scene.render.border_max_x = scene.render.border_max_y = 0.75

    changes = {"rendered": choose, "lamp": add_lamp, "material": add_material, "border": border}
    for name in [one for one in given if one in changes] or changes:
        yield from until_rest(name, changes[name], UNTIL_LIGHT in given)
    result["folder"] = str(FOLDER)


run(steps)
