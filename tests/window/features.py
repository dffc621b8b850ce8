"""Runs inside a windowed Blender: what a new user tries of each technique that needs more than a look.

Glare in the camera's tab, painted translucency, reflections that are bent, grass, relief and caustics: the panel is
opened, its buttons are used as with a mouse, the viewport is looked at, the picture rendered. A step that fails is
noted and the next one begins, so that one walk finds what there is to find.
"""

import math
import sys
import time
import traceback
from pathlib import Path

import bpy
from bpy_extras.object_utils import world_to_camera_view
from bpy_extras.view3d_utils import location_3d_to_region_2d
from mathutils import Vector

sys.path.insert(0, str(Path(__file__).parent))

from stage import ENGINE, FOLDER, main_region, picture, render, result, run, there, wait_for_rest, window

SAMPLES = 1
VIEW_SHARE = 0.4  # of the large area, for the viewport: few pixels are drawn soon, and wide panels are read easily
WARNING_BUTTON = (29, 147)  # of the first warning, in pixels from the upper right corner of the properties
HIGHLIGHT = (-0.8, 2.0, 1.7)  # on the mirror, where a highlight is moved to
ONLY = sys.argv[sys.argv.index("--") + 1 : -1]  # names of steps; by default all
result.update(done=[], failed={}, s={}, renders={})


def steps():
    open_panels()
    left, right = yield from two_areas()
    result["properties"] = [right.x, window().height - right.y - right.height, right.width, right.height]
    for step in (film, warning, painting, reflections, glare, grass, relief, caustics):
        name, started = step.__name__, time.monotonic()
        if ONLY and name not in ONLY:
            continue
        # A script that changes a scene while a material's icon is drawn by any engine in Python stops Blender: it waits
        # for the icon and holds Python's lock, which that needs to end.
        while bpy.app.is_job_running("RENDER_PREVIEW"):
            yield 0.1
        try:
            yield from step(left, right)
            result["done"].append(name)
        except Exception:
            result["failed"][name] = traceback.format_exc()
            print(traceback.format_exc(), flush=True)
        result["s"][name] = time.monotonic() - started
        print(f"features: {name} {result['s'][name]:.0f} s", flush=True)


def film(left, right):
    """The Film panel with its limits for single samples, found by searching for them."""
    stage()
    right.spaces.active.context = "RENDER"
    right.spaces.active.search_filter = "Clamp"
    yield 1.0
    picture("film_panel.png")
    right.spaces.active.search_filter = ""
    yield 0.3


def open_panels():
    """As they are after a click on each: closed ones have no content to look at."""
    closed = [
        panel for panel in bpy.types.Panel.__subclasses__()
        if ".candela.addon." in panel.__module__ and "DEFAULT_CLOSED" in getattr(panel, "bl_options", ())
        and panel.bl_context in ("data", "material", "object") and panel.is_registered
    ]  # fmt: skip
    children = {panel: [c for c in bpy.types.Panel.__subclasses__() if getattr(c, "bl_parent_id", "") == panel.__name__]
                for panel in closed}  # fmt: skip
    for panel in closed:
        if getattr(panel, "bl_parent_id", ""):
            continue
        for child in children[panel]:
            bpy.utils.unregister_class(child)
        bpy.utils.unregister_class(panel)
        panel.bl_options = set(panel.bl_options) - {"DEFAULT_CLOSED"}
        bpy.utils.register_class(panel)
        for child in children[panel]:
            bpy.utils.register_class(child)


def two_areas():
    with there():
        bpy.ops.screen.area_split(direction="VERTICAL", factor=VIEW_SHARE)
    yield 0.5
    left, right = sorted((a for a in window().screen.areas if a.type == "VIEW_3D"), key=lambda a: a.x)
    right.type = "PROPERTIES"
    left.spaces.active.show_region_ui = False
    return left, right


# ------------------------------------------------------------------------------------------------------------- scenes


