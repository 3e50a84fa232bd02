# SPDX-License-Identifier: GPL-3.0-or-later
"""What a pass on one side of the water leaves out, and what it draws without the clip."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lake_water_addon.core import cameras
from lake_water_addon.core.heights import order_by_height

SPANS = st.lists(st.tuples(st.floats(-10, 10), st.floats(0, 5)), max_size=30)


@given(SPANS, st.floats(-12, 12), st.floats(0, 2), st.sampled_from([+1, -1]), st.sampled_from([None, 4]))
def test_nothing_needed_is_left_out_and_nothing_that_may_be_cut_goes_uncut(spans, level, band, keep, layers):
    low = np.array([a for a, _ in spans])
    high = low + np.array([b for _, b in spans])
    order, heights = order_by_height(low, high, layers)
    assert sorted(order) == list(range(len(spans)))
    clip_height, clear_height = level + keep * band, level - keep * band
    clear, cut = heights.split(keep, clip_height, clear_height)
    uncut, cut = set(order[slice(*clear)]), set(order[slice(*cut)])
    assert not uncut & cut
    for i, (lowest, highest) in enumerate(zip(low, high, strict=True)):
        needed = lowest <= clip_height if keep > 0 else highest >= clip_height
        safe = highest <= clear_height if keep > 0 else lowest >= clear_height
        assert not needed or i in uncut | cut, f"{i} is left out"
        assert i not in uncut or safe, f"{i} may be cut and is drawn without the clip"


def test_everything_is_drawn_uncut_without_a_side():
    _, heights = order_by_height(np.array([0.0, -3.0]), np.array([1.0, -2.0]))
    assert heights.split(0, 0.0, 0.0) == ((0, 2), (0, 0))


def test_trees_and_stones_are_left_out_where_they_cannot_show():
    low, high = np.array([1.0, -4.0, -0.5]), np.array([9.0, -3.0, 0.5])  # tree, stone, boulder
    order, heights = order_by_height(low, high)
    (a, b), (c, d) = heights.split(+1, 0.1, -0.1)
    assert (order[a:b].tolist(), order[c:d].tolist()) == ([1], [2])
    (a, b), (c, d) = heights.split(-1, -0.1, 0.1)
    assert (order[a:b].tolist(), order[c:d].tolist()) == ([0], [2])


VIEW_VOLUME = np.diag([0.5, 0.5, 0.5, 1.0])  # -2..2 on each axis


@pytest.mark.parametrize(
    ("polygon", "area"),
    [
        ([(-1, -1), (1, -1), (1, 1), (-1, 1)], 4.0),
        ([(0, 0), (9, 0), (9, 9), (0, 9)], 4.0),
        ([(-9, -9), (9, -9), (9, 9), (-9, 9)], 16.0),
        ([(3, 3), (9, 3), (9, 9), (3, 9)], 0.0),
        ([(-4, 0), (0, -4), (4, 0), (0, 4)], 16.0),  # touches the corners
    ],
)
def test_polygon_is_clipped_to_the_view_volume(polygon, area):
    points = np.column_stack([np.array(polygon, float), np.zeros(4)])
    clipped = cameras.clip_polygon(points, VIEW_VOLUME)
    x, y = clipped[:, 0], clipped[:, 1]
    assert np.isclose(0.5 * abs(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1))), area)


def test_polygon_that_reaches_behind_the_camera_is_cut_before_it():
    projection = np.array([[1.0, 0, 0, 0], [0, 1, 0, 0], [0, 0, -1.02, -0.202], [0, 0, -1, 0]])
    floor = np.array([(-50.0, -1.0, 50.0), (50.0, -1.0, 50.0), (50.0, -1.0, -50.0), (-50.0, -1.0, -50.0)])
    clipped = cameras.clip_polygon(floor, projection)
    ndc = cameras.to_ndc(projection, clipped)
    assert clipped[:, 2].max() < 0.0
    assert np.all(np.abs(ndc) <= 1.0 + 1e-9)
