# SPDX-License-Identifier: GPL-3.0-or-later
"""Which of many things a pass on one side of the water needs, found by two binary searches.

The refraction texture needs nothing that stands on dry land, the reflection nothing that lies on
the bottom, and only what is near the surface needs the waves to clip it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class HeightOrder:
    """Things ordered by height. least_above[i]: the lowest point of those from i on; most_below[i]: the
    highest of those up to i (both (n,), ascending)."""

    least_above: np.ndarray
    most_below: np.ndarray

    def split(
        self, keep: int, clip_height: float, clear_height: float
    ) -> tuple[tuple[int, int], tuple[int, int]]:
        """Ranges (start, end) of what is wholly on the kept side, and of what may be cut.

        keep +1: below. What may reach below `clip_height` is needed; what stays below
        `clear_height` <= clip_height cannot be cut. keep -1: above, likewise upside down.
        keep 0: everything, uncut.
        """
        count = len(self.least_above)
        if keep == 0:
            return (0, count), (0, 0)
        if keep > 0:
            end = int(np.searchsorted(self.least_above, clip_height, side="right"))
            clear = min(int(np.searchsorted(self.most_below, clear_height, side="right")), end)
            return (0, clear), (clear, end)
        start = int(np.searchsorted(self.most_below, clip_height, side="left"))
        clear = max(int(np.searchsorted(self.least_above, clear_height, side="left")), start)
        return (clear, count), (start, clear)

    def around(
        self, lowest: float, highest: float
    ) -> tuple[tuple[int, int], tuple[int, int], tuple[int, int]]:
        """Ranges (start, end) of what is wholly below `lowest`, of what may be on both sides, and of what
        is wholly above `highest`: together, everything."""
        below, across = self.split(1, highest, lowest)
        return below, across, (across[1], len(self.least_above))


def order_by_height(
    lowest: np.ndarray, highest: np.ndarray, layers: int | None = None
) -> tuple[np.ndarray, HeightOrder]:
    """(order, its HeightOrder) of n >= 0 things between lowest[i] and highest[i].

    layers: sort into so many layers of equal height only, and keep the order within each: triangles
    that follow each other share vertices, and a graphics card has them still at hand.
    """
    middle = 0.5 * (lowest + highest)
    if layers is not None and len(middle):
        base, span = middle.min(), np.ptp(middle)
        middle = np.floor((middle - base) * (layers / span)) if span > 0.0 else np.zeros(len(middle))
    order = np.argsort(middle, kind="stable")
    least_above = np.minimum.accumulate(lowest[order][::-1])[::-1]
    return order, HeightOrder(least_above, np.maximum.accumulate(highest[order]))