def stage(camera_at=(0.0, -6.0, 2.2), look_at=(0.0, 0.0, 0.8)):
    """An empty scene with a floor, an area light and a camera; Candela in the viewport, through the camera."""
    scene = window().scene
    for one in list(scene.objects):
        bpy.data.objects.remove(one)
    scene.world = bpy.data.worlds.new("World")
    scene.world.color = (0.02, 0.02, 0.02)
    scene.render.engine = ENGINE
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 120, 90, 100
    scene.render.use_border = True  # all of the picture, but nothing around it in the viewport
    scene.candela.samples = scene.candela.viewport_samples = SAMPLES
    scene.candela.bounces = 0  # indirect light takes its time without a GPU
    camera = new("Camera", bpy.data.cameras.new("Camera"), camera_at)
    camera.rotation_euler = (Vector(look_at) - Vector(camera_at)).to_track_quat("-Z", "Y").to_euler()
    scene.camera = camera
    lamp = new("Area", bpy.data.lights.new("Area", "AREA"), (2.0, -2.0, 4.0))
    lamp.data.energy, lamp.data.size = 100.0, 1.0
    lamp.rotation_euler = (-lamp.location).to_track_quat("-Z", "Y").to_euler()
    return scene


def new(name, data, location=(0.0, 0.0, 0.0)):
    made = bpy.data.objects.new(name, data)
    made.location = location
    window().scene.collection.objects.link(made)
    return made


def shape(operator, material=None, **options):
    with there(left_area()):
        getattr(bpy.ops.mesh, f"primitive_{operator}_add")(**options)
    made = window().view_layer.objects.active
    if material is not None:
        made.data.materials.append(material)
    return made


def left_area():
    return min((a for a in window().screen.areas if a.type == "VIEW_3D"), key=lambda a: a.x)


