"""What Attribute nodes read of objects, of what instances them and of view layers, as Cycles looks it up.

A name is a custom property of the data-block, else a path to one of its own, such as `color`. Objects are asked, then
their data. Instancers come first where the node says so: what geometry nodes store with the instance, innermost ones
first, the settings of a particle system, the object that instances. View layers are asked, then the scene, the world.
Numbers become grey, up to four of them a colour with alpha 1; what is neither counts as not there, and what nobody has
is 0.
"""

from __future__ import annotations

import numpy as np

from .instances import Place, Source

Color = tuple[float, float, float, float]
NOTHING: Color = (0.0, 0.0, 0.0, 0.0)
OBJECT, INSTANCER, VIEW_LAYER = "OBJECT", "INSTANCER", "VIEW_LAYER"
# Of attributes of instances by their type: field and width.
FIELDS = {
    "FLOAT": ("value", 1), "INT": ("value", 1), "INT8": ("value", 1), "BOOLEAN": ("value", 1), "FLOAT2": ("vector", 2),
    "FLOAT_VECTOR": ("vector", 3), "FLOAT_COLOR": ("color", 4), "BYTE_COLOR": ("color", 4),
}  # fmt: skip


def value_of(block, name: str) -> Color | None:
    """A property of a data-block as a colour; None where it has none of that name that is a number or up to four."""
    if block is None or not name:
        return None
    value = block.get(name)
    if value is None:
        try:
            value = block.path_resolve(name)
        except (ValueError, AttributeError):
            return None
    return _as_color(value)


def _as_color(value) -> Color | None:
    if isinstance(value, (bool, int, float)):
        return (float(value),) * 3 + (1.0,)
    if isinstance(value, (str, bytes)):
        return None
    try:
        several = [float(one) for one in value]
    except (TypeError, ValueError):
        return None
    return tuple(several + [0.0, 0.0, 0.0, 1.0][len(several) :]) if 1 <= len(several) <= 4 else None


def of_view_layer(scene, view_layer, name: str) -> Color:
    """What a view layer, its scene or the world says by that name."""
    for block in (view_layer, scene, scene.world):
        found = value_of(block, name)
        if found is not None:
            return found
    return NOTHING


def of_places(places: list[Place], columns: dict[tuple[str, str], int], reading) -> list[tuple[Color, ...]]:
    """The attributes of each place, by column; () for those whose materials read none, as `reading(source)` says."""
    by_source: dict[int, tuple[Color, ...]] = {}
    stored: dict[int, _Stored] = {}
    found = []
    for place in places:
        source = place.source
        common = by_source.get(id(source))
        if common is None:
            wanted = columns if reading(source) else {}
            common = tuple(_common(source, kind, name) for kind, name in wanted)
            by_source[id(source)] = common
        if common and source.parent is not None and any(kind == INSTANCER for kind, _ in columns):
            instancer = stored.get(id(source.parent))
            if instancer is None:
                instancer = stored[id(source.parent)] = _Stored(source.parent)
            common = tuple(
                (instancer.value(place, name) if kind == INSTANCER else None) or value
                for (kind, name), value in zip(columns, common)
            )
        found.append(common)
    return found


def _common(source: Source, kind: str, name: str) -> Color:
    """What all places of a source have in common."""
    asked = [source.owner, getattr(source.owner, "data", None)]
    if kind == INSTANCER and source.parent is not None:
        asked.insert(0, source.parent)
    for block in asked:
        found = value_of(block, name)
        if found is not None:
            return found
    return NOTHING


class _Stored:
    """What geometry nodes of an object store with its instances."""

    def __init__(self, instancer):
        ask = getattr(instancer, "evaluated_geometry", None)  # later Blenders tell
        by_nodes = any(modifier.type == "NODES" for modifier in instancer.modifiers)
        self._geometry = ask() if ask is not None and by_nodes else None
        self._arrays: dict[tuple, np.ndarray | None] = {}

    def value(self, place: Place, name: str) -> Color | None:
        """Of the innermost instance around a place that has an attribute of that name."""
        geometry, path, found = self._geometry, (), None
        for number in reversed(place.numbers):
            if geometry is None or not hasattr(geometry, "instances_pointcloud"):
                break
            values = self._values(geometry, path, name)
            if values is not None and number < len(values):
                found = tuple(values[number].tolist())
            references = self._values(geometry, path, ".reference_index")
            if references is None or number >= len(references):
                break
            inside = int(references[number, 0])
            geometry, path = geometry.instance_references()[inside], (*path, inside)
        return found

    def _values(self, geometry, path: tuple, name: str) -> np.ndarray | None:
        """(N, 4) colours of the instances at a depth; None without such an attribute."""
        if (path, name) not in self._arrays:
            points = geometry.instances_pointcloud()
            layer = None if points is None else points.attributes.get(name)
            self._arrays[path, name] = None if layer is None else _colors(layer)
        return self._arrays[path, name]


def _colors(layer) -> np.ndarray | None:
    field, width = FIELDS.get(layer.data_type, ("", 0))
    if not width:
        return None
    kind = {"BOOLEAN": bool, "INT": np.int32, "INT8": np.int32}.get(layer.data_type, np.float32)
    values = np.zeros(len(layer.data) * width, kind)
    layer.data.foreach_get(field, values)
    colors = np.tile(np.array([0.0, 0.0, 0.0, 1.0], np.float32), (len(layer.data), 1))
    colors[:, : 3 if width == 1 else width] = values.reshape(-1, width)
    return colors
