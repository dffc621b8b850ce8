"""What the material compiler hands to the techniques."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .estimate import Interface
from .volume import Medium


@dataclass(frozen=True)
class Attribute:
    """A per-corner attribute that a material reads; arrives in the shader as `vec4`."""

    # UV, COLOR, TANGENT by name ("" = the active one), NAMED (colour, UV or any other), GENERATED, UV_PASS (UV, 1),
    # MOTION_BEFORE, MOTION_AFTER (from where the mesh is to where it was and will be)
    kind: str
    name: str


@dataclass(frozen=True)
class OwnSurface:
    """GLSL of a material whose surface is not where its mesh is: it moves the point that a fragment shades.

    `glsl` defines `bool own_surface(inout SurfacePoint point, Instance instance)`: it puts the point where the ray from
    `point.incoming` meets the surface (position, normals, attributes), or returns false where the ray passes. It may
    read the varyings and, besides those of the material, `textures`, whose images MaterialSet.own_images holds. The
    programs that draw the camera's view, views of lights and depth maps call it and write the depth of the point.
    `shell`: what is drawn are prisms over the mesh's triangles (scene/shells.py) instead of these. `lets_pass`: the
    surface itself may let light pass, so that a depth map asks the material, too.
    """

    glsl: str
    textures: tuple[tuple[str, str], ...] = ()  # as of gfx.library.Program
    shell: bool = False
    lets_pass: bool = True


@dataclass(frozen=True)
class CompiledMaterial:
    """GLSL for one material topology plus the values of this material.

    `glsl` defines `void evaluate_material(SurfacePoint point, inout Closures closures)`. It reads
    `material_value(k)` (rows of the block `material_values`), samplers `material_image0…`, `point.attributes[k]`.
    Materials with equal `program_key` share one program; `values` alone differ.
    """

    name: str
    program_key: str  # hash of glsl, attribute kinds and image count
    glsl: str
    attributes: tuple[Attribute, ...]
    images: tuple[str, ...]  # Image.key in sampler order
    values: np.ndarray  # (P, 4) float32, P >= 1
    transparent: bool  # some ray may pass: the surface is drawn with stochastic transparency
    casts_stochastically: bool  # so may light on its way to a surface; else what is transparent casts a full shadow
    emissive: bool
    # Mean radiance of the side that faces the viewer and of the other one, for choosing and sampling emissive geometry.
    emission: tuple[float, float, float]
    emission_behind: tuple[float, float, float]
    opacity: float  # mean coverage 0..1
    # Opacity, emission vary: what they are depends on the surfaces (scene/opacity_maps.py, scene/surface_means.py).
    uneven: bool
    uneven_emission: bool
    reads: frozenset[str]  # of what is around it: INSTANCE, CAMERA of attributes.py
    diffuse: bool  # has a diffuse closure
    glossy: bool  # has a glossy closure
    soft: bool  # has a lobe of shaders/lib/soft_lobe.glsl: sheen, velvet, translucent, toon
    tinted: bool  # what passes straight through may be coloured
    glows: bool  # emits where rays may pass: layers add what they emit to what lies behind them
    added: bool  # a lobe is added to what lets light pass, so that both together may be more than 1
    glass: Interface | None  # how it bends light, on average
    medium: Medium | None  # what its inside does with light
    scatter: float  # about how far light spreads below its surface, m; 0: it does not
    fallbacks: tuple[tuple[str, str], ...]  # (node label, sentence): what could not be translated
    # `glsl` also has `vec3 material_displacement(SurfacePoint point)`, m in world space; where DISPLACED is defined, or
    # the program finds the surface itself, evaluate_material leaves the normal alone. With DISPLACED, UNDISPLACED_PLACE
    # and UNDISPLACED_NORMAL may name attributes: the normal is then that of the tree's own detail.
    displaces: bool = False
    aovs: tuple[
        tuple[str, str], ...
    ] = ()  # name, kind: of the k-th one `glsl` has `material_aov{k}(SurfacePoint point)`
    along_normal: bool = False  # displacement is a height along the normal, not a vector
    averaging: frozenset[str] = frozenset()  # those of `images` of which some lookup averages (averages.py)
    own_surface: OwnSurface | None = None  # None: the surface is where the mesh is
    tint: tuple[float, float, float] = (1.0, 1.0, 1.0)  # where `tinted`: mean colour of what passes, over its luminance
    coated: bool = False  # a Principled BSDF of it may have a coat
    strands: bool = False  # tubes of hair show it: programs that draw meshes know them (surface/strand.glsl)
    color: tuple[float, float, float] = (0.8, 0.8, 0.8)  # about what it reflects, on average: for first looks

    @property
    def absorbed_inside(self) -> tuple[float, float, float]:
        """What solids of it absorb, per metre, where it is glass; zeros where they are clear."""
        if self.glass is None or self.medium is None:
            return 0.0, 0.0, 0.0
        return tuple(np.clip(self.medium.absorption, 0.0, 1e30).tolist())

    @property
    def colors_behind(self) -> bool:
        """Whether layers of it are drawn once more, to colour what lies behind them."""
        some = self.transparent and (self.opacity > 0.0 or self.uneven)
        return self.tinted or self.added or (some and not (self.diffuse or self.glossy))

    @property
    def bounds_alone(self) -> bool:
        """Whether it has no surface to be seen, and only says where its medium ends: nothing draws it."""
        clear = self.transparent and self.opacity <= 0.0 and not (self.uneven or self.tinted or self.emissive)
        return clear and self.medium is not None and self.glass is None
