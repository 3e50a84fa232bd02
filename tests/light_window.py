# SPDX-License-Identifier: GPL-3.0-or-later
"""Windows of light cameras whose place and size a test chooses, and the bottoms that they see."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from lake_water_addon.core import light
from lake_water_addon.core.light import LightCamera

N12 = 1.0 / 1.333

SUNS = {
    "above": (0.0, 0.0, 1.0),
    "oblique": (0.5, -0.3, 0.8),
    "low": (-0.9, 0.3, 0.35),
    "grazing": (1.0, 0.2, 1.1e-3),
}


def unit(vector) -> np.ndarray:
    return np.asarray(vector, float) / np.linalg.norm(vector)


def window(sun, size: float = 8.0, resolution: int = 64) -> LightCamera:
    """The camera along sunlight in the water whose window is `size` m wide and centred below the origin."""
    direction = light.sunlight_in_water(unit(sun), N12)
    view = np.eye(4)
    view[:3, :3] = light.light_axes(direction)
    projection = np.diag([2.0 / size, 2.0 / size, -1.0 / 100.0, 1.0])
    return LightCamera(direction, view, projection, resolution, np.full(2, size / resolution))


def lattice(count: int) -> np.ndarray:
    """uv (count^2, 2) of the middles of a texture's texels, row by row."""
    line = (np.arange(count) + 0.5) / count
    return np.stack([a.ravel() for a in np.meshgrid(line, line)], axis=1)


def on_plane(camera: LightCamera, uv: np.ndarray, depth: float, slope=(0.0, 0.0)) -> np.ndarray:
    """Points (n, 3) of the plane z = -depth + slope . xy that the camera sees at uv (n, 2)."""
    at = np.concatenate([(2 * uv - 1) / np.diag(camera.projection)[:2], np.zeros((len(uv), 1))], axis=1)
    start, normal = at @ camera.view[:3, :3], np.array([-slope[0], -slope[1], 1.0])
    along = (-depth - start @ normal) / (camera.direction @ normal)
    return start + along[:, None] * camera.direction


def plane_depths(camera: LightCamera, depth: float, slope=(0.0, 0.0)) -> np.ndarray:
    """(r, r) distances along the light of such a plane, first row at the bottom."""
    points = on_plane(camera, lattice(camera.resolution), depth, slope)
    return -(points @ camera.view[2, :3]).reshape(camera.resolution, -1)


def ground_depths(camera: LightCamera, height: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> np.ndarray:
    """(r, r) distances along the light of the ground z = height(x, y), no steeper than the light."""
    points = on_plane(camera, lattice(camera.resolution), 0.0)
    for _ in range(100):
        missing = (points[:, 2] - height(points[:, 0], points[:, 1])) / -camera.direction[2]
        points = points + missing[:, None] * camera.direction
    return -(points @ camera.view[2, :3]).reshape(camera.resolution, -1)
