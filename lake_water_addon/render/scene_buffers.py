# SPDX-License-Identifier: GPL-3.0-or-later
"""The snapshot's meshes, instances and materials on the GPU; uploads only what has a new version."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass

import bpy
import gpu
import numpy as np
from gpu.types import GPUBatch, GPUShader, GPUTexture

from ..core.heights import HeightOrder, order_by_height
from ..core.plan import rebase
from ..core.snapshot import Material, Mesh, SceneSnapshot
from .resources import Resources

INSTANCE_TEXTURE_WIDTH = 1536
"""Texels in a row of the instance texture: a multiple of 3, so that no instance is broken across rows."""

TRIANGLE_LAYERS = 32
"""Layers of a mesh's height by which its triangles are ordered."""


@dataclass(frozen=True)
class Segment:
    """A part of a draw call: instances from `first` on, or a range of the only instance's indices."""

    call: DrawCall
    first: int
    instances: int
    indices: tuple[int, int] | None = None

    def draw(self, shader: GPUShader) -> None:
        """Draw with the bound shader, whose instance_base is `first`."""
        if self.indices is None:
            self.call.batch.draw_instanced(shader, instance_count=self.instances)
        else:
            start, count = self.indices
            self.call.batch.draw_range(shader, elem_start=start, elem_count=count)


@dataclass(frozen=True, eq=False)
class DrawCall:
    """One instanced draw. flipped: its matrices mirror, so its winding is turned around.

    solid: its back faces are the inside of something. heights: of its instances in render
    space. upright: (scale, offset) from heights in the mesh to heights in render space when
    there is one instance and it is not tilted, else None.
    """

    batch: GPUBatch
    first_instance: int
    instances: int
    flipped: bool
    solid: bool
    material: Material
    image: GPUTexture | None
    heights: HeightOrder
    triangle_heights: HeightOrder
    upright: tuple[float, float] | None

    def segments(
        self, keep: int, clip_height: float, clear_height: float
    ) -> tuple[Segment | None, Segment | None]:
        """What a pass on one side of the water needs: uncut, and to be cut (see `HeightOrder.split`)."""
        if self.upright is None:
            clear, cut = self.heights.split(keep, clip_height, clear_height)
            return self._instances(*clear), self._instances(*cut)
        scale, offset = self.upright
        clear, cut = self.triangle_heights.split(
            keep, (clip_height - offset) / scale, (clear_height - offset) / scale
        )
        return self._triangles(*clear), self._triangles(*cut)

    def around(self, lowest: float, highest: float) -> tuple[Segment | None, Segment | None, Segment | None]:
        """All of it, in three parts (see `HeightOrder.around`)."""
        if self.upright is None:
            return tuple(self._instances(*part) for part in self.heights.around(lowest, highest))
        scale, offset = self.upright
        parts = self.triangle_heights.around((lowest - offset) / scale, (highest - offset) / scale)
        return tuple(self._triangles(*part) for part in parts)

    def _instances(self, start: int, end: int) -> Segment | None:
        return Segment(self, self.first_instance + start, end - start) if end > start else None

    def _triangles(self, start: int, end: int) -> Segment | None:
        return Segment(self, self.first_instance, 1, (3 * start, 3 * (end - start))) if end > start else None


@dataclass(eq=False)
class _UploadedMesh:
    """batches and triangle_heights: by part."""

    version: int
    batches: tuple[GPUBatch, ...]
    triangle_heights: tuple[HeightOrder, ...]


