"""The Snapshot: everything one frame needs of a Blender scene, as frozen dataclasses and numpy arrays.

No bpy object survives in here, so techniques can be tested on hand-made snapshots and never touch Blender.
Units are Blender's (metres, watts, radians); matrices are 4x4 float64, column vectors (`world = M @ local`).
Arrays are C-contiguous and read-only by agreement: whoever wants a change makes a new one.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ..materials.graph import Graph
from ..materials.volume import Medium
from .panorama import Panorama


def one_line(text: str) -> str:
    """The text with control characters and line ends escaped. Names of data-blocks and files may hold them, and render
    farms take a line that begins with `openjd_` for a command."""
    return "".join(one if one.isprintable() else one.encode("unicode_escape").decode() for one in text)


@dataclass(frozen=True)
class Note:
    """One sentence for the artist about something that is drawn otherwise than Cycles would draw it."""

    subject: str  # what it is about: "Material 'Glass'", "World", "Camera"
    text: str  # a full sentence that names the thing and the remedy
    material: str = ""  # data-block names, so that the interface can select what is meant
    node: str = ""

    def __str__(self) -> str:
        return one_line(f"{self.subject}: {self.text}")


@dataclass(frozen=True)
class Mesh:
    """Evaluated geometry, shared by all instances that show it.

    Corner arrays run over face corners (loops), so that a vertex may carry several normals and UVs.
    `slots` counts the material slots that the triangles refer to (at least 1).
    """

    key: str  # the same as long as this is the same data-block and evaluation kind
    version: int  # grows each time the content of `key` changes
    positions: np.ndarray  # (V, 3) float32, local space
    corner_vertices: np.ndarray  # (C,) int32, vertex of each corner
    corner_normals: np.ndarray  # (C, 3) float32, unit; smooth, flat or custom as Blender evaluates them
    triangle_corners: np.ndarray  # (T, 3) int32, corners of each triangle, sorted by material slot
    triangle_slots: np.ndarray  # (T,) int32, material slot of each triangle, ascending
    slots: int
    uv_maps: dict[str, np.ndarray] = field(default_factory=dict)  # name -> (C, 2) float32
    active_uv: str = ""  # the map that renders when none is named
    colors: dict[str, np.ndarray] = field(default_factory=dict)  # name -> (C, 4) float32, scene-linear
    active_color: str = ""
    tangents: dict[str, np.ndarray] = field(default_factory=dict)  # uv name -> (C, 4) float32, w = bitangent sign
    generated: np.ndarray | None = None  # (V, 3) float32, Generated coordinates, where a material reads them
    bounds_min: np.ndarray = None  # (3,) float64, local space; finite even for an empty mesh (zeros)
    bounds_max: np.ndarray = None
    # Where materials are relief: the mesh before they move it, and by material the first number of its triangles.
    undisplaced: Mesh | None = None
    shells: tuple[tuple[int, int], ...] = ()
    motion: tuple[np.ndarray, np.ndarray] | None = None  # (V, 3) each: to where vertices were a frame ago, and will be
    velocity: np.ndarray | None = None  # (V, 3) float32 m/s, of fluids and caches: stands for motion between frames
    strands: np.ndarray | None = None  # (V, 2) float32, of tubes that stand for hair: see strands.strand_shape

    @property
    def triangle_count(self) -> int:
        return len(self.triangle_corners)

    def triangle_materials(self, slots: Sequence[int]) -> np.ndarray:
        """(T,) the material of each triangle where `slots` holds those of an instance; the last one stands for more."""
        return np.asarray(slots, np.int64)[np.minimum(self.triangle_slots, len(slots) - 1)]


@dataclass(frozen=True)
class Visibility:
    """Ray visibility of an object or light, as in Blender's Object properties."""

    camera: bool = True
    diffuse: bool = True
    glossy: bool = True
    transmission: bool = True
    volume: bool = True
    shadow: bool = True


