# SPDX-License-Identifier: GPL-3.0-or-later
"""Water objects as water bodies."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Hashable, Iterable
from dataclasses import dataclass

import bpy
import numpy as np

from ..core.snapshot import WaterBody, WaterSettings
from ..nodes.carry import modifier_of
from ..water_objects import settings_of
from .objects import Name, find_original

MAX_TILT = 1e-3  # rad; below it a water plane counts as horizontal


@dataclass(frozen=True, eq=False)
class WaterSurface:
    """What makes an object water.

    resolution: of the grid over the object's local bounds (2, 2), least and greatest x, y;
    0 for the object's mesh.
    """

    resolution: int
    bounds: np.ndarray
    settings: WaterSettings


@dataclass(frozen=True)
class WaterRecord:
    """A water body but for its settings, which are read at every snapshot."""

    uid: int
    name: Name
    body: WaterBody
    is_instance: bool


def is_water(obj: bpy.types.Object) -> bool:
    """Whether an object, evaluated or not, is a water surface."""
    settings = getattr(obj.original, "lake_water", None)
    return settings is not None and settings.enabled


def read_surface(obj: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> WaterSurface:
    """The surface of an evaluated water object."""
    source = _source(obj.original, depsgraph)
    settings = source.lake_water
    return WaterSurface(
        resolution=settings.grid_resolution if settings.surface == "GRID" else 0,
        bounds=_bounds(obj),
        settings=settings_of(source),
    )


def _bounds(obj: bpy.types.Object) -> np.ndarray:
    """(2, 2) least and greatest x, y of an evaluated water object, without what *Sine Waves* makes of it."""
    original = obj.original
    data = original.data
    waves = modifier_of(original)
    if (
        waves is not None
        and len(original.modifiers) == 1
        and obj.mode == "OBJECT"
        and data.shape_keys is None
        and len(data.vertices)
    ):
        points = np.empty((len(data.vertices), 3), dtype=np.float32)
        data.attributes["position"].data.foreach_get("vector", points.ravel())
    else:
        points = np.array(obj.bound_box)
    points = points[:, :2].astype(np.float64)
    return np.stack([points.min(axis=0), points.max(axis=0)])


def _source(original: bpy.types.Object, depsgraph: bpy.types.Depsgraph) -> bpy.types.Object:
    """Whose settings to read: the evaluated object's if something may animate them, else the original's.

    The original needs no update to be tagged; it is also what a script has just set.
    """
    return original.evaluated_get(depsgraph) if _may_be_animated(original) else original


def _may_be_animated(original: bpy.types.Object) -> bool:
    animation = original.animation_data
    if animation is None:
        return False
    if animation.action is not None or animation.nla_tracks:
        return True
    return any(not curve.data_path.startswith("modifiers[") for curve in animation.drivers)


def refresh(records: Iterable[WaterRecord], depsgraph: bpy.types.Depsgraph) -> tuple[WaterRecord, ...] | None:
    """The records with their settings read again; None if one of the objects is not there any more."""
    refreshed = []
    for record in records:
        original = find_original(record.uid, record.name)
        if original is None:
            return None
        settings = settings_of(_source(original, depsgraph))
        if settings == record.body.settings:
            refreshed.append(record)
        else:
            body = dataclasses.replace(record.body, settings=settings)
            refreshed.append(dataclasses.replace(record, body=body))
    return tuple(refreshed)


def water_body(
    name: str,
    key: Hashable,
    surface: WaterSurface,
    matrix: np.ndarray,
    mesh: Hashable,
    note: Callable[[str], None],
) -> WaterBody | None:
    """One instance of a water object; None, with a note, if it has no area.

    matrix: (4, 4) object to world. mesh: key of its mesh, for a surface that is no grid.
    """
    x, y = matrix[:3, 0], matrix[:3, 1]
    scale_x, scale_y = np.linalg.norm(x), np.linalg.norm(y)
    if not np.isfinite(matrix).all() or min(scale_x, scale_y) < 1e-9:
        note(f'Water "{name}" has a scale of zero, not drawn')
        return None
    normal = np.cross(x, y)
    horizontal = abs(normal[2]) / max(float(np.linalg.norm(normal)), 1e-30)
    if horizontal < np.cos(MAX_TILT):
        if np.hypot(x[0], x[1]) < 1e-6 * scale_x:
            note(f'Water "{name}" stands upright, not drawn: water lies flat')
            return None
        note(f'Water "{name}" is tilted, which is ignored: water lies flat')
        matrix = _untilted(matrix)
    grid = None
    if surface.resolution:
        grid = _grid(surface, matrix)
        if min(grid[1], grid[2]) < 1e-9:
            note(f'Water "{name}" has no extent, not drawn')
            return None
    return WaterBody(
        key=key,
        name=name,
        matrix=matrix,
        settings=surface.settings,
        grid=grid,
        mesh=mesh if grid is None else None,
    )


def _untilted(matrix: np.ndarray) -> np.ndarray:
    """A matrix with the same location, heading and scale, and a horizontal plane."""
    scale = np.linalg.norm(matrix[:3, :3], axis=0)
    heading = np.arctan2(matrix[1, 0], matrix[0, 0])
    c, s = np.cos(heading), np.sin(heading)
    flat = np.eye(4)
    flat[:3, :3] = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]) * scale
    flat[:3, 3] = matrix[:3, 3]
    return flat


def _grid(surface: WaterSurface, matrix: np.ndarray) -> tuple[int, float, float, float, float]:
    """`WaterBody.grid`: the object's bounds, scaled, in the water frame."""
    (x0, y0), (x1, y1) = surface.bounds
    corners = np.array([(x0, y0), (x1, y0), (x0, y1), (x1, y1)]) @ matrix[:2, :2].T
    heading = np.arctan2(matrix[1, 0], matrix[0, 0])
    c, s = np.cos(heading), np.sin(heading)
    framed = corners @ np.array([[c, -s], [s, c]])
    low, high = framed.min(axis=0), framed.max(axis=0)
    half, center = 0.5 * (high - low), 0.5 * (high + low)
    return (surface.resolution, float(half[0]), float(half[1]), float(center[0]), float(center[1]))


def same_body(a: WaterBody, b: WaterBody) -> bool:
    """Whether two water bodies are the same."""
    return (
        (a.key, a.name, a.settings, a.grid, a.mesh) == (b.key, b.name, b.settings, b.grid, b.mesh)
        and np.array_equal(a.matrix, b.matrix)
    )  # fmt: skip