class SceneBuffers:
    """What the passes draw. `update` before drawing; the order of `calls` keeps changes of state few."""

    def __init__(self, resources: Resources) -> None:
        self._resources = resources
        self._meshes: dict[Hashable, _UploadedMesh] = {}
        self._instance_state: tuple | None = None
        self._placed: list[tuple[int, HeightOrder]] = []
        self._segments: dict[tuple, tuple[list[Segment], ...]] = {}
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
        self._segments.clear()
        self.calls = []
        for draw, (first, heights) in zip(snapshot.draws, placed, strict=True):
            mesh, material = snapshot.meshes[draw.mesh], snapshot.materials[draw.material]
            if len(mesh.parts[draw.part].triangles) == 0:
                continue
            uploaded = self._meshes[draw.mesh]
            self.calls.append(
                DrawCall(
                    uploaded.batches[draw.part],
                    first,
                    len(draw.matrices),
                    bool(np.linalg.det(draw.matrices[0][:3, :3]) < 0.0),
                    # Through the holes of leaves one sees the back faces behind, and rightly so.
                    (mesh.solid or material.cull_back_faces) and material.alpha_threshold is None,
                    material,
                    textures.get(material.image),
                    heights,
                    uploaded.triangle_heights[draw.part],
                    _upright(draw.matrices, origin),
                )
            )
        self.calls.sort(key=lambda c: (c.image is not None, c.material.image or "", c.solid, c.flipped))
        self.sky_image = (snapshot.sky.image and image_texture(snapshot.sky.image)) or self._blank_texture()
        self._version = version

    def segments(
        self, keep: int, clip_height: float, clear_height: float
    ) -> tuple[list[Segment], list[Segment]]:
        """(uncut, to be cut) of all calls for a pass on one side of the water; found once a scene."""
        key = (keep, clip_height, clear_height)
        if key not in self._segments:
            pairs = [call.segments(*key) for call in self.calls]
            self._segments[key] = tuple([pair[i] for pair in pairs if pair[i]] for i in (0, 1))
        return self._segments[key]

    def around(self, lowest: float, highest: float) -> tuple[list[Segment], list[Segment], list[Segment]]:
        """All calls in three parts: wholly below `lowest`, perhaps on both sides, above `highest`."""
        key = (lowest, highest)
        if key not in self._segments:
            parts = [call.around(*key) for call in self.calls]
            self._segments[key] = tuple([part[i] for part in parts if part[i]] for i in range(3))
        return self._segments[key]

    def parts_of(self, key: Hashable) -> tuple[GPUBatch, ...]:
        """The batches of one uploaded mesh (a water body that is a mesh)."""
        return self._meshes[key].batches

    def _upload_meshes(self, snapshot: SceneSnapshot) -> None:
        for key in [k for k in self._meshes if k not in snapshot.meshes]:
            del self._meshes[key]
        for key, mesh in snapshot.meshes.items():
            known = self._meshes.get(key)
            if known is None or known.version != mesh.version:
                self._meshes[key] = self._upload_mesh(mesh)

    def _upload_mesh(self, mesh: Mesh) -> _UploadedMesh:
        count = len(mesh.positions)
        vertices = self._resources.vertex_buffer(
            {
                "position": mesh.positions,
                "normal": mesh.normals,
                "uv": mesh.uvs if mesh.uvs is not None else np.zeros((count, 2), np.float32),
                "color": mesh.colors if mesh.colors is not None else np.ones((count, 4), np.float32),
            }
        )
        batches, heights = [], []
        for part in mesh.parts:
            z = mesh.positions[:, 2].astype(np.float64)[part.triangles]
            order, by_height = order_by_height(z.min(axis=1), z.max(axis=1), TRIANGLE_LAYERS)
            batches.append(self._resources.batch(vertices, part.triangles[order]))
            heights.append(by_height)
        return _UploadedMesh(mesh.version, tuple(batches), tuple(heights))

    def _upload_instances(self, snapshot: SceneSnapshot, origin: np.ndarray) -> list[tuple[int, HeightOrder]]:
        """Fill the instance texture. For each draw: its first instance and the heights of all of them."""
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
            order, heights = order_by_height(*_heights(snapshot.meshes[draw.mesh], matrices))
            self._placed.append((first, heights))
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
    low, high = mesh.bounds
    center, half = 0.5 * (low + high), 0.5 * (high - low)
    middle = matrices[:, 2, :3] @ center + matrices[:, 2, 3]
    reach = np.abs(matrices[:, 2, :3]) @ half
    return middle - reach, middle + reach


def _upright(matrices: np.ndarray, origin: np.ndarray) -> tuple[float, float] | None:
    """(scale, offset) of heights under the only matrix of a draw; None for several, tilted or upside down."""
    row = matrices[0][2]
    if len(matrices) > 1 or row[0] != 0.0 or row[1] != 0.0 or row[2] <= 0.0:
        return None
    return float(row[2]), float(row[3] - origin[2])


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
