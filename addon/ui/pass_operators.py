"""What can be done with a pass tree: make it of what Auto planned, run it, compare it with Cycles, keep a picture.

All work in background mode too, on the tree that is named; in the node editor on the one that is shown.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import bpy

from ..compare import metrics
from ..compare.beside import reference_steps
from ..frame import pass_graph
from ..frame.ledger import RAN, SKIPPED
from ..frame.plan import PlanError, make_plan
from ..snapshot import SnapshotCache, UnsupportedScene, take
from ..techniques import REGISTRY, make_registry
from . import ENGINE, shown_images, shown_otherwise
from .jobs import Job, draw_progress, layer_named, part
from .pass_nodes import pictures_of
from .pass_run import Rendered, reference_images, render_steps
from .pass_tree import TREE, Result, checked, fill, forget_results, graph_of, result, set_result
from .properties import settings_of


def tree_of(context, name: str):
    """The tree that is meant: by name, else the one in the node editor, else the scene's. ValueError if none is."""
    if name:
        tree = bpy.data.node_groups.get(name)
        if tree is None or tree.bl_idname != TREE:
            raise ValueError(f"There is no pass tree '{name}'.")
        return tree
    space = context.space_data
    tree = space.edit_tree if space is not None and space.type == "NODE_EDITOR" else None
    tree = tree if tree is not None and tree.bl_idname == TREE else context.scene.candela.pass_tree
    if tree is None:
        raise ValueError("No pass tree is open: choose New from Auto first.")
    return tree


def run_size(scene, tree) -> tuple[int, int]:
    """Width and height of a run in pixels."""
    share = scene.render.resolution_percentage / 100 * tree.percentage / 100
    return max(int(scene.render.resolution_x * share), 1), max(int(scene.render.resolution_y * share), 1)


class _OnTree:
    tree: bpy.props.StringProperty(
        name="Tree", description="Name of the pass tree; by default the one that is open", options={"SKIP_SAVE"}
    )


