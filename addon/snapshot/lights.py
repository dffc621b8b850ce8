"""Light objects to `Light`: Blender's settings in Cycles' meaning, before any normalisation by size.

What only EEVEE reads (diffuse and specular factors, custom distance, shadow resolution) is left out.
"""

from __future__ import annotations

import numpy as np

from ..materials.graph import Graph
from .constants import constant_color, constant_number
from .own_settings import own_settings
from .scene import Light, Visibility


def read_light(
    data, key: str, name: str, matrix: np.ndarray, visibility: Visibility, tint: np.ndarray, **of_tree
) -> Light | None:
    """A `bpy.types.Light` placed by `matrix` (4, 4); `tint` (3,) is what its node tree emits (ones without one), where
    that is one colour; `of_tree`: fields of a Light whose tree is more.

    None when it gives no light: zero power, or an area light's portal, which in Cycles only guides sampling.
    """
    cycles = getattr(data, "cycles", None)
    if getattr(cycles, "is_portal", False) and data.type == "AREA":
        return None
    strength = tint * np.array(data.color[:], np.float64) * data.energy * 2.0 ** getattr(data, "exposure", 0.0)
    if getattr(data, "use_temperature", False):
        strength = strength * np.array(data.temperature_color[:3], np.float64)
    if not np.any(strength):
        return None
    own = {}
    if data.type in ("POINT", "SPOT"):
        own.update(radius=data.shadow_soft_size, soft_falloff=data.use_soft_falloff)
    if data.type == "SPOT":
        own.update(spot_angle=data.spot_size, spot_blend=data.spot_blend)
    if data.type == "SUN":
        own.update(angle=data.angle)
    if data.type == "AREA":
        round_shape = data.shape in ("DISK", "ELLIPSE")
        second = data.size_y if data.shape in ("RECTANGLE", "ELLIPSE") else data.size
        own.update(shape="ELLIPSE" if round_shape else "RECTANGLE", size=(data.size, second), spread=data.spread)
    return Light(
        key=key,
        name=name,
        kind=data.type,
        matrix=matrix,
        strength=strength,
        normalize=getattr(data, "normalize", True),
        cast_shadow=data.use_shadow,
        caustics=getattr(cycles, "is_caustics_light", False),
        bounces=getattr(cycles, "max_bounces", 1) > 0,  # other limits of single lights are not followed
        visibility=visibility,
        own=own_settings(data),
        **of_tree,
        **own,
    )


def uses_nodes(data) -> bool:
    """Whether a light's node tree counts: a choice, until Blender 5.2 made it always so and deprecated the property."""
    switch = data.bl_rna.properties.get("use_nodes")
    always = switch is None or getattr(switch, "is_deprecated", False)
    return data.node_tree is not None and (always or data.use_nodes)


def emission_of_graph(graph: Graph) -> np.ndarray | None:
    """Colour x strength that a light's node tree emits, (3,); None where it has to be run to know."""
    node = graph.nodes.get(graph.surface[0]) if graph.surface else None
    if node is None:
        return np.zeros(3)  # an output with nothing linked emits nothing, as in Cycles
    if node.type != "ShaderNodeEmission":
        return None
    color, exact_color = constant_color(graph, node, "Color")
    strength, exact_strength = constant_number(graph, node, "Strength")
    return color * strength if exact_color and exact_strength else None
