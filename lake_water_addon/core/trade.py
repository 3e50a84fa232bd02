# SPDX-License-Identifier: GPL-3.0-or-later
"""The trade between time and error: the settings that are worth choosing, and a pace that holds a time.

A point is a set of settings with what a picture of them costs and what error it leaves. The front is those
points that no other beats in both.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

TOLERANCE = 0.1
"""A budget is held while frames take no more than this share over it."""


@dataclass(frozen=True)
class Point:
    """What some settings come to. settings: values by name; those that are not named are as they were.

    seconds: of one picture, all its samples. error: of any kind, the lower the better.
    """

    settings: Mapping[str, object]
    seconds: float
    error: float


def pareto_front(points: Sequence[Point]) -> list[Point]:
    """The points that no other is as good as in both time and error: seconds ascend, errors descend.

    Of equal points the first is kept. Those with a time or an error that is no finite number are left out.
    """
    front: list[Point] = []
    measured = [p for p in points if math.isfinite(p.seconds) and math.isfinite(p.error)]
    for point in sorted(measured, key=lambda p: (p.seconds, p.error)):
        if not front or point.error < front[-1].error:
            front.append(point)
    return front


def cheapest_within(front: Sequence[Point], error: float) -> Point | None:
    """The first point of a front whose error is no greater; None where there is none."""
    return next((point for point in front if point.error <= error), None)


def best_within(front: Sequence[Point], seconds: float) -> Point | None:
    """The last point of a front that takes no longer; None where there is none."""
    within = bisect_right(front, seconds, key=lambda point: point.seconds)
    return front[within - 1] if within else None


class Pace:
    """Holds a time budget while pictures follow each other, by stepping along a front.

    Times of a front are those of another moment, size or load, so only their ratios are believed: the
    measured times of the point in use say how long all of them take now. From their spread follows the time
    that 95 % of the frames stay below, and that is held to the budget.

    Down at once: after `SLOW` frames in a row over the budget, or when those 95 % no longer are within it by
    `TOLERANCE`. A single slow frame does nothing. Up later: after `DWELL` seconds in which nothing changed,
    to the best point that is expected within the budget. A point that had to be left again is barred for a
    time that doubles whenever this happens, up to `LONGEST_BAR`, so that the picture doesn't flicker.
    """

    SLOW = 3
    DWELL = 3.0
    LONGEST_BAR = 60.0
    PROOF = 4.0
    """A step up was right when it held for so many times the time that it was barred for, or DWELL."""
    EVERY = 3
    """Of so many frames one is measured, when all is well: measuring waits for the graphics card."""
    SELDOM = 0.1
    """s after which the next frame is measured in any case: slow ones are worth it."""
    MEMORY = 16
    """So many measured frames tell the spread."""
    NEEDED = 8
    """So many measured frames are needed before a step that no slow frames ask for."""
    QUANTILE = 1.645
    """Standard deviations from the median to what 95 % stay below."""

    def __init__(self, front: Sequence[Point], budget: float) -> None:
        """front: of `pareto_front`, at least one point. budget: s. Begins with what the front itself says.

        Raises ValueError for an empty front or a budget that is not above 0.
        """
        if not front:
            raise ValueError("there is no point to choose: calibrate first")
        if not budget > 0.0:
            raise ValueError(f"a time budget of {budget} s cannot be held: give more than 0")
        self.front = tuple(front)
        self.budget = budget
        best = best_within(self.front, budget)
        self.index = self.front.index(best) if best is not None else 0
        self._ratios: deque[float] = deque(maxlen=self.MEMORY)  # logarithms, measured by the front's time
        self._slow: list[float] = []  # logarithms, of the slow frames in a row
        self._skip = 1  # frames to come that also make what the point needs: textures, shaders
        self._until_measured = 0
        self._measured_at = -math.inf
        self._changed_at: float | None = None
        self._tried: int | None = None  # the point that the last step up went to
        self._held = self.index  # and the one that it came from
        self._bars: dict[
            int, tuple[float, float]
        ] = {}  # until when a point is barred, and for how long that was

    @property
    def point(self) -> Point:
        """What to draw the next frame with."""
        return self.front[self.index]

    @property
    def seconds(self) -> float | None:
        """Median of the last measured frames of the point in use; None until there is one."""
        return self.point.seconds * math.exp(np.median(self._ratios)) if self._ratios else None

    def measures(self, now: float) -> bool:
        """To be asked once a frame: whether its time is to be given to `record`. now: as there."""
        if self._skip:
            self._skip -= 1
            return False
        self._until_measured -= 1
        if self._until_measured > 0 and now - self._measured_at < self.SELDOM:
            return False
        self._until_measured, self._measured_at = self.EVERY, now
        return True

    def record(self, seconds: float, now: float) -> bool:
        """Take in the time of a frame drawn with `point`, and step where that asks for it.

        seconds: more than 0. now: s of a clock that only goes forward. Returns whether the point is another.
        """
        if self._changed_at is None:
            self._changed_at = now
        ratio = math.log(max(seconds, 1e-9) / max(self.point.seconds, 1e-9))
        self._ratios.append(ratio)
        limit = self.budget * (1.0 + TOLERANCE)
        if seconds > limit:
            self._slow.append(ratio)
            self._until_measured = 0  # look at the next ones: is it one frame, or all?
        else:
            self._slow.clear()
        known = len(self._ratios) >= self.NEEDED
        if len(self._slow) >= self.SLOW:
            return self._step_down(float(np.median(self._slow)), now)
        if known and self._expected(self.index) > limit:
            return self._step_down(float(np.median(self._ratios)), now)
        if known and now - self._changed_at >= self.DWELL:
            return self._step_up(now)
        return False

    def _spread(self) -> float:
        """Standard deviation of the ratios' logarithms; single slow frames do not count."""
        ratios = np.asarray(self._ratios)
        return 1.4826 * float(np.median(np.abs(ratios - np.median(ratios))))

    def _expected(self, index: int, level: float | None = None) -> float:
        """The time that 95 % of a point's frames stay below now, s. level: in place of the ratios' median."""
        level = float(np.median(self._ratios)) if level is None else level
        return self.front[index].seconds * math.exp(level + self.QUANTILE * self._spread())

    def _step_down(self, level: float, now: float) -> bool:
        if self.index == 0:
            return False
        if self._tried == self.index:
            _, wait = self._bars.get(self.index, (0.0, 0.5 * self.DWELL))
            wait = min(2.0 * wait, self.LONGEST_BAR)
            self._bars[self.index] = (now + wait, wait)
            self._tried = None
            return self._go(self._held, now)  # its own time may be wrong, and nothing else have changed
        fits = [i for i in range(self.index) if self._expected(i, level) <= self.budget]
        return self._go(fits[-1] if fits else 0, now)

    def _step_up(self, now: float) -> bool:
        _, wait = self._bars.get(self._tried, (0.0, self.DWELL))
        if self._tried is not None and now - self._changed_at >= self.PROOF * wait:
            self._bars.pop(self._tried, None)
            self._tried = None
        best = self.index
        for i in range(self.index + 1, len(self.front)):
            if self._expected(i) > self.budget or self._bars.get(i, (0.0,))[0] > now:
                break
            best = i
        if best == self.index:
            return False
        self._tried, self._held = best, self.index
        return self._go(best, now)

    def _go(self, index: int, now: float) -> bool:
        self.index = index
        self._changed_at = now
        self._ratios.clear()
        self._slow.clear()
        self._skip, self._until_measured = 1, 0
        return True
