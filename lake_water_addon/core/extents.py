# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the things of a snapshot are: boxes around them, found once for a version of the scene."""

from __future__ import annotations

import numpy as np

from .light import box_corners
from .snapshot import SceneSnapshot

Bounds = tuple[np.ndarray, np.ndarray]
"""Lowest and highest corner (3,) of a box."""


class Extents:
    """Boxes around the instances of a snapshot, in render space. origin: (3,) of it, world."""

    def __init__(self, snapshot: SceneSnapshot, origin: np.ndarray) -> None:
        self.key = (snapshot.version, tuple(origin))
        self._snapshot = snapshot
        self._origin = origin
        self._below: dict[float, Bounds | None] = {}
        self._low, self._high, self._draw = self._boxes()
        self.bounds: Bounds | None = None
        if len(self._low):
            self.bounds = self._low.min(axis=0), self._high.max(axis=0)

    def is_of(self, snapshot: SceneSnapshot, origin: np.ndarray) -> bool:
        """Whether these boxes hold for a snapshot, too."""
        return self.key == (snapshot.version, tuple(origin))

    def below(self, height: float) -> Bounds | None:
        """The box around all that reaches below a height, up to there: of a terrain, the basin and not the
        mountains. None when nothing does."""
        if height not in self._below:
            self._below[height] = self._find_below(height)
        return self._below[height]

    def _boxes(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Lowest and highest corners (n, 3) of all instances, and their draws (n,)."""
        meshes, draws = self._snapshot.meshes, self._snapshot.draws
        filled = [i for i, draw in enumerate(draws) if len(meshes[draw.mesh].positions)]
        if not filled:
            return np.empty((0, 3)), np.empty((0, 3)), np.empty(0, int)
        of_draw = np.repeat(filled, [len(draws[i].matrices) for i in filled])
        corners = np.array([meshes[draw.mesh].bounds for draw in draws])
        center, half = corners.mean(axis=1)[of_draw], 0.5 * (corners[:, 1] - corners[:, 0])[of_draw]
        matrices = np.concatenate([draws[i].matrices for i in filled])
        middle = np.einsum("nij,nj->ni", matrices[:, :3, :3], center) + matrices[:, :3, 3] - self._origin
        reach = np.einsum("nij,nj->ni", np.abs(matrices[:, :3, :3]), half)
        return middle - reach, middle + reach, of_draw

    def _find_below(self, height: float) -> Bounds | None:
        low, high = self._low.copy(), self._high.copy()
        used = low[:, 2] < height
        for i in np.nonzero(used)[0]:
            draw = self._snapshot.draws[self._draw[i]]
            matrix = draw.matrices[0]
            if len(draw.matrices) > 1 or matrix[2, :2].any() or matrix[2, 2] <= 0.0:
                continue
            # Upright and alone: its own triangles tell more than the box around it.
            mesh = self._snapshot.meshes[draw.mesh]
            below = mesh.bounds_below((height + self._origin[2] - matrix[2, 3]) / matrix[2, 2])
            if below is None:
                used[i] = False
                continue
            corners = box_corners(*below) @ matrix[:3, :3].T + matrix[:3, 3] - self._origin
            low[i], high[i] = corners.min(axis=0), corners.max(axis=0)
        if not used.any():
            return None
        top = high[used].max(axis=0)
        return low[used].min(axis=0), np.append(top[:2], min(top[2], height))
