"""A GPU context wherever Blender runs, and the order in which GPU resources die.

In a window Blender has a context. In background mode 5.2 makes one on request (`gpu.init`); 4.5 to 5.1 only have
one during a render by an engine with `bl_use_gpu_context`, and keep it afterwards, so one 4x4 render opens it.
"""

from __future__ import annotations

import inspect
import threading
import time
import weakref
from collections.abc import Callable

import bpy
import gpu

_releases: list[Callable[[], Callable[[], None] | None]] = []  # each gives the function, or None once it has gone


RECENT = 8  # pictures: what none of so many asked for may be freed

pictures = 0  # that this process has begun, of all renderers
_begins: list[Callable[[], None]] = []


def on_picture(function: Callable[[], None]) -> Callable[[], None]:
    """Register (as a decorator) what frees GPU resources that recent pictures did not use; see `begin_picture`."""
    _begins.append(function)
    return function


def begin_picture() -> None:
    """Another picture begins: the time by which stores of GPU resources tell what is old."""
    global pictures
    pictures += 1
    for function in _begins:
        function()


_enters: list[Callable[[], None]] = []
_leaves: list[Callable[[], None]] = []


def on_enter(function: Callable[[], None]) -> Callable[[], None]:
    """Register (as a decorator) what begins work in a GPU context that is not this process's only one."""
    _enters.append(function)
    return function


def on_leave(function: Callable[[], None]) -> Callable[[], None]:
    """Register (as a decorator) what ends work in a GPU context that is not this process's only one."""
    _leaves.append(function)
    return function


def enter() -> None:
    """Work in the current GPU context begins, after some in another one."""
    if available():
        for function in _enters:
            function()


def leave() -> None:
    """Work in the current GPU context ends, and may go on in another one."""
    if available():
        for function in _leaves:
            function()


class Turn:
    """A lock for whoever draws: who waits for it gets it before its last holder does again.

    GPU programs hold the constants of their next draw, for all contexts together, and a final render draws from a
    thread of its own. With a plain lock a thread that gives it back and takes it again at once leaves the others none.
    """

    def __init__(self):
        self._held, self._next = threading.Lock(), threading.Lock()

    def acquire(self, timeout: float = -1.0) -> bool:
        """Wait for `timeout` seconds at most, by default for as long as it takes; whether the turn has come."""
        started = time.monotonic()
        if not self._next.acquire(timeout=timeout):
            return False
        left = -1.0 if timeout < 0.0 else max(timeout - (time.monotonic() - started), 0.0)
        try:
            return self._held.acquire(timeout=left)
        finally:
            self._next.release()

    def release(self) -> None:
        self._held.release()

    def __enter__(self):
        self.acquire()

    def __exit__(self, *_):
        self.release()


turn = Turn()


def available() -> bool:
    """True if GPU calls work right now."""
    try:
        gpu.platform.renderer_get()
    except SystemError:
        return False
    return True


def is_only_one() -> bool:
    """Whether all GPU work of this process is done in one context, but for final renders: a window has several."""
    return bpy.app.background


def ensure() -> None:
    """Make GPU calls work in this process, or raise RuntimeError with a sentence."""
    if available():
        return
    try:
        if hasattr(gpu, "init"):
            gpu.init()
        else:
            _open_by_dummy_render()
    except SystemError as error:
        raise RuntimeError(
            f"Candela found no GPU context ({error}). Install an OpenGL driver; for software rendering on Debian: "
            "apt-get install libegl1 libgl1-mesa-dri."
        ) from error
    if not available():
        raise RuntimeError("Candela found no GPU context: this Blender was started without OpenGL, Vulkan or Metal.")


def opens_by_a_render() -> bool:
    """Whether `ensure` would have to render something first, which ends what Blender is at."""
    return not available() and not hasattr(gpu, "init")


def describe() -> str:
    """Renderer, driver and backend in one line, for reports."""
    backend = gpu.platform.backend_type_get()
    return f"{gpu.platform.renderer_get()}, {gpu.platform.version_get()}, {backend}"


def counts_in_images() -> bool:
    """Whether shaders can count in an image: Blender's Python cannot ask Metal for images with atomic operations."""
    return gpu.platform.backend_type_get() != "METAL"


def rasterises_in_software() -> bool:
    """Whether the driver is Mesa's llvmpipe, or its Vulkan front, which names itself the same."""
    return "llvmpipe" in gpu.platform.renderer_get()


def is_lavapipe() -> bool:
    """Whether the driver is Mesa's Vulkan in software."""
    return gpu.platform.backend_type_get() == "VULKAN" and rasterises_in_software()


def overtakes_draws() -> bool:
    """Whether a dispatch may run before draws that were asked for earlier: llvmpipe (seen with Mesa 22.3) starts it at
    once, while its rasteriser still works on them."""
    return gpu.platform.backend_type_get() == "OPENGL" and rasterises_in_software()


def masks_branches() -> bool:
    """Whether shaders compute what they branch around, and mask it: so does Mesa's software rasteriser."""
    return rasterises_in_software()


def to_hold(needed, everything):
    """What a program should hold: what the scene needs, where branches are masked; else everything, so that no change
    of the scene compiles it anew."""
    return needed if masks_branches() else everything


def on_release(function: Callable[[], None]) -> Callable[[], None]:
    """Register (as a decorator) what frees GPU resources. Called in reverse order of registration.

    The method of an object does not keep the object: it is called as long as the object lives.
    """
    _releases[:] = [known for known in _releases if known() is not None]
    _releases.append(weakref.WeakMethod(function) if inspect.ismethod(function) else lambda: function)
    return function


def release_all() -> None:
    """Free every GPU resource that Candela holds. The next frame makes anew what it needs."""
    if available():
        gpu.shader.unbind()
    for known in reversed(_releases):
        function = known()
        if function is not None:
            function()


class _ContextOpener(bpy.types.RenderEngine):
    bl_idname = "CANDELA_CONTEXT"
    bl_label = "Candela context"
    bl_use_gpu_context = True

    def render(self, depsgraph):
        pass


def _open_by_dummy_render() -> None:
    """Render 4x4 pixels of an empty scene: Blender 4.5 to 5.1 open the context then and keep it."""
    bpy.utils.register_class(_ContextOpener)
    scene = bpy.data.scenes.new("Candela context")
    try:
        scene.render.engine = _ContextOpener.bl_idname
        scene.render.resolution_x = scene.render.resolution_y = 4
        scene.render.resolution_percentage = 100
        scene.camera = None
        camera = bpy.data.cameras.new("Candela context")
        viewer = bpy.data.objects.new("Candela context", camera)
        scene.collection.objects.link(viewer)
        scene.camera = viewer
        bpy.ops.render.render(scene=scene.name)
        bpy.data.objects.remove(viewer)
        bpy.data.cameras.remove(camera)
    finally:
        bpy.data.scenes.remove(scene)
        bpy.utils.unregister_class(_ContextOpener)
