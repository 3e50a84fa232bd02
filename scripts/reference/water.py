# SPDX-License-Identifier: GPL-3.0-or-later
"""Rays against the surface itself: the sum of sines, and not the triangles that the extension draws of it.

Along a ray the height over the waves, g(t), has |g''| <= M, so that within

    s = 2 g / (-g' + sqrt(g'^2 + 2 M g))

of a place where it is g > 0 with slope g' there is no surface. Such steps never pass one, and near one they
are Newton's: half a dozen lead to rounding.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from lake_water_addon.core import waves
from lake_water_addon.core.snapshot import WaterBody

TOLERANCE = 1e-9
"""m: how near to the surface a ray has arrived."""

MAX_STEPS = 4000
"""Steps along a ray that skims the waves; what has not arrived then flies on."""

BLOCK = 1 << 13
"""Rays at a time: few enough for a processor's caches."""

_LEAST_CURVATURE = 1e-12


class WaterHits(NamedTuple):
    """distance: (n,) m to the surface, inf for none; normal: (n, 3) unit, from the water to the air."""

    distance: np.ndarray
    normal: np.ndarray


class Surface:
    """The surface of one body at one time. origin: (3,) of its water frame in render space.

    ValueError for a body that is a mesh: only a rectangle's surface is known between its vertices.
    """

    def __init__(self, body: WaterBody, time: float, render_origin: np.ndarray) -> None:
        if body.grid is None:
            raise ValueError(f'The water "{body.name}" is a mesh: references need a rectangle of water')
        self.body = body
        self.origin = body.matrix[:3, 3] - render_origin
        settings = body.settings
        used = settings.waves[: waves.MAX_WAVES]
        self.packed = waves.pack(used, time, settings.depth, body.heading)
        self.highest = waves.max_height(used)
        _, half_x, half_y, center_x, center_y = body.grid
        self._half = np.array([half_x, half_y])
        self._center = np.array([center_x, center_y])
        cos_h, sin_h = np.cos(body.heading), np.sin(body.heading)
        self._to_frame = np.array([[cos_h, sin_h], [-sin_h, cos_h]])
        steepness = np.sum(self.packed[:, :2] ** 2, axis=1)
        self._curvature = float(np.abs(self.packed[:, 2]) @ steepness)

    def _in_frame(self, xy: np.ndarray) -> np.ndarray:
        """(n, 2) from the rectangle's middle, along its sides, of xy (n, 2) from the body's origin."""
        return xy @ self._to_frame.T - self._center

    def height_over(self, points: np.ndarray) -> np.ndarray:
        """(n,) m by which points (n, 3) lie over the waves, which have no end here; negative below."""
        at = points - self.origin
        return at[:, 2] - waves.height(self.packed, at[:, :2])

    def contains(self, points: np.ndarray) -> np.ndarray:
        """(n,) whether points (n, 3) lie under the surface, over or under the rectangle."""
        inside = np.all(np.abs(self._in_frame((points - self.origin)[:, :2])) <= self._half, axis=1)
        found = np.zeros(len(points), bool)
        found[inside] = self.height_over(points[inside]) < 0.0
        return found

    def normal(self, points: np.ndarray) -> np.ndarray:
        """(n, 3) unit normals of the waves over points (n, 3)."""
        return waves.normal(self.packed, (points - self.origin)[:, :2])

    def _range(self, origin: np.ndarray, direction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(n,), (n,): where rays enter and leave the box that the waves lie in."""
        at = np.column_stack([self._in_frame(origin[:, :2]), origin[:, 2]])
        step = np.column_stack([direction[:, :2] @ self._to_frame.T, direction[:, 2]])
        half = np.append(self._half, self.highest + 10.0 * TOLERANCE)
        with np.errstate(divide="ignore", invalid="ignore"):
            one, other = (-half - at) / step, (half - at) / step
            parallel = step == 0.0
            inside = np.abs(at) <= half
            low = np.where(parallel, np.where(inside, -np.inf, np.inf), np.minimum(one, other))
            high = np.where(parallel, np.where(inside, np.inf, -np.inf), np.maximum(one, other))
        return np.maximum(low.max(axis=1), 0.0), high.min(axis=1)

    def first_hits(self, origin: np.ndarray, direction: np.ndarray, side: float) -> WaterHits:
        """Where rays (n, 3) first pass the surface. side: +1 for rays in the air, -1 for rays in the water.

        A ray may begin on the surface, as one does that was just reflected or refracted there.
        """
        distance = np.empty(len(origin))
        for start in range(0, len(origin), BLOCK):
            block = slice(start, start + BLOCK)
            distance[block] = self._distances(origin[block], direction[block], side)
        normal = np.zeros_like(origin)
        normal[:, 2] = 1.0
        met = np.isfinite(distance)
        normal[met] = self.normal(origin[met] + distance[met, None] * direction[met])
        return WaterHits(distance, normal)

    def _distances(self, origin: np.ndarray, direction: np.ndarray, side: float) -> np.ndarray:
        distance = np.full(len(origin), np.inf)
        at = origin - self.origin
        enter, leave = self._range(at, direction)
        rays = np.flatnonzero(enter < leave)
        t, end = enter[rays], leave[rays]
        o, d = at[rays], direction[rays]
        bound = np.maximum(self._curvature * np.sum(d[:, :2] ** 2, axis=1), _LEAST_CURVATURE)
        first = True
        for _ in range(MAX_STEPS):
            if len(rays) == 0:
                break
            place = o + t[:, None] * d
            height, slope_x, slope_y = _waves_at(self.packed, place[:, 0], place[:, 1])
            g = side * (place[:, 2] - height)
            slope = side * (d[:, 2] - slope_x * d[:, 0] - slope_y * d[:, 1])
            arrived = (g < TOLERANCE) & (slope < 0.0)
            if first:
                # What comes in from beside the rectangle, on the other side of the waves, has no way in.
                arrived &= g > -TOLERANCE
                lost = g < -1e3 * TOLERANCE
                first = False
            else:
                lost = np.zeros(len(rays), bool)
            distance[rays[arrived]] = t[arrived]
            g = np.maximum(g, 0.0)
            root = np.sqrt(slope * slope + 2.0 * bound * g)
            away = slope > 0.0
            step = np.where(
                away, (slope + root) / bound, 2.0 * g / np.where(away, 1.0, root - slope + 1e-300)
            )
            t = t + np.maximum(step, 0.1 * TOLERANCE)
            on = ~arrived & ~lost & (t <= end)
            rays, t, end, o, d, bound = rays[on], t[on], end[on], o[on], d[on], bound[on]
        return distance


def _waves_at(packed: np.ndarray, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """`waves.height` and `waves.slope` at once, wave by wave: three times as fast where it counts."""
    height, slope_x, slope_y = np.zeros_like(x), np.zeros_like(x), np.zeros_like(x)
    for kx, ky, amplitude, phase in packed:
        angle = kx * x + ky * y + phase
        height += amplitude * np.sin(angle)
        along = amplitude * np.cos(angle)
        slope_x += kx * along
        slope_y += ky * along
    return height, slope_x, slope_y
