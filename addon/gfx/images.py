"""Float images on the GPU: allocation from a pool, render targets, upload and readback."""

from __future__ import annotations

import heapq
import math
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import count as counting
from weakref import ref

import gpu
import numpy as np

from . import context
from .context import on_picture, on_release

_BYTES = {
    "RGBA32F": 16,
    "RGBA16F": 8,
    "RGBA8": 4,
    "RG32F": 8,
    "R32F": 4,
    "R16F": 2,
    "R32UI": 4,
    "RGBA32UI": 16,
    "DEPTH_COMPONENT32F": 4,
}
_CHANNELS = {
    "RGBA32F": 4,
    "RGBA16F": 4,
    "RGBA8": 4,
    "RG32F": 2,
    "R32F": 1,
    "R16F": 1,
    "R32UI": 1,
    "RGBA32UI": 4,
    "DEPTH_COMPONENT32F": 1,
}


@dataclass(eq=False)
class Image:
    """A two-dimensional GPU image. Row 0 is the bottom row. Passes that read it are compiled with its `defines`, so
    that what only some content needs costs others nothing; so they are with the images `beside` it, by the names under
    which they are bound, too, and with HAS_NAME for each, unless the program has 16 textures already."""

    width: int
    height: int
    format: str
    texture: gpu.types.GPUTexture
    defines: tuple[tuple[str, str], ...] = ()
    beside: dict[str, Image] = field(default_factory=dict)
    number: int = field(default_factory=counting().__next__)  # in the order in which images were made

    @property
    def size(self) -> tuple[int, int]:
        return self.width, self.height

    @property
    def bytes(self) -> int:
        return self.width * self.height * _BYTES[self.format]


def channels(image_format: str) -> int:
    """Of a format's texels."""
    return _CHANNELS[image_format]


def most_side() -> int:
    """Texels along the longest side that an image may have on this GPU."""
    return gpu.capabilities.max_texture_size_get()


def create(width: int, height: int, image_format: str) -> Image:
    """A new image with undefined content. Raises ValueError beyond the device's limits, RuntimeError if it is full."""
    limit = most_side()
    if not (0 < width <= limit and 0 < height <= limit):
        raise ValueError(f"An image of {width}x{height} pixels cannot be made: this GPU allows 1 to {limit}.")
    try:
        texture = gpu.types.GPUTexture((width, height), format=image_format)
    except RuntimeError as error:  # without a reason, but size and format are right
        need = width * height * _BYTES[image_format] / 2**20
        raise RuntimeError(
            f"The GPU has no memory for an image of {width}x{height} pixels ({need:.0f} MiB)."
        ) from error
    return Image(width, height, image_format, texture)


def upload(pixels: np.ndarray, image_format: str = "RGBA32F") -> Image:
    """An image with the content of `pixels`, (H, W, channels) or (H, W) float, row 0 at the bottom."""
    height, width = pixels.shape[:2]
    given = pixels.shape[2] if pixels.ndim == 3 else 1
    if given != _CHANNELS[image_format]:
        raise ValueError(f"{given} channels do not fit into {image_format}.")
    flat = np.ascontiguousarray(pixels, np.float32).ravel()
    if "16F" in image_format:
        flat = np.clip(flat, -65504.0, 65504.0)
    buffer = gpu.types.Buffer("FLOAT", flat.size, flat)
    return Image(width, height, image_format, gpu.types.GPUTexture((width, height), format=image_format, data=buffer))


def upload_varying(pixels: np.ndarray, image_format: str = "RGBA32F") -> Image:
    """`upload` of what has another size in every sample, for shaders that do not ask for it.

    llvmpipe compiles a shader anew, for a second or more, where a side of a texture is a power of two that was none
    before: such sides are a row or column longer.
    """
    spare = [(0, 0 if side & (side - 1) else 1 + (side == 1)) for side in pixels.shape[:2]]
    return upload(np.pad(pixels, (*spare, *[(0, 0)] * (pixels.ndim - 2))), image_format)


