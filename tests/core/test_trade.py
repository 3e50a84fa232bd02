# SPDX-License-Identifier: GPL-3.0-or-later
"""What is worth choosing, and the pace that holds a time budget, tried with noise, load and wrong times."""

import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lake_water_addon.core.trade import TOLERANCE, Pace, Point, best_within, cheapest_within, pareto_front

NUMBERS = st.floats(0, 10) | st.sampled_from([1.0, 2.0, 3.0, math.nan, math.inf])
POINTS = st.lists(st.builds(Point, st.just({}), NUMBERS, NUMBERS), max_size=30)
BUDGET = 0.033


def beats(one: Point, other: Point) -> bool:
    """Whether a point is as good as another in both, and better in one."""
    return (one.seconds <= other.seconds and one.error <= other.error) and (
        (one.seconds, one.error) != (other.seconds, other.error)
    )


@given(POINTS)
def test_the_front_is_what_nothing_beats(points):
    front = pareto_front(points)
    for a, b in pairwise(front):
        assert a.seconds < b.seconds
        assert a.error > b.error
    finite = [p for p in points if math.isfinite(p.seconds) and math.isfinite(p.error)]
    for point in finite:
        is_best = not any(beats(other, point) for other in finite)
        assert is_best == any((point.seconds, point.error) == (p.seconds, p.error) for p in front)


def test_of_equal_points_the_first_is_kept():
    points = [Point({"n": n}, 1.0, 1.0) for n in range(3)]
    assert pareto_front(points) == [points[0]]


@given(POINTS, st.floats(0, 10))
def test_choices_from_a_front_are_those_from_all_points(points, limit):
    front = pareto_front(points)
    finite = [p for p in points if math.isfinite(p.seconds) and math.isfinite(p.error)]
    cheapest, best = cheapest_within(front, limit), best_within(front, limit)
    seconds = [p.seconds for p in finite if p.error <= limit]
    assert (cheapest is None) == (not seconds)
    assert cheapest is None or (cheapest.seconds == min(seconds) and cheapest.error <= limit)
    errors = [p.error for p in finite if p.seconds <= limit]
    assert (best is None) == (not errors)
    assert best is None or (best.error == min(errors) and best.seconds <= limit)


def front_of(ratio: float = 1.45, first: float = 0.004, count: int = 8) -> list[Point]:
    return [Point({"intersection_steps": i + 1}, first * ratio**i, 0.2 * 0.7**i) for i in range(count)]


class Playback:
    """Frames one after another. factors: what each point's time is wrong by.

    load: factor of every frame's time, by the clock (s). noise: standard deviation of its logarithm. spikes:
    share of frames that take two to five times as long. The first frame of a point takes twice its time.
    """

    FRAME = 1.0 / 24.0

    def __init__(self, pace: Pace, seed: int = 0) -> None:
        self.pace, self.now, self.random = pace, 0.0, np.random.default_rng(seed)
        self.at, self.index, self.seconds = [], [], []
        self.factors = np.ones(len(pace.front))

    def run(
        self,
        seconds: float,
        load: Callable[[float], float] = lambda now: 1.0,
        *,
        noise: float = 0.06,
        spikes: float = 0.01,
    ) -> "Playback":
        end, fresh = self.now + seconds, not self.at
        while self.now < end:
            index = self.pace.index
            taken = self.pace.point.seconds * self.factors[index] * load(self.now)
            taken *= math.exp(self.random.normal(0.0, noise)) * (2.0 if fresh else 1.0)
            taken *= self.random.uniform(2.0, 5.0) if self.random.random() < spikes else 1.0
            measured = self.pace.measures(self.now)
            self.at.append(self.now)
            self.index.append(index)
            self.seconds.append(taken)
            self.now += max(taken + 0.005, self.FRAME)
            fresh = measured and self.pace.record(taken, self.now)
        return self

    def share_held(self, since: float) -> float:
        """Of the frames from a time on, those within the tolerance."""
        seconds = np.array(self.seconds)[np.array(self.at) >= since]
        return float((seconds <= self.pace.budget * (1.0 + TOLERANCE)).mean())

    def steps(self, direction: int) -> list[float]:
        """When it stepped up (+1) or down (-1)."""
        changes = np.sign(np.diff(self.index))
        return [self.at[i + 1] for i in np.flatnonzero(changes == direction)]

    def steps_to(self, index: int) -> list[float]:
        """When it stepped up to a point."""
        return [at for at in self.steps(+1) if self.index[self.at.index(at)] == index]


def drift(amount: float, period: float) -> Callable[[float], float]:
    return lambda now: math.exp(amount * math.sin(2.0 * math.pi * now / period))


