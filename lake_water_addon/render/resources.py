# SPDX-License-Identifier: GPL-3.0-or-later
"""The one place where GPU objects are made, so that what a frame makes can be counted."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import gpu
import numpy as np
from gpu.types import (
    Buffer,
    GPUBatch,
    GPUFrameBuffer,
    GPUIndexBuf,
    GPUShader,
    GPUShaderCreateInfo,
    GPUTexture,
    GPUUniformBuf,
    GPUVertBuf,
    GPUVertFormat,
)


class Resources:
    """Makes GPU objects and counts them by kind in `made` since `reset_counts`."""

    def __init__(self) -> None:
        self.made: Counter[str] = Counter()
        self._triangle: GPUBatch | None = None

    def reset_counts(self) -> None:
        self.made.clear()

    def shader(self, info: GPUShaderCreateInfo) -> GPUShader:
        self.made["shaders"] += 1
        shader = gpu.shader.create_from_info(info)
        # Blender skips the binding of a shader that it believes bound, and knows it by its address. One
        # made where a freed one lay would draw with the freed one's program: bind another in between.
        gpu.shader.from_builtin("UNIFORM_COLOR").bind()
        return shader

    def texture(self, size: tuple[int, ...], pixel_format: str, data: np.ndarray | None = None) -> GPUTexture:
        """data: float32 in any shape, rows from the bottom; None leaves the content undefined."""
        self.made["textures"] += 1
        if data is None:
            return GPUTexture(size, format=pixel_format)
        flat = np.ascontiguousarray(data, dtype=np.float32).ravel()
        return GPUTexture(size, format=pixel_format, data=Buffer("FLOAT", len(flat), flat))

    def framebuffer(self, colors: Sequence[GPUTexture], depth: GPUTexture | None = None) -> GPUFrameBuffer:
        self.made["framebuffers"] += 1
        return GPUFrameBuffer(color_slots=tuple(colors), depth_slot=depth)

    def uniform_buffer(self, data: np.ndarray) -> GPUUniformBuf:
        self.made["buffers"] += 1
        return GPUUniformBuf(Buffer("FLOAT", data.size, data))

    def vertex_buffer(self, attributes: dict[str, np.ndarray]) -> GPUVertBuf:
        """attributes: name -> (V, n) float32."""
        self.made["buffers"] += 1
        vertex_format = GPUVertFormat()
        for name, values in attributes.items():
            vertex_format.attr_add(id=name, comp_type="F32", len=values.shape[1], fetch_mode="FLOAT")
        buffer = GPUVertBuf(vertex_format, len(next(iter(attributes.values()))))
        for name, values in attributes.items():
            buffer.attr_fill(name, np.ascontiguousarray(values, dtype=np.float32))
        return buffer

    def batch(self, vertices: GPUVertBuf, triangles: np.ndarray) -> GPUBatch:
        """triangles: (T, 3) int32 indices."""
        self.made["batches"] += 1
        indices = GPUIndexBuf(type="TRIS", seq=np.ascontiguousarray(triangles, dtype=np.int32))
        return GPUBatch(type="TRIS", buf=vertices, elem=indices)

    def points(self, vertices: GPUVertBuf) -> GPUBatch:
        """A batch that draws each vertex as a point."""
        self.made["batches"] += 1
        return GPUBatch(type="POINTS", buf=vertices)

    def covering_triangle(self) -> GPUBatch:
        """One triangle over the whole target (attribute `position`, device coordinates); made once."""
        if self._triangle is None:
            corners = np.array([(-1, -1), (3, -1), (-1, 3)], np.float32)
            self._triangle = self.batch(
                self.vertex_buffer({"position": corners}), np.array([(0, 1, 2)], np.int32)
            )
        return self._triangle
