# SPDX-License-Identifier: GPL-3.0-or-later
"""Traced: the search against planes in closed form, and what light in the water is made of."""

import numpy as np
import pytest

from lake_water_addon.core import cameras, depth_trace, optics
from lake_water_addon.core import technique_traced as traced
from tests.core.test_intersection import looking_down, projection_of

N = 1.333
SIZE = 256
SETTINGS = traced.TracedSettings()
KINDS = ("perspective", "shifted lens", "orthographic")
every_kind = pytest.mark.parametrize("kind", KINDS)


def points_at(view, projection, uv, depth):
    """(n, 3) camera-space points seen at uv (n, 2), `depth` (n,) away along the axis."""
    ndc = 2.0 * uv - 1.0
    w = 1.0 if cameras.is_orthographic(projection) else depth
    x = (ndc[:, 0] * w - projection[0, 2] * -depth) / projection[0, 0]
    y = (ndc[:, 1] * w - projection[1, 2] * -depth) / projection[1, 1]
    if cameras.is_orthographic(projection):
        x, y = (ndc[:, i] / projection[i, i] for i in (0, 1))
    return np.stack([x, y, -depth], axis=1)


def depth_of_plane(view, projection, height):
    """(SIZE, SIZE) distances of the plane z = height along the axis, at the texels' centres."""
    line = (np.arange(SIZE) + 0.5) / SIZE
    uv = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    near, far = (points_at(view, projection, uv, np.full(len(uv), d)) for d in (1.0, 2.0))
    to_world = np.linalg.inv(view)
    near, far = (p @ to_world[:3, :3].T + to_world[:3, 3] for p in (near, far))
    depth = 1.0 + (height - near[:, 2]) / (far - near)[:, 2]
    return np.where(depth > 0.0, depth, 1e5).reshape(SIZE, SIZE)


def refracted_rays(view, projection, count=500, seed=1):
    """Points (n, 3) of the plane z = 0 in view and refracted directions, in the world."""
    rng = np.random.default_rng(seed)
    uv = rng.uniform(0.1, 0.9, (count, 2))
    near, far = (points_at(view, projection, uv, np.full(count, d)) for d in (1.0, 2.0))
    to_world = np.linalg.inv(view)
    near, far = (p @ to_world[:3, :3].T + to_world[:3, 3] for p in (near, far))
    sight = (far - near) / np.linalg.norm(far - near, axis=1, keepdims=True)
    surface = near - sight * (near[:, 2:] / sight[:, 2:])
    return surface, optics.refract_direction(sight, np.array([0.0, 0.0, 1.0]), 1.0 / N)[0]


def texture_rays(view, projection, surface, direction, end):
    origin = surface @ view[:3, :3].T + view[:3, 3]
    return depth_trace.texture_ray(origin, direction @ view[:3, :3].T, projection, end, SIZE)


@every_kind
@pytest.mark.parametrize("scale", [1.0, 0.6])
def test_level_bottom_is_found(kind, scale):
    """To a hundredth of a texel and a centimetre; also in a flattened view, which is no rigid one."""
    projection, view = projection_of(kind), cameras.flattened_view(looking_down(6.0, 0.9), 0.0, scale)
    surface, direction = refracted_rays(looking_down(6.0, 0.9), projection)
    ray = texture_rays(view, projection, surface, direction, 4.0 / -direction[:, 2])
    found = depth_trace.trace(depth_of_plane(view, projection, -3.0), ray, SIZE, SETTINGS, 1.0)
    way = 3.0 / -direction[:, 2]
    inside = ray.end > way
    assert inside.mean() > 0.9
    assert np.all(found.known[inside] == 1.0)
    np.testing.assert_allclose(found.way[inside], way[inside], atol=0.01)
    hit = (surface + way[:, None] * direction) @ view[:3, :3].T + view[:3, 3]
    uv = cameras.to_texture(projection, hit)
    np.testing.assert_allclose(found.uv[inside] * SIZE, uv[inside] * SIZE, atol=0.01)


@every_kind
def test_no_bottom_is_nothing(kind):
    projection, view = projection_of(kind), looking_down(6.0, 0.9)
    surface, direction = refracted_rays(view, projection)
    ray = texture_rays(view, projection, surface, direction, np.full(len(surface), 10.0))
    found = depth_trace.trace(np.full((SIZE, SIZE), 1e5), ray, SIZE, SETTINGS, 1.0)
    assert not found.known.any()
    np.testing.assert_allclose(found.way, ray.end)


