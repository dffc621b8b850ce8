"""Runs inside a windowed Blender: the pass tree as an artist makes, runs and compares it, and pictures of it."""

import sys
import time
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).parent))

from stage import ENGINE, main_region, picture, result, run, there, viewport_area, viewports, wait_for_rest, window

TREE = "CandelaPassTree"
JOB_TIMEOUT_S = 300
jobs = sys.modules[next(name for name in sys.modules if name.endswith("candela.addon.ui.jobs"))]
pass_tree = sys.modules[next(name for name in sys.modules if name.endswith("candela.addon.ui.pass_tree"))]


def steps():
    scene = window().scene
    scene.render.engine = ENGINE
    scene.candela.viewport_samples = 4
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 320, 180, 100
    bpy.context.preferences.system.use_region_overlap = False  # the sidebar stands beside the nodes
    area = viewport_area()
    with there(area):
        bpy.ops.screen.area_split(direction="HORIZONTAL", factor=0.6)
    yield 0.5
    upper, lower = sorted((one for one in window().screen.areas if one.type == "VIEW_3D"), key=lambda one: -one.height)[
        :2
    ]
    upper.type = "NODE_EDITOR"
    upper.ui_type = TREE
    lower.type = "IMAGE_EDITOR"
    yield 0.5
    with there(upper):
        result["from_auto"] = list(bpy.ops.candela.passes_from_auto())
    result["used_unasked"] = scene.candela.pass_tree is not None
    tree = scene.candela.pass_tree = upper.spaces.active.node_tree
    tree.samples, tree.percentage, tree.reference_samples = 4, 100, 16
    upper.spaces.active.show_region_ui = True
    yield 0.3
    sidebar = next(region for region in upper.regions if region.type == "UI")
    sidebar.active_panel_category = "Candela"
    yield 0.5
    yield from job("run", upper, bpy.ops.candela.passes_run)
    frame_all(upper)
    yield 1.0
    picture("passes_run.png")
    result["times"] = {one.name: pass_tree.result(one).milliseconds for one in tree.nodes if pass_tree.result(one)}
    yield from job("compare", upper, bpy.ops.candela.passes_compare)
    frame_all(upper)
    yield 1.0
    picture("passes_compared.png")
    for node in tree.nodes:
        node.select = node.technique in ("direct_light", "environment_light")
    frame(upper, bpy.ops.node.view_selected)
    yield 1.0
    picture("passes_nodes.png")
    frame_all(upper)
    result["errors"] = [line for one in tree.nodes if pass_tree.result(one) for line in pass_tree.result(one).errors]
    film = next(one for one in tree.nodes if one.technique == "film")
    surfaces = next(one for one in tree.nodes if one.technique == "surfaces")
    reader = next(link.to_node for link in tree.links if link.from_node == surfaces and link.to_node != film)
    with there(upper):
        bpy.ops.ed.undo_push(message="compared")
    tree.links.new(reader.inputs["Surface"], film.outputs["Depth"])
    yield 1.0
    picture("passes_wrong_link.png")
    with there(upper):
        bpy.ops.ed.undo_push(message="wrong link")
        bpy.ops.ed.undo()
    yield 0.5
    tree = window().scene.candela.pass_tree
    result["links_fine_after_undo"] = all(link.is_valid for link in tree.links)
    window().scene.candela.bounces = 0  # one sample of indirect light takes seconds without a GPU
    lower.type = "VIEW_3D"
    lower.spaces.active.shading.type = "RENDERED"
    yield 0.5
    yield from wait_for_rest()
    result["viewport"] = viewports()[0].status()
    yield from changes_by_a_script(window().scene)
    yield from undo_while_it_runs(upper)


def changes_by_a_script(scene):
    """Each is drawn, without anything else that happens in the window."""
    scene.candela.seed = 3
    yield 0.5
    yield from wait_for_rest()
    result["seed_drawn"] = viewports()[0].frame.settings.seed
    glossy = next(one for one in scene.candela.pass_tree.nodes if one.technique == "traced_glossy")
    glossy.mute = True
    yield 0.5
    yield from wait_for_rest()
    result["muted_drawn"] = "traced_glossy" in viewports()[0].frame.settings.passes


def undo_while_it_runs(area):
    scene = window().scene
    with there(area):
        scene.objects["Knot"].location.x += 1.0
        bpy.ops.ed.undo_push(message="moved")
        bpy.ops.candela.passes_run("INVOKE_DEFAULT")
    while jobs.Job.running is not None and jobs.Job.progress[0] == 0.0:
        yield 0.05
    result["running_before_undo"] = jobs.Job.running is not None
    with there(area):
        bpy.ops.ed.undo()
    yield 0.5
    result["running_after_undo"] = jobs.Job.running is not None


def job(name, area, operator):
    """Start the operator as its button does and wait for its end; yields."""
    started = time.monotonic()
    with there(area):
        result[name] = list(operator("INVOKE_DEFAULT"))
    while jobs.Job.running is not None:
        if time.monotonic() - started > JOB_TIMEOUT_S:
            raise TimeoutError(f"{name} does not end")
        yield 0.1
    result[f"{name}_s"] = time.monotonic() - started


def frame_all(area):
    frame(area, bpy.ops.node.view_all)


def frame(area, operator):
    with bpy.context.temp_override(window=window(), area=area, region=main_region(area)):
        operator()


run(steps)
