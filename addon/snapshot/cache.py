"""What a sync may reuse from the previous one, and the rule that decides it.

Meshes. Blender gives an evaluated mesh a new `session_uid` each time it evaluates the geometry, so the same
number means the same content, and nothing is read. A new number, or a data-block that an update names, only
means "maybe changed": the arrays are read and compared by digest, and the mesh keeps its version when they
are equal. (That is what happens in each F12 render, whose dependency graph evaluates everything anew.)

Objects have no such number. What they say of themselves (visibility to rays, colour, name, ...) is taken over when
all updates since the last sync were told, none was about the scene or its collections, and none names the object.

Node graphs have none either. They are taken over only when the caller has told all updates since the last sync
(`invalidate`) and none of them can concern a graph; without that news they are read again.

For images there is not even news: Blender tells no one when an image is painted, reloaded or gets another alpha mode.
What can be asked cheaply (file time, packed data, settings, whether it is loaded) is compared at each sync, and the
pixels of one that is unsaved, or whose file is newer than the pixels that Blender may still show.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from ..materials.graph import Graph
from .scene import Aov, Image, Instance, Mesh, Note, Volume

# Versions never repeat in this Blender session, not even across caches: a GPU mesh that is stored under
# (key, version) by one engine instance can then never be mistaken for another content.
_versions = itertools.count(1)

# Objects and their data, but for lights, which have node trees.
_DATA = frozenset(
    (
        *("Armature", "Camera", "Curve", "Curves", "Key", "Lattice", "Mesh", "MetaBall", "Object", "PointCloud"),
        *("SurfaceCurve", "TextCurve", "Volume"),
    )
)

# Updates of these types cannot change what a node tree says. Anything else (materials, node groups, textures,
# images, actions, scripts' own data) lets all graphs be read again: reading is cheap, a stale one is a bug.
_UNRELATED_TO_GRAPHS = _DATA | {"Collection", "Scene"}

# Updates of these types say all they mean by naming an object, its data or what surfaces show. Any other may have
# arranged the scene anew: what is hidden, left out, or seen by indirect light alone.
_ABOUT_THEMSELVES = _DATA | {
    *("Image", "Material", "ShaderNodeTree", "World"),
    *("AreaLight", "PointLight", "SpotLight", "SunLight"),
}


def next_version() -> int:
    """A number that was never a version before in this session."""
    return next(_versions)


@dataclass
class MeshEntry:
    """A mesh as it was read last: `evaluation` is the evaluated data-block's session_uid, 0 when unknown."""

    mesh: Mesh
    evaluation: int
    digest: bytes
    asked: frozenset  # names of tangents and attributes that the materials asked for
    notes: tuple[Note, ...]


@dataclass
class ImageEntry:
    """An image as it was read last; `state` is compared to decide whether the pixels must be read again."""

    image: Image
    state: tuple
    notes: tuple[Note, ...]
    again: float = 0.0  # by the monotonic clock: no sooner is a file that was written since looked at again


@dataclass
class GraphEntry:
    """A node tree as it was read last, with the (image session_uid or Sky, key) pairs that it shows."""

    graph: Graph
    notes: tuple[Note, ...]
    images: tuple[tuple[object, str], ...]
    aovs: tuple[Aov, ...] = ()  # that were asked for


@dataclass
class Placed:
    """All mesh instances of the last sync: as places in Blender's order, and as instances in the snapshot's."""

    keys: list[str]
    matrices: np.ndarray  # (N, 4, 4)
    facts: list  # ObjectFacts of each
    looks: list[tuple]  # of each its own numbers, and with whose mesh, materials and links it is shown
    made: list[Instance]
    order: list[str]  # of the meshes
    ordered: tuple[Instance, ...] = ()


@dataclass
class SnapshotCache:
    """Holds the parts of the last snapshot. One cache serves any number of syncs of any scenes, one at a time."""

    meshes: dict[str, MeshEntry] = field(default_factory=dict)
    images: dict[str, ImageEntry] = field(default_factory=dict)
    graphs: dict[str, GraphEntry] = field(default_factory=dict)
    stands_in: bool = (
        False  # images of bytes are not read: small ones stand in for them, which mostly need the same programs
    )
    culls: bool = False  # whether these leave out the backs of materials as EEVEE does
    volumes: dict[str, tuple[tuple, Volume]] = field(default_factory=dict)  # with the state they were read in
    facts: dict[tuple[int, int, int], object] = field(default_factory=dict)  # ObjectFacts by uid, parent's, data's
    placed: Placed | None = None
    # Attributes of objects and instancers that materials ever asked for, by kind and name: where instances keep them.
    columns: dict[tuple[str, str], int] = field(default_factory=dict)
    changed: set[int] = field(default_factory=set)  # session_uids of original data-blocks
    informed: bool = False  # all updates since the last sync are in `changed`
    arranged: bool = False  # one of them was about the scene as a whole

    def invalidate(self, updates: Iterable) -> None:
        """Take note of `depsgraph.updates`; call it for every update, it only records.

        Calling it is a promise: no update since the last sync was kept back. An empty list promises nothing, since
        Blender empties it once its handlers have run.
        """
        for update in updates:
            block = update.id.original
            self.changed.add(block.session_uid)
            kind = type(block).__name__
            if kind not in _UNRELATED_TO_GRAPHS:
                self.graphs.clear()
            self.arranged |= kind not in _ABOUT_THEMSELVES
            self.informed = True

    def doubt(self) -> None:
        """Updates may have been missed: let the next sync read all that only they tell of."""
        self.graphs.clear()
        self.arranged = True

    def finish(self, meshes: Iterable[str], images: Iterable[str], graphs: Iterable[str]) -> None:
        """End a sync: forget what the scene no longer holds, and all news, which is now worked in."""
        for entries, used in ((self.meshes, meshes), (self.images, images), (self.graphs, graphs)):
            for key in entries.keys() - set(used):
                del entries[key]
        self.changed.clear()
        self.informed = self.arranged = False

    def clear(self) -> None:
        """Forget everything; the next sync reads the whole scene."""
        self.meshes.clear()
        self.images.clear()
        self.graphs.clear()
        self.volumes.clear()
        self.facts.clear()
        self.placed = None
        self.changed.clear()
        self.informed = self.arranged = False