def test_rays_end_where_they_leave_the_texture():
    projection, view = projection_of("perspective"), looking_down(6.0, 0.9)
    rng = np.random.default_rng(3)
    direction = rng.normal(size=(500, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    surface, _ = refracted_rays(view, projection)
    ray = texture_rays(view, projection, surface, direction, np.full(500, 1e3))
    assert np.all((ray.to > -1e-9) & (ray.to < 1.0 + 1e-9))
    at_border = np.min(np.minimum(ray.to, 1.0 - ray.to), axis=1) < 1e-9
    assert np.all(at_border | (ray.end > 999.0) | (ray.dw < 0.0))
    assert at_border.mean() > 0.5


class Post:
    """A plate over a level bottom, seen straight down by a parallel camera."""

    projection = projection_of("orthographic")
    view = looking_down(6.0, np.pi / 2.0)

    def __init__(self, top=-1.0, bottom=-3.0):
        self.depth = np.full((SIZE, SIZE), 6.0 - bottom)
        self.x = 16.0 * ((np.arange(SIZE) + 0.5) / SIZE - 0.5)
        self.depth[:, np.abs(self.x) < 0.5] = 6.0 - top

    def trace(self, start, direction, settings=SETTINGS, hidden=1.0, end=20.0):
        direction = np.array([direction]) / np.linalg.norm(direction)
        ray = texture_rays(self.view, self.projection, np.array([start]), direction, np.array([end]))
        found = depth_trace.trace(self.depth, ray, SIZE, settings, hidden)
        return (np.array([start]) + found.way[:, None] * direction)[0], found.known[0]


def test_a_ray_that_passes_far_behind_goes_on():
    """Under the plate, and on to the bottom beyond."""
    hit, known = Post().trace((-2.0, 0.0, -2.0), (1.0, 0.0, -0.25))
    assert known == 1.0
    np.testing.assert_allclose(hit, (2.0, 0.0, -3.0), atol=0.02)


def test_a_ray_within_the_thickness_is_stopped():
    thick = traced.TracedSettings(thickness=2.0)
    hit, _ = Post().trace((-2.0, 0.0, -2.0), (1.0, 0.0, -0.25), thick)
    np.testing.assert_allclose(hit[0], -0.5, atol=0.1)


def test_what_is_hidden_is_taken_from_where_the_ray_is_least_behind():
    """The bottom is met behind the plate: the first of it beyond is as near as the texture knows."""
    post = Post()
    start, direction = (-1.0, 0.0, -2.4), (1.0, 0.0, -0.6)
    hit, known = post.trace(start, direction, traced.TracedSettings(thickness=0.05), end=2.2)
    assert known == 1.0
    assert 0.0 < hit[0] < 1.0
    _, known = post.trace(start, direction, traced.TracedSettings(thickness=0.05), hidden=0.0, end=2.2)
    assert known == 0.0


def test_what_was_met_while_hidden_is_where_the_ray_comes_out():
    """A bottom that ends, met behind the plate: beside it the ray is behind that, then before nothing."""
    post = Post()
    post.depth[:, post.x > 2.0] = 1e5
    thin, start = traced.TracedSettings(thickness=0.05, march_steps=200), (-1.0, 0.0, -2.0)
    hit, known = post.trace(start, (1.0, 0.0, -0.9), thin, hidden=0.2)
    assert known == 1.0
    np.testing.assert_allclose(hit[0], 0.5, atol=0.1)
    # Too far behind for that.
    _, known = post.trace(start, (1.0, 0.0, -0.9), thin, hidden=0.02)
    assert known == 0.0


@pytest.mark.parametrize("n12", [1.0 / N, N], ids=["from the air", "from below"])
def test_flattened_view_shows_a_refracted_ray_as_a_point(n12):
    """Of every ray with that angle of incidence, whatever its azimuth: U and all points behind it are one."""
    from_air = n12 < 1.0
    view = looking_down(6.0, 0.9) if from_air else looking_down(-2.0, -0.9)
    projection = projection_of("perspective")
    angle = 1.0 if from_air else 0.7
    eye = cameras.eye_position(view)
    up = cameras.UP if from_air else -cameras.UP  # towards the eye
    for azimuth in np.linspace(0.3, 2.8, 7):
        level = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        sight = np.sin(angle) * level - np.cos(angle) * up
        surface = eye + sight * (abs(eye[2]) / np.cos(angle))
        bent, exists = optics.refract_direction(sight, up, n12)
        assert exists
        scale = float(cameras.apparent_depth(np.cos(angle), n12))
        flat = cameras.flattened_view(view, 0.0, scale)
        points = surface + np.linspace(0.0, 5.0, 6)[:, None] * bent
        uv = cameras.to_texture(projection, points @ flat[:3, :3].T + flat[:3, 3])
        np.testing.assert_allclose(uv, np.broadcast_to(uv[0], uv.shape), atol=1e-12)
        straight = cameras.to_texture(projection, surface[None] @ view[:3, :3].T + view[:3, 3])
        np.testing.assert_allclose(uv[:1], straight, atol=1e-12)


def test_apparent_depth_straight_down_is_one_over_n():
    assert cameras.apparent_depth(1.0, 1.0 / N) == pytest.approx(1.0 / N, rel=1e-12)
    assert cameras.apparent_depth(1.0, N) == pytest.approx(N, rel=1e-12)
    assert cameras.apparent_depth(0.5, 1.0) == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize("n", [1.05, N, 1.5, 2.4])
def test_diffuse_transmittance_is_walshs(n):
    """1 less the closed form of Walsh (1926) for the reflectance of an even sky."""
    n2, n4 = n**2, n**4
    reflected = (
        0.5
        + (n - 1.0) * (3.0 * n + 1.0) / (6.0 * (n + 1.0) ** 2)
        + n2 * (n2 - 1.0) ** 2 / (n2 + 1.0) ** 3 * np.log((n - 1.0) / (n + 1.0))
        - 2.0 * n**3 * (n2 + 2.0 * n - 1.0) / ((n2 + 1.0) * (n4 - 1.0))
        + 8.0 * n4 * (n4 + 1.0) / ((n2 + 1.0) * (n4 - 1.0) ** 2) * np.log(n)
    )
    assert optics.diffuse_transmittance(n) == pytest.approx(1.0 - reflected, abs=1e-9)


def test_diffuse_light_is_absorbed_as_over_its_mean_path():
    """exp(-a path depth) against the integral over all directions: to 1 % where half of it is left."""
    cosine = (np.arange(20000) + 0.5) / 20000
    passed = 1.0 - optics.fresnel_dielectric(cosine, 1.0 / N)
    below = np.sqrt(1.0 - (1.0 - cosine**2) / N**2)
    for absorbed in (0.01, 0.1, 0.5):
        exact = np.sum(cosine * passed * np.exp(-absorbed / below)) / np.sum(cosine * passed)
        assert np.exp(-absorbed * optics.diffuse_path(N)) == pytest.approx(exact, rel=0.01)
