"""Has Cycles render a tile of grass for all directions of view and light, view by view, so that it can go on later.

The camera is orthographic with a sheared matrix: its picture is the tile's square on top of the blades, whatever the
direction of the rays. A texel's ray passes through its place in that plane, so that no picture is resampled, on any
device. Light is one sun of irradiance pi and no angle; a Lambertian texel of albedo a, lit head-on, then stores a. One
light for each render: of several, each would see a part of the samples only.

Around the tile stand copies of it, as far as its shadows and slanting views reach. Each finished view is a file of its
own in a folder beside the patch; a run that was stopped goes on after the last of them, and one with other settings
begins anew. The scene that is rendered is a temporary one; the open file keeps its own.
"""

from __future__ import annotations

import contextlib
import hashlib
import math
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path

import bpy
import mathutils
import numpy as np

from ..snapshot.exr import ExrError, read_exr
from .blades import COLORS, SOIL, TRANSLUCENT, Recipe, blades_of
from .directions import LIGHTS, VIEWS, Rings, finer
from .patch import Patch, PatchError, compressed_patch, read_arrays, save, write_arrays

BOUNCES = 4
FINER_TEXELS, FINER_SAMPLES = 32, 4  # of pictures of which the mean alone is kept
GENERATION = 1  # to be raised when the same settings give other pictures


@dataclass(frozen=True)
class Order:
    """What is to be rendered."""

    recipe: Recipe = field(default_factory=Recipe)
    texels: int = 64
    views: Rings = VIEWS
    lights: Rings = LIGHTS
    samples: int = 16
    luma: int = 8
    chroma: int = 2
    finer: bool = True  # means under lights in between are kept

    def __post_init__(self):
        if not 4 <= self.texels <= 256 or not 1 <= self.samples <= 65536:
            raise ValueError("A patch has 4 to 256 texels along a side, and 1 to 65536 samples.")

    @property
    def fingerprint(self) -> str:
        """Equal orders give equal pictures; how they are compressed is no part of it."""
        parts = (GENERATION, asdict(self.recipe), self.texels, self.views, self.lights, self.samples)
        parts += (self.finer_lights,) if self.finer else ()
        return hashlib.blake2b(repr(parts).encode(), digest_size=12).hexdigest()

    @property
    def finer_lights(self) -> Rings | None:
        return finer(self.lights) if self.finer else None


def generate(order: Order, path: Path) -> Iterator[tuple[int, int]]:
    """Render what is missing and write the patch; yields (views done, views in all) after each. Raises PatchError."""
    folder = views_folder(path)
    missing = [view for view in range(order.views.number) if read_view(order, folder, view) is None]
    done = order.views.number - len(missing)
    yield done, order.views.number
    if missing:
        with studio(order) as stage:
            for view in missing:
                direction = order.views.vectors[view]
                means = stage.means(direction, order.finer_lights.vectors if order.finer else np.zeros((0, 3)))
                write_view(order, folder, view, *stage.render(direction, order.lights.vectors), means)
                done += 1
                yield done, order.views.number
    save(patch_of(order, folder), path)
    for view in range(order.views.number):
        with contextlib.suppress(OSError):
            view_file(folder, view).unlink()
    with contextlib.suppress(OSError):
        folder.rmdir()


