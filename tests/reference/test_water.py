# SPDX-License-Identifier: GPL-3.0-or-later
"""Rays against the analytic surface."""

from __future__ import annotations

import numpy as np
import pytest

from lake_water_addon.core import waves
from scripts.reference.water import Surface
from tests.gpu.scenes import LAKE_WAVES, STEEP_WAVES, grid_mesh, translation, water

RNG = np.random.default_rng(5)


def _directions(count: int, steepest: float = 1.0) -> np.ndarray:
    """Unit directions that point down, most of them at a low angle."""
    d = RNG.normal(size=(count, 3))
    d[:, 2] = -np.abs(d[:, 2]) * steepest - 1e-3
    return d / np.linalg.norm(d, axis=1, keepdims=True)


@pytest.mark.parametrize("these_waves", [LAKE_WAVES, STEEP_WAVES])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_the_first_meeting_is_found(these_waves, side):
    surface = Surface(water(waves=these_waves), 1.0, np.zeros(3))
    count = 300
    origin = np.column_stack([RNG.uniform(-5.0, 5.0, (count, 2)), np.full(count, 2.0)]) * (1.0, 1.0, side)
    direction = _directions(count, 0.3) * (1.0, 1.0, side)
    found = surface.first_hits(origin, direction, side)
    met = np.isfinite(found.distance)
    assert 0.3 < met.mean()
    place = origin + np.where(met, found.distance, 0.0)[:, None] * direction
    assert np.abs(surface.height_over(place[met])).max() < 2e-9
    np.testing.assert_allclose(np.linalg.norm(found.normal, axis=1), 1.0, atol=1e-12)
    # Nothing was passed on the way: by brute force, along what misses up to the edge of the water, too.
    for i in range(count):
        length = found.distance[i] - 1e-6 if met[i] else 200.0
        along = origin[i] + np.linspace(0.0, length, 20_000)[:, None] * direction[i]
        inside = np.abs(along[:, :2]).max(axis=1) <= 30.0
        assert (side * surface.height_over(along[inside]) > -1e-9).all()


def test_a_ray_that_starts_on_the_surface_leaves_it():
    surface = Surface(water(waves=LAKE_WAVES), 1.0, np.zeros(3))
    start = np.column_stack([RNG.uniform(-5.0, 5.0, (500, 2)), np.zeros(500)])
    start[:, 2] = waves.height(surface.packed, start[:, :2])
    up = surface.normal(start)
    assert np.isinf(surface.first_hits(start, up, 1.0).distance).all()
    assert np.isinf(surface.first_hits(start, -up, -1.0).distance).all()


def test_calm_water_is_a_rectangle_that_turns_with_its_object():
    body = water((3.0, -2.0, 1.0), half_size=2.0)
    turned = np.array([[0.6, -0.8, 0, 0], [0.8, 0.6, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])
    body = type(body)(**{**body.__dict__, "matrix": translation(3.0, -2.0, 1.0) @ turned})
    surface = Surface(body, 0.0, np.zeros(3))
    local = np.array([[1.9, 1.9], [-1.9, 1.9], [2.1, 0.0], [0.0, -2.1]])
    origin = np.column_stack([local, np.zeros(4)]) @ turned[:3, :3].T + (3.0, -2.0, 6.0)
    found = surface.first_hits(origin, np.tile([0.0, 0.0, -1.0], (4, 1)), 1.0)
    np.testing.assert_allclose(found.distance, [5.0, 5.0, np.inf, np.inf], atol=1e-9)
    assert surface.contains(origin - (0.0, 0.0, 5.5)).tolist() == [True, True, False, False]


def test_water_on_a_mesh_is_refused():
    mesh = grid_mesh("mesh", 3, 1.0)
    body = water()
    body = type(body)(**{**body.__dict__, "grid": None, "mesh": mesh.key})
    with pytest.raises(ValueError, match="rectangle"):
        Surface(body, 0.0, np.zeros(3))
