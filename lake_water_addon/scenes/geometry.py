# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes as arrays, the shapes that the lake's props are made of, and the way into Blender."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import bpy
import numpy as np

COLOR_ATTRIBUTE = "Color"


@dataclass(frozen=True, eq=False)
class Geometry:
    """A polygon mesh.

    positions: (V, 3). corners: (L,) vertex of each face corner, the faces one after another; sizes: (F,)
    corners of each face. uvs: (L, 2) or None. colors: (V, 3) scene-linear or None. normals: (V, 3) custom
    vertex normals or None. slots: (F,) material slot; smooth: (F,) smooth shaded.
    Counter-clockwise faces look outwards.
    """

    positions: np.ndarray
    corners: np.ndarray
    sizes: np.ndarray
    uvs: np.ndarray | None = None
    colors: np.ndarray | None = None
    normals: np.ndarray | None = None
    slots: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=np.int32))
    smooth: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=bool))

    def __post_init__(self) -> None:
        faces = len(self.sizes)
        if len(self.slots) != faces:
            object.__setattr__(self, "slots", np.zeros(faces, dtype=np.int32))
        if len(self.smooth) != faces:
            object.__setattr__(self, "smooth", np.ones(faces, dtype=bool))

    def moved(self, matrix: np.ndarray, offset: Sequence[float] = (0.0, 0.0, 0.0)) -> Geometry:
        """The mesh after x -> matrix x + offset. matrix: (3, 3), rotation and scale, no mirroring."""
        normals = self.normals
        if normals is not None:
            normals = normals @ np.linalg.inv(matrix)
            normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
        return replace(
            self, positions=self.positions @ np.asarray(matrix).T + np.asarray(offset), normals=normals
        )

    def with_slot(self, slot: int) -> Geometry:
        """The same mesh with every face in one material slot."""
        return replace(self, slots=np.full(len(self.sizes), slot, dtype=np.int32))

    def with_color(self, color: Sequence[float] | np.ndarray) -> Geometry:
        """The same mesh with one colour, or with (V, 3) colours."""
        colors = np.broadcast_to(np.asarray(color, dtype=np.float64), self.positions.shape)
        return replace(self, colors=colors.copy())

    def flat(self) -> Geometry:
        """The same mesh, flat shaded."""
        return replace(self, smooth=np.zeros(len(self.sizes), dtype=bool))

    def smooth_normals(self) -> np.ndarray:
        """(V, 3) vertex normals weighted by area (Newell's sum over each face)."""
        starts = np.concatenate([[0], np.cumsum(self.sizes)[:-1]])
        face = np.repeat(np.arange(len(self.sizes)), self.sizes)
        following = np.arange(len(self.corners)) + 1
        ends = starts + self.sizes
        wrap = following == ends[face]
        following[wrap] = starts[face[wrap]]
        a, b = self.positions[self.corners], self.positions[self.corners[following]]
        face_normals = np.zeros((len(self.sizes), 3))
        np.add.at(face_normals, face, np.cross(a, b))
        normals = np.zeros_like(self.positions)
        np.add.at(normals, self.corners, face_normals[face])
        return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)


def join(parts: Sequence[Geometry]) -> Geometry:
    """One mesh from several. What a part lacks is filled in: uv 0, white, its own smooth normals."""
    offsets = np.cumsum([0] + [len(p.positions) for p in parts[:-1]])
    any_uv = any(p.uvs is not None for p in parts)
    any_color = any(p.colors is not None for p in parts)
    any_normal = any(p.normals is not None for p in parts)
    return Geometry(
        positions=np.concatenate([p.positions for p in parts]),
        corners=np.concatenate([p.corners + o for p, o in zip(parts, offsets, strict=True)]),
        sizes=np.concatenate([p.sizes for p in parts]),
        uvs=np.concatenate([p.uvs if p.uvs is not None else np.zeros((len(p.corners), 2)) for p in parts])
        if any_uv
        else None,
        colors=np.concatenate(
            [p.colors if p.colors is not None else np.ones((len(p.positions), 3)) for p in parts]
        )
        if any_color
        else None,
        normals=np.concatenate([p.normals if p.normals is not None else p.smooth_normals() for p in parts])
        if any_normal
        else None,
        slots=np.concatenate([p.slots for p in parts]),
        smooth=np.concatenate([p.smooth for p in parts]),
    )


def rotation(yaw: float = 0.0, pitch: float = 0.0, roll: float = 0.0) -> np.ndarray:
    """(3, 3): first roll about X, then pitch about Y, then yaw about Z; radians."""
    cr, sr, cp, sp, cy, sy = (
        np.cos(roll),
        np.sin(roll),
        np.cos(pitch),
        np.sin(pitch),
        np.cos(yaw),
        np.sin(yaw),
    )
    rx = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    ry = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    rz = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    return rz @ ry @ rx


