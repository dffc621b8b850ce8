"""Scenes made at random, beside Cycles: `python -m bench random`.

Each number makes one scene: objects of several kinds under modifiers, Principled materials with random values, textures
and mixes, lamps of all kinds and shapes, a world, a camera; in metres, hundredths or hundreds of them. Both engines
render it without bounces, or with all light, and what differs by more than noise is printed with what the scene holds.
`--save` writes a scene to a file instead, to be taken apart. `--alone SECONDS` renders as many as fit in that time by
Candela alone (bench/long_runs.py).
"""

from __future__ import annotations

import argparse
import math
import random
from collections.abc import Callable
from dataclasses import dataclass, field

import bpy
import mathutils
import numpy as np

from bench import long_runs
from bench.quick import size_of
from bench.shading import tree_of

UNITS = (1.0, 1.0, 1.0, 0.01, 100.0)  # metres of what is about a metre large
WORST = 0.01  # of the pixels: edges in few samples
TEXTURES = ("Checker", "Noise", "Voronoi", "Wave", "Brick", "Magic", "Gradient")
COORDINATES = ("Generated", "Object", "UV", "Normal")
VARIED = (
    "Base Color", "Base Color", "Roughness", "Metallic", "Alpha", "Sheen Weight", "Coat Weight", "Specular IOR Level",
    "Emission Color", "Normal",
)  # fmt: skip
MIXED = ("Diffuse", "Glossy", "Transparent", "Sheen", "Metallic", "Translucent", "Toon")
OBJECTS: dict[str, Callable] = {
    "cube": lambda: bpy.ops.mesh.primitive_cube_add(size=1.6),
    "sphere": lambda: bpy.ops.mesh.primitive_uv_sphere_add(segments=24, ring_count=12),
    "ico sphere": lambda: bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=2),
    "torus": bpy.ops.mesh.primitive_torus_add,
    "monkey": lambda: bpy.ops.mesh.primitive_monkey_add(size=2),
    "cone": bpy.ops.mesh.primitive_cone_add,
    "grid": lambda: bpy.ops.mesh.primitive_grid_add(x_subdivisions=12, y_subdivisions=12),
    "curve": lambda: bpy.ops.curve.primitive_bezier_curve_add(radius=1.5),
    "text": bpy.ops.object.text_add,
    "metaball": lambda: bpy.ops.object.metaball_add(type="BALL", radius=1),
}
MODIFIERS = {  # not Bevel, whose normals Blender 5.2 computes anew each time, and otherwise
    "SUBSURF": {"levels": 2, "render_levels": 2}, "ARRAY": {"count": 3}, "WIREFRAME": {"thickness": 0.08},
    "SOLIDIFY": {"thickness": 0.1}, "WEIGHTED_NORMAL": {},
}  # fmt: skip
HIDDEN = {"visible_shadow": 0.1, "visible_camera": 0.06, "visible_diffuse": 0.06}  # how often


@dataclass
class Draws:
    """Draws of one scene, and what was drawn, in words."""

    number: int
    notes: list[str] = field(default_factory=list)
    alike: int = 1  # scenes in a row that hold things of the same kinds

    def __post_init__(self):
        self.draw = self.kinds = random.Random(self.number)

    def about(self, thing: str) -> None:
        """What kinds of it there are is drawn next: alike for scenes that are."""
        if self.alike > 1:
            self.kinds = random.Random(f"{self.number // self.alike} {thing}")

    def happens(self, chance: float, note: str = "") -> bool:
        drawn = self.kinds.random() < chance
        if drawn and note:
            self.notes.append(note)
        return drawn

    def choice(self, of, note: bool = True):
        drawn = self.kinds.choice(list(of))
        if note:
            self.notes.append(str(drawn))
        return drawn

    def color(self) -> tuple[float, float, float, float]:
        return (self.draw.random(), self.draw.random(), self.draw.random(), 1.0)


