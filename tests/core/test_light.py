# SPDX-License-Identifier: GPL-3.0-or-later
"""Cameras along sunlight: what they hold, that they stand still, and the shadows' windows."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lake_water_addon.core import cameras, light, optics, shadows
from tests.core.test_cameras import PROJECTIONS, orthographic, perspective, view_of

N12 = 1.0 / 1.333

SUNS = {
    "oblique": (0.5, -0.3, 0.8),
    "straight above": (0.0, 0.0, 1.0),
    "grazing": (0.8, 0.6, 1e-3),
    "along +Y": (0.0, 1.0, 0.0),
    "along -Y": (0.0, -1.0, 1e-3),
    "almost along +Y": (0.0, 0.9, 0.4358),
    "below the horizon": (0.3, 0.4, -0.9),
    "straight below": (0.0, 0.0, -1.0),
}

BOUNDS = (np.array([-30.0, -20.0, -5.0]), np.array([25.0, 40.0, 12.0]))


def towards(sun):
    return np.array(sun) / np.linalg.norm(sun)


def in_texels(camera, points):
    """Places (n, 2) in the texture of a light camera, in texels."""
    at = points @ camera.view[:3, :3].T + camera.view[:3, 3]
    return shadows.in_window(camera.projection, camera.resolution, at)


# Windows.


@given(
    low=st.floats(-1e4, 1e4),
    extent=st.floats(0.0, 5e3),
    resolution=st.sampled_from([16, 100, 256, 1024, 4096]),
)
def test_window_holds_its_interval_with_a_border(low, extent, resolution):
    start, size = light.window(low, low + extent, resolution)
    border = light.BORDER * size / resolution * (1.0 - 1e-6)
    assert start + border <= low and low + extent <= start + size - border


@given(low=st.floats(-1e4, 1e4), extent=st.floats(1.0, 5e3))
def test_window_is_hardly_larger_than_needed(low, extent):
    """Steps and border take 1/16 and 8 texels, and sizes are half an octave apart."""
    _, size = light.window(low, low + extent, 1024)
    assert size <= extent * np.sqrt(2.0) / (1.0 - 1.0 / 16.0 - 8.0 / 1024.0) * (1.0 + 1e-9)


def test_window_has_few_sizes():
    sizes = {light.window(3.0, 3.0 + extent, 512)[1] for extent in np.linspace(10.0, 20.0, 1000)}
    assert len(sizes) <= light.STEPS_PER_DOUBLING + 1


@pytest.mark.parametrize("resolution", [1, 4, 8])
def test_window_of_too_few_texels_is_refused(resolution):
    with pytest.raises(ValueError, match="no room"):
        light.window(0.0, 1.0, resolution)


# The camera.


@pytest.mark.parametrize("sun", SUNS.values(), ids=SUNS)
def test_axes_are_a_rotation_that_looks_along_the_light(sun):
    direction = -towards(sun)
    axes = light.light_axes(direction)
    np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(axes) == pytest.approx(1.0)
    np.testing.assert_allclose(axes[2], -direction, atol=1e-15)


@pytest.mark.parametrize("margin", [0.0, 2.5])
@pytest.mark.parametrize("sun", SUNS.values(), ids=SUNS)
def test_camera_holds_its_points_and_all_that_may_shade_them(sun, margin):
    points = np.random.default_rng(1).uniform((-8, 2, -3), (5, 9, 1), (200, 3))
    camera = light.light_camera(-towards(sun), points, BOUNDS, 256, margin)
    border = light.BORDER * (1.0 - 1e-6) + margin / camera.texel
    texel = in_texels(camera, points)
    assert np.all(texel.min(axis=0) >= border) and np.all(texel.max(axis=0) <= 256 - border)
    drawn = np.random.default_rng(2).uniform(*BOUNDS, (2000, 3))
    clip = cameras.to_clip(camera.projection @ camera.view, drawn)
    assert np.all(np.abs(clip[:, 2]) < 1.0), "clipped by the near or the far plane"
    np.testing.assert_allclose(clip[:, 3], 1.0)
    np.testing.assert_allclose(camera.view[:3, 3], 0.0, err_msg="distances are not those along the light")


@pytest.mark.parametrize("sun", SUNS.values(), ids=SUNS)
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_bounds_without_thickness(sun, axis):
    """A scene that is flat, or a single point: cameras stay invertible, and see it."""
    flat = (BOUNDS[0].copy(), BOUNDS[1].copy())
    flat[1][axis] = flat[0][axis]
    for low, high in (flat, (BOUNDS[0], BOUNDS[0])):
        corners = light.box_corners(low, high)
        camera = light.light_camera(-towards(sun), corners, (low, high), 64)
        assert np.isfinite(np.linalg.inv(camera.projection)).all()
        clip = cameras.to_clip(camera.projection @ camera.view, corners)
        assert np.all(np.abs(clip[:, :3]) < 1.0)


def test_camera_is_limited_to_what_is_of_use():
    inside = (np.array([-2.0, -2.0, -1.0]), np.array([2.0, 2.0, 0.0]))
    direction = np.array([0.0, 0.0, -1.0])
    line, far_line = (np.array([[-500.0, y, -1.0], [500.0, y, -1.0]]) for y in (1.0, 90.0))
    camera = light.light_camera(direction, line, BOUNDS, 256, 3.0, within=inside)
    assert camera.texel[0] * 256 < 8.0
    assert light.light_camera(direction, far_line, BOUNDS, 256, within=inside) is None


# A camera that stands still.


def followed(offset, sun=SUNS["oblique"], projection=None):
    """The light camera of a view from a place that is moved by `offset`."""
    view = view_of(np.array([0.0, -20.0, 6.0]) + offset, pitch=-0.3)
    to_clip = (perspective(far=200.0) if projection is None else projection) @ view
    seen = light.visible_part_of_box(*BOUNDS, to_clip)
    return light.light_camera(-towards(sun), seen, BOUNDS, 512)


@pytest.mark.parametrize("sun", SUNS.values(), ids=SUNS)
def test_points_keep_their_place_within_a_texel_while_the_view_moves(sun):
    """To 1e-6 texels between all windows of a size: edges of shadows do not crawl."""
    points = np.random.default_rng(3).uniform(*BOUNDS, (100, 3))
    places = {}
    for step in np.linspace(0.0, 30.0, 150):
        camera = followed((0.3 * step, step, 0.02 * step), sun)
        phase = in_texels(camera, points)
        for axis in (0, 1):
            places.setdefault((axis, camera.texel[axis]), []).append(phase[:, axis])
    shared = {key: found for key, found in places.items() if len(found) > 1}
    assert shared
    for found in shared.values():
        moved = np.array(found) - found[0]
        np.testing.assert_allclose(moved, np.round(moved), atol=1e-6)


def test_a_view_that_moves_a_little_asks_for_no_new_picture():
    """In 200 steps of 2.5 mm the camera changes twice at most; in 200 of 5 cm, now and then."""
    for step, most in ((2.5e-3, 2), (0.05, 40)):
        keys = [followed((0.5 * step * i, step * i, 0.0)).key for i in range(200)]
        changes = sum(a != b for a, b in pairwise(keys))
        assert changes <= most, (step, changes)
    assert followed((0, 0, 0)).key != followed((0, 8, 0)).key


@pytest.mark.parametrize("sun", SUNS.values(), ids=SUNS)
def test_steady_camera_keeps_its_size_while_the_points_are_turned(sun):
    points = np.random.default_rng(6).normal(size=(30, 3)) * [3.0, 0.5, 1.0]
    found = [
        light.light_camera(
            -towards(sun), points @ view_of((0, 0, 0), yaw, 0.2)[:3, :3], BOUNDS, 256, steady=True
        )
        for yaw in np.linspace(0.0, 2.0 * np.pi, 60)
    ]
    assert len({tuple(camera.texel) for camera in found}) == 1
    assert found[0].texel[0] == found[0].texel[1]
    loose = light.light_camera(-towards(sun), points, BOUNDS, 256)
    assert np.all(loose.texel <= found[0].texel)
    texel = in_texels(found[0], points @ view_of((0, 0, 0), 0.0, 0.2)[:3, :3])
    assert texel.min() >= light.BORDER * (1 - 1e-6) and texel.max() <= 256 - light.BORDER * (1 - 1e-6)


def test_key_tells_cameras_apart():
    camera = followed((0, 0, 0))
    again = followed((0, 0, 0))
    assert camera.key == again.key
    assert camera.key != followed((0, 0, 0), SUNS["grazing"]).key
    assert camera.key != replace(camera, resolution=256).key


# What a view sees of a box.


def seen_samples(low, high, to_clip, count=17):
    """Points (n, 3) of a lattice in the box that lie in the view volume."""
    lines = [np.linspace(a, b, count) for a, b in zip(low, high, strict=True)]
    lattice = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, 3)
    clip = cameras.to_clip(to_clip, lattice)
    return lattice[np.all(np.abs(clip[:, :3]) <= clip[:, 3:], axis=1)]


def assert_corners_of_what_is_seen(low, high, to_clip):
    """All of them in box and view, and nothing that is seen lies beyond them in any direction."""
    corners = light.visible_part_of_box(low, high, to_clip)
    scale = 1.0 + max(np.abs(low).max(), np.abs(high).max())
    samples = seen_samples(low, high, to_clip)
    if len(corners) == 0:
        assert len(samples) == 0
        return corners
    assert np.all(corners >= low - 1e-5 * scale) and np.all(corners <= high + 1e-5 * scale)
    clip = cameras.to_clip(to_clip, corners)
    reach = np.abs(clip).max(axis=1, keepdims=True) + scale
    assert np.all(np.abs(clip[:, :3]) <= clip[:, 3:] + 1e-5 * reach)
    if len(samples):
        directions = np.random.default_rng(4).normal(size=(50, 3))
        assert np.all(
            (samples @ directions.T).max(axis=0) <= (corners @ directions.T).max(axis=0) + 1e-5 * scale
        )
    return corners


place = st.floats(-15.0, 15.0)
turn = st.floats(-np.pi, np.pi)
thickness = st.sampled_from([0.0, 1e-3, 0.5, 4.0, 20.0])


@pytest.mark.parametrize("projection", PROJECTIONS.values(), ids=PROJECTIONS)
@given(
    eye=st.tuples(place, place, place),
    angles=st.tuples(turn, st.floats(-np.pi / 2, np.pi / 2), turn),
    low=st.tuples(place, place, place),
    extent=st.tuples(thickness, thickness, thickness),
)
def test_visible_part_of_a_box(projection, eye, angles, low, extent):
    low = np.array(low)
    assert_corners_of_what_is_seen(low, low + extent, projection @ view_of(eye, *angles))


@pytest.mark.parametrize(
    "projection", [perspective(far=200.0), orthographic()], ids=["perspective", "parallel"]
)
def test_box_that_is_seen_whole_has_its_own_corners(projection):
    low, high = np.array([-1.0, 10.0, -1.0]), np.array([1.0, 12.0, 1.0])
    corners = light.visible_part_of_box(low, high, projection @ view_of((0, 0, 0)))
    assert {tuple(c) for c in np.round(corners, 6)} == {tuple(c) for c in light.box_corners(low, high)}


def test_view_within_a_box_has_the_view_volume_s_corners():
    projection = perspective(near=0.5, far=20.0)
    view = view_of((1, 2, 3), yaw=0.4, pitch=-0.2)
    corners = light.visible_part_of_box(np.full(3, -100.0), np.full(3, 100.0), projection @ view)
    ends = cameras.to_ndc(projection, corners @ view[:3, :3].T + view[:3, 3])
    np.testing.assert_allclose(np.abs(ends), 1.0, atol=1e-6)
    assert len(np.unique(np.round(ends), axis=0)) == 8


@pytest.mark.parametrize(
    ("low", "high"),
    [((-1, -30, -1), (1, -20, 1)), ((200, 10, 0), (210, 20, 1)), ((-1, 5000, -1), (1, 6000, 1))],
    ids=["behind", "beside", "beyond"],
)
@pytest.mark.parametrize(
    "projection", [perspective(far=200.0), orthographic()], ids=["perspective", "parallel"]
)
def test_box_out_of_the_view_has_no_corners(projection, low, high):
    assert (
        len(
            light.visible_part_of_box(
                np.array(low, float), np.array(high, float), projection @ view_of((0, 0, 0))
            )
        )
        == 0
    )


@pytest.mark.parametrize(
    "projection", [perspective(far=200.0), orthographic()], ids=["perspective", "parallel"]
)
def test_flat_box(projection):
    """A level scene has no height: the part of a rectangle that is seen."""
    low, high = np.array([-50.0, -50.0, -2.0]), np.array([50.0, 50.0, -2.0])
    to_clip = projection @ view_of((0, -10, 3), pitch=-0.5)
    corners = assert_corners_of_what_is_seen(low, high, to_clip)
    polygon = cameras.clip_polygon(light.box_corners(low, high)[[0, 4, 6, 2]], to_clip)
    assert len(polygon) > 3
    for found in polygon:
        assert np.linalg.norm(corners - found, axis=1).min() < 1e-4


# Light and sight below the surface.


@pytest.mark.parametrize("elevation", [90.0, 60.0, 30.0, 1.0, 0.06])
@pytest.mark.parametrize("azimuth", [0.0, 90.0, 200.0])
def test_sunlight_in_water_obeys_snell(elevation, azimuth):
    up, around = np.radians(elevation), np.radians(azimuth)
    sun = np.array([np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)])
    direction = light.sunlight_in_water(sun, N12)
    assert np.linalg.norm(direction) == pytest.approx(1.0)
    np.testing.assert_allclose(direction[:2], -N12 * sun[:2], atol=1e-12)
    assert direction[2] < -np.sqrt(1.0 - N12**2) + 1e-9


def test_sight_below_the_surface_is_refracted():
    polygon = np.array([[3.0, 4.0, 0.0], [-2.0, 1.0, 0.0], [0.0, 0.0, 0.0]])
    eye = np.array([0.0, 0.0, 2.0])
    seen = light.seen_through(polygon, view_of(eye), perspective(), N12)
    incident = (polygon - eye) / np.linalg.norm(polygon - eye, axis=1, keepdims=True)
    np.testing.assert_allclose(seen[:, :2], N12 * incident[:, :2], atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(seen, axis=1), 1.0)
    assert np.all(seen[:, 2] < 0.0)


def test_sight_of_a_parallel_view_is_the_same_everywhere():
    view = view_of((0, 0, 9), yaw=0.3, pitch=-0.7)
    seen = light.seen_through(np.zeros((4, 3)), view, orthographic(), N12)
    along, _ = optics.refract_direction(-view[2, :3], cameras.UP, N12)
    np.testing.assert_allclose(seen, np.broadcast_to(along, (4, 3)))


# Shadows in several windows.


def two_windows(edge=0.3):
    """A small window in a large one, both with something over all that lies beyond x = `edge` m."""
    down = np.array([0.0, 0.0, -1.0])
    windows, depths = [], []
    for half in (2.0, 12.0):
        corners = light.box_corners(np.array([-half, -half, -1.0]), np.array([half, half, 0.0]))
        camera = light.light_camera(down, corners, (corners[0], corners[-1]), 128)
        texel = np.arange(128) + 0.5
        x, y = np.meshgrid(texel, texel)
        middle = np.stack([x, y, np.full_like(x, 64.0)], axis=-1) / 64.0 - 1.0
        to_render = np.linalg.inv(camera.projection @ camera.view)
        at = middle @ to_render[:3, :3].T + to_render[:3, 3]
        windows.append(camera)
        depths.append(np.where(at[..., 0] > edge, -5.0, 0.0))
    return windows, depths


def test_windows_give_way_to_each_other_without_a_step():
    """Along a line within the soft edge, from the small window into the large one and out of all."""
    windows, depths = two_windows()
    texel = [camera.texel.max() for camera in windows]
    points = np.stack([np.full(8001, 0.3), np.linspace(-40.0, 40.0, 8001), np.zeros(8001)], axis=1)
    up = np.broadcast_to([0.0, 0.0, 1.0], points.shape)
    lit = shadows.visibility(points, up, windows, depths)
    inner = np.abs(points[:, 1]) < 10.0
    assert np.abs(np.diff(lit[inner])).max() < 0.05
    alone = [shadows.visibility(points, up, [w], [d]) for w, d in zip(windows, depths, strict=True)]
    near = np.abs(points[:, 1]) < 1.5
    np.testing.assert_array_equal(lit[near], alone[0][near])
    beyond = (np.abs(points[:, 1]) > 4.0) & inner
    np.testing.assert_array_equal(lit[beyond], alone[1][beyond])
    assert abs(alone[0][4000] - alone[1][4000]) > 0.05, f"no step to hide: texels of {texel}"
    np.testing.assert_array_equal(lit[np.abs(points[:, 1]) > 35.0], 1.0)


def test_either_side_of_a_leaf_is_lit_by_what_reaches_the_leaf():
    windows, depths = two_windows()
    depths = [np.full_like(depth, 0.5) for depth in depths]  # a level leaf, 0.5 m below the origin
    leaf = np.array([[-1.0, 0.5, -0.5], [1.0, 0.5, -0.5], [0.2, -0.3, -0.5]])
    for side in (1.0, -1.0):
        normal = np.broadcast_to([0.0, 0.0, side], leaf.shape)
        np.testing.assert_allclose(shadows.visibility(leaf, normal, windows, depths), 1.0)
        np.testing.assert_array_equal(shadows.visibility(leaf - [0, 0, 0.1], normal, windows, depths), 0.0)


@given(
    angle=st.floats(0.0, 89.0),
    azimuth=st.floats(0.0, 2.0 * np.pi),
    phase=st.tuples(st.floats(0.0, 1.0), st.floats(0.0, 1.0)),
)
def test_no_slope_shades_itself(angle, azimuth, phase):
    """Not even by a thousandth, wherever its points lie within the texels."""
    down = np.array([0.0, 0.0, -1.0])
    corners = light.box_corners(np.full(3, -4.0), np.full(3, 4.0))
    camera = light.light_camera(down, corners, (corners[0], corners[-1]), 64)
    slope = np.tan(np.radians(angle)) * np.array([np.cos(azimuth), np.sin(azimuth)])
    texel = np.arange(64) + 0.5
    x, y = np.meshgrid(texel, texel)
    middle = np.stack([x, y, np.zeros_like(x)], axis=-1) / 32.0 - 1.0
    to_render = np.linalg.inv(camera.projection @ camera.view)
    at = middle @ to_render[:3, :3].T + to_render[:3, 3]
    depth = -(at[..., :2] @ slope)  # of the plane z = slope . xy, which is -z
    xy = np.random.default_rng(5).uniform(-2.0, 2.0, (50, 2)) + np.array(phase) * camera.texel
    points = np.column_stack([xy, xy @ slope])
    normal = np.array([*-slope, 1.0]) / np.linalg.norm([*-slope, 1.0])
    lit = shadows.visibility(points, np.broadcast_to(normal, points.shape), [camera], [depth])
    assert lit.min() > 0.999, lit.min()
