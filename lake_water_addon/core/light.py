# SPDX-License-Identifier: GPL-3.0-or-later
"""Orthographic cameras along sunlight, in the air and in the water, fitted to what a view sees of them.

Matrices and points are in render space (see `plan`), float64.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from . import cameras, optics

STEPS_PER_DOUBLING = 2
"""Sizes that a window may have between one and twice that."""

BORDER = 4
"""Free texels on each side: a shadow's filter reads 1.5 texels away, its lookup is moved by 0.5."""

STEPS_PER_WINDOW = 16
"""A window moves by a part of its size, so that a moving view does not ask for a new one in each frame."""

MIN_WINDOW = 1e-2
"""m: the least side of a window."""

_UNIT_CORNERS = np.array(list(itertools.product((0.0, 1.0), repeat=3)))

_TRIPLES = np.array(list(itertools.combinations(range(12), 3)))

DEPTH_MARGIN = 1.0
"""m between the outermost geometry and the near and far planes."""


@dataclass(frozen=True, eq=False)
class LightCamera:
    """A camera along light that travels in `direction` (unit, (3,)).

    view: (4, 4) a mere rotation; projection: (4, 4) orthographic; texel: (2,) m, the size of one texel of the
    depth texture, `resolution` a side. Equal `key`s mean equal cameras.
    """

    direction: np.ndarray
    view: np.ndarray
    projection: np.ndarray
    resolution: int
    texel: np.ndarray

    @property
    def key(self) -> tuple:
        """Tells this camera and its texture from others."""
        return self.view.tobytes(), self.projection.tobytes(), self.resolution


def sunlight_in_water(sun_direction: np.ndarray, n12: float) -> np.ndarray:
    """(3,) unit direction of sunlight below a flat surface; sun_direction: unit, towards a sun with z > 0."""
    refracted, _ = optics.refract_direction(-sun_direction, cameras.UP, n12)
    return refracted / np.linalg.norm(refracted)


def light_axes(direction: np.ndarray) -> np.ndarray:
    """(3, 3) rows: right, up and back of a camera that looks along `direction`."""
    x, y, z = back = -direction
    # Across back and the y axis, or the x axis where back is near that.
    right = np.array([z, 0.0, -x] if abs(y) < 0.9 else [0.0, -z, y])
    right /= np.linalg.norm(right)
    return np.stack([right, _cross(back[None], right[None])[0], back])


