# SPDX-License-Identifier: GPL-3.0-or-later
"""Rays of pictures, and what light along rays finds in a snapshot."""

from __future__ import annotations

import numpy as np

from lake_water_addon import raycast
from lake_water_addon.core import cameras


class RayCaster(raycast.RayCaster):
    """With what tests ask about light. albedo: (draws, 3), base colours of its materials."""

    def __init__(self, scene) -> None:
        super().__init__(scene)
        self.albedo = np.array([scene.materials[draw.material].base_color for draw in scene.draws])

    def is_free(self, origin: np.ndarray, direction: np.ndarray) -> np.ndarray:
        """(n,) True where nothing lies in the way."""
        return ~self.cast(origin, direction).found

    def first(self, points: np.ndarray, direction: np.ndarray) -> np.ndarray:
        """(n,) distances along light in `direction` (3,), from each point (n, 3), to what it hits first.

        Negative: nearer to the light than the point.
        """
        far = 1e3
        return self.cast(points - far * direction, np.broadcast_to(direction, points.shape)).distance - far


def pixel_rays(view: np.ndarray, projection: np.ndarray, size: tuple[int, int]):
    """Origins and unit directions (h * w, 3) of the rays through the pixels' middles, lowest row first."""
    x, y = (2.0 * (np.arange(n) + 0.5) / n - 1.0 for n in size)
    x, y = (grid.ravel() for grid in np.meshgrid(x, y))
    to_world = np.linalg.inv(projection @ view)
    ends = []
    for z in (-1.0, 1.0):
        clip = np.column_stack([x, y, np.full(x.size, z), np.ones(x.size)]) @ to_world.T
        ends.append(clip[:, :3] / clip[:, 3:])
    direction = ends[1] - ends[0]
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    if not cameras.is_orthographic(projection):
        # The pole of the mirrored camera's rays is its eye, too.
        return np.broadcast_to(cameras.eye_position(view), direction.shape), direction
    return ends[0], direction
