# SPDX-License-Identifier: GPL-3.0-or-later
"""The camera under water: on which side of the surface a picture begins, and its fog.

A picture begins on its camera's near plane, and each of its pixels at a point of that rectangle: the pixel
is in the air or under water as that point is. `NearPlane` and what follows from it is the float64 twin of
`gpu_shaders/fog_lib.glsl`. Positions are in render space (see `plan`), in m.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from . import cameras, optics, waves
from .light import box_corners
from .snapshot import Mesh, WaterBody

NO_WATER = -1e5
"""m: height of the surface where there is none."""

HEIGHT_TEXELS = 128
"""Texels a side of the map of the surface's heights at the near plane."""

RAY_LENGTH = 1.5
"""The thesis's m, in m: how far a ray is followed from a surface seen from below, to be looked up there."""

MIN_MAP_SIZE = 1e-3
"""m: the least side of that map."""

CELLS = 8
"""Parts along each side of the near plane, in each of which the surface is bounded by itself."""

ROUNDING = 1e-4
"""m: what the GPU's surface may differ from this one by rounding."""

RECTANGLE_TOLERANCE = 1e-3
"""By which part of it a mesh's area may differ from its bounding box's if it counts as a rectangle."""

MENISCUS = 0.006
"""Width of the meniscus as a part of the picture's height."""

MIN_MENISCUS = 3.0
"""Pixels: its least width. It hides in which pixel exactly the side changes."""

_CORNERS = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)], dtype=np.float64)


class Side(StrEnum):
    """Where a picture begins, in respect of one water body."""

    AIR = "AIR"
    UNDER = "UNDER"
    SPLIT = "SPLIT"


@dataclass(frozen=True)
class ViewSide:
    """side, with its reason in words for a person. from_above: the surface can be seen from the air,
    from_below: from the water; both only when SPLIT."""

    side: Side
    reason: str
    from_above: bool
    from_below: bool


@dataclass(frozen=True, eq=False)
class NearPlane:
    """The rectangle on which a picture begins.

    origin: the eye, or where an orthographic camera is; center: from there to the rectangle's middle;
    right, up: from its middle to the middles of its right and upper edge; all (3,). near, far: clip
    range in m; an orthographic camera's may be negative.
    """

    origin: np.ndarray
    center: np.ndarray
    right: np.ndarray
    up: np.ndarray
    near: float
    far: float
    orthographic: bool

    def offset(self, ndc: np.ndarray) -> np.ndarray:
        """(..., 3) from `origin` to the point of the rectangle at device coordinates (..., 2)."""
        return self.center + ndc[..., :1] * self.right + ndc[..., 1:2] * self.up

    def point(self, ndc: np.ndarray) -> np.ndarray:
        """(..., 3) point of the rectangle at device coordinates (..., 2)."""
        return self.origin + self.offset(ndc)

    def distance(self, ndc: np.ndarray, depth: np.ndarray) -> np.ndarray:
        """(...) m from the eye to what lies at device coordinates (..., 2) and window depth (...) in 0..1.

        The projection's inverse: z = near / ((1 - depth) + depth near / far) along the axis, and the
        point lies as far beyond the near plane's point as z beyond near. An orthographic camera has no
        eye: the distance is that from the plane through it, 0 for what lies behind.
        """
        if self.orthographic:
            return np.maximum(self.near + depth * (self.far - self.near), 0.0)
        to_plane = np.linalg.norm(self.offset(ndc), axis=-1)
        return to_plane / ((1.0 - depth) + depth * (self.near / self.far))


def near_plane(view: np.ndarray, projection: np.ndarray) -> NearPlane:
    """That of a camera; view (4, 4) may mirror. Any lens shift, crop, clip range; orthographic, too."""
    inverse = np.linalg.inv(projection)
    corners = np.array([(0, 0, -1, 1), (1, 0, -1, 1), (0, 1, -1, 1)], dtype=np.float64) @ inverse.T
    center, right, up = (corners[:, :3] / corners[:, 3:]) @ view[:3, :3]  # the transpose is the inverse
    near, far = cameras.clip_range(projection)
    return NearPlane(
        cameras.eye_position(view),
        center,
        right - center,
        up - center,
        near,
        far,
        cameras.is_orthographic(projection),
    )


def fog_transmittance(plane: NearPlane, k: float, ndc: np.ndarray, depth: np.ndarray) -> np.ndarray:
    """(...) a = exp(-k distance) of what a depth texture holds; 0 where nothing was drawn (depth 1)."""
    return np.where(depth < 1.0, optics.attenuation(k, plane.distance(ndc, depth)), 0.0)