def patch_of(order: Order, folder: Path) -> Patch:
    """The patch of rendered views."""

    def found(view: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        content = read_view(order, folder, view)
        if content is None:
            raise PatchError(f"{view_file(folder, view)} is missing or damaged: run again to render that view.")
        return content

    heights = np.stack([found(view)[1] for view in range(order.views.number)])
    means = np.stack([found(view)[2] for view in range(order.views.number)]) if order.finer else None
    recipe = order.recipe
    return compressed_patch(
        recipe.size, recipe.height, order.views, order.lights, lambda view: found(view)[0], heights, order.luma,
        order.chroma, order.finer_lights, means,
    )  # fmt: skip


# Finished views ------------------------------------------------------------------------------------------------------


def views_folder(path: Path) -> Path:
    """Where the views of a patch stand until it is done."""
    return path.with_name(path.name + ".views")


def view_file(folder: Path, view: int) -> Path:
    return folder / f"view_{view:04}.npz"


def write_view(
    order: Order, folder: Path, view: int, pictures: np.ndarray, heights: np.ndarray, means: np.ndarray
) -> None:
    """Raises PatchError, as on a full disk."""
    about = np.frombuffer(order.fingerprint.encode(), np.uint8)
    write_arrays(view_file(folder, view), {"about": about, "pictures": pictures, "heights": heights, "means": means})


def read_view(order: Order, folder: Path, view: int) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """(L, N, N, 3) pictures, (N, N) heights and (M, 3) means under the finer lights, or None where they are missing,
    damaged or of another order."""
    if not view_file(folder, view).is_file():
        return None
    try:
        arrays = read_arrays(view_file(folder, view))
        pictures, heights = arrays["pictures"], arrays["heights"]
        means = arrays["means"] if order.finer else np.zeros((0, 3), np.float32)
        own = bytes(arrays["about"]) == order.fingerprint.encode()
    except (PatchError, KeyError):
        return None
    n = order.texels
    fits = pictures.shape == (order.lights.number, n, n, 3) and heights.shape == (n, n)
    fits = fits and means.shape == (order.finer_lights.number if order.finer else 0, 3)
    return (pictures, heights, means) if own and fits and np.isfinite(pictures).all() else None


# The scene -----------------------------------------------------------------------------------------------------------


class Studio:
    """A scene with the tile, its copies, a sun and a camera."""

    def __init__(self, order: Order, scene: bpy.types.Scene, file: Path):
        self.order, self.scene, self.file = order, scene, file
        self.sun = next(one for one in scene.objects if one.type == "LIGHT")
        self.camera = scene.camera

    def render(self, view: np.ndarray, lights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Pictures (L, N, N, 3) of a view under each of the lights, pi radiance / irradiance head-on, and heights
        (N, N) in metres above the ground. Unit vectors to the viewer and the light."""
        recipe, n = self.order.recipe, self.scene.render.resolution_x
        away = 4.0 * recipe.height / view[2] + recipe.size
        matrix = np.eye(4)
        matrix[:3, 2] = view
        matrix[:3, 3] = np.array([0.5 * recipe.size, 0.5 * recipe.size, recipe.height]) + away * view
        self.camera.matrix_parent_inverse = mathutils.Matrix(matrix.tolist())
        self.camera.data.clip_end = 4.0 * away
        pictures, heights = [], None
        for light in lights:
            self.sun.rotation_euler = mathutils.Vector(light).to_track_quat("Z", "Y").to_euler()
            combined, position = self._pictures()
            pictures.append(combined[..., :3])
            if heights is None:
                heights = np.clip(position[..., 2], 0.0, recipe.height)
        stacked = np.stack(pictures).astype(np.float32)
        if stacked.shape[1:] != (n, n, 3):
            raise PatchError("Cycles rendered a picture of another size than was asked for.")
        return stacked, heights.astype(np.float32)

    def means(self, view: np.ndarray, lights: np.ndarray) -> np.ndarray:
        """(M, 3) means of such pictures, which are small ones."""
        if not len(lights):
            return np.zeros((0, 3), np.float32)
        render, cycles = self.scene.render, self.scene.cycles
        before = render.resolution_x, cycles.samples
        render.resolution_x = render.resolution_y = FINER_TEXELS
        cycles.samples = FINER_SAMPLES
        found = self.render(view, lights)[0].mean(axis=(1, 2))
        render.resolution_x = render.resolution_y = before[0]
        cycles.samples = before[1]
        return found

    def _pictures(self) -> tuple[np.ndarray, np.ndarray]:
        try:
            state = bpy.ops.render.render(scene=self.scene.name)
        except RuntimeError as error:
            raise PatchError(
                f"Cycles could not render the tile: {' '.join(str(error).split()).rstrip('.')}."
            ) from error
        if "FINISHED" not in state:
            raise PatchError("The render of the tile was cancelled; run again to go on.")
        result = next((image for image in bpy.data.images if image.type == "RENDER_RESULT"), None)
        try:
            result.save_render(str(self.file), scene=self.scene)
            layers = read_exr(self.file)
        except (RuntimeError, OSError, ExrError, AttributeError) as error:
            raise PatchError(f"A picture of the tile could not be kept: {str(error).strip().rstrip('.')}.") from error
        named = {name.rpartition(".")[2]: pixels for name, pixels in layers.items()}
        return named["Combined"], named["Position"]


@contextmanager
def studio(order: Order) -> Iterator[Studio]:
    """The scene for the time of the block; what was made for it is removed afterwards, and nothing else."""
    before, made = set(_blocks()), set()
    try:
        scene = bpy.data.scenes.new("Grass tile")
        try:
            build(order, scene)
        finally:
            made = set(_blocks()) - before  # what comes later is the artist's: a run in a window gives way to events
        with tempfile.TemporaryDirectory(prefix="candela_") as folder:
            yield Studio(order, scene, Path(folder) / "tile.exr")
    finally:
        _left.update(made)
        remove_left()


_KINDS = ("scenes", "objects", "meshes", "cameras", "lights", "materials", "collections")
_left: set[int] = set()  # session_uid of data-blocks of tiles that were rendered or given up


def _blocks() -> dict[int, bpy.types.ID]:
    """Those of the file that a tile may consist of, by session_uid: undo and the artist may free what is held."""
    return {one.session_uid: one for kind in _KINDS for one in getattr(bpy.data, kind)}


def remove_left() -> None:
    """Remove what is there of former tiles: at their end, and after an undo to a step that was made meanwhile."""
    if not _left:
        return
    found = [one for uid, one in _blocks().items() if uid in _left]
    for scene in [one for one in found if isinstance(one, bpy.types.Scene)]:
        found.remove(scene)
        # Blender keeps what such a render holds after its scene is gone, and reads the scene's memory whenever other
        # data-blocks are removed: at times a segmentation fault.
        scene.render.use_persistent_data = False
        with contextlib.suppress(RuntimeError):  # it stays where the artist has removed all other scenes
            bpy.data.scenes.remove(scene)  # windows that show it go to another one, unlike with batch_remove
    if found:  # to remove nothing makes Blender sort all collections anew
        bpy.data.batch_remove(found)


def build(order: Order, scene: bpy.types.Scene) -> None:
    """The tile with its copies, ground, sun and camera, and the settings of the render."""
    recipe = order.recipe
    used = [rings for rings in (order.views, order.lights, order.finer_lights) if rings]
    slant = max(math.tan(math.radians(rings.polar[-1])) for rings in used)
    around = min(math.ceil(recipe.height * slant / recipe.size) + 1, 12)
    field_of(recipe, scene, range(-around, around + 1))
    sun = bpy.data.lights.new("Sun", "SUN")
    sun.energy, sun.angle = math.pi, 0.0
    scene.collection.objects.link(bpy.data.objects.new("Sun", sun))
    camera = bpy.data.cameras.new("Camera")
    camera.type, camera.ortho_scale, camera.clip_start = "ORTHO", recipe.size, 1e-4 * recipe.size
    placed = bpy.data.objects.new("Camera", camera)
    placed.parent = bpy.data.objects.new("Shear", None)  # a parent's inverse is the one matrix that may be sheared
    for one in (placed, placed.parent):
        scene.collection.objects.link(one)
    scene.camera = placed
    render, cycles, image = scene.render, scene.cycles, scene.render.image_settings
    render.engine = "CYCLES"
    render.resolution_x = render.resolution_y = order.texels
    render.resolution_percentage = 100
    render.use_persistent_data = True
    render.film_transparent = True
    render.use_compositing = render.use_sequencer = False
    cycles.samples, cycles.seed = order.samples, 0
    cycles.use_denoising = cycles.use_adaptive_sampling = False
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0.0
    cycles.pixel_filter_type = "BOX"
    cycles.light_sampling_threshold = 0.0
    cycles.max_bounces = cycles.diffuse_bounces = cycles.transmission_bounces = BOUNCES
    scene.view_layers[0].use_pass_position = True
    if hasattr(image, "media_type"):
        image.media_type = "MULTI_LAYER_IMAGE"
    image.file_format, image.color_mode, image.color_depth = "OPEN_EXR_MULTILAYER", "RGBA", "32"
    scene.view_settings.view_transform = "Standard"


def field_of(recipe: Recipe, scene: bpy.types.Scene, tiles: range, ground: bool = True) -> None:
    """Copies of the tile side by side, its own at the origin, and ground below them."""
    made = blades_of(recipe)
    mesh = bpy.data.meshes.new("Blades")
    mesh.from_pydata(made.vertices.tolist(), [], made.faces.tolist())
    for color in COLORS:
        mesh.materials.append(_material("Blade", color, TRANSLUCENT))
    mesh.polygons.foreach_set("material_index", made.materials.astype(np.int32))
    tile = bpy.data.collections.new("Tile")
    tile.objects.link(bpy.data.objects.new("Blades", mesh))
    for row in tiles:
        for column in tiles:
            copy = bpy.data.objects.new("Copy", None)
            copy.instance_type, copy.instance_collection = "COLLECTION", tile
            copy.location = (column * recipe.size, row * recipe.size, 0.0)
            scene.collection.objects.link(copy)
    if ground:
        half = 1000.0 * recipe.size
        soil = bpy.data.meshes.new("Soil")
        soil.from_pydata([(-half, -half, 0), (half, -half, 0), (half, half, 0), (-half, half, 0)], [], [(0, 1, 2, 3)])
        soil.materials.append(_material("Soil", SOIL, 0.0))
        scene.collection.objects.link(bpy.data.objects.new("Soil", soil))


def _material(name: str, color: tuple[float, float, float], translucent: float) -> bpy.types.Material:
    material = bpy.data.materials.new(name)
    if bpy.app.version < (5, 0):
        material.use_nodes = True
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    output = nodes.new("ShaderNodeOutputMaterial")
    shader = nodes.new("ShaderNodeBsdfDiffuse")
    shader.inputs["Color"].default_value = (*color, 1.0)
    if translucent:
        passing, mix = nodes.new("ShaderNodeBsdfTranslucent"), nodes.new("ShaderNodeMixShader")
        passing.inputs["Color"].default_value = (*color, 1.0)
        mix.inputs[0].default_value = translucent
        links.new(shader.outputs[0], mix.inputs[1])
        links.new(passing.outputs[0], mix.inputs[2])
        shader = mix
    links.new(shader.outputs[0], output.inputs["Surface"])
    return material


def default_folder() -> Path:
    """Where patches are written unless told otherwise: beside the open file, or where Blender was started."""
    return Path(bpy.data.filepath).parent if bpy.data.filepath else Path.cwd()
