# SPDX-License-Identifier: GPL-3.0-or-later
"""Sunlight under water by counting photons.

Photons are launched on an even lattice across the light below a calm surface, meet the analytic waves, are
refracted there and fly to the real geometry. They are counted in the plane across that light, where the
density of a calm water's photons is 1 whatever the bottom's slope: the projection along the light is but
another way to number the places of a surface. So the count over that of calm clear water is the light L of
`core.water_light`, and it is exact for surfaces that turn to the light.

Where something lies before something else, seen along that light, there are two surfaces under one place of
the plane: photons on the first one and those on all others are counted apart.

A lattice and not chance: the counts of random photons would vary by the square root of their number.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np

from lake_water_addon.core import optics
from lake_water_addon.core.light import LightCamera, light_axes, sunlight_in_water
from lake_water_addon.core.snapshot import Sun

from .geometry import Geometry, clearance
from .optics import WaterOptics
from .water import Surface

PER_CELL = 9.0
"""Photons of a calm surface in a cell of the count."""

WINDOW_RATIO = 4.0
"""Each window is about so many times smaller than the one before."""

MAX_WINDOWS = 3

LEAST_SHRINKING = 0.6
"""A window that is not this much smaller than the one before is not worth its photons."""

BORDER = 2
"""Cells between a window's border and what it has to hold."""

CHUNK = 1 << 17

_GOLDEN = 0.5 * (5.0**0.5 - 1.0)

Progress = Callable[[Iterable, int, str], Iterable]
"""Passes chunks of work on: (chunks, their number, what they are) -> chunks."""


