# SPDX-License-Identifier: GPL-3.0-or-later
"""The snapshot's meshes, instances and materials on the GPU; uploads only what has a new version."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass

import bpy
import gpu
import numpy as np
from gpu.types import GPUBatch, GPUTexture

from ..core.plan import rebase
from ..core.snapshot import Material, Mesh, SceneSnapshot
from .resources import Resources

INSTANCE_TEXTURE_WIDTH = 1536
"""Texels in a row of the instance texture: a multiple of 3, so that no instance is broken across rows."""


@dataclass(frozen=True, eq=False)
class DrawCall:
    """One instanced draw. flipped: its matrices mirror, so its winding is turned around."""

    batch: GPUBatch
    first_instance: int
    instances: int
    flipped: bool
    solid: bool
    material: Material
    image: GPUTexture | None


@dataclass(eq=False)
class _UploadedMesh:
    version: int
    parts: tuple[GPUBatch, ...]


class SceneBuffers:
    """What the passes draw. `update` before drawing; the order of `calls` keeps changes of state few."""

    def __init__(self, resources: Resources) -> None:
        self._resources = resources
        self._meshes: dict[Hashable, _UploadedMesh] = {}
        self._instance_state: tuple | None = None
        self._version: tuple | None = None
        self._blank: GPUTexture | None = None
        self.instances: GPUTexture | None = None
        self.calls: list[DrawCall] = []
        self.sky_image: GPUTexture | None = None

    def update(self, snapshot: SceneSnapshot, origin: np.ndarray) -> None:
        """Upload what changed since the last call. origin: of render space, world, float64."""
        version = (snapshot.version, tuple(origin))
        if version == self._version:
            return
        self._upload_meshes(snapshot)
        first = self._upload_instances(snapshot, origin)
        images = {m.image for m in snapshot.materials.values() if m.image}
        textures = {name: image_texture(name) for name in images}
        self.calls = []
        for draw, start in zip(snapshot.draws, first, strict=True):
            mesh = snapshot.meshes[draw.mesh]
            material = snapshot.materials[draw.material]
            self.calls.append(
                DrawCall(
                    self._meshes[draw.mesh].parts[draw.part],
                    start,
                    len(draw.matrices),
                    bool(np.linalg.det(draw.matrices[0][:3, :3]) < 0.0),
                    mesh.solid or material.cull_back_faces,
                    material,
                    textures.get(material.image),
                )
            )
        self.calls.sort(key=lambda c: (c.image is not None, c.material.image or "", c.solid, c.flipped))
        self.sky_image = (snapshot.sky.image and image_texture(snapshot.sky.image)) or self._blank_texture()
        self._version = version

    def parts_of(self, key: Hashable) -> tuple[GPUBatch, ...]:
        """The batches of one uploaded mesh (a water body that is a mesh)."""
        return self._meshes[key].parts

    def _upload_meshes(self, snapshot: SceneSnapshot) -> None:
        for key in [k for k in self._meshes if k not in snapshot.meshes]:
            del self._meshes[key]
        for key, mesh in snapshot.meshes.items():
            known = self._meshes.get(key)
            if known is None or known.version != mesh.version:
                self._meshes[key] = _UploadedMesh(mesh.version, self._make_batches(mesh))

    def _make_batches(self, mesh: Mesh) -> tuple[GPUBatch, ...]:
        count = len(mesh.positions)
        vertices = self._resources.vertex_buffer(
            {
                "position": mesh.positions,
                "normal": mesh.normals,
                "uv": mesh.uvs if mesh.uvs is not None else np.zeros((count, 2), np.float32),
                "color": mesh.colors if mesh.colors is not None else np.ones((count, 4), np.float32),
            }
        )
        return tuple(self._resources.batch(vertices, part.triangles) for part in mesh.parts)

    def _upload_instances(self, snapshot: SceneSnapshot, origin: np.ndarray) -> list[int]:
        """Fill the instance texture; the first instance of each draw is returned."""
        counts = [len(draw.matrices) for draw in snapshot.draws]
        first = np.concatenate([[0], np.cumsum(counts)]).astype(int)
        state = (tuple(origin), tuple((d.version, n) for d, n in zip(snapshot.draws, counts, strict=True)))
        if state != self._instance_state:
            rows_per_line = INSTANCE_TEXTURE_WIDTH // 3
            lines = max(1, -(-int(first[-1]) // rows_per_line))
            texels = np.zeros((lines * rows_per_line, 3, 4), np.float32)
            if counts:
                stacked = np.concatenate([draw.matrices for draw in snapshot.draws])
                texels[: first[-1]] = rebase(stacked, origin)[:, :3, :]
            self.instances = self._resources.texture((INSTANCE_TEXTURE_WIDTH, lines), "RGBA32F", texels)
            self.instances.filter_mode(False)
            self._instance_state = state
        return [int(i) for i in first[:-1]]

    def _blank_texture(self) -> GPUTexture:
        if self._blank is None:
            self._blank = self._resources.texture((1, 1), "RGBA16F", np.zeros(4, np.float32))
        return self._blank


def image_texture(name: str) -> GPUTexture | None:
    """Blender's own texture of an image, scene-linear; None when it is gone or has no pixels."""
    image = bpy.data.images.get(name)
    if image is None or not image.has_data and image.size[0] == 0:
        return None
    return gpu.texture.from_image(image)
