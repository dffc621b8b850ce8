"""Materials and other node trees of one sync: which graph, which images, and what they want of the meshes."""

from __future__ import annotations

from dataclasses import replace

import bpy

from ..materials.attributes import attributes_of
from ..materials.culling import culled
from ..materials.graph import Graph, Input, Node
from ..materials.ies import Profile
from ..materials.nodes.inputs import FLAT
from ..materials.reader import read_graph
from ..materials.sky import Sky
from ..materials.translucency import names_of, with_maps
from .cache import GraphEntry, SnapshotCache
from .images import ImageTable, whole_key
from .meshes import Wanted
from .object_attributes import INSTANCER, OBJECT, VIEW_LAYER, of_view_layer
from .own_settings import own_images, own_settings
from .scene import Aov, Material, Note

GREY = (0.8, 0.8, 0.8)
OF_OTHERS = {"object_matrix", "layer_value"}  # properties of nodes that change without their tree


def diffuse_graph(color) -> Graph:
    """A Diffuse BSDF of one colour."""
    inputs = {
        "Color": Input("COLOR", tuple(float(c) for c in (*color[:3], 1.0))),
        "Roughness": Input("FLOAT", 0.0),
        "Normal": Input("VECTOR", (0.0, 0.0, 0.0)),
    }
    node = Node("Diffuse", "Diffuse", "ShaderNodeBsdfDiffuse", inputs, {"BSDF": "SHADER"})
    return Graph({"Diffuse": node}, surface=("Diffuse", "BSDF"))


def empty_slot_graph() -> Graph:
    """What Cycles draws where no material is chosen: grey, diffuse before Blender 5.0 and Principled since."""
    if bpy.app.version < (5, 0):
        return diffuse_graph(GREY)
    inputs = {
        "Base Color": Input("COLOR", (*GREY, 1.0)),
        "Metallic": Input("FLOAT", 0.0),
        "Roughness": Input("FLOAT", 0.5),
        "IOR": Input("FLOAT", 1.5),
        "Alpha": Input("FLOAT", 1.0),
        "Normal": Input("VECTOR", (0.0, 0.0, 0.0)),
        "Specular IOR Level": Input("FLOAT", 0.5),
        "Specular Tint": Input("COLOR", (1.0, 1.0, 1.0, 1.0)),
    }
    node = Node("Principled", "Principled", "ShaderNodeBsdfPrincipled", inputs, {"BSDF": "SHADER"})
    return Graph({"Principled": node}, surface=("Principled", "BSDF"))


def empty_volume_graph() -> Graph:
    """What Cycles draws where a volume object has no material."""
    inputs = {"Color": Input("COLOR", (0.5, 0.5, 0.5, 1.0)), "Density": Input("FLOAT", 1.0)}
    node = Node("Principled", "Principled", "ShaderNodeVolumePrincipled", inputs, {"Volume": "SHADER"})
    return Graph({"Principled": node}, volume=("Principled", "Volume"))