def build(number: int, alike: int = 1) -> tuple[bpy.types.Scene, str]:
    """Scene `number` in an empty file, and what it holds. `alike` scenes in a row share their materials, and kinds of
    lamps, world and camera, whose programs are then compiled once for all of them."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene, draws = bpy.context.scene, Draws(number, alike=alike)
    unit = draws.draw.choice(UNITS)
    draws.notes.append(f"{unit:g} m")
    painted = draws if alike == 1 else Draws(number // alike, draws.notes)
    materials = [_material(painted) for _ in range(4)]
    bpy.ops.mesh.primitive_plane_add(size=12 * unit)
    bpy.context.object.data.materials.append(materials[0])
    for _ in range(draws.draw.randint(2, 6)):
        _object(draws, unit, materials)
    for k in range(draws.draw.randint(1, 4)):
        draws.about(f"lamp {k}")
        _lamp(draws, unit, scene)
    draws.about("world")
    _world(draws, scene)
    draws.about("camera")
    _camera(draws, unit, scene)
    scene.view_settings.view_transform = "Standard"
    return scene, ", ".join(draws.notes)


def _material(draws: Draws) -> bpy.types.Material:
    draws.notes.append("material:")
    made = bpy.data.materials.new("Material")
    tree = tree_of(made)
    shader = next(node for node in tree.nodes if node.type == "BSDF_PRINCIPLED")
    draw = draws.draw
    values = [
        (1.0, {"Base Color": draws.color(), "Roughness": draw.uniform(0.1, 1.0)}),
        (0.4, {"Metallic": draw.choice((1.0, draw.random()))}),
        (0.2, {"Specular IOR Level": draw.random()}), (0.15, {"Specular Tint": draws.color()}),
        (0.2, {"IOR": draw.uniform(1.1, 2.5)}), (0.15, {"Diffuse Roughness": draw.random()}),
        (0.2, {"Anisotropic": draw.random(), "Anisotropic Rotation": draw.random()}),
        (0.2, {"Coat Weight": draw.random(), "Coat Roughness": draw.uniform(0.1, 0.6), "Coat Tint": draws.color()}),
        (0.2, {"Sheen Weight": draw.random(), "Sheen Roughness": draw.uniform(0.1, 1.0)}),
        (0.1, {"Emission Color": draws.color(), "Emission Strength": draw.uniform(0.05, 1.0)}),
        (0.12, {"Alpha": draw.uniform(0.2, 1.0)}),
    ]  # fmt: skip
    for chance, inputs in values:
        if draws.happens(chance):
            for name, value in inputs.items():
                shader.inputs[name].default_value = value
                draws.notes.append(f"{name} {value:.2f}" if isinstance(value, float) else name)
    if draws.happens(0.6):
        _texture(draws, tree, shader)
    if draws.happens(0.25):
        _mix(draws, tree, shader)
    return made


def _texture(draws: Draws, tree, shader) -> None:
    """Colours of a texture on one of the shader's inputs."""
    texture = tree.nodes.new(f"ShaderNodeTex{draws.choice(TEXTURES)}")
    if "Scale" in texture.inputs:
        texture.inputs["Scale"].default_value = draws.draw.uniform(0.5, 4.0)
    place, turned = tree.nodes.new("ShaderNodeTexCoord"), tree.nodes.new("ShaderNodeMapping")
    turned.inputs["Rotation"].default_value = [draws.draw.uniform(0, 3) for _ in "xyz"]
    turned.inputs["Location"].default_value = [draws.draw.random() for _ in "xyz"]
    ramp = tree.nodes.new("ShaderNodeValToRGB")
    for element in ramp.color_ramp.elements:
        element.color = draws.color()
    factor = next((one for one in texture.outputs if one.name in ("Fac", "Factor", "Distance")), texture.outputs[0])
    tree.links.new(place.outputs[draws.choice(COORDINATES)], turned.inputs["Vector"])
    tree.links.new(turned.outputs[0], texture.inputs["Vector"])
    tree.links.new(factor, ramp.inputs[0])
    name, colors = draws.choice(VARIED), ramp.outputs[0]
    if name == "Normal":
        bump = tree.nodes.new("ShaderNodeBump")
        bump.inputs["Strength"].default_value = draws.draw.uniform(0.1, 1.0)
        bump.inputs["Distance"].default_value = draws.draw.uniform(0.02, 0.3)
        tree.links.new(colors, bump.inputs["Height"])
        colors = bump.outputs[0]
    if name == "Emission Color":
        shader.inputs["Emission Strength"].default_value = draws.draw.uniform(0.05, 0.5)
    tree.links.new(colors, shader.inputs[name])