def window(low: float, high: float, resolution: int) -> tuple[float, float]:
    """(start, size) in m of a window over [low, high], one of a fixed lattice for a given size.

    Sizes are powers of two and steps between, and a window starts at a multiple of a whole number of
    its texels: whatever the view does, a point of the scene keeps its place within a texel. At least
    BORDER texels on each side are free. ValueError for a resolution that has no room for them.
    """
    step_texels = max(resolution // STEPS_PER_WINDOW, 1)
    held = 1.0 - (step_texels + 2 * BORDER) / resolution  # part of a window, wherever its steps lie
    if held <= 0.0:
        raise ValueError(f"a light camera of {resolution} texels a side has no room for shadows: raise it")
    wanted = max(high - low, MIN_WINDOW) / held
    size = 2.0 ** (np.ceil(STEPS_PER_DOUBLING * np.log2(wanted) - 1e-9) / STEPS_PER_DOUBLING)
    texel = size / resolution
    step = texel * step_texels
    return float(np.floor((low - BORDER * texel) / step) * step), float(size)


def box_corners(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """(8, 3) corners of an axis-aligned box."""
    return low + _UNIT_CORNERS * (high - low)


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Cross products of rows (n, 3), without what numpy's own spends on other shapes."""
    return a[:, (1, 2, 0)] * b[:, (2, 0, 1)] - a[:, (2, 0, 1)] * b[:, (1, 2, 0)]


def visible_part_of_box(low: np.ndarray, high: np.ndarray, to_clip: np.ndarray) -> np.ndarray:
    """Corners (n, 3) of what a view-projection (4, 4) sees of an axis-aligned box; n = 0 when nothing.

    The corners of a convex body are those meetings of three of its planes that lie within all others.
    """
    planes = np.empty((12, 4))  # a point (x, 1) is within a plane p where p . x >= 0
    planes[0:3] = np.column_stack([np.eye(3), -low])
    planes[3:6] = np.column_stack([-np.eye(3), high])
    planes[6:9] = to_clip[3] + to_clip[:3]
    planes[9:12] = to_clip[3] - to_clip[:3]
    planes /= np.linalg.norm(planes[:, :3], axis=1, keepdims=True)
    triples = planes[_TRIPLES]
    a, b, c = triples[:, 0, :3], triples[:, 1, :3], triples[:, 2, :3]
    bc = _cross(b, c)
    volume = np.sum(a * bc, axis=1)
    meet = np.abs(volume) > 1e-9  # parallel planes do not
    w = -triples[meet][..., 3]
    a, b, c, bc = a[meet], b[meet], c[meet], bc[meet]
    points = w[:, :1] * bc + w[:, 1:2] * _cross(c, a) + w[:, 2:] * _cross(a, b)
    points /= volume[meet, None]
    within = points @ planes[:, :3].T + planes[:, 3] >= -1e-6 * (
        1.0 + np.abs(points).max(axis=1, keepdims=True)
    )
    return points[np.all(within, axis=1)]


def seen_through(polygon: np.ndarray, view: np.ndarray, projection: np.ndarray, n12: float) -> np.ndarray:
    """(n, 3) unit directions in which a view looks on below the corners (n, 3) of a flat surface's part."""
    if cameras.is_orthographic(projection):
        incident = np.broadcast_to(-view[2, :3], polygon.shape)
    else:
        incident = polygon - cameras.eye_position(view)
        incident = incident / np.linalg.norm(incident, axis=1, keepdims=True)
    refracted, _ = optics.refract_direction(incident, cameras.UP, n12)
    return refracted


def light_camera(
    direction: np.ndarray,
    points: np.ndarray,
    bounds: tuple[np.ndarray, np.ndarray],
    resolution: int,
    margin: float = 0.0,
    within: tuple[np.ndarray, np.ndarray] | None = None,
    steady: bool = False,
) -> LightCamera | None:
    """The camera along `direction` whose picture holds all `points` (n, 3), and `margin` m around them.

    within: corners (3,) of a box outside of which nothing is of use; None when no point is near it. steady:
    as large as the points could need however they were turned, so that a view that turns, as round a
    turntable, does not see its texels change in size.

    bounds: lowest and highest corner (3,) of what it may draw; its clip planes lie beyond them, and do
    not depend on the view.
    """
    axes = light_axes(direction)
    at = points @ axes.T
    low, high = at.min(axis=0) - margin, at.max(axis=0) + margin
    if steady:
        half = 0.5 * np.linalg.norm(points[:, None] - points, axis=2).max() + margin
        low, high = 0.5 * (low + high) - half, 0.5 * (low + high) + half
    if within is not None:
        limit = box_corners(*within) @ axes.T
        low, high = np.maximum(low, limit.min(axis=0)), np.minimum(high, limit.max(axis=0))
        if np.any(low[:2] >= high[:2]):
            return None
    x, width = window(low[0], high[0], resolution)
    y, height = window(low[1], high[1], resolution)
    depth = box_corners(*bounds) @ axes[2]
    top, bottom = depth.max() + DEPTH_MARGIN, depth.min() - DEPTH_MARGIN
    view = np.eye(4)
    view[:3, :3] = axes
    projection = np.diag([2.0 / width, 2.0 / height, -2.0 / (top - bottom), 1.0])
    projection[:3, 3] = (
        -(2.0 * x + width) / width,
        -(2.0 * y + height) / height,
        (top + bottom) / (top - bottom),
    )
    return LightCamera(direction, view, projection, resolution, np.array([width, height]) / resolution)