class CANDELA_OT_passes_from_auto(_OnTree, bpy.types.Operator):
    """Make a pass tree of the techniques that Auto chooses for this scene now"""

    bl_idname = "candela.passes_from_auto"
    bl_label = "New from Auto"
    bl_options = {"REGISTER", "UNDO"}

    use: bpy.props.BoolProperty(
        name="Render With It", default=False,
        description="Render the scene and its viewports by the new tree instead of what Auto chooses",
    )  # fmt: skip

    def execute(self, context):
        scene = context.scene
        try:
            snapshot = take(context.evaluated_depsgraph_get(), SnapshotCache(), 64, 64)
            plan = make_plan(make_registry(), snapshot, replace(settings_of(scene, viewport=False), passes=None))
        except (UnsupportedScene, PlanError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        tree = bpy.data.node_groups.new(self.tree or "Passes", TREE)
        graph = pass_graph.from_plan(plan)
        fill(tree, graph, pass_graph.depths(graph))
        if self.use:
            scene.candela.pass_tree = tree
        space = context.space_data
        if space is not None and space.type == "NODE_EDITOR" and space.tree_type == TREE:
            space.node_tree = tree
        return {"FINISHED"}


class CANDELA_OT_passes_run(_OnTree, Job, bpy.types.Operator):
    """Run the passes, and show each one's picture and time on its node and the output in the Image Editor"""

    bl_idname = "candela.passes_run"
    bl_label = "Run"

    node: bpy.props.StringProperty(
        name="Node", description="Run only what this node needs, and show it", options={"SKIP_SAVE"}
    )
    compare: bpy.props.BoolProperty(
        name="Compare", description="Compare what comes out with Cycles", options={"SKIP_SAVE", "HIDDEN"}
    )

    def work(self, context) -> Iterator[tuple[float, str]]:
        scene, tree = context.scene, tree_of(context, self.tree)
        if self.node and self.node not in tree.nodes:
            raise ValueError(f"The tree '{tree.name}' has no node '{self.node}'.")
        found = checked(graph_of(tree), self.node)
        if not found.order:
            raise ValueError(
                "Nothing leads to an Image Output: link a pass to one, or choose New from Auto."
                if not self.node
                else f"'{self.node}' needs no pass to be run."
            )
        size, share = run_size(scene, tree), 0.5 if self.compare else 1.0
        settings = replace(settings_of(scene, viewport=False), samples=tree.samples, passes=found.order, profile=True)
        depsgraph, layer = context.evaluated_depsgraph_get(), context.view_layer.name
        rendered = yield from part(render_steps(scene, depsgraph, size, settings), 0.0, share)
        reference = None
        if self.compare:
            chosen = layer_named(scene, layer)
            shown_otherwise.warn(self, chosen)
            steps = reference_steps(scene, tree.reference_samples, settings.bounces == 0, size, chosen)
            reference = yield from part(steps, share, 1.0)
        truth = reference_images(reference) if reference is not None else {}
        self._show(context, tree, rendered, truth, reference)
        yield 1.0, "done"

    def _show(self, context, tree, rendered: Rendered, truth: dict, reference) -> None:
        shown = pictures_of(tree, rendered.images, truth)
        errors = _errors(rendered, reference) if reference is not None else {}
        known = {node.name: result(node).milliseconds for node in tree.nodes if result(node)}
        forget_results(tree)
        rows = {row.name: row for row in rendered.ledger.rows}
        written = {technique.name: {write.name for write in technique.writes} for technique in REGISTRY}
        for node in tree.nodes:
            row = rows.get(getattr(node, "technique", ""))
            if node.name not in shown and (row is None or row.state == SKIPPED):
                continue
            took = row.milliseconds if row is not None and row.state == RAN else known.get(node.name)
            lines = [line for name, line in errors.items() if row is not None and name in written[node.technique]]
            set_result(node, Result(shown.get(node.name), took, lines))
        outputs = [node for node in tree.nodes if node.bl_idname == "CandelaPassOutput" and node.name in shown]
        best = self.node or next((node.name for node in outputs), "")
        if best in shown:
            shown_images.show(context, f"Candela {tree.name}", shown[best])


def _errors(rendered: Rendered, reference) -> dict[str, str]:
    """A line about each image of the frame that Cycles has a picture of."""
    (mean, half), lines = reference.paths(), {}
    for name, truth in reference_images(reference).items():
        if name not in rendered.images or name == "film.depth":
            continue
        path = name.removeprefix("radiance.").removeprefix("film.")
        exposure = rendered.exposure if name.startswith("radiance.") else 1.0
        noise = half.get(path) if path in mean else None
        error = metrics.compare_radiance(path, rendered.images[name][..., :3] * exposure, truth, noise)
        relmse, _, _, bias, _ = metrics.figures(error)
        lines[name] = f"{pass_graph.in_words(name)}: {relmse}, bias {bias}"
    return lines


def _run(operator: bpy.types.Operator, mode: str, **options) -> set[str]:
    """What an operator says that has called Run, whose sentence becomes its own. Run may go on; the caller has ended:
    Blender never frees an operator that claims to be modal and is not."""
    try:
        called = bpy.ops.candela.passes_run(mode, tree=operator.tree, **options)
    except RuntimeError as error:
        operator.report({"ERROR"}, str(error).removeprefix("Error: ").strip())
        return {"CANCELLED"}
    return {"CANCELLED"} if "CANCELLED" in called else {"FINISHED"}


class CANDELA_OT_passes_run_to_node(_OnTree, bpy.types.Operator):
    """Run only what the active node needs, and show its picture"""

    bl_idname = "candela.passes_run_to_node"
    bl_label = "Run to Node"

    @classmethod
    def poll(cls, context):
        space = context.space_data
        return Job.running is None and space is not None and space.type == "NODE_EDITOR" and context.active_node

    def execute(self, context):
        return _run(self, "INVOKE_DEFAULT", node=context.active_node.name)


class CANDELA_OT_passes_compare(_OnTree, bpy.types.Operator):
    """Run the passes and Cycles, and show the error of each light path on the nodes. The reference is kept"""

    bl_idname = "candela.passes_compare"
    bl_label = "Compare with Cycles"

    @classmethod
    def poll(cls, context):
        return Job.running is None

    def execute(self, context):
        return _run(self, "EXEC_DEFAULT" if bpy.app.background else "INVOKE_DEFAULT", compare=True)


class CANDELA_OT_passes_bake(_OnTree, bpy.types.Operator):
    """Store a node's picture of the last run as an image in this file, in scene-linear floats"""

    bl_idname = "candela.passes_bake"
    bl_label = "Bake to Image"
    bl_options = {"REGISTER", "UNDO"}

    node: bpy.props.StringProperty(
        name="Node", description="Node whose picture is kept; by default the active one", options={"SKIP_SAVE"}
    )

    def execute(self, context):
        try:
            tree = tree_of(context, self.tree)
        except ValueError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        node = tree.nodes.get(self.node) if self.node else tree.nodes.active
        found = result(node) if node is not None else None
        if found is None or found.picture is None:
            self.report({"ERROR"}, "The node has no picture yet: run the tree first, and choose a node that shows one.")
            return {"CANCELLED"}
        image = shown_images.write(f"{tree.name} {node.name}", found.picture)
        image.pack()
        image.use_fake_user = True
        self.report({"INFO"}, f"The picture is kept as image '{image.name}'.")
        return {"FINISHED"}


class NODE_PT_candela_passes(bpy.types.Panel):
    bl_label = "Passes"
    bl_space_type = "NODE_EDITOR"
    bl_region_type = "UI"
    bl_category = "Candela"

    @classmethod
    def poll(cls, context):
        return context.space_data.tree_type == TREE

    def draw(self, context):
        layout, tree = self.layout, context.space_data.edit_tree
        layout.operator("candela.passes_from_auto", icon="ADD")
        if tree is None:
            return
        settings = layout.column()
        settings.use_property_split, settings.use_property_decorate = True, False
        settings.prop(tree, "samples")
        settings.prop(tree, "percentage")
        settings.prop(tree, "reference_samples", text="Reference")
        column = layout.column(align=True)
        column.operator("candela.passes_run", icon="PLAY")
        column.operator("candela.passes_run_to_node", icon="NODE")
        column.operator("candela.passes_compare", icon="SPLIT_HORIZONTAL")
        column.operator("candela.passes_bake", icon="IMAGE_DATA")
        draw_progress(layout)
        row = layout.column()
        row.use_property_split, row.use_property_decorate = True, False
        if context.scene.render.engine == ENGINE:
            row.prop(context.scene.candela, "pass_tree", text="Render With")
            if context.scene.candela.pass_tree != tree:
                row.label(text="Renders do not use this tree.", icon="INFO")


def _draw_header(self, context):
    """The tree's buttons where a node editor has those of other trees."""
    if context.space_data.tree_type != TREE:
        return
    row = self.layout.row(align=True)
    row.operator("candela.passes_from_auto", icon="ADD", text="" if context.space_data.edit_tree else "New from Auto")
    if context.space_data.edit_tree is not None:
        row.operator("candela.passes_run", icon="PLAY")
        row.operator("candela.passes_run_to_node", icon="NODE", text="")
        row.operator("candela.passes_compare", icon="SPLIT_HORIZONTAL", text="")


_CLASSES = (
    CANDELA_OT_passes_from_auto,
    CANDELA_OT_passes_run,
    CANDELA_OT_passes_run_to_node,
    CANDELA_OT_passes_compare,
    CANDELA_OT_passes_bake,
    NODE_PT_candela_passes,
)


def register() -> None:
    for made in _CLASSES:
        bpy.utils.register_class(made)
    bpy.types.NODE_HT_header.append(_draw_header)


def unregister() -> None:
    bpy.types.NODE_HT_header.remove(_draw_header)
    for made in reversed(_CLASSES):
        bpy.utils.unregister_class(made)