LIST_WIDTH = 2048  # a power of two, so that shaders address lists by shift and mask


def upload_list(rows: np.ndarray) -> Image:
    """A long list of vec4, (N, 4) float, as an image: entry i stands at column i & 2047, row i >> 11."""
    height = max(-(-len(rows) // LIST_WIDTH), 1)
    padded = np.zeros((height * LIST_WIDTH, 4), np.float32)
    padded[: len(rows)] = rows
    return upload(padded.reshape(height, LIST_WIDTH, 4))


def read(image: Image) -> np.ndarray:
    """Copy to the CPU: (H, W, channels) float32 (uint32 for R32UI). Waits for the GPU.

    Blender cannot read RGBA32UI back, and RGBA8 as bytes alone: ValueError.
    """
    if image.format in ("RGBA32UI", "RGBA8"):
        raise ValueError("An image of four integers cannot be read back: copy what is needed into floats first.")
    buffer = image.texture.read()
    count = math.prod(buffer.dimensions)
    buffer.dimensions = count  # strides of multi-dimensional buffers are wrong before Blender 5.2
    kind = np.uint32 if image.format == "R32UI" else np.float32
    return np.array(np.frombuffer(buffer, kind)).reshape(image.height, image.width, -1)


MOST_FRAMEBUFFERS = 32  # of one image, beside others: what was asked for least recently goes
framebuffer_count = 0  # how many this process has made; tests assert on its growth


class _Framebuffers:
    """Framebuffers of a GPU context by the images that they hold. They go with any of those."""

    def __init__(self):
        # By number of the first image, then by the numbers of all: the framebuffer, and what tells whether one of them
        # is gone. Plain numbers, since this is asked for each pass, and keys that are objects take many times longer.
        self._of: dict[int, dict[tuple, tuple[gpu.types.GPUFrameBuffer, list]]] = {}
        self._first: dict[int, ref[Image]] = {}

    def over(self, colors: tuple[Image, ...], depth: Image | None) -> gpu.types.GPUFrameBuffer:
        """The framebuffer of these images, made when first asked for."""
        key = (*[image.number for image in colors], -1 if depth is None else -2 - depth.number)
        own = self._of.get(key[0])
        found = own.pop(key, None) if own else None
        if found is None:
            own, found = self._made(key[0], colors, depth)
        own[key] = found
        return found[0]

    def _made(self, number: int, colors: tuple[Image, ...], depth: Image | None):
        global framebuffer_count
        own = self._of.get(number)
        if own is None:
            own = self._of[number] = {}
            of, first = self._of, self._first

            def gone(_) -> None:
                of.pop(number, None)
                first.pop(number, None)

            first[number] = ref(colors[0] if colors else depth, gone)
        for known in [known for known, (_, held) in own.items() if any(one() is None for one in held)]:
            del own[known]
        while len(own) >= MOST_FRAMEBUFFERS:
            del own[next(iter(own))]
        slots = {"color_slots": [image.texture for image in colors]} if colors else {}
        if depth is not None:
            slots["depth_slot"] = depth.texture
        framebuffer_count += 1
        held = [ref(one) for one in (*colors, depth) if one is not None]
        return own, (gpu.types.GPUFrameBuffer(**slots), held)


# A framebuffer works in one GPU context only and must end before it. Images, programs and buffers are shared by all
# contexts, and outlive the one of a final render, which Blender makes for each render anew. Windows have several: all
# 3D regions are drawn in one that lasts, operators and timers run in that of the window that was drawn last. To bind a
# framebuffer of another context fails, and leaves a place on Blender's short stack of framebuffers taken for ever.
_lasting = _Framebuffers()
_thread = threading.local()


@contextmanager
def lasting_context():
    """For drawing 3D regions: framebuffers are kept for their next picture."""
    before = getattr(_thread, "framebuffers", None)
    _thread.framebuffers = _lasting
    try:
        context.enter()
        yield
    finally:
        try:
            context.leave()
        finally:
            _thread.framebuffers = before


def _framebuffers() -> _Framebuffers:
    """Those of the current GPU context; new ones where it is not known which it is."""
    own = getattr(_thread, "framebuffers", None)
    if own is not None:
        return own
    return _lasting if context.is_only_one() else _Framebuffers()


def lasts() -> bool:
    """Whether the current GPU context is one that goes on drawing after this picture, as far as that is known."""
    own = getattr(_thread, "framebuffers", None)
    return context.is_only_one() if own is None else own is _lasting


@contextmanager
def passing_context():
    """For work in a GPU context that may end afterwards: framebuffers made inside are freed at the end."""
    before = getattr(_thread, "framebuffers", None)
    _thread.framebuffers = _Framebuffers()
    try:
        context.enter()
        yield
    finally:
        try:
            context.leave()
        finally:
            _thread.framebuffers = before


@dataclass(eq=False)
class Target:
    """Images that a draw writes: colour attachments in slot order and an optional depth image."""

    colors: tuple[Image, ...]
    depth: Image | None = None

    @property
    def framebuffer(self) -> gpu.types.GPUFrameBuffer:
        """The attachments as an object of the current GPU context, made when first asked for by any target."""
        return (getattr(_thread, "framebuffers", None) or _framebuffers()).over(self.colors, self.depth)

    @property
    def size(self) -> tuple[int, int]:
        return (self.colors[0] if self.colors else self.depth).size

    def clear(self, color=(0.0, 0.0, 0.0, 0.0), depth: float = 1.0) -> None:
        """Set every colour attachment to `color` and the depth image to `depth`."""
        framebuffer = self.framebuffer
        with framebuffer.bind():
            if self.colors and self.depth is not None:
                framebuffer.clear(color=color, depth=depth)
            elif self.colors:
                framebuffer.clear(color=color)
            else:
                framebuffer.clear(depth=depth)


class Pool:
    """Images by size and format, given back after use and handed out again, the oldest first: frames that ask for the
    same images in the same order get the same ones, and so the framebuffers that were made of them."""

    def __init__(self):
        # By size and format, the oldest first, with the number of the picture in which it was given back.
        self._free: dict[tuple[int, int, str], list[tuple[int, Image, int]]] = {}
        self.allocated_bytes = 0

    def take(self, width: int, height: int, image_format: str) -> Image:
        """An image with undefined content."""
        stock = self._free.get((width, height, image_format))
        if stock:
            return heapq.heappop(stock)[1]
        image = create(width, height, image_format)
        self.allocated_bytes += image.bytes
        return image

    def give(self, image: Image) -> None:
        image.beside = {}
        stock = self._free.setdefault((image.width, image.height, image.format), [])
        heapq.heappush(stock, (image.number, image, context.pictures))

    def trim(self) -> None:
        """Free all images that nobody holds."""
        self._free_before(context.pictures + 1)

    def free_old(self) -> None:
        """Free images that nobody holds and no recent picture asked for."""
        self._free_before(context.pictures - context.RECENT)

    def _free_before(self, picture: int) -> None:
        for key, stock in list(self._free.items()):
            if all(one[2] >= picture for one in stock):
                continue
            self.allocated_bytes -= sum(image.bytes for _, image, given in stock if given < picture)
            self._free[key] = [one for one in stock if one[2] >= picture]
            heapq.heapify(self._free[key])
            if not self._free[key]:
                del self._free[key]


pool = Pool()
on_release(pool.trim)
on_picture(pool.free_old)


@contextmanager
def borrowed(width: int, height: int, image_format: str) -> Iterator[Target]:
    """A target over one image of the pool, which gets it back at the end."""
    image = pool.take(width, height, image_format)
    try:
        yield Target((image,))
    finally:
        pool.give(image)


def finish() -> None:
    """Wait until the GPU has done everything submitted so far, by a texel that is drawn last and read back."""
    with borrowed(1, 1, "R32F") as target:
        target.clear()
        target.colors[0].texture.read()
