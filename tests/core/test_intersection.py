# SPDX-License-Identifier: GPL-3.0-or-later
"""The intersection algorithm against analytic intersections with known bottoms.

The bottoms are given as functions of the line of sight, as exact as a depth texture could ever be,
so that what is measured is the algorithm.
"""

import itertools

import numpy as np
import pytest

from lake_water_addon.core import cameras, optics
from lake_water_addon.core.intersection import intersect

N12 = 1.0 / 1.333


def projection_of(kind):
    if kind == "orthographic":
        p = np.diag([1 / 8.0, 1 / 8.0, -2.0 / 200.0, 1.0])
        p[2, 3] = -1.0
        return p
    shift = (0.35, -0.6) if kind == "shifted lens" else (0.0, 0.0)
    n, f = 0.1, 1000.0
    return np.array(
        [
            [1 / 0.8, 0, shift[0], 0],
            [0, 1 / 0.8, shift[1], 0],
            [0, 0, -(f + n) / (f - n), -2 * f * n / (f - n)],
            [0, 0, -1, 0],
        ]
    )


def looking_down(height, pitch):
    """World to camera of a camera at (0, 0, height), turned down by `pitch` from the level, facing +Y."""
    c, s = np.cos(pitch), np.sin(pitch)
    to_world = np.eye(4)
    to_world[:3, :3] = np.column_stack([(1, 0, 0), (0, s, c), (0, -c, s)])  # right, up, back
    to_world[2, 3] = height
    return np.linalg.inv(to_world)


class Lake:
    """Water plane z = 0 over the plane bottom n.p = n.p0, seen by a camera and its refraction camera."""

    def __init__(self, kind="perspective", depth=3.0, slope=(0.0, 0.0), pitch=0.9, turned=True):
        self.projection = projection_of(kind)
        self.view = looking_down(6.0, pitch)
        self.texture_view = (
            cameras.refraction_view(self.view, self.projection, 0.0, N12) if turned else self.view
        )
        self.normal = np.array([-slope[0], -slope[1], 1.0])
        self.offset = -depth  # normal . p = -depth

    def depth(self, uv):
        """Distance along the viewing axis of the bottom seen at each texture coordinate."""
        to_world = np.linalg.inv(self.texture_view)
        inverse = np.linalg.inv(self.projection)
        ndc = 2.0 * uv - 1.0
        ends = []
        for z in (-1.0, 0.5):
            h = np.column_stack([ndc, np.full(len(uv), z), np.ones(len(uv))]) @ inverse.T
            ends.append(h[:, :3] / h[:, 3:] @ to_world[:3, :3].T + to_world[:3, 3])
        start, direction = ends[0], ends[1] - ends[0]
        t = (self.offset - start @ self.normal) / (direction @ self.normal)
        points = start + t[:, None] * direction
        return -(points @ self.texture_view[2, :3] + self.texture_view[2, 3])

    def rays(self, count=400, seed=1):
        """Surface points in view (world), refracted directions (world)."""
        ndc = np.random.default_rng(seed).uniform(-0.95, 0.95, (count, 2))
        to_world = np.linalg.inv(self.view)
        surface, direction = np.empty((count, 3)), np.empty((count, 3))
        for i, p in enumerate(ndc):
            o, d = cameras.ray_through(self.projection, p)
            o, d = (to_world @ np.append(o, 1.0))[:3], to_world[:3, :3] @ d
            surface[i], direction[i] = o - d * (o[2] / d[2]), d
        return surface, optics.refract_direction(direction, np.array([0.0, 0.0, 1.0]), N12)[0]

    def truth(self, surface, direction):
        t = (self.offset - surface @ self.normal) / (direction @ self.normal)
        return surface + t[:, None] * direction

    def search(self, surface, direction, steps):
        """World-space estimates after `steps`."""
        rotation, shift = self.texture_view[:3, :3], self.texture_view[:3, 3]
        found = intersect(
            surface @ rotation.T + shift, direction @ rotation.T, self.depth, self.projection, steps
        )
        to_world = np.linalg.inv(self.texture_view)
        return (
            found.hit @ to_world[:3, :3].T + to_world[:3, 3],
            found.bottom @ to_world[:3, :3].T + to_world[:3, 3],
            found.error,
        )


KINDS = ("perspective", "shifted lens", "orthographic")


BOTTOMS = ((0.0, 0.0), (0.3, 0.0), (0.0, 0.25), (-0.1, -0.1))
every_kind = pytest.mark.parametrize("kind", KINDS)


@pytest.mark.parametrize("turned", [True, False], ids=["refraction camera", "main camera"])
@every_kind
def test_flat_bottom_is_found_in_the_closed_form(kind, turned):
    """W = U + R depth / |R.z|."""
    lake = Lake(kind, turned=turned)
    surface, direction = lake.rays()
    expected = surface + direction * (3.0 / -direction[:, 2])[:, None]
    hit, bottom, error = lake.search(surface, direction, 16)
    np.testing.assert_allclose(hit, expected, atol=1e-9)
    np.testing.assert_allclose(bottom, expected, atol=1e-9)
    assert np.all(error < 1e-9)


