# SPDX-License-Identifier: GPL-3.0-or-later
"""The meshes of the snapshots: equal content keeps its version."""

from __future__ import annotations

from collections.abc import Hashable

from ..core.snapshot import Mesh
from .geometry import Geometry
from .versions import next_version

MAX_VARIANTS = 2  # contents remembered of one mesh: the viewport's and the render's


class MeshStore:
    """The last contents of each mesh, by key."""

    def __init__(self) -> None:
        self._variants: dict[Hashable, list[Mesh]] = {}

    def intern(self, key: Hashable, geometry: Geometry) -> Mesh:
        """The mesh of this key with this content: the one there was, or one with a new version."""
        variants = self._variants.setdefault(key, [])
        for i, mesh in enumerate(variants):
            if geometry.same_as(mesh):
                variants.insert(0, variants.pop(i))
                return mesh
        mesh = Mesh(
            key=key,
            version=next_version(),
            positions=geometry.positions,
            normals=geometry.normals,
            uvs=geometry.uvs,
            colors=geometry.colors,
            parts=geometry.parts,
            solid=geometry.solid,
        )
        variants.insert(0, mesh)
        del variants[MAX_VARIANTS:]
        return mesh

    def keep_only(self, keys: set[Hashable]) -> None:
        """Forget all meshes but these."""
        for key in self._variants.keys() - keys:
            del self._variants[key]

    def clear(self) -> None:
        """Forget all."""
        self._variants.clear()