def _mix(draws: Draws, tree, shader) -> None:
    """A second shader mixed with or added to the first."""
    other = tree.nodes.new(f"ShaderNodeBsdf{draws.choice(MIXED)}")
    if "Roughness" in other.inputs:
        other.inputs["Roughness"].default_value = draws.draw.uniform(0.15, 1.0)
    both = tree.nodes.new(f"ShaderNode{draws.choice(('Mix', 'Mix', 'Add'))}Shader")
    first, second = (socket for socket in both.inputs if socket.type == "SHADER")
    if len(both.inputs) > 2:
        both.inputs[0].default_value = draws.draw.random()
        if draws.happens(0.3, "by Fresnel"):
            tree.links.new(tree.nodes.new("ShaderNodeFresnel").outputs[0], both.inputs[0])
    output = next(node for node in tree.nodes if node.type == "OUTPUT_MATERIAL")
    tree.links.new(shader.outputs[0], first)
    tree.links.new(other.outputs[0], second)
    tree.links.new(both.outputs[0], output.inputs["Surface"])


def _object(draws: Draws, unit: float, materials: list[bpy.types.Material]) -> None:
    draw = draws.draw
    OBJECTS[draws.choice(OBJECTS)]()
    made = bpy.context.object
    if made.type == "CURVE":
        made.data.bevel_depth = 0.15
    elif made.type == "FONT":
        made.data.extrude = 0.1
    for _ in range(draw.choice((1, 1, 2))):
        made.data.materials.append(draw.choice(materials))
    if made.type == "MESH":
        if len(made.data.materials) > 1:
            slots = np.array([draw.randrange(2) for _ in made.data.polygons], np.int32)
            made.data.polygons.foreach_set("material_index", slots)
        if draws.happens(0.4, "smooth"):
            made.data.shade_smooth()
        if draws.happens(0.45):
            kind = draws.choice(MODIFIERS)
            modifier = made.modifiers.new(kind, kind)
            for name, value in MODIFIERS[kind].items():
                setattr(modifier, name, value)
    made.location = [unit * draw.uniform(-2, 2), unit * draw.uniform(-2, 2), unit * draw.uniform(0, 1.5)]
    made.rotation_euler = [draw.uniform(-3, 3) for _ in "xyz"]
    uneven = [draw.uniform(0.4, 1.5) for _ in "xyz"]
    scale = draw.choice([(1, 1, 1), (1, 1, 1), uneven, (-1, 1, 1)])
    made.scale = unit * draw.uniform(0.3, 0.9) * np.array(scale)
    for name, chance in HIDDEN.items():
        setattr(made, name, not draws.happens(chance, f"not {name}"))
    made.is_holdout = draws.happens(0.05, "held out")


