"""How materials bend and mirror what meets them where no shader of theirs can run: means, texels of a row a material.

0  colour of what passes glass, once; index of refraction
1  roughness; share of the material that is glass; losses at the interface (0 none but total reflection, 1
   Fresnel's, 2 with multiple scattering given back); whether what is mirrored has the colour, too
2  what the inside absorbs, 1/m, -1 of clear glass; whether the material is a mirror that passes photons on
3  and on, two by two as 0 and 1: interfaces that the material has beside (several Glass nodes); share 0: none
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..frame.picture import Frame
from ..gfx import images
from ..materials.compiled import CompiledMaterial
from ..materials.estimate import Interface
from ..surfaces.hits import absorbed_inside, defines_of_absorption


def interface_table(compiled: Sequence[CompiledMaterial], mirrors: dict[int, float] | None = None) -> np.ndarray:
    """(N, 3 + 2 K, 4) float32 rows of the materials, K the most interfaces that one has beside its first; `mirrors`:
    roughness of those that mirror photons."""
    table = np.zeros((len(compiled), 3 + 2 * (most_interfaces(compiled) - 1), 4), np.float32)
    for number, (row, material) in enumerate(zip(table, compiled)):
        for place, glass in zip((0, *range(3, row.shape[0], 2)), _interfaces(material)):
            losses = 0.0 if not glass.fresnel else 2.0 if glass.multiple else 1.0
            row[place] = *glass.color, glass.ior
            row[place + 1] = glass.roughness, glass.share, losses, glass.mirrors_color
        row[2, :3] = absorbed_inside(material)
        if mirrors and number in mirrors:
            row[2, 3] = 1.0
            if not material.glass:
                row[1, 0] = mirrors[number]
    return table


def most_interfaces(compiled: Sequence[CompiledMaterial]) -> int:
    """How many interfaces a material has at most, at least 1."""
    return max((len(_interfaces(material)) for material in compiled), default=1) or 1


def _interfaces(material: CompiledMaterial) -> tuple[Interface, ...]:
    return (material.glass, *material.glass.others) if material.glass else ()


def upload_interfaces(compiled: Sequence[CompiledMaterial], mirrors: dict[int, float] | None = None) -> images.Image:
    """The table as an image, which says to programs whether any solid absorbs."""
    table = interface_table(compiled, mirrors)
    image = images.upload(table)
    image.defines = defines_of_absorption(table[(table[:, 1, 1] > 0.0), 2, :3])
    return image


def clear_roughness(frame: Frame) -> float:
    """Roughness up to which glass shows that nothing is behind it (Film > Transparent Glass); below 0: none does."""
    film = frame.snapshot.film
    return film.clear_glass if film.transparent else -1.0
