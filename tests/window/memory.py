"""What this process holds, after everything that is free has been given back."""

import ctypes
import gc
import re
import sys
from pathlib import Path

import bpy


def now():
    """Megabytes resident, in Blender's own allocations and in Candela's images on the GPU, and counts of objects.

    The C library keeps what is freed for later; it is asked to return that first, for what it keeps depends on the
    order of the walk.
    """
    gc.collect()
    if sys.platform == "linux":
        ctypes.CDLL(None).malloc_trim(0)
    images = [one for one in gc.get_objects() if str(type(one).__module__).endswith("candela.addon.gfx.images")]
    images = [one for one in images if type(one).__name__ == "Image"]
    return {
        "resident_mib": round(resident_mib(), 1),
        "blender_mib": blender_mib(),
        "images": len(images),
        "images_mib": round(sum(one.bytes for one in images) / 2**20, 2),
        "mappings": mappings(),
        "objects": len(gc.get_objects()),
    }


def resident_mib():
    """Memory of this process, where the system tells."""
    status = Path("/proc/self/statm")
    return int(status.read_text().split()[1]) * 4 / 1024 if status.exists() else 0.0


def mappings():
    """Mapped ranges of memory. Linux allows 65530; a software driver of Vulkan maps each set of bindings by itself."""
    ranges = Path("/proc/self/maps")
    return len(ranges.read_text().splitlines()) if ranges.exists() else 0


def blender_mib():
    """Blender's own allocations, as its status bar shows them."""
    window = bpy.context.window_manager.windows[0]
    text = window.scene.statistics(window.view_layer)
    found = re.search(r"Memory: ([0-9.,]+) ([KMG])iB", text)
    return float(found[1].replace(",", "")) * {"K": 1 / 1024, "M": 1, "G": 1024}[found[2]]
