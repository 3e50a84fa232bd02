# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the things of a snapshot are: boxes around them, found once for a version of the scene."""

from __future__ import annotations

import numpy as np

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
        self._first = np.searchsorted(self._draw, np.arange(len(snapshot.draws)))  # instance of each draw
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
        lowest, highest = np.full(3, np.inf), np.full(3, -np.inf)
        reaching = np.nonzero(self._low[:, 2] < height)[0]
        # The lowest first: what reaches far down is the basin, and most others lie within its box.
        for i in reaching[np.argsort(self._low[reaching, 2])]:
            low, high = self._low[i], self._high[i]
            if np.all(low[:2] >= lowest[:2]) and np.all(high[:2] <= highest[:2]):
                continue
            draw = self._snapshot.draws[self._draw[i]]
            matrix = draw.matrices[i - self._first[self._draw[i]]].copy()
            matrix[:3, 3] -= self._origin
            # Its own triangles tell more than the box around it, of a tree that of its crown.
            below = self._snapshot.meshes[draw.mesh].bounds_below(matrix, height)
            if below is None:
                continue
            low, high = below
            lowest, highest = np.minimum(lowest, low), np.maximum(highest, high)
        if np.any(lowest > highest):
            return None
        return lowest, np.append(highest[:2], min(highest[2], height))