def _lamp(draws: Draws, unit: float, scene: bpy.types.Scene) -> None:
    draw, kind = draws.draw, draws.choice(("POINT", "SPOT", "SUN", "AREA"))
    light = bpy.data.lights.new("Lamp", kind)
    placed = bpy.data.objects.new("Lamp", light)
    scene.collection.objects.link(placed)
    placed.location = [unit * draw.uniform(-4, 4), unit * draw.uniform(-4, 4), unit * draw.uniform(1.5, 5)]
    target = mathutils.Vector((unit * draw.uniform(-1, 1), unit * draw.uniform(-1, 1), 0))
    placed.rotation_euler = (target - placed.location).to_track_quat("-Z", "Y").to_euler()
    light.color = [draw.uniform(0.3, 1) for _ in "rgb"]
    light.energy = draw.uniform(0.3, 4) if kind == "SUN" else draw.uniform(100, 600) * unit**2
    if kind in ("POINT", "SPOT"):
        light.shadow_soft_size = draw.choice((0, 0.05, 0.3, 1)) * unit
        light.use_soft_falloff = draw.random() < 0.5
    if kind == "SPOT":
        light.spot_size, light.spot_blend = draw.uniform(0.3, 2.5), draw.random()
    if kind == "SUN":
        light.angle = draw.choice((0, 0.01, 0.1, 0.6))
    if kind == "AREA":
        light.shape = draws.choice(("SQUARE", "RECTANGLE", "DISK", "ELLIPSE"))
        light.size, light.size_y = (draw.uniform(0.1, 3) * unit for _ in "uv")
        light.spread = draw.choice((math.pi, math.pi, draw.uniform(0.3, 3)))
    if hasattr(light, "exposure") and draws.happens(0.2, "exposure"):
        light.exposure = draw.uniform(-1, 1)
    if hasattr(light, "use_temperature") and draws.happens(0.2, "temperature"):
        light.use_temperature, light.temperature = True, draw.uniform(2000, 9000)
    light.use_shadow = not draws.happens(0.1, "no shadow")
    if draws.happens(0.15, "scaled"):
        placed.scale = [draw.uniform(0.5, 2) for _ in "xyz"]


def _world(draws: Draws, scene: bpy.types.Scene) -> None:
    scene.world = bpy.data.worlds.new("World")
    tree = tree_of(scene.world)
    background = next(node for node in tree.nodes if node.type == "BACKGROUND")
    background.inputs["Color"].default_value = draws.color()
    background.inputs["Strength"].default_value = draws.draw.choice((0, 0, 0.05, 0.3, 1))
    if draws.happens(0.15, "sky"):
        sky = tree.nodes.new("ShaderNodeTexSky")
        tree.links.new(sky.outputs[0], background.inputs["Color"])
        background.inputs["Strength"].default_value = 0.1
    elif draws.happens(0.2, "gradient"):
        place, gradient = tree.nodes.new("ShaderNodeTexCoord"), tree.nodes.new("ShaderNodeTexGradient")
        tree.links.new(place.outputs["Generated"], gradient.inputs[0])
        tree.links.new(gradient.outputs[0], background.inputs["Color"])


def _camera(draws: Draws, unit: float, scene: bpy.types.Scene) -> None:
    draw = draws.draw
    data = bpy.data.cameras.new("Camera")
    scene.camera = bpy.data.objects.new("Camera", data)
    scene.collection.objects.link(scene.camera)
    turn, distance = draw.uniform(0, 2 * math.pi), draw.uniform(4, 7) * unit
    scene.camera.location = (distance * math.cos(turn), distance * math.sin(turn), unit * draw.uniform(1, 4))
    towards = mathutils.Vector((0, 0, 0.6 * unit)) - scene.camera.location
    scene.camera.rotation_euler = towards.to_track_quat("-Z", "Y").to_euler()
    data.lens, data.clip_start, data.clip_end = draw.uniform(22, 60), 0.01 * unit, 1000 * unit
    if draws.happens(0.2, "orthographic"):
        data.type, data.ortho_scale = "ORTHO", 6 * unit
    if draws.happens(0.15, "shifted"):
        data.shift_x, data.shift_y = draw.uniform(-0.2, 0.2), draw.uniform(-0.2, 0.2)
    if draws.happens(0.1, "depth of field"):
        data.dof.use_dof, data.dof.focus_distance = True, distance
        data.dof.aperture_fstop = data.lens / 1000 / (unit * draw.uniform(0.02, 0.2))
    scene.render.film_transparent = draws.happens(0.1, "transparent film")