@dataclass(frozen=True, eq=False)
class Window:
    """Counts over a rectangle across the light. low, cell: (2,) m, its corner and the size of a cell.

    counts: (2, rows, columns, channels), of what the light sees first and of the rest, as parts of the light
    on the water.
    """

    low: np.ndarray
    cell: np.ndarray
    counts: np.ndarray

    def at(self, places: np.ndarray, layer: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(n, channels) at places (n, 2) of a layer (n,), and (n,) whether they lie in the window."""
        rows, columns = self.counts.shape[1:3]
        at = (places - self.low) / self.cell - 0.5
        inside = np.all((at >= 0.0) & (at < (columns - 1, rows - 1)), axis=1)
        low = np.clip(np.floor(at), 0, (columns - 2, rows - 2)).astype(np.int64)
        px, py = (at - low).T[:, :, None]
        x, y = low.T
        lower = self.counts[layer, y, x] * (1.0 - px) + self.counts[layer, y, x + 1] * px
        upper = self.counts[layer, y + 1, x] * (1.0 - px) + self.counts[layer, y + 1, x + 1] * px
        return lower * (1.0 - py) + upper * py, inside


class Sunlight:
    """Sunlight under one water surface."""

    def __init__(self, geometry: Geometry, surface: Surface, water: WaterOptics, sun: Sun) -> None:
        self._geometry, self._surface, self._water, self.sun = geometry, surface, water, sun
        self.direction = sunlight_in_water(sun.direction, 1.0 / water.ior)
        self.axes = light_axes(self.direction)
        self.bending = float(sun.direction[2] / -self.direction[2])
        self.windows: list[Window] = []

    def across(self, points: np.ndarray) -> np.ndarray:
        """(n, 2) m: places of points (n, 3) in the plane across the light."""
        return points @ self.axes[:2].T

    def layer(self, points: np.ndarray, face: np.ndarray) -> np.ndarray:
        """(n,) 0 for what the light of a calm surface reaches first, 1 for what lies in its shadow.

        face: (n, 3) normals of the triangles, either side.
        """
        turned = np.where(np.sum(face * self.direction, axis=1, keepdims=True) > 0.0, -1.0, 1.0)
        start = points + turned * face * clearance(points)
        top = self._surface.origin[2] + self._surface.highest
        length = np.maximum(top - start[:, 2], 0.0) / -self.direction[2]
        back = np.broadcast_to(-self.direction, points.shape)
        return self._geometry.occluded(start, back, length).astype(np.int64)

    def count(
        self,
        points: np.ndarray,
        distance: np.ndarray,
        photons: int,
        *,
        workers: int = 2,
        progress: Progress = lambda chunks, _number, _what: chunks,
    ) -> None:
        """Make windows for light on points (n, 3), seen from `distance` (n,) m, with `photons` each."""
        self.windows = []
        deepest = self._surface.origin[2] - self._geometry.bounds()[0][2]
        farthest = distance.max(initial=0.0)
        boxes = []
        for i in range(MAX_WINDOWS):
            near = self.across(points[distance <= farthest / WINDOW_RATIO**i])
            if len(near) == 0:
                break
            low, high = near.min(axis=0), near.max(axis=0)
            side = np.maximum(high - low, 1e-2)
            if boxes and side.prod() > LEAST_SHRINKING**2 * boxes[-1][1].prod():
                continue
            boxes.append((low, side))
        for low, side in boxes:
            cell = np.sqrt((side + 2.0 * self._reach(deepest)).prod() * PER_CELL / photons)
            size = np.ceil(side / cell).astype(int) + 2 * BORDER
            start = low - 0.5 * (size * cell - side)
            square = np.full(2, cell)
            self.windows.insert(
                0, self.count_over(start, square, size, photons, workers=workers, progress=progress)
            )

    def _reach(self, depth: float) -> float:
        """m, across the light, by which waves move a ray at most until it is `depth` m deep: they turn it by
        about half their slope."""
        slope = np.abs(self._surface.packed[:, 2]) @ np.linalg.norm(self._surface.packed[:, :2], axis=1)
        return self._surface.highest * 2.0 + 0.5 * min(slope, 1.0) * max(depth, 0.0)

    def count_texture(
        self, camera: LightCamera, texels: int, photons: int, *, workers: int = 2
    ) -> np.ndarray:
        """(texels, texels, channels) light, as the caustics of a planned body have it in the texture of that
        camera: of what the light sees first."""
        low = -(1.0 + camera.projection[:2, 3]) / np.diag(camera.projection)[:2]
        size = np.full(2, 2 * texels)
        cell = 2.0 / np.diag(camera.projection)[:2] / size
        counts = self.count_over(low, cell, size, photons, workers=workers).counts[0]
        return counts.reshape(texels, 2, texels, 2, -1).mean(axis=(1, 3))

    def count_over(
        self,
        low: np.ndarray,
        cell: np.ndarray,
        size: np.ndarray,
        photons: int,
        *,
        workers: int = 2,
        progress: Progress = lambda chunks, _number, _what: chunks,
    ) -> Window:
        """A window of `size` = (columns, rows) cells. photons: launched over all of it and beyond."""
        margin = self._reach(self._surface.origin[2] - self._geometry.bounds()[0][2]) + 1.5 * cell
        launch_low, launch_side = low - margin, size * cell + 2.0 * margin
        channels = 1 if self._water.is_gray else len(self._water.absorption)
        counts = np.zeros((2, size[1], size[0], channels))

        def counted(start: int) -> np.ndarray:
            i = np.arange(start, min(start + CHUNK, photons))
            # A Fibonacci lattice: even in all directions, and with none along the cells.
            even = np.stack([(i + 0.5) / photons, np.mod((i + 0.5) * _GOLDEN, 1.0)], axis=1)
            return self._photons(launch_low + even * launch_side, low, cell, counts.shape)

        starts = range(0, photons, CHUNK)
        with ThreadPoolExecutor(workers) as pool:
            what = f"photons, {size[0]} x {size[1]} cells of {1000 * cell.max():.1f} mm"
            for part in progress(pool.map(counted, starts), len(starts), what):
                counts += part
        return Window(low, cell, counts * (launch_side.prod() / photons / cell.prod()))

    def _photons(
        self, launch: np.ndarray, low: np.ndarray, cell: np.ndarray, shape: tuple[int, ...]
    ) -> np.ndarray:
        """Counts like those of `Window`, not yet scaled, of photons launched at places (n, 2)."""
        geometry, surface, water, sun = self._geometry, self._surface, self._water, self.sun
        plane = launch @ self.axes[:2]
        level = surface.origin[2]
        plane += ((level - plane[:, 2]) / self.direction[2])[:, None] * self.direction
        # From over the highest wave, along the sun's straight light.
        up = (2.0 * surface.highest + 1e-3) / sun.direction[2]
        origin = plane + up * sun.direction
        incident = np.broadcast_to(-sun.direction, origin.shape)
        met = surface.first_hits(origin, incident, +1.0)
        wet = np.isfinite(met.distance)
        place, normal = origin[wet] + met.distance[wet, None] * incident[wet], met.normal[wet]
        lit = ~geometry.occluded(
            place + sun.direction * clearance(place), np.broadcast_to(sun.direction, place.shape)
        )
        place, normal = place[lit], normal[lit]
        incident = incident[: len(place)]
        refracted, _ = optics.refract_direction(incident, normal, 1.0 / water.ior)
        passed = 1.0 - optics.fresnel_dielectric(-np.sum(incident * normal, axis=1), 1.0 / water.ior)
        hits = geometry.first_hits(place, refracted)
        landed = hits.triangle >= 0
        place, refracted, passed = place[landed], refracted[landed], passed[landed]
        hits = type(hits)(hits.triangle[landed], hits.distance[landed])
        found = geometry.surface(hits, place, refracted)
        at = (self.across(found.position) - low) / cell
        near = np.all((at > -1.5) & (at < (shape[2] + 1.5, shape[1] + 1.5)), axis=1)
        layer = self.layer(found.position[near], found.face[near])
        channels = self._water.absorption[: shape[3]]
        light = passed[near, None] * np.exp(-hits.distance[near, None] * channels)
        return _splat(at[near], layer, light, shape)

    def calm(self, points: np.ndarray) -> np.ndarray:
        """(n, 3) L under a calm surface in full sun at points (n, 3)."""
        path = np.maximum(self._surface.origin[2] - points[:, 2], 0.0) / -self.direction[2]
        passed = 1.0 - optics.fresnel_dielectric(self.sun.direction[2], 1.0 / self._water.ior)
        return passed * np.exp(-path[:, None] * self._water.absorption)

    def light(self, points: np.ndarray, face: np.ndarray) -> np.ndarray:
        """(n, 3) L at points (n, 3) of triangles with normals (n, 3); of calm water where none fell."""
        layer, places = self.layer(points, face), self.across(points)
        light = self.calm(points) * (layer == 0)[:, None]
        unknown = np.ones(len(points), bool)
        for window in self.windows:
            found, inside = window.at(places, layer)
            these = unknown & inside
            light[these] = found[these]
            unknown &= ~inside
        if unknown.any():
            left = points[unknown]
            path = np.maximum(self._surface.origin[2] - left[:, 2], 0.0) / -self.direction[2]
            above = left - path[:, None] * self.direction
            to_sun = np.broadcast_to(self.sun.direction, above.shape)
            hidden = self._geometry.occluded(above + to_sun * clearance(above), to_sun)
            light[unknown] *= ~hidden[:, None]
        return light

    def irradiance(self, points: np.ndarray, normal: np.ndarray, face: np.ndarray) -> np.ndarray:
        """(n, 3) W/m^2 of the sun on points (n, 3) with unit normals (n, 3), and those of their triangles."""
        cosine = np.maximum(-(normal @ self.direction), 0.0)
        return self.sun.irradiance * (self.bending * cosine)[:, None] * self.light(points, face)


def _splat(at: np.ndarray, layer: np.ndarray, light: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """Light (n, channels) at places (n, 2), in cells, spread over 3 x 3 of them by a quadratic B-spline."""
    _, rows, columns, channels = shape
    nearest = np.floor(at)
    part = at - nearest - 0.5
    weights = np.stack([0.5 * (0.5 - part) ** 2, 0.75 - part**2, 0.5 * (0.5 + part) ** 2])  # (3, n, 2)
    x, y = nearest.astype(np.int64).T
    # A border on each side takes what falls beside the window.
    wide = columns + 6
    index = (layer * (rows + 6) + y + 3) * wide + x + 3
    steps = (np.arange(-1, 2)[:, None] * wide + np.arange(-1, 2)).reshape(9, 1)
    to = (steps + index).ravel()
    share = (weights[:, None, :, 1] * weights[None, :, :, 0]).reshape(9, -1)
    cells = np.stack(
        [np.bincount(to, (share * of_channel).ravel(), 2 * (rows + 6) * wide) for of_channel in light.T]
    )
    return np.moveaxis(cells.reshape(channels, 2, rows + 6, wide)[:, :, 3:-3, 3:-3], 0, -1)