def meniscus_weight(height: np.ndarray, per_pixel: np.ndarray, width: float) -> np.ndarray:
    """(...) how much of the meniscus is in a pixel: 1 on the line, 0 from `width` / 2 pixels on (Hermite).

    height: of the near point over the surface, m; per_pixel: by how much that changes from one pixel
    to the next, m.
    """
    t = np.clip(2.0 - 4.0 * np.abs(height) / (np.maximum(per_pixel, 1e-12) * width), 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)


def meniscus_width(picture_height: float) -> float:
    """Pixels, of a whole picture of so many pixels' height."""
    return max(MIN_MENISCUS, MENISCUS * picture_height)


@dataclass(frozen=True, eq=False)
class HeightMap:
    """A map, seen from above, of the surface's heights around the near plane.

    corner: (2,) x, y of its lower left corner; size: (2,) m. view, projection: (4, 4), of the orthographic
    camera that draws it.
    """

    corner: np.ndarray
    size: np.ndarray
    view: np.ndarray
    projection: np.ndarray

    def height(self, texels: np.ndarray, xy: np.ndarray) -> np.ndarray:
        """(...) height of the surface at x, y (..., 2), bilinear between the middles of the texels (n, n)."""
        count = len(texels)
        at = np.clip((xy - self.corner) / self.size * count - 0.5, 0.0, count - 1.0)
        low = np.minimum(np.floor(at), count - 2.0).astype(int)
        part = at - low
        column, row = low[..., 0], low[..., 1]
        x, y = part[..., 0], part[..., 1]
        lower = texels[row, column] + x * (texels[row, column + 1] - texels[row, column])
        upper = texels[row + 1, column] + x * (texels[row + 1, column + 1] - texels[row + 1, column])
        return lower + y * (upper - lower)


def height_map(plane: NearPlane, lowest: float, highest: float) -> HeightMap:
    """The map under (or over) the near plane; all of the surface is between `lowest` and `highest`."""
    corners = plane.point(_CORNERS)[:, :2]
    middle = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
    # Two texels more on each side: the middles of the outermost are not at the border.
    size = np.maximum(np.ptp(corners, axis=0), MIN_MAP_SIZE) * (HEIGHT_TEXELS / (HEIGHT_TEXELS - 4))
    margin = max(highest - lowest, 1.0)
    view = np.eye(4)
    view[:3, 3] = -middle[0], -middle[1], -(highest + margin)
    depth = highest - lowest + 2.0 * margin
    projection = np.diag([2.0 / size[0], 2.0 / size[1], -2.0 / depth, 1.0])
    projection[2, 3] = -1.0
    return HeightMap(middle - 0.5 * size, size, view, projection)


def grid_height(body: WaterBody, packed: np.ndarray, xy: np.ndarray) -> np.ndarray:
    """(n,) height over the plane of a grid body's surface as it is drawn, flat between vertices.

    xy: (n, 2) from the body's origin along the axes of render space; beyond the grid its last cells go on.
    """
    resolution, half_x, half_y, center_x, center_y = body.grid
    cos_h, sin_h = np.cos(body.heading), np.sin(body.heading)
    axes = np.array([[cos_h, sin_h], [-sin_h, cos_h]])  # rows: the water frame's x and y
    half = np.array([half_x, half_y])
    cell = 2.0 * half / (resolution - 1)
    first = np.array([center_x, center_y]) - half
    at = (xy @ axes.T - first) / cell
    low = np.clip(np.floor(at), 0, resolution - 2)
    u, v = (at - low).T
    corner, right, top, opposite = (
        waves.height(packed, ((low + offset) * cell + first) @ axes)
        for offset in ((0, 0), (1, 0), (0, 1), (1, 1))
    )
    # WaterPainter cuts each cell from its first corner to the one opposite.
    lower = corner + u * (right - corner) + v * (opposite - right)
    upper = corner + v * (top - corner) + u * (opposite - top)
    return np.where(u >= v, lower, upper)


def surface_band(body: WaterBody, mesh: Mesh | None, at: np.ndarray) -> tuple[float, float]:
    """(lowest, highest) z in render space that the surface may have. at: (3,) the body's origin there."""
    reach = waves.max_height(body.settings.waves) + ROUNDING
    relief = np.zeros(1)
    if mesh is not None:
        relief = (box_corners(*mesh.bounds) @ body.matrix[:3, :3].T)[:, 2]
    return float(at[2] + relief.min() - reach), float(at[2] + relief.max() + reach)