@pytest.mark.parametrize("slope", BOTTOMS)
@every_kind
def test_second_step_finds_a_plane_bottom(kind, slope):
    """Two points of the bottom's trace give its line, and eq. (3) the point where the ray meets it."""
    lake = Lake(kind, depth=4.0, slope=slope)
    surface, direction = lake.rays()
    deep = surface @ lake.normal - lake.offset > 0.05
    assert deep.sum() > 100
    surface, direction = surface[deep], direction[deep]
    truth = lake.truth(surface, direction)
    for steps in (2, 3, 16):
        found, _, _ = lake.search(surface, direction, steps)
        assert np.max(np.linalg.norm(found - truth, axis=1)) < 1e-9


@every_kind
def test_more_steps_are_never_worse_on_an_uneven_bottom(kind):
    """|A - W| is the algorithm's own measure, and the best is kept. The true error follows it."""
    lake = Lake(kind, depth=4.0)
    plane = lake.depth
    lake.depth = lambda uv: plane(uv) + 0.4 * np.sin(9.0 * uv[:, 0]) * np.cos(7.0 * uv[:, 1])
    surface, direction = lake.rays()
    errors = [lake.search(surface, direction, n)[2] for n in range(16)]
    for fewer, more in itertools.pairwise(errors):
        assert np.all(more <= fewer)
    means = [float(np.mean(e)) for e in errors]
    assert means[2] < 0.05 * means[0] and means[15] < 0.01 * means[2], means


def test_first_step_goes_as_far_along_the_ray_as_the_bottom_lies_behind_the_surface():
    """W1 = U + |A1 - U| R, as the thesis has it, where that is better than U."""
    lake = Lake(turned=False)
    surface, direction = lake.rays(50)
    _, first_bottom, first_error = lake.search(surface, direction, 0)
    np.testing.assert_allclose(first_error, np.linalg.norm(first_bottom - surface, axis=1), atol=1e-9)
    hit, _, error = lake.search(surface, direction, 1)
    better = error < first_error
    assert better.mean() > 0.9
    np.testing.assert_allclose(hit[better], (surface + first_error[:, None] * direction)[better], atol=1e-9)
    np.testing.assert_allclose(hit[~better], surface[~better], atol=1e-9)


def test_straight_ray_is_exact_after_one_step():
    """Without refraction A1 itself is the answer, and every line is parallel to the ray."""
    lake = Lake(turned=False)
    surface, _ = lake.rays(50)
    eye = cameras.eye_position(lake.view)
    direction = surface - eye
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    for steps in (1, 2, 16):
        hit, _, _ = lake.search(surface, direction, steps)
        np.testing.assert_allclose(hit, lake.truth(surface, direction), atol=1e-6)


def test_bottom_at_the_surface_is_found_at_once():
    """At the shore U itself lies on the bottom: d = 0, and the water is clear."""
    lake = Lake(depth=0.0)
    surface, direction = lake.rays(50)
    for steps in (1, 3, 16):
        hit, bottom, error = lake.search(surface, direction, steps)
        np.testing.assert_allclose(hit, surface, atol=1e-9)
        np.testing.assert_allclose(bottom, surface, atol=1e-9)
        assert np.all(error < 1e-9)


@pytest.mark.parametrize("bottom", [1e5, 1e-3, 0.0, 7.0])
@every_kind
def test_degenerate_input_gives_finite_results(kind, bottom):
    """No bottom, a bottom at the eye, rays upwards, no ray at all, points beside and behind the camera."""
    rng = np.random.default_rng(2)
    surface = rng.uniform([-20, -20, -30], [20, 20, 1], (500, 3))
    direction = rng.normal(size=(500, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    direction[:20] = 0.0
    surface[20:40] = 0.0
    for steps in (1, 2, 16):
        with np.errstate(all="ignore"):
            found = intersect(
                surface, direction, lambda uv: np.full(len(uv), bottom), projection_of(kind), steps
            )
        for part in found:
            assert np.isfinite(part).all()


def test_wall_in_the_line_of_sight():
    """A step in the bottom, not a plane: the estimate stays on the ray and its own error tells the truth."""
    lake = Lake(turned=False)
    shallow, deep = Lake(turned=False, depth=1.0), Lake(turned=False, depth=3.0)

    def depth(uv):
        return np.where(uv[:, 0] < 0.5, shallow.depth(uv), deep.depth(uv))

    lake.depth = depth
    surface, direction = lake.rays()
    hit, bottom, error = lake.search(surface, direction, 8)
    off_the_ray = np.linalg.norm(np.cross(hit - surface, direction), axis=1)
    np.testing.assert_allclose(off_the_ray, 0.0, atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(hit - bottom, axis=1), error, atol=1e-9)
    assert np.median(error) < 1e-3