def differences(own: dict, first: dict, second: dict, tolerance: float) -> tuple[list[str], bool]:
    """By light path its relMSE, without the reference's noise and the worst pixels, and its bias; and whether one is
    off, by more than `tolerance`, or by more than a hundredth of the light and what two references differ by."""
    from addon.compare.metrics import relative_squared_error

    found, off = [], False
    for path, pixels in own.items():
        one, other, mine = (picture[..., :3].astype(float) for picture in (first[path], second[path], pixels))
        mean, half = (one + other) / 2, (one - other) / 2
        if not mean.any() and not mine.any():
            continue
        errors = relative_squared_error(mine, mean)
        kept = np.argsort(errors, axis=None)[: errors.size - math.ceil(WORST * errors.size)]
        noise = relative_squared_error(mean + half, mean)
        error = float(errors.ravel()[kept].mean() - noise.ravel()[kept].mean())
        light = max(float(mean.mean()), 1e-30)
        bias, apart = float(mine.mean()) / light, abs(float(one.mean() - other.mean())) / light
        off = off or not np.isfinite(error) or error > tolerance or abs(bias - 1) > 0.015 + 2 * apart
        found.append(f"{path} {error:.4f} {bias:.3f}")
    return found, off


def add_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--first", type=int, default=0, metavar="N", help="number of the first scene (default 0)")
    parser.add_argument("--count", type=int, default=20, metavar="N", help="scenes (default 20, five seconds each)")
    parser.add_argument("--samples", type=int, default=64, metavar="N", help="default 64; the references have twice it")
    parser.add_argument("--size", type=size_of, default=(96, 72), metavar="WxH", help="default 96x72")
    parser.add_argument("--all-light", action="store_true", help="with bounces")
    parser.add_argument("--tolerance", type=float, default=0.01, metavar="E", help="relMSE that is off (default 0.01)")
    parser.add_argument("--alone", type=float, metavar="SECONDS", help="as many as fit, by Candela alone, with bounces")
    parser.add_argument(
        "--alike", type=int, default=1, metavar="N", help="of those, N in a row are of the same kinds (default 1)"
    )
    parser.add_argument("--same", action="store_true", help="with --alone: the first scene again and again")
    parser.add_argument("--keep", action="store_true", help="with --alone: go on after the last scene that is kept")
    parser.add_argument("--every", type=int, default=25, metavar="N", help="scenes between two looks at memory (25)")
    parser.add_argument("--save", metavar="FILE.blend", help="write the first scene to a file and render nothing")


def command(options: argparse.Namespace) -> int:
    import addon
    from addon.compare.passes import light_paths
    from addon.compare.reference import render_passes

    addon.register()
    if options.save:
        _, notes = build(options.first)
        bpy.ops.wm.save_as_mainfile(filepath=options.save)
        print(notes)
        return 0
    if options.alone is not None:
        return long_runs.alone(options)
    off = 0
    for number in range(options.first, options.first + options.count):
        scene, notes = build(number)

        def render(engine: str, samples: int, seed: int, scene=scene) -> dict:
            direct = not options.all_light
            return light_paths(
                render_passes(scene, engine, samples, seed, direct_only=direct, size=options.size).images
            )

        own = render("CANDELA", options.samples, 3)
        first, second = (render("CYCLES", 2 * options.samples, seed) for seed in (1, 2))
        found, is_off = differences(own, first, second, options.tolerance)
        off += is_off
        print(
            f"{number} {'off' if is_off else 'alike'}: {'; '.join(found)}" + (f"\n    {notes}" if is_off else ""),
            flush=True,
        )
    print(f"{off} of {options.count} scenes are off.")
    return 0
