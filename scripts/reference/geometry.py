# SPDX-License-Identifier: GPL-3.0-or-later
"""A snapshot's triangles, and rays against them.

Embree finds the triangle in float32; where the ray meets its plane is then computed in float64.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore_scene import EmbreeScene

from lake_water_addon.core.plan import rebase, render_origin
from lake_water_addon.core.snapshot import Draw, Mesh, SceneSnapshot

from .images import Images, bilinear

CLEARANCE = 1e-4
"""m by which a ray starts off a surface, and again for each 50 m of distance from the origin."""

MAX_LAYERS = 256
"""Holes of leaves, one behind the other, that a ray passes; then it ends on one."""

FARTHEST = 1e6
"""m: the length of a ray that has no end."""


class Hits(NamedTuple):
    """What rays meet. triangle: (n,) number, -1 for nothing; distance: (n,) m, inf for nothing."""

    triangle: np.ndarray
    distance: np.ndarray


class SurfacePoints(NamedTuple):
    """Places on triangles. position: (n, 3); albedo: (n, 3); draw: (n,) number.

    normal, face: (n, 3) unit, interpolated and the triangle's own, as on the side that the ray came from.
    """

    position: np.ndarray
    normal: np.ndarray
    face: np.ndarray
    albedo: np.ndarray
    draw: np.ndarray


def clearance(position: np.ndarray) -> np.ndarray:
    """(n, 1) m that a ray from points (n, 3) starts off their surface."""
    return CLEARANCE * (1.0 + np.linalg.norm(position, axis=1, keepdims=True) / 50.0)


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-300)


class Geometry:
    """All instances of a snapshot, in render space.

    images: pixels of the textures that the materials name (see `images`); KeyError when one is missing.
    """

    def __init__(self, snapshot: SceneSnapshot, images: Images | None = None) -> None:
        self.origin = render_origin(snapshot)
        self.materials = list(snapshot.materials.values())
        self._images = images or {}
        missing = {m.image for m in self.materials if m.image} - self._images.keys()
        if missing:
            raise KeyError(f"the pixels of the image {sorted(missing)[0]!r} were not given")
        numbers = {key: i for i, key in enumerate(snapshot.materials)}
        pieces = [
            _instances(snapshot.meshes[draw.mesh], draw, self.origin, numbers[draw.material], i)
            for i, draw in enumerate(snapshot.draws)
        ]
        self.corners = _stack([p.corners for p in pieces], (3, 3))  # (T, 3 corners, 3)
        self._normals = _stack([p.normals for p in pieces], (3, 3))
        self._uvs = _stack([p.uvs for p in pieces], (3, 2))
        self._colors = _stack([p.colors for p in pieces], (3, 3))
        self._material = _stack([p.material for p in pieces], (), np.int32)
        self._draw = _stack([p.draw for p in pieces], (), np.int32)
        winding = _stack([p.winding for p in pieces], ())
        first, second = (self.corners[:, i] - self.corners[:, 0] for i in (1, 2))
        self._face = np.cross(first, second) * winding[:, None]
        cut = np.array([m.alpha_threshold is not None for m in self.materials], bool)[self._material]
        self._culled = np.array([m.cull_back_faces for m in self.materials], bool)[self._material]
        self._is_cut = cut
        self._all = self._scene(np.arange(len(self.corners)))
        self._opaque, self._cut = self._scene(np.flatnonzero(~cut)), self._scene(np.flatnonzero(cut))

    def _scene(self, triangles: np.ndarray) -> tuple[EmbreeScene, np.ndarray] | None:
        """Embree's tree over some triangles, and their numbers; None for none."""
        if len(triangles) == 0:
            return None
        scene = EmbreeScene(robust=True)
        corners = self.corners[triangles].astype(np.float32).reshape(-1, 3)
        TriangleMesh(scene, corners, np.arange(len(corners), dtype=np.int32).reshape(-1, 3))
        # The tree is built by the first ray: now, and not by several threads at once.
        scene.run(np.zeros((1, 3), np.float32), np.ones((1, 3), np.float32))
        return scene, triangles

    def bounds(self) -> tuple[np.ndarray, np.ndarray]:
        """Lowest and highest corner (3,) of all triangles."""
        return self.corners.min(axis=(0, 1)), self.corners.max(axis=(0, 1))

    def first_hits(self, origin: np.ndarray, direction: np.ndarray) -> Hits:
        """The first thing that rays (n, 3) see: leaves where they are opaque, faces that are not culled."""
        return self._search(self._all, origin, direction, np.full(len(origin), FARTHEST), culls=True)

    def occluded(
        self, origin: np.ndarray, direction: np.ndarray, length: np.ndarray | float = FARTHEST
    ) -> np.ndarray:
        """(n,) whether something lies on rays (n, 3) within `length` m; either side of a face counts."""
        length = np.broadcast_to(np.asarray(length, dtype=np.float64), (len(origin),))
        hidden = np.zeros(len(origin), bool)
        if self._opaque is not None and len(origin):
            arrays = (a.astype(np.float32) for a in (origin, direction))
            dists = length.astype(np.float32)
            hidden = self._opaque[0].run(*arrays, dists=dists, query="OCCLUDED") >= 0
        if self._cut is not None:
            rest = np.flatnonzero(~hidden)
            found = self._search(self._cut, origin[rest], direction[rest], length[rest], culls=False)
            hidden[rest] = found.triangle >= 0
        return hidden

    def _search(
        self,
        scene: tuple[EmbreeScene, np.ndarray] | None,
        origin: np.ndarray,
        direction: np.ndarray,
        length: np.ndarray,
        *,
        culls: bool,
    ) -> Hits:
        triangle = np.full(len(origin), -1, np.int64)
        distance = np.full(len(origin), np.inf)
        if scene is None:
            return Hits(triangle, distance)
        tree, numbers = scene
        start = np.zeros(len(origin))
        rays = np.arange(len(origin))
        for layer in range(MAX_LAYERS):
            if len(rays) == 0:
                break
            at = origin[rays] + start[rays, None] * direction[rays]
            left = (length - start)[rays].astype(np.float32)
            found = tree.run(
                at.astype(np.float32), direction[rays].astype(np.float32), dists=left, output=True
            )
            met = found["primID"] >= 0
            rays, at = rays[met], at[met]
            of_ray = numbers[found["primID"][met]]
            way = self._way(of_ray, at, direction[rays], found["tfar"][met]) + start[rays]
            seen = np.ones(len(rays), bool)
            if layer < MAX_LAYERS - 1:
                if culls:
                    behind = np.sum(self._face[of_ray] * direction[rays], axis=1) > 0.0
                    seen &= ~(behind & self._culled[of_ray])
                leaves = np.flatnonzero(seen & self._is_cut[of_ray])
                place = origin[rays[leaves]] + way[leaves, None] * direction[rays[leaves]]
                seen[leaves] = self._is_opaque_at(of_ray[leaves], place)
            triangle[rays[seen]], distance[rays[seen]] = of_ray[seen], way[seen]
            rays, at, way = rays[~seen], at[~seen], way[~seen]
            start[rays] = way + 0.1 * clearance(at)[:, 0]
        return Hits(triangle, distance)

    def _way(
        self, triangle: np.ndarray, origin: np.ndarray, direction: np.ndarray, near: np.ndarray
    ) -> np.ndarray:
        """(n,) m to the triangles' planes; Embree's own answer `near` where a plane is seen edge on."""
        face = self._face[triangle]
        towards = np.sum(face * direction, axis=1)
        height = np.sum(face * (self.corners[triangle, 0] - origin), axis=1)
        edge_on = np.abs(towards) < 1e-3 * np.linalg.norm(face, axis=1)
        way = height / np.where(edge_on, 1.0, towards)
        return np.where(edge_on | (way < 0.0), near, way)

    def _weights(self, triangle: np.ndarray, position: np.ndarray) -> np.ndarray:
        """(n, 3) barycentric coordinates of points (n, 3) of triangles."""
        a, b, c = (self.corners[triangle, i] for i in range(3))
        face = np.cross(b - a, c - a)
        area = np.maximum(np.sum(face * face, axis=1), 1e-300)
        of_b = np.sum(np.cross(position - a, c - a) * face, axis=1) / area
        of_c = np.sum(np.cross(b - a, position - a) * face, axis=1) / area
        weights = np.clip(np.stack([1.0 - of_b - of_c, of_b, of_c], axis=1), 0.0, 1.0)
        return weights / np.maximum(weights.sum(axis=1, keepdims=True), 1e-300)

    def _is_opaque_at(self, triangle: np.ndarray, position: np.ndarray) -> np.ndarray:
        uv = np.einsum("nc,ncd->nd", self._weights(triangle, position), self._uvs[triangle])
        opaque = np.ones(len(triangle), bool)
        for number in np.unique(self._material[triangle]):
            material, these = self.materials[number], self._material[triangle] == number
            alpha = bilinear(self._images[material.image][..., 3:], uv[these])[:, 0]
            opaque[these] = alpha >= material.alpha_threshold
        return opaque

    def surface(self, hits: Hits, origin: np.ndarray, direction: np.ndarray) -> SurfacePoints:
        """Where rays (n, 3) that all hit something did so."""
        triangle = hits.triangle
        position = origin + hits.distance[:, None] * direction
        weights = self._weights(triangle, position)
        towards = np.where(np.sum(self._face[triangle] * direction, axis=1) <= 0.0, 1.0, -1.0)[:, None]
        normal = _unit(np.einsum("nc,ncd->nd", weights, self._normals[triangle]))
        face = _unit(self._face[triangle])
        albedo = np.empty_like(position)
        for number in np.unique(self._material[triangle]):
            material, these = self.materials[number], self._material[triangle] == number
            if material.image is not None:
                uv = np.einsum("nc,ncd->nd", weights[these], self._uvs[triangle[these]])
                albedo[these] = bilinear(self._images[material.image][..., :3], uv)
            elif material.use_color_attribute:
                albedo[these] = np.einsum("nc,ncd->nd", weights[these], self._colors[triangle[these]])
            else:
                albedo[these] = material.base_color
        return SurfacePoints(position, towards * normal, towards * face, albedo, self._draw[triangle])


