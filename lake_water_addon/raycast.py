# SPDX-License-Identifier: GPL-3.0-or-later
"""Casts rays into a snapshot with Blender's own bounding volume hierarchy: no texture, no camera, no GPU.

Its coordinates are float32, so that they are counted from an origin near what is looked at.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from .core.snapshot import Material, SceneSnapshot

CHUNK = 50_000
"""Triangles in one tree: so many take about a tenth of a second."""

MAX_LAYERS = 64
"""Holes of leaves, one behind the other, that a ray passes; then it ends on one."""

CLEARANCE = 1e-5
"""m, and as a part of the way so far, that a ray goes on behind a hole."""

Alphas = Mapping[str, np.ndarray]
"""Name -> (h, w) alpha of an image, first row at the bottom."""


@dataclass(frozen=True)
class RayHits:
    """What rays (n,) hit first. distance: m, inf without; normal: (n, 3), the face's; material: the number of
    the draw, -1 without."""

    distance: np.ndarray
    normal: np.ndarray
    material: np.ndarray

    @property
    def found(self) -> np.ndarray:
        return np.isfinite(self.distance)


def read_alphas(snapshot: SceneSnapshot) -> dict[str, np.ndarray]:
    """The alphas of all images that cut holes, from the open Blender file; none of those that are gone."""
    import bpy

    found = {}
    for name in {m.image for m in snapshot.materials.values() if _cuts(m)}:
        image = bpy.data.images.get(name)
        if image is not None and image.size[0] and image.channels == 4:
            pixels = np.empty(image.size[0] * image.size[1] * 4, np.float32)
            image.pixels.foreach_get(pixels)
            found[name] = pixels.reshape(image.size[1], image.size[0], 4)[..., 3].copy()
    return found


def _cuts(material: Material) -> bool:
    return material.image is not None and material.alpha_threshold is not None


class RayCaster:
    """The triangles of all draws of a snapshot. Materials are numbered in the order of its draws.

    alphas: of the images that cut holes (`read_alphas`); what is not among them is taken for whole. origin:
    (3,) world, of the coordinates that rays have.
    """

    def __init__(
        self, snapshot: SceneSnapshot, alphas: Alphas | None = None, origin: np.ndarray | None = None
    ) -> None:
        origin = np.zeros(3) if origin is None else origin
        corners, uvs, numbers, winding = [np.empty((0, 3, 3))], [np.empty((0, 3, 2))], [], []
        for number, draw in enumerate(snapshot.draws):
            mesh = snapshot.meshes[draw.mesh]
            triangles = mesh.parts[draw.part].triangles
            coordinates = mesh.uvs if mesh.uvs is not None else np.zeros((len(mesh.positions), 2))
            for matrix in draw.matrices:
                placed = mesh.positions.astype(np.float64) @ matrix[:3, :3].T + (matrix[:3, 3] - origin)
                corners.append(placed[triangles])
                uvs.append(coordinates[triangles])
                numbers.append(np.full(len(triangles), number))
                winding.append(np.full(len(triangles), np.sign(np.linalg.det(matrix[:3, :3]))))
        self._corners, self._uvs = np.concatenate(corners), np.concatenate(uvs)
        self._material = np.concatenate([np.empty(0, int), *numbers])
        self._winding = np.concatenate([np.empty(0), *winding])
        self._materials = [snapshot.materials[draw.material] for draw in snapshot.draws]
        self._alphas = alphas or {}
        self._trees: list = []
        self._begun = 0  # triangles that are in trees
        self._sees_through = np.array(
            [m.cull_back_faces or (_cuts(m) and m.image in self._alphas) for m in self._materials], bool
        )

    @property
    def progress(self) -> float:
        """Part of the triangles that are in trees, 0 to 1."""
        return self._begun / len(self._corners) if len(self._corners) else 1.0

    def build(self) -> bool:
        """Build one more tree; returns whether all are built. `cast` builds those that are left."""
        from mathutils.bvhtree import BVHTree

        if self._begun < len(self._corners):
            chunk = self._corners[self._begun : self._begun + CHUNK]
            indices = np.arange(3 * len(chunk)).reshape(-1, 3)
            tree = BVHTree.FromPolygons(chunk.reshape(-1, 3).tolist(), indices.tolist(), all_triangles=True)
            self._trees.append((self._begun, tree))
            self._begun += len(chunk)
        return self._begun >= len(self._corners)

    def cast(self, origin: np.ndarray, direction: np.ndarray) -> RayHits:
        """The first hits of rays from origin (n, 3) along unit directions (n, 3).

        Through the holes that images cut, and through the backs of faces that are culled.
        """
        while not self.build():
            pass
        origin, direction = np.broadcast_arrays(
            np.asarray(origin, np.float64), np.asarray(direction, np.float64)
        )
        count = len(origin)
        distance, normal = np.full(count, np.inf), np.zeros((count, 3))
        material = np.full(count, -1)
        rays, begin = np.arange(count), np.zeros(count)
        for layer in range(MAX_LAYERS):
            start = origin[rays] + begin[rays, None] * direction[rays]
            triangle, way, face = self._nearest(start, direction[rays])
            met = triangle >= 0
            rays, triangle, way, face = rays[met], triangle[met], way[met] + begin[rays[met]], face[met]
            stops = np.ones(len(rays), bool)
            if layer < MAX_LAYERS - 1:
                some = np.flatnonzero(self._sees_through[self._material[triangle]])
                at = origin[rays[some]] + way[some, None] * direction[rays[some]]
                stops[some] = self._stops(triangle[some], at, face[some], direction[rays[some]])
            ended = rays[stops]
            distance[ended], normal[ended] = way[stops], face[stops]
            material[ended] = self._material[triangle[stops]]
            rays, way = rays[~stops], way[~stops]
            if len(rays) == 0:
                break
            begin[rays] = way + CLEARANCE * (1.0 + way)
        return RayHits(distance, normal, material)

    def _nearest(
        self, origin: np.ndarray, direction: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(triangle (n,), -1 for none; distance (n,); normal (n, 3)) of whatever lies in the way first."""
        triangle, distance = np.full(len(origin), -1), np.full(len(origin), np.inf)
        normal = np.zeros((len(origin), 3))
        for i, (start, along) in enumerate(zip(origin.tolist(), direction.tolist(), strict=True)):
            for first, tree in self._trees:
                at, face_normal, face, length = tree.ray_cast(start, along)
                if at is not None and length < distance[i]:
                    triangle[i], distance[i], normal[i] = first + face, length, face_normal
        return triangle, distance, normal

    def _stops(
        self, triangle: np.ndarray, at: np.ndarray, face: np.ndarray, direction: np.ndarray
    ) -> np.ndarray:
        """(n,) whether rays that meet triangles at points (n, 3) are stopped there."""
        stops = np.ones(len(triangle), bool)
        from_behind = np.sum(face * direction, axis=1) * self._winding[triangle] > 0.0
        for number in np.unique(self._material[triangle]):
            material, these = self._materials[number], np.flatnonzero(self._material[triangle] == number)
            if material.cull_back_faces:
                stops[these] &= ~from_behind[these]
            if _cuts(material) and material.image in self._alphas:
                uv = self._uv(triangle[these], at[these])
                stops[these] &= _bilinear(self._alphas[material.image], uv) >= material.alpha_threshold
        return stops

    def _uv(self, triangle: np.ndarray, at: np.ndarray) -> np.ndarray:
        """(n, 2) texture coordinates at points (n, 3) of triangles."""
        a, b, c = (self._corners[triangle, i] for i in range(3))
        face = np.cross(b - a, c - a)
        area = np.maximum(np.sum(face * face, axis=1), 1e-300)
        of_b = np.sum(np.cross(at - a, c - a) * face, axis=1) / area
        of_c = np.sum(np.cross(b - a, at - a) * face, axis=1) / area
        return np.einsum("cn,ncd->nd", np.stack([1.0 - of_b - of_c, of_b, of_c]), self._uvs[triangle])


def _bilinear(image: np.ndarray, uv: np.ndarray) -> np.ndarray:
    """(n,) of an image (h, w) that repeats, at texture coordinates (n, 2)."""
    height, width = image.shape
    at = uv * (width, height) - 0.5
    low = np.floor(at)
    x, y = low.astype(np.int64).T
    px, py = (at - low).T
    x0, x1, y0, y1 = x % width, (x + 1) % width, y % height, (y + 1) % height
    lower = image[y0, x0] * (1.0 - px) + image[y0, x1] * px
    return lower * (1.0 - py) + (image[y1, x0] * (1.0 - px) + image[y1, x1] * px) * py