SCENARIOS = {
    "quiet": {"noise": 0.03},
    "noisy": {"noise": 0.1},
    "slow drift": {"load": drift(0.25, 60.0)},
    "fast drift": {"load": drift(0.2, 12.0)},
    "twice as slow": {"load": lambda now: 2.0},
    "many spikes": {"spikes": 0.025},
    "drift and noise": {"load": drift(0.2, 30.0), "noise": 0.08},
}


@pytest.mark.parametrize("budget", [0.02, 0.033])
@pytest.mark.parametrize("scenario", SCENARIOS)
@pytest.mark.parametrize("wrong", [0.0, 0.2])
def test_95_percent_of_frames_are_within_10_percent(scenario, budget, wrong):
    for seed in range(2):
        playback = Playback(Pace(front_of(), budget), seed)
        playback.factors = np.exp(playback.random.normal(0.0, wrong, len(playback.factors)))
        playback.run(60.0, **SCENARIOS[scenario])
        assert playback.share_held(since=1.5) >= 0.95
        ups = playback.steps(+1)
        assert min(np.diff(ups), default=np.inf) >= Pace.DWELL, "it flickers"
        assert len(ups) <= 10


@pytest.mark.parametrize("budget", [0.02, 0.033, 0.05])
def test_it_uses_what_time_there_is(budget):
    """Not only by choosing the cheapest: without noise it is the dearest point that fits."""
    playback = Playback(Pace(front_of(), budget)).run(20.0, lambda now: 0.6, noise=0.01, spikes=0.0)
    dearest = max(i for i, point in enumerate(front_of()) if 0.6 * 1.02 * point.seconds <= budget)
    assert playback.index[-1] == dearest


def test_single_slow_frames_change_nothing():
    pace = Pace(front_of(), BUDGET)
    playback = Playback(pace).run(3.0, noise=0.02, spikes=0.0)
    before = pace.index
    for _ in range(20):
        pace.record(10 * BUDGET, playback.now)
        playback.run(1.0, noise=0.02, spikes=0.0)
    assert set(playback.index) == {before}


@pytest.mark.parametrize("factor", [1.5, 3.0])
def test_a_dearer_scene_is_settled_within_a_second(factor):
    playback = Playback(Pace(front_of(), BUDGET)).run(10.0)
    changed = playback.now
    playback.run(10.0, lambda now: factor)
    assert playback.share_held(since=changed + 1.0) >= 0.95
    assert playback.steps(-1)[0] < changed + 1.0


def test_a_cheaper_scene_gets_better_settings_soon():
    pace = Pace(front_of(), BUDGET)
    playback = Playback(pace).run(10.0)
    before = pace.index
    playback.run(Pace.DWELL + 1.0, lambda now: 0.4)
    assert pace.index > before
    assert len(playback.steps(+1)) == 1, "in one step, not through all points between"


def test_a_point_that_fails_is_tried_ever_more_rarely():
    """Point 5 costs twice what its measurement said."""
    pace = Pace(front_of(), BUDGET)
    assert pace.index == 5
    playback = Playback(pace)
    playback.factors[5:] = 2.0
    playback.run(200.0, noise=0.02, spikes=0.0)
    waits = np.diff(playback.steps_to(5))
    assert len(waits) >= 4
    np.testing.assert_allclose(waits[1:4] / waits[:3], 2.0, rtol=0.15)
    assert waits.max() < Pace.LONGEST_BAR + 2.0
    assert playback.index.count(5) < 0.02 * len(playback.index)


def test_few_frames_are_measured_while_all_is_well():
    pace = Pace(front_of(), BUDGET)
    playback = Playback(pace).run(5.0, noise=0.02, spikes=0.0)
    asked = [pace.measures(playback.now + i / 60.0) for i in range(300)]
    assert np.mean(asked) == pytest.approx(1.0 / Pace.EVERY, abs=0.01)
    assert all(pace.measures(100.0 + i * Pace.SELDOM * 1.01) for i in range(10)), "slow ones are all measured"
    assert pace.seconds == pytest.approx(np.median(playback.seconds), rel=0.02)


def test_what_cannot_be_held_takes_the_cheapest():
    pace = Pace(front_of(), 0.001)
    Playback(pace).run(10.0)
    assert pace.index == 0


def test_nothing_to_choose_and_no_time_are_refused():
    with pytest.raises(ValueError, match="calibrate first"):
        Pace([], 0.03)
    for budget in (0.0, -1.0, math.nan):
        with pytest.raises(ValueError, match="give more than 0"):
            Pace(front_of(), budget)