@dataclass(frozen=True)
class Links:
    """Light and shadow linking of an object, by groups of objects that all lights treat alike (linking.py)."""

    receiver: int = 0  # the group of receivers that it belongs to
    blocker: int = 0  # and of blockers
    unlit: tuple[int, ...] = ()  # of what gives light: groups of receivers that it does not light
    passing: frozenset[int] = frozenset()  # and of blockers that let its light pass


NO_LINKS = Links()
LAST_GROUP = 15  # that triangles of the hierarchy tell apart; those beyond count as this one there


@dataclass(frozen=True, eq=False)
class Instance:
    """One placement of a mesh. Instances of the same mesh and materials stand next to each other.

    A later snapshot has the same object where nothing of it has changed, so they are compared by identity.
    """

    object_name: str
    mesh: str  # Mesh.key
    matrix: np.ndarray  # (4, 4) float64
    materials: tuple[int, ...]  # index into Snapshot.materials, one per slot of the mesh
    visibility: Visibility = Visibility()
    random: float = 0.0  # 0..1, Blender's per-instance random
    pass_index: int = 0
    holdout: bool = False
    color: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)  # of the object, as in its viewport display
    generated: tuple[float, float, float] = (0.0, 0.0, 0.0)  # where on its instancer an instance stands
    uv: tuple[float, float] = (0.0, 0.0)
    key: str = ""  # stable identity across frames (object and persistent id)
    terminator: float = 0.1  # the object's geometry offset against the shadow terminator; 0: none
    own: tuple[tuple[str, object], ...] = ()  # Candela's settings of the object, see snapshot/own_settings.py
    caustics_caster: bool = False  # set to cast shadow caustics
    asset: str = ""  # name of the topmost parent, if it has one
    group: str = ""  # light group of the object
    links: Links = NO_LINKS
    shadow_catcher: bool = False
    attributes: tuple[tuple[float, ...], ...] = ()  # that Attribute nodes read of it and of its instancer, by column
    blurred: bool = True  # whether motion blur shows that it moves, or that its vertices do
    deforms: bool = True


@dataclass(frozen=True, eq=False)
class Volume:
    """Grids of an OpenVDB object on one lattice of voxels; those outside the arrays are empty."""

    key: str
    version: int
    grids: dict[str, np.ndarray]  # name -> (X, Y, Z) or (X, Y, Z, 3) float32
    low: np.ndarray  # (3,) index of the first voxel
    to_object: np.ndarray  # (3, 4) float64, from voxel indices (a voxel's centre is a whole number) to object space

    @property
    def size(self) -> tuple[int, int, int]:
        return next(iter(self.grids.values())).shape[:3]


@dataclass(frozen=True, eq=False)
class VolumeInstance:
    """One placement of a volume."""

    object_name: str
    volume: Volume
    matrix: np.ndarray  # (4, 4) float64
    material: int  # index into Snapshot.materials
    visibility: Visibility = Visibility()
    key: str = ""
    density: float = 1.0  # factor of all coefficients, so that a scaled object stays as opaque
    group: str = ""  # light group of the object


