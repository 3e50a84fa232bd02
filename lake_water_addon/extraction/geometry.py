# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender meshes to arrays: triangulated, one vertex for each distinct combination of corner values."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import bpy
import numpy as np

from ..core.snapshot import Mesh, MeshPart
from ..nodes.sine_waves import FLAT_ATTRIBUTE


@dataclass(frozen=True, eq=False)
class Geometry:
    """The content of a `core.snapshot.Mesh`, not yet named. Arrays and meaning are the same."""

    positions: np.ndarray
    normals: np.ndarray
    uvs: np.ndarray | None
    colors: np.ndarray | None
    parts: tuple[MeshPart, ...]
    solid: bool

    def same_as(self, mesh: Mesh) -> bool:
        """Whether a mesh of the snapshot has exactly this content."""
        return (
            self.solid == mesh.solid
            and len(self.parts) == len(mesh.parts)
            and all(
                a.slot == b.slot and np.array_equal(a.triangles, b.triangles)
                for a, b in zip(self.parts, mesh.parts, strict=True)
            )
            and np.array_equal(self.positions, mesh.positions)
            and np.array_equal(self.normals, mesh.normals)
            and _same(self.uvs, mesh.uvs)
            and _same(self.colors, mesh.colors)
        )


def read_mesh(
    mesh: bpy.types.Mesh,
    uv_name: str | None = None,
    color_name: str | None = None,
    *,
    flat: bool = False,
) -> Geometry | None:
    """Read an evaluated mesh in object space; None when it has no faces.

    uv_name, color_name: the UV map and colour attribute to take along, None for none.
    One that the mesh does not have is left out. Colours come scene-linear.
    flat: the mesh is a water surface, taken as it was before *Sine Waves* raised it.
    Vertices are shared where normal, UV and colour agree, so that a smooth mesh keeps its
    vertex count; vertex v of the mesh is vertex v of the result, split ones follow after.
    """
    mesh.calc_loop_triangles()
    n_triangles = len(mesh.loop_triangles)
    if n_triangles == 0:
        return None
    n_vertices, n_corners = len(mesh.vertices), len(mesh.loops)
    corner_vertex = _read(mesh.attributes[".corner_vert"].data, "value", n_corners, 1, np.int32)
    positions = _read(mesh.attributes["position"].data, "vector", n_vertices, 3)
    if n_triangles == len(mesh.polygons):  # all triangles: their corners are in order
        triangle_corners = np.arange(n_corners, dtype=np.int32).reshape(-1, 3)
    else:
        triangle_corners = _read(mesh.loop_triangles, "loops", n_triangles, 3, np.int32)

    corner_layers: list[np.ndarray] = []
    vertex_normals = corner_normals = None
    if flat and FLAT_ATTRIBUTE in mesh.attributes:
        positions = _read(mesh.attributes[FLAT_ATTRIBUTE].data, "vector", n_vertices, 3)
        vertex_normals = _smooth_normals(positions, corner_vertex[triangle_corners])
    elif mesh.normals_domain == "POINT":
        vertex_normals = _read(mesh.vertex_normals, "vector", n_vertices, 3)
    else:
        corner_normals = _read(mesh.corner_normals, "vector", n_corners, 3)
        corner_layers.append(corner_normals)
    uv_layer = mesh.uv_layers.get(uv_name) if uv_name is not None else None
    uvs = None
    if uv_layer is not None:
        uvs = _read(mesh.attributes[uv_layer.name].data, "vector", n_corners, 2)
        corner_layers.append(uvs)
    vertex_colors = corner_colors = None
    attribute = mesh.color_attributes.get(color_name) if color_name is not None else None
    if attribute is not None:
        if attribute.domain == "POINT":
            vertex_colors = _read(attribute.data, "color", n_vertices, 4)
        else:
            corner_colors = _read(attribute.data, "color", n_corners, 4)
            corner_layers.append(corner_colors)

    corner_to_new, corner_of_new = _share_vertices(corner_vertex, n_vertices, corner_layers)
    split = corner_vertex[corner_of_new[n_vertices:]]  # the mesh vertex of each added one

    def from_vertices(values: np.ndarray) -> np.ndarray:
        return np.concatenate([values, values[split]]) if len(split) else values

    normals = corner_normals[corner_of_new] if vertex_normals is None else from_vertices(vertex_normals)
    if vertex_colors is not None:
        colors = from_vertices(vertex_colors)
    else:
        colors = corner_colors[corner_of_new] if corner_colors is not None else None
    return Geometry(
        positions=from_vertices(positions),
        normals=normals,
        uvs=uvs[corner_of_new] if uvs is not None else None,
        colors=colors,
        parts=_parts(mesh, corner_to_new[triangle_corners]),
        solid=_is_solid(mesh, corner_vertex, positions, triangle_corners),
    )