def principled(name, **values):
    material = bpy.data.materials.new(name)
    if material.node_tree is None:
        material.use_nodes = True
    shader = next(node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED")
    for socket, value in values.items():
        shader.inputs[socket.replace("_", " ")].default_value = value
    return material


def activate(thing):
    with there(left_area()):
        bpy.ops.object.select_all(action="DESELECT")
        thing.select_set(True)
        window().view_layer.objects.active = thing
        bpy.ops.ed.undo_push(message="scene")  # what a script makes is no step of itself


def rendered(left):
    left.spaces.active.region_3d.view_perspective = "CAMERA"
    left.spaces.active.shading.type = "RENDERED"
    yield from wait_for_rest()


def f12(name):
    result["renders"][name] = yield from render()
    settings = window().scene.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "IMAGE"
    settings.file_format, settings.color_mode = "PNG", "RGB"
    bpy.data.images["Render Result"].save_render(str(FOLDER / f"{name}_render.png"), scene=window().scene)


def press(kind, x, y, value="PRESS"):
    window().event_simulate(type=kind, value=value, x=round(x), y=round(y))


def move(x, y):
    press("MOUSEMOVE", x, y, "NOTHING")


def click(x, y):
    move(x, y)
    yield 0.1
    press("LEFTMOUSE", x, y)
    yield 0.1
    press("LEFTMOUSE", x, y, "RELEASE")
    yield 0.3


def on_screen(area, point):
    """Where a point of the scene is in the window, in pixels from the lower left corner."""
    region = main_region(area)
    where = location_3d_to_region_2d(region, area.spaces.active.region_3d, Vector(point))
    return region.x + where[0], region.y + where[1]


# -------------------------------------------------------------------------------------------------------------- steps


def warning(left, right):
    """A click on the button of a warning: its object is selected, and its tab shown, at once."""
    scene = stage()
    ledger = sys.modules[next(name for name in sys.modules if name.endswith("candela.addon.frame.ledger"))]
    note = sys.modules[next(name for name in sys.modules if name.endswith("candela.addon.snapshot.scene"))].Note
    cube = shape("cube", principled("Odd"), size=1.0)
    activate(scene.camera)
    ledger.publish(ledger.Ledger(notes=(note("Material 'Odd'", "A part of it is drawn otherwise.", "Odd"),)))
    yield 0.3
    right.spaces.active.context = "RENDER"
    yield 1.0
    picture("warning.png")
    yield from click(right.x + right.width - WARNING_BUTTON[0], right.y + right.height - WARNING_BUTTON[1])
    yield 2.0
    picture("warning_clicked.png")
    result["culprit"] = [window().view_layer.objects.active == cube, cube.select_get(), right.spaces.active.context]


def glare(left, right):
    scene = stage()
    shape("plane", size=20.0)
    lamp = shape("uv_sphere", principled("Lamp", Emission_Strength=500.0, Emission_Color=(1, 0.9, 0.7, 1)), radius=0.15,
                 location=(0.0, 0.0, 1.2))  # fmt: skip
    lamp.data.shade_smooth()
    next(o for o in scene.objects if o.type == "LIGHT").data.energy = 20.0
    activate(scene.camera)
    yield 0.3
    right.spaces.active.context = "DATA"
    yield from rendered(left)
    yield 0.5
    picture("glare_off.png")
    scene.camera.data.candela.glare_mode = "CONVOLUTION"
    scene.camera.data.candela.eye_side = "128"
    yield from wait_for_rest()
    with there(right):
        result["observer"] = list(bpy.ops.candela.eye_preset(preset=observers()[0]))
        result["eye_pictures"] = list(bpy.ops.candela.eye_pictures("INVOKE_DEFAULT"))
    yield from wait_for_rest()
    yield 0.5
    picture("glare_on.png")
    scroll(right)
    yield 0.7
    picture("glare_panel.png")
    window().view_layer.use_pass_z = True
    yield from f12("glare")


def observers():
    operator = bpy.ops.candela.eye_preset.get_rna_type()
    return [item.identifier for item in operator.properties["preset"].enum_items]


def scroll(area, pages=1):
    with bpy.context.temp_override(window=window(), area=area, region=main_region(area)):
        for _ in range(pages):
            bpy.ops.view2d.scroll_down(page=True)


def painting(left, right):
    scene = stage(camera_at=(0.0, -4.0, 1.4))
    shape("plane", size=20.0)
    skin = principled("Skin", Base_Color=(0.8, 0.5, 0.4, 1.0), Subsurface_Weight=1.0, Subsurface_Scale=0.3)
    ball = shape("uv_sphere", skin, radius=1.0, location=(0.0, 0.0, 1.0))
    ball.data.shade_smooth()
    activate(ball)
    yield 0.3
    right.spaces.active.context = "MATERIAL"
    yield from rendered(left)
    yield 0.5
    picture("painting_before.png")
    with there(right):  # True: a step for undo, as a click on the button makes one
        result["new_maps"] = list(bpy.ops.candela.new_translucency_maps("EXEC_DEFAULT", True, size=128))
    yield 0.5
    scroll(right, 2)
    yield 0.7
    picture("painting_maps.png")
    yield from wait_for_rest()
    translucency = skin.candela.image_space_subsurface_translucency_map
    result["before_paint"] = mean(translucency)
    with there(right):
        result["paint"] = list(bpy.ops.candela.paint_translucency_map("INVOKE_DEFAULT", True, name="translucency_map"))
    yield 0.5
    result["paint_mode"] = ball.mode
    result["canvas"] = scene.tool_settings.image_paint.canvas.name if scene.tool_settings.image_paint.canvas else ""
    brush = scene.tool_settings.image_paint.brush
    result["brush"] = brush.name if brush else ""
    picture("painting_mode.png")
    tools = scene.tool_settings
    for holder in (tools, tools.image_paint):  # of the brush, of all brushes, and of all since Blender 5.0
        unified = getattr(holder, "unified_paint_settings", None)
        if unified is not None:
            unified.color = (0.0, 0.0, 0.0)
    if brush:
        brush.color = (0.0, 0.0, 0.0)
    x, y = on_screen(left, (0.0, -1.0, 1.0))
    yield from drag((x - 60, y), (x + 60, y))
    yield 1.0
    result["after_paint"] = mean(translucency)
    yield from wait_for_rest()
    picture("painting_painted.png")
    with there(left):
        bpy.ops.ed.undo()
    yield 0.5
    translucency = bpy.data.materials["Skin"].candela.image_space_subsurface_translucency_map
    result["after_undo"] = mean(translucency)
    with there(left):
        bpy.ops.ed.redo()
    yield 0.5
    translucency = bpy.data.materials["Skin"].candela.image_space_subsurface_translucency_map
    result["after_redo"] = mean(translucency)
    with there(left):
        bpy.ops.object.mode_set(mode="OBJECT")
    yield from f12("painting")
    path = str(FOLDER / "painted.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path, copy=True)
    result["dirty_after_save"] = bpy.data.materials["Skin"].candela.image_space_subsurface_translucency_map.is_dirty
    with bpy.data.libraries.load(path) as (inside, taken):
        taken.images = [name for name in inside.images if "translucency" in name]
    result["reopened"] = mean(taken.images[0])
    bpy.data.images.remove(taken.images[0])


def mean(image):
    values = list(image.pixels)[::4]
    return sum(values) / max(len(values), 1)


def drag(start, end, steps=8):
    move(*start)
    yield 0.2
    press("LEFTMOUSE", *start)
    yield 0.1
    for number in range(1, steps + 1):
        share = number / steps
        move(*(a + (b - a) * share for a, b in zip(start, end)))
        yield 0.1
    press("LEFTMOUSE", *end, "RELEASE")
    yield 0.3


def reflections(left, right):
    scene = stage(camera_at=(0.0, -5.0, 1.6), look_at=(0.0, 2.0, 1.2))
    shape("plane", size=20.0)
    mirror = shape("plane", principled("Mirror", Metallic=1.0, Roughness=0.0), size=4.0, location=(0.0, 2.0, 1.6),
                   rotation=(math.radians(90.0), 0.0, 0.0))  # fmt: skip
    scene.candela.bounces = 1
    for x, colour in ((-1.5, (0.8, 0.1, 0.1, 1.0)), (1.5, (0.1, 0.2, 0.8, 1.0))):
        shape("cube", principled(f"Colour {x}", Base_Color=colour), size=0.8, location=(x, 0.0, 0.4))
    activate(mirror)
    yield 0.3
    right.spaces.active.context = "OBJECT"
    yield from rendered(left)
    scroll(right, 2)
    yield 0.7
    picture("reflections_before.png")
    constraints = lambda: window().view_layer.objects.active.candela.reflection_editing_constraints  # noqa: E731
    with there(right):  # the button stands in the Properties editor
        result["pick"] = list(bpy.ops.candela.pick_reflection("INVOKE_DEFAULT"))
    yield 0.5
    picture("reflections_picking.png")
    yield from click(*on_screen(left, (0.0, 2.0, 1.2)))
    yield 0.5
    result["picked"] = len(constraints())
    yield from wait_for_rest()
    picture("reflections_picked.png")
    entry = constraints()[0]
    # What is mirrored here lies behind the viewer, and with it the target's handle: the other one is dragged.
    before = Vector(entry.point)
    x, y = on_screen(left, mirror.matrix_world @ before)
    yield from drag((x, y), (x + 60, y + 10))
    yield 0.5
    result["dragged"] = (Vector(constraints()[0].point) - before).length
    with there(left):
        bpy.ops.ed.undo()
    yield 0.5
    mirror = window().view_layer.objects.active
    result["undragged"] = (Vector(constraints()[0].point) - before).length
    with there(left):
        bpy.ops.ed.redo()
    yield 0.5
    scene, mirror = window().scene, window().view_layer.objects.active
    yield from wait_for_rest()
    picture("reflections_dragged.png")
    entry = constraints()[0]
    entry.target = mirror.matrix_world.inverted() @ Vector((1.5, 0.0, 0.4))
    yield from wait_for_rest()
    yield 0.5
    picture("reflections_turned.png")
    result["keyframe"] = [entry.keyframe_insert("target", frame=1)]
    entry.target = mirror.matrix_world.inverted() @ Vector((-1.5, 0.0, 0.4))
    result["keyframe"].append(entry.keyframe_insert("target", frame=10))
    scene.frame_set(1)
    yield from f12("reflections_1")
    scene.frame_set(10)
    yield from f12("reflections_10")
    # A second place, to which the lamp's highlight is moved; the first one keeps what it shows.
    mirror.active_material.node_tree.nodes["Principled BSDF"].inputs["Roughness"].default_value = 0.15
    yield from f12("reflections_without")
    with there(right):
        result["pick_second"] = list(bpy.ops.candela.pick_reflection("INVOKE_DEFAULT"))
    yield 0.5
    yield from click(*on_screen(left, HIGHLIGHT))
    yield 0.5
    result["picked_second"] = len(constraints())
    lamp = next(one for one in scene.objects if one.type == "LIGHT")
    mirror = window().view_layer.objects.active
    constraints()[1].target = mirror.matrix_world.inverted() @ lamp.matrix_world.translation
    yield from wait_for_rest()
    yield 0.5
    picture("reflections_highlight.png")
    yield from f12("reflections_with")
    spot = world_to_camera_view(scene, scene.camera, Vector(HIGHLIGHT))
    result["highlight"] = [spot.x, spot.y]
    with there(right):
        result["return_to_view"] = list(bpy.ops.candela.return_to_view("INVOKE_DEFAULT"))
    yield from wait_for_rest()
    picture("reflections_view.png")
    with there(right):
        result["pick_and_escape"] = list(bpy.ops.candela.pick_reflection("INVOKE_DEFAULT"))
    yield 0.3
    x, y = on_screen(left, (0.0, 2.0, 1.2))
    move(x, y)
    press("ESC", x, y)
    press("ESC", x, y, "RELEASE")
    yield 0.3
    result["after_escape"] = len(constraints())
    yield from bound_reflections(left, scene, lamp, constraints()[0])


def bound_reflections(left, scene, lamp, first):
    """The first target goes with the lamp, which is moved by G and keyframed; the heat map; and a mirror of it all."""
    mirror = window().view_layer.objects.active
    scene.frame_set(1)
    mirror.animation_data_clear()
    first.target_object = lamp
    lamp.keyframe_insert("location", frame=1)
    activate(lamp)
    before = lamp.location.copy()
    with there(left):
        result["moved"] = list(bpy.ops.transform.translate("EXEC_DEFAULT", value=(-3.0, 0.5, -1.5)))
    lamp.keyframe_insert("location", frame=10)
    result["lamp_moved"] = (lamp.location - before).length
    for frame in (1, 10):
        scene.frame_set(frame)
        yield from f12(f"reflections_lamp_{frame}")
    activate(mirror)
    scene.candela.edit_heat_shown = True
    yield from wait_for_rest()
    yield 0.5
    picture("reflections_heat.png")
    scene.candela.edit_heat_shown = False
    camera = scene.camera
    camera.rotation_euler.rotate_axis("Y", math.pi)  # away from the mirror, into another one
    shape(
        "plane", mirror.active_material, size=6.0, location=(0.0, -7.0, 1.6), rotation=(-math.radians(90.0), 0.0, 0.0)
    )
    scene.candela.bounces = 2  # one by each mirror
    yield from f12("reflections_mirrored")
    for one in mirror.candela.reflection_editing_constraints:
        one.enabled = False
    mirror.update_tag()
    yield from f12("reflections_mirrored_without")


def grass(left, right):
    stage(camera_at=(0.0, -1.2, 0.5), look_at=(0.0, 0.0, 0.05))
    meadow = principled("Meadow")
    ground = shape("plane", meadow, size=4.0)
    shape("cube", size=0.2, location=(0.0, 0.2, 0.1))
    activate(ground)
    yield 0.3
    right.spaces.active.context = "MATERIAL"
    yield from rendered(left)
    meadow.candela.grass_patch = "MEADOW"
    yield from wait_for_rest()
    scroll(right, 2)
    yield 0.7
    picture("grass.png")
    yield from f12("grass")


def relief(left, right):
    stage(camera_at=(0.0, -3.0, 1.5), look_at=(0.0, 0.0, 0.0))
    rough = principled("Rough")
    nodes, links = rough.node_tree.nodes, rough.node_tree.links
    noise, bumps = nodes.new("ShaderNodeTexNoise"), nodes.new("ShaderNodeDisplacement")
    bumps.inputs["Scale"].default_value = 0.3
    links.new(noise.outputs[0], bumps.inputs["Height"])
    links.new(bumps.outputs[0], next(n for n in nodes if n.type == "OUTPUT_MATERIAL").inputs["Displacement"])
    rough.displacement_method = "DISPLACEMENT"
    ground = shape("plane", rough, size=4.0)
    activate(ground)
    yield 0.3
    right.spaces.active.context = "MATERIAL"
    yield from rendered(left)
    scroll(right, 2)
    yield 0.7
    picture("relief.png")
    yield from f12("relief")


def caustics(left, right):
    scene = stage(camera_at=(0.0, -4.0, 2.5), look_at=(0.0, 0.0, 0.3))
    shape("plane", size=20.0)
    scene.candela.bounces = 1
    ball = shape("uv_sphere", principled("Glass", Transmission_Weight=1.0, Roughness=0.0), radius=0.6,
                 location=(0.0, 0.0, 0.8))  # fmt: skip
    ball.data.shade_smooth()
    next(o for o in scene.objects if o.type == "LIGHT").data.size = 0.1
    right.spaces.active.context = "RENDER"
    yield from rendered(left)
    picture("caustics.png")
    scroll(right, 1)
    yield 0.7
    picture("caustics_last_picture.png")
    yield from f12("caustics")


run(steps)
