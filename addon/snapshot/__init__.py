"""From Blender's evaluated scene to plain arrays: the only room that reads Blender scene data.

`take` makes a `scene.Snapshot`; `SnapshotCache` remembers between two of them what did not change.
"""

from importlib import import_module

# Where the room's verbs live. They are imported on first use, because `scene`, the data that everybody may import,
# must not bring Blender along.
_HOMES = {
    "SnapshotCache": "cache",
    "UnsupportedScene": "errors",
    "camera_of_scene": "camera",
    "camera_of_view": "camera",
    "take": "extract",
}
__all__ = list(_HOMES)


def __getattr__(name: str):
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f".{_HOMES[name]}", __name__), name)