@dataclass(frozen=True)
class Image:
    """Pixels of an image data-block, bottom row first, exactly as stored: no colour conversion is applied yet.

    `encoding` says what a shader does with a filtered texel: 'LINEAR' nothing, 'SRGB' the sRGB decode.
    """

    key: str
    version: int
    pixels: np.ndarray  # (H, W, 4) float32
    encoding: str = "LINEAR"
    alpha_mode: str = "STRAIGHT"  # STRAIGHT, PREMUL, CHANNEL_PACKED, NONE
    name: str = ""
    missing: bool = False  # it could not be read: the pixels stand in for it, wherever it is asked
    # Of a UDIM image: number of each tile, where it stands in `pixels` (x, y from the lower left) and its size.
    tiles: tuple[tuple[int, int, int, int, int], ...] = ()
    bits: int = 32  # a channel of the GPU's copy needs: 8 of bytes, 16 of colours, 32 of other numbers
    stands_for: tuple[int, int] | None = None  # width and height of the image that small pixels stand in for

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels, as they stand in programs (materials/expressions.py)."""
        return self.stands_for or self.pixels.shape[1::-1]


@dataclass(frozen=True)
class Material:
    """A material as its node graph; `graph` is flat (groups are dissolved) and holds no bpy object."""

    key: str
    name: str
    graph: Graph
    pass_index: int = 0
    own: tuple[tuple[str, object], ...] = ()  # Candela's settings of the material
    own_images: tuple[tuple[str, str], ...] = ()  # Image.key of those of them that are images


@dataclass(frozen=True)
class Light:
    """A light object. `strength` already holds power x colour x temperature x 2^exposure, normalisation not applied.

    Sun: W/m2; all others: W. `matrix` keeps the object's scale, because the area shapes scale with it.
    """

    key: str
    name: str
    kind: str  # POINT, SPOT, SUN, AREA
    matrix: np.ndarray  # (4, 4) float64; the light shines along local -Z
    strength: np.ndarray  # (3,) float64
    normalize: bool = True  # False: strength does not shrink with the light's area
    radius: float = 0.0  # POINT, SPOT: metres
    soft_falloff: bool = True  # POINT, SPOT
    angle: float = 0.0  # SUN: full angle of the disc, radians
    shape: str = "RECTANGLE"  # AREA: RECTANGLE or ELLIPSE (square and disk are the special cases)
    size: tuple[float, float] = (1.0, 1.0)  # AREA: local metres, before the object's scale
    spread: float = np.pi  # AREA: full angle, radians
    spot_angle: float = np.pi  # SPOT: full cone angle, radians
    spot_blend: float = 0.0  # SPOT
    cast_shadow: bool = True
    caustics: bool = False  # set to give shadow caustics
    bounces: bool = True  # whether surfaces send its light on
    visibility: Visibility = Visibility()
    own: tuple[tuple[str, object], ...] = ()  # Candela's settings of the lamp
    group: str = ""  # light group of the object
    graph: Graph | None = None  # a tree that is more than one colour and strength; `strength` is then without it
    random: float = 0.0  # what the tree may ask of the object
    pass_index: int = 0
    color: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    links: Links = NO_LINKS


@dataclass(frozen=True)
class Aperture:
    """The opening of a thin lens: a disc, or a regular polygon of `blades` corners, in the camera's own plane."""

    radius: float  # metres, of the disc or to the polygon's corners
    focus: float  # distance along the view axis that is sharp, metres
    blades: int = 0  # below 3: a disc
    rotation: float = 0.0  # radians from the camera's right to the middle of the first edge, counter-clockwise
    ratio: float = 1.0  # of height to width


@dataclass(frozen=True)
class Camera:
    """A view. `kind` PERSPECTIVE, ORTHOGRAPHIC or PANORAMIC; the frustum is given on the plane one unit before it.

    `frame` = (left, right, bottom, top): for PERSPECTIVE tangents of the view angles, for ORTHOGRAPHIC metres, for
    PANORAMIC (whose `panorama` says what it sees) as wide as pixels of the mean angle, in radians, together;
    lens shift, sensor fit and pixel aspect are contained. It spans the full picture, not the render border.
    """

    matrix: np.ndarray  # (4, 4) float64, rigid: columns are right, up, backward, position
    kind: str
    frame: tuple[float, float, float, float]
    clip_start: float
    clip_end: float
    name: str = ""
    aperture: Aperture | None = None  # None: all is in focus
    panorama: Panorama | None = None
    from_above: bool = False  # each place of a surface is seen from above itself: of bakes alone, as the next one
    bends: bool = False  # what faces away is seen, too