class _Instances(NamedTuple):
    corners: np.ndarray
    normals: np.ndarray
    uvs: np.ndarray
    colors: np.ndarray
    material: np.ndarray
    draw: np.ndarray
    winding: np.ndarray


def _stack(arrays: list[np.ndarray], shape: tuple[int, ...], dtype: type = np.float64) -> np.ndarray:
    return np.concatenate([np.empty((0, *shape), dtype), *arrays])


def _instances(mesh: Mesh, draw: Draw, origin: np.ndarray, material: int, number: int) -> _Instances:
    """The triangles of one draw, those of all its instances one after the other."""
    triangles = mesh.parts[draw.part].triangles
    matrices = rebase(draw.matrices, origin)
    n, t = len(matrices), len(triangles)
    positions = np.einsum("mij,vj->mvi", matrices[:, :3, :3], mesh.positions.astype(np.float64))
    positions += matrices[:, None, :3, 3]
    a, b, c = (matrices[:, i, :3] for i in range(3))
    # Normals go with the cofactors, as in scene_vert.glsl.
    winding = np.where(np.sum(a * np.cross(b, c), axis=1) < 0.0, -1.0, 1.0)
    cofactors = np.stack([np.cross(b, c), np.cross(c, a), np.cross(a, b)], axis=1) * winding[:, None, None]
    normals = _unit(np.einsum("mij,vj->mvi", cofactors, mesh.normals.astype(np.float64)))
    count = len(mesh.positions)
    uvs = mesh.uvs if mesh.uvs is not None else np.zeros((count, 2), np.float32)
    colors = mesh.colors[:, :3] if mesh.colors is not None else np.ones((count, 3), np.float32)
    return _Instances(
        positions[:, triangles].reshape(n * t, 3, 3),
        normals[:, triangles].reshape(n * t, 3, 3),
        np.tile(uvs[triangles], (n, 1, 1)),
        np.tile(colors[triangles], (n, 1, 1)),
        np.full(n * t, material, np.int32),
        np.full(n * t, number, np.int32),
        np.repeat(winding, t),
    )
