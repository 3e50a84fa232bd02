# SPDX-License-Identifier: GPL-3.0-or-later
"""Casts rays into a snapshot with Blender's own bounding volume hierarchy: no texture, no camera, no GPU.

Its coordinates are float32, so scenes have to lie near the world's origin.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lake_water_addon.core import cameras


@dataclass(frozen=True)
class Hits:
    """What rays (n,) hit first. distance: m, inf without; normal: (n, 3), the face's; material: number."""

    distance: np.ndarray
    normal: np.ndarray
    material: np.ndarray

    @property
    def found(self) -> np.ndarray:
        return np.isfinite(self.distance)


class RayCaster:
    """The triangles of all draws of a snapshot. Materials are numbered in the order of its draws."""

    def __init__(self, scene) -> None:
        from mathutils.bvhtree import BVHTree

        corners, self._material = [], []
        for number, draw in enumerate(scene.draws):
            mesh = scene.meshes[draw.mesh]
            for matrix in draw.matrices:
                placed = mesh.positions.astype(np.float64) @ matrix[:3, :3].T + matrix[:3, 3]
                corners.append(placed[mesh.parts[draw.part].triangles])
                self._material += [number] * len(corners[-1])
        triangles = np.concatenate(corners)
        indices = np.arange(3 * len(triangles)).reshape(-1, 3)
        self._tree = BVHTree.FromPolygons(
            triangles.reshape(-1, 3).tolist(), indices.tolist(), all_triangles=True
        )
        self._triangles = triangles
        self.albedo = np.array([scene.materials[draw.material].base_color for draw in scene.draws])

    def cast(self, origin: np.ndarray, direction: np.ndarray) -> Hits:
        """The first hits of rays from origin (n, 3) along unit directions (n, 3)."""
        origin, direction = np.broadcast_arrays(origin, direction)
        distance, normal = np.full(len(origin), np.inf), np.zeros((len(origin), 3))
        material = np.full(len(origin), -1)
        for i, (start, along) in enumerate(zip(origin.tolist(), direction.tolist(), strict=True)):
            at, face_normal, face, length = self._tree.ray_cast(start, along)
            if at is not None:
                distance[i], normal[i], material[i] = length, face_normal, self._material[face]
        return Hits(distance, normal, material)

    def is_free(self, origin: np.ndarray, direction: np.ndarray) -> np.ndarray:
        """(n,) True where nothing lies in the way."""
        return ~self.cast(origin, direction).found

    def first(self, points: np.ndarray, direction: np.ndarray) -> np.ndarray:
        """(n,) distances along light in `direction` (3,), from each point (n, 3), to what it hits first.

        Negative: nearer to the light than the point.
        """
        far = 1e3
        return self.cast(points - far * direction, np.broadcast_to(direction, points.shape)).distance - far


def pixel_rays(view: np.ndarray, projection: np.ndarray, size: tuple[int, int]):
    """Origins and unit directions (h * w, 3) of the rays through the pixels' middles, lowest row first."""
    x, y = (2.0 * (np.arange(n) + 0.5) / n - 1.0 for n in size)
    x, y = (grid.ravel() for grid in np.meshgrid(x, y))
    to_world = np.linalg.inv(projection @ view)
    ends = []
    for z in (-1.0, 1.0):
        clip = np.column_stack([x, y, np.full(x.size, z), np.ones(x.size)]) @ to_world.T
        ends.append(clip[:, :3] / clip[:, 3:])
    direction = ends[1] - ends[0]
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    if not cameras.is_orthographic(projection):
        # The pole of the mirrored camera's rays is its eye, too.
        return np.broadcast_to(cameras.eye_position(view), direction.shape), direction
    return ends[0], direction