@dataclass(frozen=True)
class World:
    """Radiance from infinitely far away: `color` alone, an equirectangular `image` times `color`, or a node tree.

    For an image, a world direction d is looked up at `mapping[:, :3] @ d + mapping[:, 3]`, normalised, with
    u = -atan2(y, x)/2pi + 0.5 and v = asin(z)/pi + 0.5 (Blender's equirectangular convention).
    """

    color: np.ndarray  # (3,) float64 radiance, or factor of the image
    image: Image | None = None
    mapping: np.ndarray = None  # (3, 4) float64
    graph: Graph | None = None  # a tree that is more than that; it then says all, and `color` is white
    visibility: Visibility = Visibility()
    medium: Medium | None = None  # what fills all space
    volume: Graph | None = None  # the tree that says so
    group: str = ""  # its light group

    @property
    def even(self) -> bool:
        """Whether it has the same colour all around."""
        return self.image is None and self.graph is None


@dataclass(frozen=True)
class Aov:
    """A value of the surface seen that the view layer asks for: what AOV Output nodes of this name give, or its UV."""

    name: str
    # COLOR, VALUE; by no name UV, the map that renders, VECTOR, how the surface moves, HIT, 1 where one is, and
    # DISTANCE of it from where the camera's rays begin.
    kind: str

    @property
    def of_surface(self) -> bool:
        """Whether a layer that is too thin to be what passes of surfaces show has no part in it."""
        return self.kind in ("UV", "VECTOR", "HIT", "DISTANCE")


@dataclass(frozen=True, eq=False)
class BakedPoints:
    """Places of one object that a picture shows instead of what a camera sees: of a bake, as Blender finds them."""

    instance: str  # Instance.key
    triangle: np.ndarray  # (H, W) int, row of the mesh's triangles; -1: none
    share: np.ndarray  # (H, W, 2) float, weights of its second and third corner
    step: np.ndarray  # (H, W, 2, 2) float, how they change a pixel to the right, and one up
    plain: bool = False  # of the neutral material, whatever the object's own is
    outward: bool = False  # facing away from the world's origin
    through_camera: bool = False  # seen from the camera, not each from above


CRYPTOMATTES = ("object", "material", "asset")
MOST_LEVELS = 16
RANKED = "crypto."  # names of images that hold pairs of ids and weights (kernels/ranks.py) begin so
CRYPTO_DEFAULT = "default_surface"  # name of the material of empty slots, as in Cycles


@dataclass(frozen=True)
class Film:
    """Size and sampling of the picture. `border` is (x0, y0, x1, y1) in pixels of the full picture."""

    width: int
    height: int
    border: tuple[int, int, int, int]
    filter_width: float = 1.5  # pixels, Blackman-Harris
    transparent: bool = False
    clear_glass: float = -1.0  # roughness up to which glass shows a transparent film's hole behind it; below 0: none
    exposure: float = 1.0
    caustics_reflective: bool = True  # whether diffuse surfaces see light that mirrors, or glass, throw
    caustics_refractive: bool = True
    mist: Mist | None = None  # this and what follows: what passes ask for beside light and colours
    position: bool = False
    indices: bool = False
    aovs: tuple[Aov, ...] = ()
    alpha_threshold: float = 0.5  # opacity from which on a layer is what passes of surfaces show
    cryptomattes: tuple[str, ...] = ()  # of CRYPTOMATTES
    cryptomatte_levels: int = 6  # names that a pixel of a Cryptomatte holds
    light_groups: tuple[str, ...] = ()  # names; see light_groups.py
    open_within: float | None = None  # metres: how far the pass Ambient Occlusion looks; None: it is not asked for

    @property
    def cryptomatte_images(self) -> int:
        """Of a Cryptomatte: each holds two levels."""
        return (min(self.cryptomatte_levels, MOST_LEVELS) + 1) // 2

    def cryptomatte_names(self, kind: str) -> list[str]:
        """Names of the frame's images of a Cryptomatte."""
        return [f"{RANKED}{kind}.{k}" for k in range(self.cryptomatte_images)]

    @property
    def border_size(self) -> tuple[int, int]:
        return self.border[2] - self.border[0], self.border[3] - self.border[1]


