"""Runs inside a windowed Blender: one edit after the other, as an artist makes them, and undo of some. When the view
rests, its picture is compared with one that nothing was kept for: the same scene read anew by a viewport of its own.

    blender FILE.blend --python session.py -- [EDIT ...] FOLDER

What differs after an edit is stale, or was kept wrongly.
"""

import math
import sys
import time
import traceback
from pathlib import Path

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from stage import (
    ENGINE,
    FOLDER,
    candela,
    main_region,
    result,
    run,
    there,
    viewport_area,
    viewports,
    wait_for_rest,
    window,
)

SAMPLES = 2
PIXEL = "8"  # of the screen, for one of the picture
PAUSE_S = 0.02
WHOLE = 50.0 * (2.0 - math.sqrt(2.0))  # Blender's zoom at which the camera's frame fills the region
SAME = 0.03  # of a value, between two pictures: rays search trees that were refitted, or are made anew
MOST_OTHER = 0.02  # of all blocks may differ by more
EDITS = []
before = []  # the picture before the last edit


def edit(function):
    """An edit; what it returns, if not None, is the way back."""
    EDITS.append(function)
    return function


def scene():
    return window().scene


def thing(name):
    return scene().objects[name]


def first(kind):
    return next(one for one in scene().objects if one.type == kind and one.visible_get())