class ShadingTable:
    """Collects materials in order of first use; index 0 is the neutral default."""

    def __init__(self, cache: SnapshotCache, images: ImageTable, aovs: tuple[Aov, ...] = (), layer=None):
        """`layer`: the evaluated scene and view layer, of which nodes may read properties."""
        self.materials: list[Material] = [Material("default", "Default", empty_slot_graph())]
        self.wanted: list[Wanted] = [Wanted()]
        self.notes: list[Note] = []
        self.graphs: set[str] = set()
        self._cache, self._images, self._aovs, self._layer = cache, images, aovs, layer
        own = None if layer is None else getattr(layer[0], "candela", None)
        self._culls = bool(own is not None and own.use_backface_culling)
        if cache.culls != self._culls:
            cache.graphs.clear()
            cache.culls = self._culls
        uv = tuple((aov.name, aov.kind, Input("VECTOR")) for aov in aovs if aov.of_surface)
        self.materials[0] = replace(self.materials[0], graph=replace(self.materials[0].graph, aovs=uv))
        self._index: dict[int, int] = {}
        self._empty_volume = 0
        self._images_by_uid: dict[int, object] | None = None

    def index_of(self, material) -> int:
        """Index of an evaluated material in `materials`; 0 for None."""
        if material is None:
            return 0
        pointer = material.as_pointer()
        if pointer not in self._index:
            self._index[pointer] = self._add(material)
        return self._index[pointer]

    def index_of_volume(self, material) -> int:
        """As `index_of`, for a volume object: None is the default of volumes."""
        if material is not None:
            return self.index_of(material)
        if self._empty_volume == 0:
            self._empty_volume = len(self.materials)
            self.materials.append(Material("default volume", "Default", empty_volume_graph()))
            self.wanted.append(Wanted())
        return self._empty_volume

    def _add(self, material) -> int:
        key = f"material {(material.original or material).session_uid}"
        graph = self.graph_of(material, key, f"Material '{material.name}'")
        images = tuple((name, self._images.key_of(image)) for name, image in own_images(material))
        own = own_settings(material)
        self.materials.append(Material(key, material.name, graph, material.pass_index, own, images))
        self.wanted.append(wanted_by(graph))
        return len(self.materials) - 1

    def graph_of(self, block, key: str, subject: str) -> Graph:
        """The flat graph of a material, world or light; one that stands for its plain settings without nodes."""
        entry = self._cache.graphs.get(key)
        if key in self.graphs:
            return entry.graph
        if entry is None or not self._reusable(entry, block):
            entry = self._cache.graphs[key] = self._read(block, subject, entry)
        self.graphs.add(key)
        self.notes.extend(entry.notes)
        return entry.graph

    def _read(self, block, subject: str, old: GraphEntry | None) -> GraphEntry:
        shown: list[tuple[int, str]] = []

        def image_key(image, user) -> str:
            if isinstance(image, Sky):
                key = self._images.key_of_sky(image)
                shown.append((image, key))
                return key
            if isinstance(image, Profile):
                return self._images.key_of_profile(image, user)
            key = self._images.key_of(image, user)
            shown.append(((image.original or image).session_uid, key))
            return key

        graph, remarks = read_graph(block, image_key, tuple((aov.name, aov.kind) for aov in self._aovs))
        if isinstance(block, bpy.types.Material):
            named = ((name, bpy.data.images.get(image)) for name, image in names_of(own_settings(block)).items())
            if self._culls:
                graph = culled(graph, block.use_backface_culling, block.use_backface_culling_shadow)
            graph = with_maps(graph, {name: image_key(image, None) for name, image in named if image is not None})
        graph = self._with_sources(graph, isinstance(block, bpy.types.Material))
        if old is not None and old.graph == graph:
            graph = old.graph  # the same object, so that whoever compiled it need not compare again
        name = block.name if isinstance(block, bpy.types.Material) else ""
        notes = tuple(Note(subject, text, material=name, node=node) for node, text in remarks)
        return GraphEntry(graph, notes, tuple(dict.fromkeys(shown)), self._aovs)

    def _with_sources(self, graph: Graph, of_material: bool) -> Graph:
        """With what Attribute nodes read of the view layer, and for materials where instances keep what they read of
        objects and instancers."""
        changed = {}
        for key, node in graph.nodes.items():
            kind, name = node.properties.get("attribute_type"), str(node.properties.get("attribute_name", ""))
            if node.type != "ShaderNodeAttribute":
                continue
            if kind == VIEW_LAYER and self._layer is not None:
                changed[key] = {"layer_value": of_view_layer(*self._layer, name)}
            elif kind in (OBJECT, INSTANCER) and of_material:
                column = self._cache.columns.setdefault((kind, name), len(self._cache.columns))
                changed[key] = {"of_instance": True, "attribute_column": float(column)}
        if not changed:
            return graph
        made = {key: replace(graph.nodes[key], properties={**graph.nodes[key].properties, **new})
                for key, new in changed.items()}  # fmt: skip
        return replace(graph, nodes={**graph.nodes, **made})

    def reads_instances(self, material: int) -> bool:
        """Whether a material reads attributes of objects or instancers."""
        return any(node.properties.get("of_instance") for node in self.materials[material].graph.nodes.values())

    def _reusable(self, entry: GraphEntry, block) -> bool:
        """Nothing was said about it since the last sync, and its images can be handed on again."""
        cache = self._cache
        if entry.aovs != self._aovs:
            return False
        if not cache.informed or (block.original or block).session_uid in cache.changed:
            return False
        if any(not OF_OTHERS.isdisjoint(node.properties) for node in entry.graph.nodes.values()):
            return False  # another object's place is part of it, or what the view layer says
        if any(node.type == "ShaderNodeTexIES" for node in entry.graph.nodes.values()):
            return False  # its file, or text, changes without a trace
        if entry.images and self._images_by_uid is None:
            self._images_by_uid = {image.session_uid: image for image in bpy.data.images}
        for uid, key in entry.images:
            if isinstance(uid, Sky):
                self._images.key_of_sky(uid)
                continue
            image = self._images_by_uid.get(uid)
            if image is None or key != whole_key(uid) or image.source == "SEQUENCE":
                return False  # its node says what of it is shown
            if self._images.key_of(image) != key:
                return False
        return True


def wanted_by(graph: Graph) -> Wanted:
    """Tangents and attributes that the nodes of a graph look up in the mesh."""
    attributes = attributes_of(graph)
    named = {attribute.name for attribute in attributes if attribute.kind in ("COLOR", "NAMED", "UV")}
    named |= {FLAT} if graph.displacement is not None else set()
    return Wanted(
        frozenset(attribute.name for attribute in attributes if attribute.kind == "TANGENT"),
        frozenset(named - {""}),
        any(attribute.kind == "GENERATED" for attribute in attributes),
    )
