"""A stage for small scenes that are rendered by the real engine, through Blender, and read back pass by pass."""

import contextlib
import warnings

import bpy
import numpy as np
import OpenEXR
import pytest

from addon import engine
from addon.compare import reference
from addon.compare.reference import render_passes
from addon.frame import ledger
from addon.frame.settings import PARTIAL
from addon.kernels.ranks import ids_of


def own_share(scene):
    """For `render_passes`: slices and early ends as the scene has them, which a measured picture has not."""
    return [(scene.candela, param.name, getattr(scene.candela, param.name)) for param in PARTIAL]


class Stage:
    """One Blender scene that tests clear and fill. It stays the same scene, so that shaders compile once."""

    def __init__(self):
        bpy.ops.wm.read_factory_settings(use_empty=True)
        self.scene = bpy.context.scene
        self.clear()

    def clear(self):
        """An empty scene: no world, square pixels, a filter so narrow that a pixel is the value at its centre."""
        bpy.data.batch_remove([*bpy.data.objects, *bpy.data.meshes, *bpy.data.lights, *bpy.data.cameras])
        bpy.data.batch_remove([*bpy.data.materials, *bpy.data.worlds, *bpy.data.images])
        scene, render = self.scene, self.scene.render
        for name in list(scene.candela.bl_rna.properties.keys()):
            if name not in ("rna_type", "name"):
                scene.candela.property_unset(name)
        render.filter_size = 0.01
        render.film_transparent = render.use_border = False
        render.resolution_x = render.resolution_y = 32
        render.resolution_percentage = 100
        render.pixel_aspect_x = render.pixel_aspect_y = 1

    # Things --------------------------------------------------------------------------------------------------------

    def link(self, name, data, location=(0, 0, 0), turn=(0, 0, 0), scale=(1, 1, 1)):
        placed = bpy.data.objects.new(name, data)
        self.scene.collection.objects.link(placed)
        placed.location, placed.rotation_euler, placed.scale = location, turn, scale
        return placed

    def mesh(self, vertices, faces=(), edges=(), material=None, **placement):
        made = bpy.data.meshes.new("Mesh")
        made.from_pydata(vertices, edges, faces)
        if material is not None:
            made.materials.append(material)
        return self.link("Mesh", made, **placement)

    def rectangle(self, low, high, z=0.0, material=None, **placement):
        """A rectangle in a plane of constant z, facing up; `low` and `high` are its corners in x and y."""
        (x0, y0), (x1, y1) = low, high
        corners = [(x0, y0, z), (x1, y0, z), (x1, y1, z), (x0, y1, z)]
        return self.mesh(corners, [(0, 1, 2, 3)], material=material, **placement)

    def card(self, material, left, right, **placement):
        """A square of two metres that shows an image between u = `left` and `right`."""
        made = self.rectangle((-1, -1), (1, 1), material=material, **placement)
        layer = made.data.uv_layers.new(name="UVMap")
        for corner, place in enumerate([(left, 0), (right, 0), (right, 1), (left, 1)]):
            layer.uv[corner].vector = place
        return made

    def remove(self, placed):
        """Take an object out of the file, with its mesh and materials."""
        data = placed.data
        bpy.data.batch_remove([placed, *(material for material in data.materials if material), data])

    def floor(self, half=20.0, **options):
        """A white Lambertian plane at z = 0 that reaches beyond the picture."""
        options.setdefault("material", self.diffuse())
        return self.rectangle((-half, -half), (half, half), **options)

    def blocker(self, low, high, z, **options):
        """A rectangle that casts shadows and that the camera does not see."""
        made = self.rectangle(low, high, z, **options)
        made.visible_camera = False
        return made

    def light(self, kind, location=(0, 0, 2), turn=(0, 0, 0), scale=(1, 1, 1), **settings):
        """A light that shines down with power 100 (suns: 1), unless `settings` of the data-block say otherwise."""
        data = bpy.data.lights.new(kind, kind)
        data.energy = 1.0 if kind == "SUN" else 100.0
        for name, value in settings.items():
            setattr(data, name, value)
        return self.link(kind, data, location, turn, scale)

    def enlarge(self, scale):
        """All that stands in the scene, `scale` times as large and as far apart; powers stay."""
        for placed in self.scene.objects:
            placed.location *= scale
            if placed.type == "LIGHT":
                placed.data.shadow_soft_size *= scale
            elif placed.type == "MESH":
                placed.scale *= scale
            else:
                placed.data.clip_start, placed.data.clip_end = 0.01 * scale, 100 * scale

    def camera_above(self, span=4.0, height=10.0):
        """An orthographic camera that looks down on `span` metres around the origin, +Y up."""
        data = bpy.data.cameras.new("Camera")
        data.type, data.ortho_scale = "ORTHO", span
        self.scene.camera = self.link("Camera", data, (0, 0, height))
        return self.scene.camera

    def camera(self, location, turn, angle=0.9):
        data = bpy.data.cameras.new("Camera")
        data.angle = angle
        self.scene.camera = self.link("Camera", data, location, turn)
        return self.scene.camera

    def world(self, color=(1, 1, 1), strength=1.0):
        made = bpy.data.worlds.new("World")
        self.use_nodes(made)
        background = next(node for node in made.node_tree.nodes if node.type == "BACKGROUND")
        background.inputs["Color"].default_value = (*color, 1)
        background.inputs["Strength"].default_value = strength
        self.scene.world = made
        return made

    # Materials -----------------------------------------------------------------------------------------------------

    def use_nodes(self, block):
        if bpy.app.version < (5, 0):
            block.use_nodes = True

    def material(self, node_type, **inputs):
        """One shader node with the given inputs (underscores for spaces), straight into the output."""
        made = bpy.data.materials.new(node_type)
        self.use_nodes(made)
        nodes = made.node_tree.nodes
        nodes.clear()
        shader, output = nodes.new(node_type), nodes.new("ShaderNodeOutputMaterial")
        made.node_tree.links.new(shader.outputs[0], output.inputs["Surface"])
        for name, value in inputs.items():
            shader.inputs[name.replace("_", " ")].default_value = value
        return made

    def diffuse(self, albedo=1.0, roughness=0.0):
        return self.material("ShaderNodeBsdfDiffuse", Color=(albedo, albedo, albedo, 1), Roughness=roughness)

    def principled(self, **inputs):
        return self.material("ShaderNodeBsdfPrincipled", **inputs)

    def see_through(self, opacity):
        """A black material that lets 1 - opacity of the light pass."""
        return self.principled(Base_Color=(0, 0, 0, 1), Alpha=opacity)

    # Pictures ------------------------------------------------------------------------------------------------------

    def render(self, samples=1, size=(32, 32), seed=0, engine="CANDELA", finite=True, bounces=0):
        """Passes by Candela's names, (H, W, C) float32, bottom row first."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", DeprecationWarning)
            extra = own_share(self.scene)
            images = render_passes(self.scene, engine, samples, seed, size=size, bounces=bounces, extra=extra).images
        if engine == "CANDELA" and finite:
            assert ledger.latest().bad_pixels == 0
            for name, pixels in images.items():
                assert np.isfinite(pixels).all(), f"{name} has pixels that are not finite"
        return images

    @property
    def renderer(self):
        return engine.session(self.scene, "final").renderer

    @property
    def ledger(self):
        return ledger.latest()


@pytest.fixture(scope="module")
def kept_stage(registered):
    with contextlib.suppress(ReferenceError):
        engine.free_sessions()
    return Stage()


@pytest.fixture
def stage(kept_stage):
    kept_stage.clear()
    return kept_stage


ORDER = "XYZWUVRGBArgba"


def read_with_openexr(path) -> dict[str, np.ndarray]:
    """As addon.snapshot.exr.read_exr, by the reference implementation; and the file's header under "header"."""
    with OpenEXR.File(str(path), separate_channels=True) as file:
        found: dict[str, dict[str, np.ndarray]] = {}
        for part in range(len(file.parts)):
            for name, channel in file.channels(part).items():
                layer, _, letter = name.rpartition(".")
                found.setdefault(layer, {})[letter] = np.asarray(channel.pixels, np.float32)[::-1]
        header = dict(file.header(0))
    stacked = {
        layer: np.stack([channels[k] for k in sorted(channels, key=lambda k: f"{ORDER.find(k):02d}")], -1)
        for layer, channels in found.items()
    }
    return stacked | {"header": header}


