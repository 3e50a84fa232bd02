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
    """One instanced draw. flipped: its matrices mirror, so its winding is turned around.

    solid: its back faces are the inside of something.

    Its instances are ordered by height. least_above[i] is the lowest point of the instances
    from i on, most_below[i] the highest point of those up to i; render space, m.
    """

    batch: GPUBatch
    first_instance: int
    instances: int
    flipped: bool
    solid: bool
    material: Material
    image: GPUTexture | None
    least_above: np.ndarray
    most_below: np.ndarray

    def instances_beside(self, keep: int, clip_height: float) -> tuple[int, int]:
        """(first, count) of the instances that may reach below (keep +1) or above (-1) a height; 0: all.

        Trees need not go through the vertex shader for the refraction texture, nor the stones on the
        bottom for the reflection.
        """
        start, end = 0, self.instances
        if keep > 0:
            end = int(np.searchsorted(self.least_above, clip_height, side="right"))
        elif keep < 0:
            start = int(np.searchsorted(self.most_below, clip_height, side="left"))
        return self.first_instance + start, end - start


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
        self._placed: list[tuple[int, np.ndarray, np.ndarray]] = []
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
        placed = self._upload_instances(snapshot, origin)
        images = {m.image for m in snapshot.materials.values() if m.image}
        textures = {name: image_texture(name) for name in images}
        self.calls = []
        for draw, (first, least_above, most_below) in zip(snapshot.draws, placed, strict=True):
            mesh = snapshot.meshes[draw.mesh]
            material = snapshot.materials[draw.material]
            self.calls.append(
                DrawCall(
                    self._meshes[draw.mesh].parts[draw.part],
                    first,
                    len(draw.matrices),
                    bool(np.linalg.det(draw.matrices[0][:3, :3]) < 0.0),
                    # Through the holes of leaves one sees the back faces behind, and rightly so.
                    (mesh.solid or material.cull_back_faces) and material.alpha_threshold is None,
                    material,
                    textures.get(material.image),
                    least_above,
                    most_below,
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

    def _upload_instances(
        self, snapshot: SceneSnapshot, origin: np.ndarray
    ) -> list[tuple[int, np.ndarray, np.ndarray]]:
        """Fill the instance texture. For each draw: its first instance and the heights of `DrawCall`."""
        state = (
            tuple(origin),
            tuple((d.version, len(d.matrices), snapshot.meshes[d.mesh].version) for d in snapshot.draws),
        )
        if state == self._instance_state:
            return self._placed
        self._placed = []
        stacked = []
        first = 0
        for draw in snapshot.draws:
            matrices = rebase(draw.matrices, origin)
            lowest, highest = _heights(snapshot.meshes[draw.mesh], matrices)
            order = np.argsort(lowest + highest, kind="stable")
            self._placed.append(
                (
                    first,
                    np.minimum.accumulate(lowest[order][::-1])[::-1],
                    np.maximum.accumulate(highest[order]),
                )
            )
            stacked.append(matrices[order, :3, :])
            first += len(matrices)
        per_line = INSTANCE_TEXTURE_WIDTH // 3
        lines = max(1, -(-first // per_line))
        texels = np.zeros((lines * per_line, 3, 4), np.float32)
        if stacked:
            texels[:first] = np.concatenate(stacked)
        self.instances = self._resources.texture((INSTANCE_TEXTURE_WIDTH, lines), "RGBA32F", texels)
        self.instances.filter_mode(False)
        self._instance_state = state
        return self._placed

    def _blank_texture(self) -> GPUTexture:
        if self._blank is None:
            self._blank = self._resources.texture((1, 1), "RGBA16F", np.zeros(4, np.float32))
        return self._blank


def _heights(mesh: Mesh, matrices: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest z (n,) of the mesh's bounding box under each of the matrices (n, 4, 4)."""
    if len(mesh.positions) == 0:
        return matrices[:, 2, 3], matrices[:, 2, 3]
    low, high = mesh.positions.min(axis=0).astype(np.float64), mesh.positions.max(axis=0).astype(np.float64)
    center, half = 0.5 * (low + high), 0.5 * (high - low)
    middle = matrices[:, 2, :3] @ center + matrices[:, 2, 3]
    reach = np.abs(matrices[:, 2, :3]) @ half
    return middle - reach, middle + reach


def image_texture(name: str) -> GPUTexture | None:
    """Blender's own texture of an image, scene-linear; None when it is gone or has no pixels."""
    image = bpy.data.images.get(name)
    if image is None or not (image.has_data or image.size[0]):
        return None
    texture = gpu.texture.from_image(image)
    if gpu.platform.device_type_get() == "SOFTWARE":
        # Mesa's llvmpipe takes up to 40 s for a frame of 480x270 with it, where a GPU takes next to nothing.
        texture.anisotropic_filter(False)
    return texture
