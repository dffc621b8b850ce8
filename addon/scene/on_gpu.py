"""What modules of scene/ may ask of a picture in the making: its scene on the GPU, and nothing else."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol, TypeVar

if TYPE_CHECKING:
    from ..gfx.struct import Block
    from ..materials.compiled import CompiledMaterial
    from ..snapshot.scene import Snapshot
    from .acceleration import Hierarchy
    from .emission_maps import EmissionMaps
    from .geometry import SceneGeometry
    from .materials import MaterialSet
    from .opacity_maps import OpacityMaps

Kept = TypeVar("Kept")


class Scheduled(Protocol):
    """When a picture is drawn."""

    may_rebuild: bool  # what still serves of pictures before may be made anew
    is_draft: bool  # it is one of a moving view


class Drawn(Protocol):
    """How a picture is drawn."""

    schedule: Scheduled


class SceneOnGpu(Protocol):
    """A frame (frame/picture.py), as far as its scene is concerned; `tests/test_imports.py` holds scene/ to it."""

    snapshot: Snapshot
    geometry: SceneGeometry
    materials: MaterialSet
    measured_materials: list[CompiledMaterial]
    opacity_maps: OpacityMaps
    emission_maps: EmissionMaps
    settings: Drawn
    view_block: Block
    offset_size: float

    def hierarchy(self, path: str = "glossy", passing: frozenset[int] = frozenset()) -> Hierarchy | None: ...

    def kept(self, kind: type[Kept]) -> Kept: ...