def outline(body: WaterBody, mesh: Mesh | None, at: np.ndarray) -> tuple[np.ndarray, bool]:
    """(corners (4, 2) of a convex quadrangle around the body in render space, whether it is full of water).

    A grid fills its rectangle. A mesh may be of any shape within its bounding box.
    """
    if mesh is None:
        _, half_x, half_y, center_x, center_y = body.grid
        cos_h, sin_h = np.cos(body.heading), np.sin(body.heading)
        frame = np.array([center_x, center_y]) + _CORNERS * (half_x, half_y)
        return frame @ np.array([[cos_h, sin_h], [-sin_h, cos_h]]) + at[:2], True
    low, high = mesh.bounds
    if not body.matrix[2, :2].any() and not body.matrix[:2, 2].any():
        box = 0.5 * (low + high)[:2] + _CORNERS * (0.5 * (high - low)[:2])
        filled = abs(mesh.covered_area / max(np.prod((high - low)[:2]), 1e-12) - 1.0) < RECTANGLE_TOLERANCE
        return box @ body.matrix[:2, :2].T + at[:2], filled
    corners = (box_corners(low, high) @ body.matrix[:3, :3].T)[:, :2]
    low, high = corners.min(axis=0), corners.max(axis=0)
    return 0.5 * (low + high) + _CORNERS * (0.5 * (high - low)) + at[:2], False


def _beyond_edges(points: np.ndarray, quadrangle: np.ndarray) -> np.ndarray:
    """(points, 4) whether each point (n, 2) lies beyond each edge of a convex quadrangle (4, 2)."""
    edges = np.roll(quadrangle, -1, axis=0) - quadrangle
    area = np.sum(
        quadrangle[:, 0] * np.roll(quadrangle[:, 1], -1) - quadrangle[:, 1] * np.roll(quadrangle[:, 0], -1)
    )
    away = points[:, None] - quadrangle
    cross = edges[:, 0] * away[..., 1] - edges[:, 1] * away[..., 0]
    return np.sign(area) * cross < 0.0


def view_side(
    plane: NearPlane, body: WaterBody, mesh: Mesh | None, at: np.ndarray, packed: np.ndarray
) -> ViewSide:
    """On which side of a body's surface the picture begins.

    mesh: of a body that is one, else None; at: (3,) the body's origin; packed: its waves. AIR and UNDER
    are certain; SPLIT is only that it may be so, and the picture's pixels decide for themselves.
    """
    if mesh is not None and len(mesh.positions) == 0:
        return ViewSide(Side.AIR, "the water has no surface", False, False)
    corners = plane.point(_CORNERS)
    lowest, highest = surface_band(body, mesh, at)
    looks_down = not plane.orthographic or _meets_from_above(plane, body, packed)
    if corners[:, 2].min() > highest:
        return ViewSide(Side.AIR, "the camera is above the water", looks_down, False)
    quadrangle, filled = outline(body, mesh, at)
    beyond = _beyond_edges(corners[:, :2], quadrangle)
    reaches_above = bool(corners[:, 2].max() > lowest)
    from_above = reaches_above and looks_down
    if beyond.all(axis=0).any():
        if from_above:
            return ViewSide(Side.AIR, "the camera is beside the water", True, False)
        return ViewSide(Side.AIR, "the camera is beside the water and below its surface", False, False)
    over, under = False, not reaches_above
    if reaches_above and body.grid is not None:
        over, under = _sides_of_cells(plane, body, at, packed)
    if over:
        return ViewSide(Side.AIR, "the camera is above the waves", looks_down, False)
    if under and filled and not beyond.any():
        return ViewSide(Side.UNDER, "the camera is under water", False, True)
    cuts = (
        "the surface cuts through the picture"
        if reaches_above
        else "the water's edge cuts through the picture"
    )
    return ViewSide(Side.SPLIT, cuts, from_above, True)


def _meets_from_above(plane: NearPlane, body: WaterBody, packed: np.ndarray) -> bool:
    """Whether an orthographic picture's rays can meet the surface from the air: unless they rise steeply."""
    forward = np.cross(plane.up, plane.right)
    steepest = np.inf if body.grid is None else np.sqrt(2.0) * waves.max_slope(packed)
    return bool(forward[2] <= 0.0 or forward[2] <= steepest * np.hypot(forward[0], forward[1]))


def _sides_of_cells(
    plane: NearPlane, body: WaterBody, at: np.ndarray, packed: np.ndarray
) -> tuple[bool, bool]:
    """Whether all of the near plane is over, and whether all of it is under the surface of a grid.

    The drawn surface is nowhere steeper than sqrt(2) times the sum of the waves' steepest slopes: so
    its height at the middle of a part of the near plane bounds it all over that part.
    """
    line = (np.arange(CELLS) + 0.5) * (2.0 / CELLS) - 1.0
    ndc = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    points = plane.point(ndc) - at
    over = points[:, 2] - grid_height(body, packed, points[:, :2])
    slope = np.sqrt(2.0) * waves.max_slope(packed)
    reach = np.abs(plane.right) + np.abs(plane.up)  # of the whole rectangle, along each axis
    bound = (reach[2] + slope * np.hypot(reach[0], reach[1])) / CELLS + ROUNDING
    return bool(np.all(over > bound)), bool(np.all(over < -bound))