def shader(material):
    return next(node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED")


def material_of(name):
    return thing(name).active_material


# --------------------------------------------------------------------------------------------------------------- edits


@edit
def move_object():
    thing("Subject").location.z += 0.3


@edit
def move_parent():
    thing("Parent").rotation_euler.z += 0.7


@edit
def add_lamp():
    with there():
        bpy.ops.object.light_add(type="POINT", location=(0.3, -0.3, 1.2))
    bpy.context.object.name = "Added lamp"
    thing("Added lamp").data.energy = 30.0


@edit
def lamp_of_another_kind():
    thing("Added lamp").data.type = "SPOT"


@edit
def lamp_turned():
    thing("Added lamp").rotation_euler = (0.5, 0.4, 0.0)


@edit
def lamp_without_shadow():
    thing("Added lamp").data.use_shadow = False


@edit
def lamp_hidden():
    thing("Added lamp").hide_set(True)


@edit
def lamp_shown():
    thing("Added lamp").hide_set(False)


@edit
def lamp_removed():
    bpy.data.objects.remove(thing("Added lamp"))


@edit
def lamp_with_nodes():
    lamp = first("LIGHT").data
    lamp.use_nodes = True
    emission = next(node for node in lamp.node_tree.nodes if node.type == "EMISSION")
    emission.inputs["Color"].default_value = (1.0, 0.2, 0.1, 1.0)


@edit
def lamp_color_ramp():
    lamp = first("LIGHT").data
    emission = next(node for node in lamp.node_tree.nodes if node.type == "EMISSION")
    emission.inputs["Color"].default_value = (0.2, 0.4, 1.0, 1.0)
    emission.inputs["Strength"].default_value = 2.0


@edit
def material_color():
    shader(material_of("Subject")).inputs["Base Color"].default_value = (0.05, 0.6, 0.1, 1.0)


@edit
def material_node_added():
    tree = material_of("Subject").node_tree
    noise = tree.nodes.new("ShaderNodeTexChecker")
    noise.name = "Pattern"
    tree.links.new(noise.outputs["Color"], shader(material_of("Subject")).inputs["Base Color"])


@edit
def material_node_scaled():
    material_of("Subject").node_tree.nodes["Pattern"].inputs["Scale"].default_value = 11.0


@edit
def material_link_removed():
    tree = material_of("Subject").node_tree
    tree.links.remove(shader(material_of("Subject")).inputs["Base Color"].links[0])


@edit
def material_emits():
    node = shader(material_of("Subject"))
    node.inputs["Emission Color"].default_value = (1.0, 0.5, 0.1, 1.0)
    node.inputs["Emission Strength"].default_value = 4.0


@edit
def material_emits_no_more():
    shader(material_of("Subject")).inputs["Emission Strength"].default_value = 0.0


@edit
def material_alpha():
    shader(material_of("Subject")).inputs["Alpha"].default_value = 0.3


@edit
def material_opaque_metal():
    node = shader(material_of("Subject"))
    node.inputs["Alpha"].default_value, node.inputs["Metallic"].default_value = 1.0, 1.0
    node.inputs["Roughness"].default_value = 0.1


@edit
def material_glass():
    node = shader(material_of("Subject"))
    node.inputs["Metallic"].default_value, node.inputs["Transmission Weight"].default_value = 0.0, 1.0


@edit
def material_swapped():
    made = bpy.data.materials.new("Other")
    if not made.use_nodes:
        made.use_nodes = True
    shader(made).inputs["Base Color"].default_value = (0.7, 0.1, 0.5, 1.0)
    thing("Subject").material_slots[0].material = made


@edit
def material_group_edited():
    group = bpy.data.node_groups.new("Group", "ShaderNodeTree")
    group.interface.new_socket("Color", in_out="OUTPUT", socket_type="NodeSocketColor")
    out, rgb = group.nodes.new("NodeGroupOutput"), group.nodes.new("ShaderNodeRGB")
    rgb.name = "Value"
    rgb.outputs[0].default_value = (0.1, 0.1, 0.9, 1.0)
    group.links.new(rgb.outputs[0], out.inputs[0])
    tree = material_of("Subject").node_tree
    node = tree.nodes.new("ShaderNodeGroup")
    node.node_tree = group
    tree.links.new(node.outputs[0], shader(material_of("Subject")).inputs["Base Color"])


@edit
def material_group_value():
    bpy.data.node_groups["Group"].nodes["Value"].outputs[0].default_value = (0.9, 0.8, 0.1, 1.0)


@edit
def image_texture():
    image = bpy.data.images.new("Painted", 32, 32)
    image.pixels.foreach_set(np.tile(np.array([0.1, 0.7, 0.3, 1.0], np.float32), 1024))
    image.update()
    tree = material_of("Subject").node_tree
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image = image
    tree.links.new(node.outputs["Color"], shader(material_of("Subject")).inputs["Base Color"])


@edit
def image_painted():
    image = bpy.data.images["Painted"]
    image.pixels.foreach_set(np.tile(np.array([0.9, 0.1, 0.1, 1.0], np.float32), 1024))
    image.update()
    viewport_area().tag_redraw()  # as a brush does; of the image itself Blender tells nobody


@edit
def object_color():
    tree = material_of("Subject").node_tree
    node = tree.nodes.new("ShaderNodeObjectInfo")
    tree.links.new(node.outputs["Color"], shader(material_of("Subject")).inputs["Base Color"])


@edit
def object_color_changed():
    thing("Subject").color = (0.1, 0.9, 0.9, 1.0)


@edit
def attribute_property():
    thing("Subject")["tint"] = 0.2
    tree = material_of("Subject").node_tree
    node = tree.nodes.new("ShaderNodeAttribute")
    node.attribute_type, node.attribute_name = "OBJECT", "tint"
    tree.links.new(node.outputs["Fac"], shader(material_of("Subject")).inputs["Base Color"])


@edit
def attribute_property_changed():
    thing("Subject")["tint"] = 0.9
    thing("Subject").update_tag()


@edit
def world_color():
    if scene().world is None:
        scene().world = bpy.data.worlds.new("World")
    world = scene().world
    if not world.use_nodes:
        world.use_nodes = True
    node = next(node for node in world.node_tree.nodes if node.type == "BACKGROUND")
    node.inputs["Color"].default_value, node.inputs["Strength"].default_value = (0.2, 0.4, 0.9, 1.0), 1.0


@edit
def world_sky():
    tree = scene().world.node_tree
    sky = tree.nodes.new("ShaderNodeTexSky")
    back = next(node for node in tree.nodes if node.type == "BACKGROUND")
    tree.links.new(sky.outputs[0], back.inputs["Color"])
    back.inputs["Strength"].default_value = 0.1


@edit
def world_sun_turned():
    sky = next(node for node in scene().world.node_tree.nodes if node.type == "TEX_SKY")
    sky.sun_rotation = 2.0


@edit
def world_other():
    made = bpy.data.worlds.new("Grey")
    if not made.use_nodes:
        made.use_nodes = True
    scene().world = made


@edit
def hide_object():
    thing("Second").hide_viewport = True


@edit
def show_object():
    thing("Second").hide_viewport = False


@edit
def hide_by_eye():
    thing("Second").hide_set(True)


@edit
def show_by_eye():
    thing("Second").hide_set(False)


@edit
def unseen_by_camera():
    thing("Second").visible_camera = False


@edit
def seen_by_camera():
    thing("Second").visible_camera = True


@edit
def casts_no_shadow():
    thing("Second").visible_shadow = False


@edit
def casts_shadow():
    thing("Second").visible_shadow = True


@edit
def collection_hidden():
    window().view_layer.layer_collection.children["Things"].hide_viewport = True


@edit
def collection_shown():
    window().view_layer.layer_collection.children["Things"].hide_viewport = False


@edit
def collection_excluded():
    window().view_layer.layer_collection.children["Things"].exclude = True


@edit
def collection_included():
    window().view_layer.layer_collection.children["Things"].exclude = False


@edit
def collection_holdout():
    window().view_layer.layer_collection.children["Things"].holdout = True


@edit
def collection_no_holdout():
    window().view_layer.layer_collection.children["Things"].holdout = False


@edit
def collection_instanced():
    made = bpy.data.objects.new("Instance", None)
    made.instance_type, made.instance_collection = "COLLECTION", bpy.data.collections["Things"]
    made.location = (0.0, 0.0, 1.0)
    scene().collection.objects.link(made)


@edit
def instance_moved():
    thing("Instance").location.x -= 0.3


@edit
def instance_removed():
    bpy.data.objects.remove(thing("Instance"))


@edit
def frame_changed():
    scene().frame_set(12)


@edit
def frame_changed_again():
    scene().frame_set(5)


@edit
def modifier_added():
    made = thing("Second").modifiers.new("Array", "ARRAY")
    made.count = 2


@edit
def modifier_value():
    thing("Second").modifiers["Array"].relative_offset_displace = (0.0, -1.3, 0.0)


@edit
def modifier_off():
    thing("Second").modifiers["Array"].show_viewport = False


@edit
def vertices_moved():
    mesh = thing("Subject").data
    for vertex in mesh.vertices:
        vertex.co *= 1.2
    mesh.update()


@edit
def mesh_swapped():
    thing("Second").data = thing("Subject").data


@edit
def shape_key():
    one = thing("Subject")
    one.shape_key_add(name="Basis")
    key = one.shape_key_add(name="Tall")
    for point in key.data:
        point.co.z *= 1.5
    key.value = 0.5


@edit
def shape_key_value():
    thing("Subject").data.shape_keys.key_blocks["Tall"].value = 1.0


@edit
def shade_smooth():
    with there():
        bpy.ops.object.select_all(action="DESELECT")
        thing("Subject").select_set(True)
        window().view_layer.objects.active = thing("Subject")
        bpy.ops.object.shade_smooth()


@edit
def text_object():
    curve = bpy.data.curves.new("Text", "FONT")
    curve.body, curve.size, curve.extrude = "ab", 0.5, 0.02
    made = bpy.data.objects.new("Text", curve)
    made.rotation_euler.x, made.location = math.pi / 2, (-0.4, -0.6, 0.6)
    scene().collection.objects.link(made)


@edit
def text_body():
    thing("Text").data.body = "xyz"


@edit
def text_deleted():
    with there():
        bpy.ops.object.select_all(action="DESELECT")
        thing("Text").select_set(True)
        bpy.ops.object.delete()


@edit
def edit_mode_moves():
    with there():
        bpy.ops.object.select_all(action="DESELECT")
        window().view_layer.objects.active = thing("Second")
        thing("Second").select_set(True)
        bpy.ops.object.mode_set(mode="EDIT")
        bpy.ops.mesh.select_all(action="SELECT")
        bpy.ops.transform.translate(value=(0, 0, 0.2))


@edit
def edit_mode_ends():
    with there():
        bpy.ops.object.mode_set(mode="OBJECT")


@edit
def duplicate_linked():
    with there():
        bpy.ops.object.select_all(action="DESELECT")
        thing("Second").select_set(True)
        bpy.ops.object.duplicate(linked=True)
        bpy.ops.transform.translate(value=(-0.5, 0, 0.4))


@edit
def local_view():
    with there():
        bpy.ops.object.select_all(action="DESELECT")
        thing("Subject").select_set(True)
        window().view_layer.objects.active = thing("Subject")
        bpy.ops.view3d.localview(frame_selected=False)


@edit
def local_view_edit():
    thing("Subject").location.x += 0.1


@edit
def local_view_ends():
    with there():
        bpy.ops.view3d.localview(frame_selected=False)


@edit
def lamps_hidden_in_the_region():
    viewport_area().spaces.active.show_object_viewport_light = False


@edit
def lamps_shown_in_the_region():
    viewport_area().spaces.active.show_object_viewport_light = True


@edit
def border():
    scene().render.use_border = True
    scene().render.border_min_x, scene().render.border_max_x = 0.2, 0.7
    scene().render.border_min_y, scene().render.border_max_y = 0.1, 0.8


@edit
def border_off():
    scene().render.use_border = False


@edit
def film_transparent():
    scene().render.film_transparent = True


@edit
def film_opaque():
    scene().render.film_transparent = False


@edit
def exposure():
    scene().view_settings.exposure = 1.0


@edit
def lens():
    scene().camera.data.lens *= 0.8


@edit
def depth_of_field():
    scene().camera.data.dof.use_dof = True
    scene().camera.data.dof.aperture_fstop = 0.2
    scene().camera.data.dof.focus_object = thing("Subject")


@edit
def focus_moves():
    thing("Subject").location.y -= 0.3


@edit
def other_camera():
    made = bpy.data.objects.new("Camera 2", bpy.data.cameras.new("Camera 2"))
    made.matrix_world = scene().camera.matrix_world.copy()
    made.location.x += 0.2
    scene().collection.objects.link(made)
    scene().camera = made


@edit
def world_volume():
    tree = scene().world.node_tree
    made = tree.nodes.new("ShaderNodeVolumePrincipled")
    made.inputs["Density"].default_value = 0.15
    out = next(node for node in tree.nodes if node.type == "OUTPUT_WORLD")
    tree.links.new(made.outputs[0], out.inputs["Volume"])


@edit
def world_volume_denser():
    made = next(node for node in scene().world.node_tree.nodes if node.type == "PRINCIPLED_VOLUME")
    made.inputs["Density"].default_value = 0.4


@edit
def world_volume_gone():
    tree = scene().world.node_tree
    tree.nodes.remove(next(node for node in tree.nodes if node.type == "PRINCIPLED_VOLUME"))


@edit
def light_linked():
    made = bpy.data.collections.new("Receivers")
    made.objects.link(thing("Second"))
    first("LIGHT").light_linking.receiver_collection = made


@edit
def light_links_changed():
    bpy.data.collections["Receivers"].objects.link(thing("Subject"))


@edit
def light_links_off():
    first("LIGHT").light_linking.receiver_collection = None


@edit
def catcher():
    thing("Ground").is_shadow_catcher = True


@edit
def catcher_moves():
    thing("Subject").location.x += 0.2


@edit
def catcher_off():
    thing("Ground").is_shadow_catcher = False


@edit
def bounces():
    scene().candela.bounces = 0


@edit
def simplify():
    scene().render.use_simplify = True
    scene().render.simplify_subdivision = 0


@edit
def purge_and_new_mesh():
    with there():
        bpy.ops.mesh.primitive_ico_sphere_add(radius=0.3, location=(0.2, -0.5, 0.4))


# ------------------------------------------------------------------------------------------------------------ measured


def stage_scene():
    """Things with names, one of which moves with the frame, and one that hangs on a parent."""
    one = scene()
    one.render.engine = ENGINE
    one.render.preview_pixel_size = PIXEL
    one.candela.viewport_samples, one.candela.bounces = SAMPLES, 1
    one.frame_set(1)
    things = bpy.data.collections.new("Things")
    one.collection.children.link(things)

    def add(name, operator, location, **more):
        with there():
            getattr(bpy.ops.mesh, operator)(location=location, **more)
        made = bpy.context.object
        made.name = name
        material = bpy.data.materials.new(name)
        if not material.use_nodes:
            material.use_nodes = True
        made.data.materials.append(material)
        return made

    add("Subject", "primitive_uv_sphere_add", (0.4, -0.4, 0.5), radius=0.3, segments=16, ring_count=8)
    second = add("Second", "primitive_cube_add", (-0.4, -0.2, 0.3), size=0.4)
    add("Ground", "primitive_plane_add", (0.0, 0.0, 0.02), size=1.8)
    moving = add("Moving", "primitive_cone_add", (0.0, 0.0, 0.2), radius1=0.2, depth=0.4)
    for frame, x in ((1, -0.8), (20, 0.8)):
        moving.location.x = x
        moving.keyframe_insert("location", frame=frame)
    with there():
        bpy.ops.object.empty_add(location=(0.0, 0.0, 0.9))
    bpy.context.object.name = "Parent"
    second.parent = bpy.context.object
    second.matrix_parent_inverse = bpy.context.object.matrix_world.inverted()
    one.collection.objects.unlink(second)
    things.objects.link(second)
    space = viewport_area().spaces.active
    space.overlay.show_overlays = space.show_gizmo = False
    space.region_3d.view_perspective, space.region_3d.view_camera_zoom = "CAMERA", WHOLE
    space.shading.type = "RENDERED"


def fresh():
    """The picture of the viewport as one that has kept nothing would show it; (H, W, 4)."""
    module, shown = candela(), viewports()[0]
    space = viewport_area().spaces.active
    other = module.Viewport()
    with there():
        depsgraph = bpy.context.evaluated_depsgraph_get()
        closes_eyes = module._closes_eyes(depsgraph.view_layer_eval.layer_collection)
        visible = (lambda one: one.visible_in_viewport_get(space)) if module._hidden(space, closes_eyes) else None

        def source(camera, width, height):
            return module.take(depsgraph, other.cache, width, height, view=camera, shown=visible)

        _, size, border, _, other.render_pass = shown._asked
        other.scale, other.pace, other.step, other.coarsest = shown.scale, shown.pace, shown.step, shown.coarsest
        region_data = viewport_area().spaces.active.region_3d
        camera = module.camera_of_view(
            region_data, space, scene().camera if region_data.view_perspective == "CAMERA" else None
        )
        settings = module.settings_of(depsgraph.scene, viewport=True, depsgraph=depsgraph)
        with module.images.passing_context():
            while not other.done:
                other.draw_frame(source, camera, size, settings, border=border)
            found = module.images.read(other.picture)
            other.release()
    return found


def blocks(picture):
    """Means of 4 x 4 pixels: single choices of indirect light may differ, by the last digit of what they weigh."""
    height, width = (extent // 4 * 4 for extent in picture.shape[:2])
    return picture[:height, :width].reshape(height // 4, 4, width // 4, 4, -1).mean(axis=(1, 3))


def compared(name):
    """Note how much the picture at rest differs from a fresh one."""
    module = candela()
    with module.images.passing_context():
        kept = module.images.read(viewports()[0].picture)
    anew = fresh()
    if kept.shape != anew.shape:
        result["edits"][name] = {"shapes": [kept.shape, anew.shape]}
        return
    kept_blocks, anew_blocks = blocks(kept), blocks(anew)
    away = np.abs(kept_blocks - anew_blocks).max(axis=-1) / np.maximum(np.abs(anew_blocks[..., :3]).max(axis=-1), 0.02)
    mean = float(np.abs(kept.mean(axis=(0, 1)) - anew.mean(axis=(0, 1))).max() / max(anew[..., :3].mean(), 1e-3))
    note = {
        "seen": len(viewports()[0].frame.snapshot.instances), "other": float((away > SAME).mean()), "mean": mean,
        "brightness": float(anew[..., :3].mean()), "changed": None,
    }  # fmt: skip
    if before and before[-1].shape == kept.shape:
        note["changed"] = float(np.abs(kept - before[-1]).mean() / max(anew[..., :3].mean(), 1e-3))
    before[:] = [kept]
    result["edits"][name] = note
    if note["other"] > MOST_OTHER:
        np.savez(FOLDER / f"{name}.npz", kept=kept, fresh=anew)


def steps():
    stage_scene()
    wanted = sys.argv[sys.argv.index("--") + 1 : -1]
    result["edits"], result["failed"] = {}, {}
    yield from wait_for_rest()
    compared("start")
    push("start")
    for change in EDITS:
        name = change.__name__
        if wanted and name not in wanted:
            continue
        started = time.monotonic()
        try:
            change()
        except Exception:
            result["failed"][name] = traceback.format_exc()
            continue
        push(name)
        yield PAUSE_S
        yield from wait_for_rest()
        compared(name)
        print(name, result["edits"][name], f"{time.monotonic() - started:.1f} s", flush=True)
        for k in range(1, 3) if EDITS.index(change) % 5 == 4 else ():
            with there():
                (bpy.ops.ed.undo if k == 1 else bpy.ops.ed.redo)()
            yield PAUSE_S
            yield from wait_for_rest()
            compared(f"{name}, {'undone' if k == 1 else 'redone'}")
    result["region"] = [main_region(viewport_area()).width, main_region(viewport_area()).height]


def push(message):
    with there():
        bpy.ops.ed.undo_push(message=message)


run(steps)