def grid_faces(rows: int, columns: int, *, wrap: bool = False) -> np.ndarray:
    """(n, 4) quads over a row-major lattice of vertices; `wrap` joins the last column to the first.

    Counter-clockwise when columns run along +X and rows along +Y.
    """
    c = np.arange(columns if wrap else columns - 1)
    r = np.arange(rows - 1)
    cc, rr = np.meshgrid(c, r)
    cn = (cc + 1) % columns
    return np.stack(
        [rr * columns + cc, rr * columns + cn, (rr + 1) * columns + cn, (rr + 1) * columns + cc], axis=-1
    ).reshape(-1, 4)


def tube(
    path: np.ndarray,
    radii: np.ndarray,
    sides: int,
    *,
    repeat: tuple[float, float] = (1.0, 1.0),
    capped: bool = True,
) -> Geometry:
    """A closed tube around a (P, 3) path with (P,) radii; uv = (around, along) times `repeat`."""
    path = np.asarray(path, dtype=np.float64)
    tangent = np.gradient(path, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    # One reference axis for the whole path keeps the rings from twisting against each other.
    overall = path[-1] - path[0]
    reference = np.eye(3)[int(np.argmin(np.abs(overall)))]
    side = np.cross(tangent, reference)
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    up = np.cross(tangent, side)  # right-handed, or the tube would be inside out
    angle = np.linspace(0.0, 2.0 * np.pi, sides, endpoint=False)
    ring = side[:, None, :] * np.cos(angle)[None, :, None] + up[:, None, :] * np.sin(angle)[None, :, None]
    positions = (path[:, None, :] + ring * np.asarray(radii)[:, None, None]).reshape(-1, 3)
    quads = grid_faces(len(path), sides, wrap=True)
    rows = quads // sides
    # The right-hand corners count on past the seam instead of wrapping back to column 0.
    column = quads[:, :1] % sides + np.array([0, 1, 1, 0])
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    along /= along[-1]
    uvs = np.stack([column / sides * repeat[0], along[rows] * repeat[1]], axis=-1).reshape(-1, 2)
    corners, sizes = quads.ravel(), np.full(len(quads), 4)
    smooth = np.ones(len(quads), dtype=bool)
    if capped:
        bottom, top = np.arange(sides), len(positions) - sides + np.arange(sides)
        corners = np.concatenate([corners, bottom[::-1], top])
        sizes = np.concatenate([sizes, [sides, sides]])
        disc = 0.5 + 0.5 * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        uvs = np.concatenate([uvs, disc[::-1] * 0.2, disc * 0.2])
        smooth = np.concatenate([smooth, [False, False]])
    return Geometry(positions, corners, sizes, uvs=uvs, smooth=smooth)


def box(
    size: Sequence[float],
    *,
    uv_scale: float = 1.0,
    uv_offset: Sequence[float] = (0.0, 0.0),
    long_axis: int = 0,
) -> Geometry:
    """A closed flat-shaded box about the origin; uv in metres times `uv_scale`, u along `long_axis`."""
    half = np.asarray(size, dtype=np.float64) / 2.0
    corner = np.array([[x, y, z] for z in (-1, 1) for y in (-1, 1) for x in (-1, 1)], dtype=np.float64)
    faces = np.array([[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]])
    positions = corner * half
    normal_axis = np.array([2, 2, 1, 1, 0, 0])
    p = positions[faces]
    uvs = np.empty((6, 4, 2))
    for f, n in enumerate(normal_axis):
        axes = [a for a in range(3) if a != n]
        if long_axis in axes:
            axes = [long_axis] + [a for a in axes if a != long_axis]
        uvs[f] = p[f][:, axes]
    return Geometry(
        positions,
        faces.ravel(),
        np.full(6, 4),
        uvs=uvs.reshape(-1, 2) * uv_scale + np.asarray(uv_offset),
        smooth=np.zeros(6, dtype=bool),
    )


def geodesic_sphere(frequency: int) -> tuple[np.ndarray, np.ndarray]:
    """Unit directions (10 f^2 + 2, 3) and triangles: an icosahedron, its edges cut into f = `frequency`."""
    phi = (1.0 + np.sqrt(5.0)) / 2.0
    v = np.array(
        [
            [-1, phi, 0],
            [1, phi, 0],
            [-1, -phi, 0],
            [1, -phi, 0],
            [0, -1, phi],
            [0, 1, phi],
            [0, -1, -phi],
            [0, 1, -phi],
            [phi, 0, -1],
            [phi, 0, 1],
            [-phi, 0, -1],
            [-phi, 0, 1],
        ]
    )
    t = np.array(
        [
            [0, 11, 5],
            [0, 5, 1],
            [0, 1, 7],
            [0, 7, 10],
            [0, 10, 11],
            [1, 5, 9],
            [5, 11, 4],
            [11, 10, 2],
            [10, 7, 6],
            [7, 1, 8],
            [3, 9, 4],
            [3, 4, 2],
            [3, 2, 6],
            [3, 6, 8],
            [3, 8, 9],
            [4, 9, 5],
            [2, 4, 11],
            [6, 2, 10],
            [8, 6, 7],
            [9, 8, 1],
        ]
    )
    f = frequency
    index = {(i, j): n for n, (i, j) in enumerate((i, j) for i in range(f + 1) for j in range(f + 1 - i))}
    bary = np.array([[f - i - j, i, j] for (i, j) in list(index)]) / f
    local = []
    for (i, j), here in index.items():
        if i + j < f:
            local.append([here, index[i + 1, j], index[i, j + 1]])
            if i + j < f - 1:
                local.append([index[i + 1, j], index[i + 1, j + 1], index[i, j + 1]])
    points = (bary[None] @ v[t]).reshape(-1, 3)
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    triangles = (np.array(local)[None] + (np.arange(20) * len(bary))[:, None, None]).reshape(-1, 3)
    _, first, inverse = np.unique(np.round(points, 6), axis=0, return_index=True, return_inverse=True)
    return points[first], inverse.reshape(-1)[triangles]


def cards(
    centers: np.ndarray,
    right: np.ndarray,
    up: np.ndarray,
    tiles: np.ndarray,
    normals: np.ndarray | None = None,
) -> Geometry:
    """Textured quads. centers, right, up: (n, 3), half extents; tiles: (n, 4) uv rectangle (u0, v0, u1, v1).

    normals: (n, 4, 3) custom normals of the corners, or None for the quads' own.
    """
    n = len(centers)
    signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    positions = centers[:, None] + right[:, None] * signs[None, :, :1] + up[:, None] * signs[None, :, 1:]
    u = np.where(signs[:, 0] > 0, tiles[:, 2:3], tiles[:, 0:1])
    w = np.where(signs[:, 1] > 0, tiles[:, 3:4], tiles[:, 1:2])
    return Geometry(
        positions.reshape(-1, 3),
        np.arange(4 * n),
        np.full(n, 4),
        uvs=np.stack([u, w], axis=-1).reshape(-1, 2),
        normals=None if normals is None else np.asarray(normals).reshape(-1, 3),
    )


def two_sided(sheet: Geometry) -> Geometry:
    """The mesh with a turned copy of every face that keeps the custom normals.

    Renderers turn the normal of a face that is seen from behind. For a leaf card, whose normals are those of
    the plant as a whole, that would make its back black: with back-face culling the copy is seen instead.
    """
    starts = np.concatenate([[0], np.cumsum(sheet.sizes)[:-1]])
    face = np.repeat(np.arange(len(sheet.sizes)), sheet.sizes)
    order = (2 * starts + sheet.sizes - 1)[face] - np.arange(len(sheet.corners))
    back = replace(sheet, corners=sheet.corners[order], uvs=None if sheet.uvs is None else sheet.uvs[order])
    return join([sheet, back])


def build_mesh(name: str, geometry: Geometry, materials: Sequence[bpy.types.Material]) -> bpy.types.Mesh:
    """A Blender mesh from the arrays, with the materials in its slots."""
    mesh = bpy.data.meshes.new(name)
    g = geometry
    mesh.vertices.add(len(g.positions))
    mesh.vertices.foreach_set("co", np.ascontiguousarray(g.positions, dtype=np.float32).ravel())
    mesh.loops.add(len(g.corners))
    mesh.loops.foreach_set("vertex_index", np.ascontiguousarray(g.corners, dtype=np.int32))
    mesh.polygons.add(len(g.sizes))
    starts = np.concatenate([[0], np.cumsum(g.sizes)[:-1]]).astype(np.int32)
    mesh.polygons.foreach_set("loop_start", starts)
    mesh.polygons.foreach_set("material_index", np.ascontiguousarray(g.slots, dtype=np.int32))
    mesh.polygons.foreach_set("use_smooth", np.ascontiguousarray(g.smooth, dtype=bool))
    if g.uvs is not None:
        layer = mesh.uv_layers.new(name="UVMap")
        layer.uv.foreach_set("vector", np.ascontiguousarray(g.uvs, dtype=np.float32).ravel())
    if g.colors is not None:
        rgba = np.ones((len(g.positions), 4), dtype=np.float32)
        rgba[:, :3] = g.colors
        attribute = mesh.color_attributes.new(COLOR_ATTRIBUTE, "FLOAT_COLOR", "POINT")
        attribute.data.foreach_set("color", rgba.ravel())
        mesh.color_attributes.active_color = attribute
        mesh.color_attributes.render_color_index = mesh.color_attributes.active_color_index
    if g.normals is not None:
        attribute = mesh.attributes.new("custom_normal", "FLOAT_VECTOR", "POINT")
        attribute.data.foreach_set("vector", np.ascontiguousarray(g.normals, dtype=np.float32).ravel())
    for material in materials:
        mesh.materials.append(material)
    mesh.update(calc_edges=True)
    return mesh
