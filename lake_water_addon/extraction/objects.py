# SPDX-License-Identifier: GPL-3.0-or-later
"""Looking at Blender objects: identity, transform, slots, visibility."""

from __future__ import annotations

import bpy
import numpy as np

Name = tuple[str, str | None]
"""Of an object, with the path of the library it is linked from. Look-ups only: names are no identity."""


def name_of(obj: bpy.types.Object) -> Name:
    """The name to find an object's original by later."""
    original = obj.original
    return (original.name, original.library.filepath if original.library is not None else None)


def find_original(uid: int, name: Name) -> bpy.types.Object | None:
    """The object with a uid, looked up by its name; None if it has another name by now."""
    obj = bpy.data.objects.get(name)
    return obj if obj is not None and obj.session_uid == uid else None


def find_evaluated(uid: int, name: Name, depsgraph: bpy.types.Depsgraph) -> bpy.types.Object | None:
    """The evaluated object with a uid, looked up by its name; None if it has another name by now."""
    original = find_original(uid, name)
    return original.evaluated_get(depsgraph) if original is not None else None


def matrix_of(owner: bpy.types.Object | bpy.types.DepsgraphObjectInstance) -> np.ndarray:
    """(4, 4) float64 object to world."""
    return np.array(owner.matrix_world, dtype=np.float64)


def determinants(matrices: np.ndarray) -> np.ndarray:
    """(n,) determinants of the linear parts of (n, 4, 4)."""
    x, y, z = matrices[:, :3, 0], matrices[:, :3, 1], matrices[:, :3, 2]
    return np.einsum("ij,ij->i", np.cross(x, y), z)


def is_usable(determinant: np.ndarray) -> np.ndarray:
    """Whether a transform with this determinant can be drawn: no zero scale, nothing infinite."""
    return np.isfinite(determinant) & (np.abs(determinant) > 1e-24)


def slots_of(obj: bpy.types.Object) -> tuple[int, ...]:
    """The uids of the materials in an evaluated object's slots, 0 for an empty one."""
    return tuple(
        slot.material.original.session_uid if slot.material is not None else 0 for slot in obj.material_slots
    )


def is_shown(obj: bpy.types.Object) -> bool:
    """Whether the object's own switches let the camera see its surface."""
    return obj.visible_camera and not obj.is_holdout


def has_layer_flags(layer: bpy.types.LayerCollection) -> bool:
    """Whether a layer collection or one below it is a holdout or indirect only."""
    return layer.holdout or layer.indirect_only or any(has_layer_flags(child) for child in layer.children)
