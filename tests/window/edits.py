"""What an artist does to a scene, one edit after the other, as session.py makes them; the things that they name are
staged there, and later edits build on what earlier ones have left."""

import math

import bpy
import numpy as np
from stage import there, viewport_area, window

EDITS = []


def edit(function):
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
