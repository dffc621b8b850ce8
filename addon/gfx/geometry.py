"""Vertex and index buffers from numpy arrays."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field

import gpu
import numpy as np

_numbers = itertools.count()


@dataclass(eq=False)
class Batch:
    """Triangles on the GPU. Several batches may share one vertex buffer."""

    handle: gpu.types.GPUBatch
    triangles: int
    number: int = field(default_factory=_numbers.__next__)  # no other batch ever has it, as id() may be given again


def vertex_buffer(**attributes: np.ndarray) -> gpu.types.GPUVertBuf:
    """A vertex buffer of float32 (N, k) or int32 (N,) attributes; all of the same length N."""
    layout = gpu.types.GPUVertFormat()
    count = len(next(iter(attributes.values())))
    for name, data in attributes.items():
        if len(data) != count:
            raise ValueError(f"Vertex attribute '{name}' has {len(data)} entries, the others have {count}.")
        if data.dtype == np.int32:
            layout.attr_add(id=name, comp_type="I32", len=1, fetch_mode="INT")
        else:
            layout.attr_add(id=name, comp_type="F32", len=data.shape[1], fetch_mode="FLOAT")
    buffer = gpu.types.GPUVertBuf(format=layout, len=count)
    for name, data in attributes.items():
        kind = np.int32 if data.dtype == np.int32 else np.float32
        buffer.attr_fill(id=name, data=np.ascontiguousarray(data, kind))
    return buffer


def triangle_batch(vertices: gpu.types.GPUVertBuf, indices: np.ndarray) -> Batch:
    """Triangles over a vertex buffer; `indices` is (T, 3) integer."""
    flat = np.ascontiguousarray(indices, np.int32).reshape(-1, 3)
    elements = gpu.types.GPUIndexBuf(type="TRIS", seq=flat)
    return Batch(gpu.types.GPUBatch(type="TRIS", buf=vertices, elem=elements), len(flat))


def point_batch(vertices: gpu.types.GPUVertBuf) -> gpu.types.GPUBatch:
    """One point for each vertex of a buffer."""
    return gpu.types.GPUBatch(type="POINTS", buf=vertices)


def numbered_points(count: int) -> gpu.types.GPUBatch:
    """Points with nothing but an int attribute `number`, 0 to count - 1."""
    return gpu.types.GPUBatch(type="POINTS", buf=vertex_buffer(number=np.arange(count, dtype=np.int32)))