def all_of(layers: dict, view_layer: str) -> dict:
    prefix = view_layer + "."
    named = {name.removeprefix(prefix): pixels for name, pixels in layers.items() if name.startswith(prefix)}
    made = next((layers[name] for name in ("Composite.Combined", "") if name in layers), None)  # by the compositor
    return {**named, "combined": named["Combined"], "composed": made, "header": layers["header"]}


def coverage(passes, kind, name) -> np.ndarray:
    """(H, W) what a reader of the standard finds for a name."""
    ranks = [passes[key] for key in sorted(passes) if key.startswith(f"Crypto{kind}")]
    pairs = np.concatenate(ranks, axis=-1)
    wanted = ids_of([name])[0]
    return np.where(pairs[..., 0::2] == wanted, pairs[..., 1::2], 0.0).sum(axis=-1)


@pytest.fixture
def written(stage, monkeypatch):
    """The stage; `written.both(samples)` are the passes of Candela and of Cycles by the names in their files."""
    monkeypatch.setattr(reference, "read_exr", read_with_openexr)
    monkeypatch.setattr(reference, "named_images", all_of)
    layer = stage.scene.view_layers[0]

    def rendered(engine, samples, size=(48, 40), extra=(), **options):
        extra = [*own_share(stage.scene), *extra]
        return reference.render_passes(stage.scene, engine, samples, 1, size=size, extra=extra, **options).images

    stage.written = rendered
    stage.layer, stage.coverage = layer, coverage
    stage.both = lambda samples, cycles_samples=None, **options: (
        rendered("CANDELA", samples, **options), rendered("CYCLES", cycles_samples or samples, **options)
    )  # fmt: skip
    yield stage
    for name in dir(layer):
        if name.startswith("use_pass_") and name not in ("use_pass_combined",):
            setattr(layer, name, False)
    while layer.aovs:
        layer.aovs.remove(layer.aovs[0])
    while len(layer.lightgroups):
        layer.lightgroups.remove(layer.lightgroups[0])
    layer.cycles.denoising_store_passes = False
    layer.pass_alpha_threshold, layer.pass_cryptomatte_depth = 0.5, 6


def places(size, span=4.0):
    """World x, y of the pixel centres under `camera_above`, each (H, W); the longer side spans `span`."""
    width, height = size
    step = span / max(size)
    y, x = np.mgrid[0:height, 0:width]
    return (x + 0.5 - width / 2) * step, (y + 0.5 - height / 2) * step