def _smooth_normals(positions: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """(V, 3) float32 unit normals of vertices (V, 3): the mean of the triangles (T, 3), weighted by area."""
    a, b, c = (positions[triangles[:, i]].astype(np.float64) for i in range(3))
    areas = np.cross(b - a, c - a)
    normals = np.zeros((len(positions), 3))
    for i in range(3):
        np.add.at(normals, triangles[:, i], areas)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    return np.where(length > 0.0, normals / np.maximum(length, 1e-30), (0.0, 0.0, 1.0)).astype(np.float32)


def default_uv_name(mesh: bpy.types.Mesh) -> str | None:
    """Name of the UV map that renders use when none is named."""
    for layer in mesh.uv_layers:
        if layer.active_render:
            return layer.name
    return None


def default_color_name(mesh: bpy.types.Mesh) -> str | None:
    """Name of the colour attribute that renders use when none is named."""
    name = mesh.attributes.default_color_name
    return name if name and name in mesh.color_attributes else None


def _read(
    data: Iterable, name: str, count: int, width: int, dtype: type[np.generic] = np.float32
) -> np.ndarray:
    """(count, width) array of one attribute, or (count,) for a width of 1."""
    values = np.empty(count * width, dtype=dtype)
    data.foreach_get(name, values)
    return values.reshape(count, width) if width > 1 else values


def _same(a: np.ndarray | None, b: np.ndarray | None) -> bool:
    return b is None if a is None else b is not None and np.array_equal(a, b)


def _share_vertices(
    corner_vertex: np.ndarray, n_vertices: int, layers: list[np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Which corners can share a vertex.

    Each vertex keeps the values of one of its corners; corners with the same values share
    it, the others get vertices of their own. Returns the new vertex of each corner, and for
    each new vertex a corner to take its values from.
    """
    n_corners = len(corner_vertex)
    kept = np.zeros(n_vertices, dtype=np.int32)
    if not layers:
        kept[corner_vertex] = np.arange(n_corners, dtype=np.int32)
        return corner_vertex, kept
    kept[corner_vertex] = np.arange(n_corners, dtype=np.int32)
    kept_corner = kept[corner_vertex]
    differs = np.zeros(n_corners, dtype=bool)
    for layer in layers:
        # Two floats at a time as bits: half the gathers, and equal bits are equal values.
        bits = layer.view(np.uint64) if layer.shape[1] % 2 == 0 else layer.view(np.uint32)
        for column in bits.T:
            differs |= column[kept_corner] != column
    split = np.flatnonzero(differs).astype(np.int32)
    if len(split) == 0:
        return corner_vertex, kept
    corner_to_new = corner_vertex.copy()
    corner_to_new[split] = np.arange(n_vertices, n_vertices + len(split), dtype=np.int32)
    return corner_to_new, np.concatenate([kept, split])


def _parts(mesh: bpy.types.Mesh, triangles: np.ndarray) -> tuple[MeshPart, ...]:
    """The triangles of each material slot that has any, in the order of the slots."""
    attribute = mesh.attributes.get("material_index")
    if attribute is None:
        return (MeshPart(0, np.ascontiguousarray(triangles)),)
    face_slots = _read(attribute.data, "value", len(mesh.polygons), 1, np.int32)
    if (face_slots == face_slots[0]).all():
        return (MeshPart(max(0, int(face_slots[0])), np.ascontiguousarray(triangles)),)
    faces = _read(mesh.loop_triangle_polygons, "value", len(triangles), 1, np.int32)
    slots = np.maximum(face_slots[faces], 0)
    return tuple(MeshPart(int(slot), triangles[slots == slot]) for slot in np.unique(slots))


def _is_solid(
    mesh: bpy.types.Mesh, corner_vertex: np.ndarray, positions: np.ndarray, triangle_corners: np.ndarray
) -> bool:
    """Whether the back faces are the inside: every edge has two faces that run along it in opposite
    directions, and the enclosed volume is positive."""
    n_edges, n_corners = len(mesh.edges), len(corner_vertex)
    corner_edge = _read(mesh.attributes[".corner_edge"].data, "value", n_corners, 1, np.int32)
    if n_corners != 2 * n_edges or not (np.bincount(corner_edge, minlength=n_edges) == 2).all():
        return False
    edge_start = _read(mesh.attributes[".edge_verts"].data, "value", n_edges, 2, np.int32)[:, 0]
    forward = edge_start[corner_edge] == corner_vertex
    if not (np.bincount(corner_edge[forward], minlength=n_edges) == 1).all():
        return False
    centred = positions - positions.mean(axis=0)
    a, b, c = (centred[corner_vertex[triangle_corners[:, i]]] for i in range(3))
    return float(np.einsum("ij,ij->", a, np.cross(b, c), dtype=np.float64)) > 0.0