@dataclass(frozen=True)
class Mist:
    """What the Mist pass shows of the distance from the camera (orthographic: along its axis): 0 up to `start`, 1 from
    `start + depth` on, both in metres, and in between the share to the power of `exponent`."""

    start: float
    depth: float
    exponent: float


@dataclass(frozen=True, eq=False)
class Motion:
    """How a scene moves from a frame before to a frame after; vertices: Mesh.motion."""

    cameras: tuple[Camera, Camera]
    matrices: dict[str, tuple[np.ndarray, np.ndarray]]  # (4, 4) each, by key of the instance

    @cached_property
    def key(self) -> tuple:
        """Equal for motions that are alike."""
        cameras = [(one.matrix.tobytes(), one.kind, one.frame) for one in self.cameras]
        return (*cameras, *((name, *(one.tobytes() for one in pair)) for name, pair in self.matrices.items()))


@dataclass(frozen=True)
class Moment:
    """When the scene is looked at: its frame, with a fraction between frames, and how many make a second."""

    frame: float = 0.0
    per_second: float = 24.0

    @property
    def seconds(self) -> float:
        return self.frame / self.per_second


@dataclass(frozen=True)
class Snapshot:
    """One frame of one view layer."""

    meshes: dict[str, Mesh]
    instances: tuple[Instance, ...]
    materials: tuple[Material, ...]  # index 0 is the neutral default for empty slots
    images: dict[str, Image]
    lights: tuple[Light, ...]
    world: World
    camera: Camera | None
    film: Film
    notes: tuple[Note, ...] = ()
    scene_name: str = ""
    moment: Moment = Moment()
    motion: Motion | None = None  # where the view layer asks for it
    volumes: tuple[VolumeInstance, ...] = ()
    baked: BakedPoints | None = None
    sync_stats: dict = field(default_factory=dict)  # meshes_read, meshes_reused, seconds: what the sync cost

    @cached_property
    def used_materials(self) -> frozenset[int]:
        """Of all instances."""
        return frozenset(slot for slots in self.material_sets for slot in slots)

    @cached_property
    def blocker_sets(self) -> frozenset[frozenset[int]]:
        """Groups of blockers that lights let pass, all that differ."""
        return frozenset(one.links.passing for one in (*self.lights, *self.instances) if one.links.passing)

    @cached_property
    def lights_are_linked(self) -> bool:
        """Whether a light leaves out receivers, or some objects do not block it."""
        return any(one.links.unlit or one.links.passing for one in (*self.lights, *self.instances))

    @cached_property
    def material_sets(self) -> frozenset[tuple[int, ...]]:
        """What instances have in their slots."""
        return frozenset(one.materials for one in self.instances)

    @cached_property
    def casts_shadows(self) -> bool:
        """Whether any instance does."""
        return any(one.visibility.shadow for one in self.instances)

    @cached_property
    def has_catchers(self) -> bool:
        """Whether any instance is a shadow catcher."""
        return True in {one.shadow_catcher for one in self.instances}

    @cached_property
    def own_values(self) -> tuple[tuple[str, tuple], ...]:
        """What has been set of techniques' parameters on objects and materials, by key."""
        return tuple((one.key, one.own) for one in (*self.instances, *self.materials) if one.own)

    @cached_property
    def triangle_count(self) -> int:
        """Triangles of all instances together."""
        return sum(self.meshes[mesh].triangle_count * count for (mesh, _), count in self.times_shown.items())

    @cached_property
    def times_shown(self) -> Counter[tuple[str, tuple[int, ...]]]:
        """How many instances each mesh has with the same materials."""
        return Counter((instance.mesh, instance.materials) for instance in self.instances)
