# SPDX-License-Identifier: GPL-3.0-or-later
"""On which side of the surface a picture begins, and how far away is what a depth texture holds."""

from dataclasses import replace

import numpy as np
import pytest

from lake_water_addon.core import cameras, under_water, waves
from lake_water_addon.core.snapshot import Mesh, MeshPart, WaterBody, WaterSettings
from lake_water_addon.core.under_water import Side
from lake_water_addon.core.waves import SineWave

SHORT_WAVES = (SineWave(0.08, 4.0, 0.2), SineWave(0.05, 1.1, -0.9, 1.0), SineWave(0.02, 0.7, 2.0, 2.0))
RNG = np.random.default_rng


def perspective(near=0.1, far=1000.0, fov=0.9, shift=(0.0, 0.0)):
    x = 1.0 / np.tan(fov / 2)
    matrix = np.zeros((4, 4))
    matrix[0, 0], matrix[1, 1], matrix[3, 2] = x, 1.5 * x, -1.0
    matrix[:2, 2] = shift
    matrix[2, 2], matrix[2, 3] = -(far + near) / (far - near), -2 * far * near / (far - near)
    return matrix


def orthographic(near=0.1, far=1000.0, width=10.0):
    matrix = np.diag([2.0 / width, 3.0 / width, -2.0 / (far - near), 1.0])
    matrix[2, 3] = -(far + near) / (far - near)
    return matrix


def look_at(position, target, roll=0.0):
    back = np.subtract(position, target).astype(float)
    back /= np.linalg.norm(back)
    right = np.cross([0.0, 0.0, 1.0], back) if abs(back[2]) < 0.999 else np.array([1.0, 0.0, 0.0])
    right /= np.linalg.norm(right)
    up = np.cross(back, right)
    c, s = np.cos(roll), np.sin(roll)
    to_world = np.eye(4)
    to_world[:3, :3] = np.column_stack([c * right + s * up, c * up - s * right, back])
    to_world[:3, 3] = position
    return np.linalg.inv(to_world)


def grid_body(resolution=49, heading=0.4, location=(0.0, 0.0, 0.0), of_waves=SHORT_WAVES):
    matrix = np.eye(4)
    c, s = np.cos(heading), np.sin(heading)
    matrix[:2, :2] = [[c, -s], [s, c]]
    matrix[:3, 3] = location
    settings = WaterSettings(waves=of_waves)
    return WaterBody("water", "Water", matrix, settings, (resolution, 10.0, 8.0, 1.0, -2.0))


def packed_of(body, time=0.7):
    return waves.pack(body.settings.waves, time, 5.0, body.heading)


def side_of(body, view, projection, mesh=None, packed=None):
    plane = under_water.near_plane(view, projection)
    packed = packed_of(body) if packed is None else packed
    return under_water.view_side(plane, body, mesh, body.matrix[:3, 3], packed)


PROJECTIONS = {
    "perspective": perspective(),
    "shifted": perspective(shift=(0.4, -0.7)),
    "cropped": cameras.crop(perspective(), 0.1, 0.2, 0.4, 0.9),
    "long clip range": perspective(1e-3, 1e6),
    "orthographic": orthographic(),
    "orthographic from behind": orthographic(-50.0, 80.0),
}
every_projection = pytest.mark.parametrize("projection", PROJECTIONS.values(), ids=PROJECTIONS)
VIEWS = (
    look_at((3, -5, -2), (1, 2, -0.5), 0.3),
    cameras.mirrored_view(look_at((3, -5, -2), (1, 2, -0.5)), 0.2),
)


def window_coordinates(view, projection, points):
    """(ndc (n, 2), depth (n,) in 0..1) of points in front of the near plane."""
    clip = cameras.to_clip(projection @ view, points)
    ndc = clip[:, :3] / clip[:, 3:]
    return ndc[:, :2], 0.5 * ndc[:, 2] + 0.5


@pytest.mark.parametrize("view", VIEWS, ids=["camera", "mirrored"])
@every_projection
def test_near_plane_is_where_window_depth_is_zero(view, projection):
    plane = under_water.near_plane(view, projection)
    ndc = RNG(1).uniform(-1, 1, (200, 2))
    seen, depth = window_coordinates(view, projection, plane.point(ndc))
    np.testing.assert_allclose(seen, ndc, atol=1e-9)
    np.testing.assert_allclose(depth, 0.0, atol=1e-9)


@pytest.mark.parametrize("view", VIEWS, ids=["camera", "mirrored"])
@every_projection
def test_distance_from_depth_is_the_distance_to_the_point(view, projection):
    """Also with a shifted lens, in a border render, and in the mirrored camera."""
    near, far = cameras.clip_range(projection)
    z = -np.geomspace(max(near, 1e-4), far, 300) * 0.999 - 1e-6
    inverse = np.linalg.inv(projection)
    ndc = RNG(2).uniform(-1, 1, (300, 2))
    ends = [np.column_stack([ndc, np.full(300, e), np.ones(300)]) @ inverse.T for e in (-1.0, 1.0)]
    first, last = (e[:, :3] / e[:, 3:] for e in ends)
    in_camera = first + ((z - first[:, 2]) / (last[:, 2] - first[:, 2]))[:, None] * (last - first)
    points = (in_camera - view[:3, 3]) @ view[:3, :3]
    seen, depth = window_coordinates(view, projection, points)
    plane = under_water.near_plane(view, projection)
    expected = np.linalg.norm(in_camera, axis=1)
    if plane.orthographic:
        expected = -in_camera[:, 2]
    resolved = (1.0 - depth) > 1e-12  # float64 holds the window depth no better
    np.testing.assert_allclose(plane.distance(seen, depth)[resolved], expected[resolved], rtol=1e-3)
    assert resolved.sum() > 150


def test_fog_of_nothing_is_opaque_and_that_of_the_near_plane_is_clear():
    plane = under_water.near_plane(np.eye(4), perspective())
    a = under_water.fog_transmittance(plane, 0.5, np.zeros((3, 2)), np.array([0.0, 0.5, 1.0]))
    np.testing.assert_allclose(a, [np.exp(-0.05), np.exp(-0.5 * 0.1 / (0.5 + 0.5e-4)), 0.0], rtol=1e-12)


def test_what_lies_behind_an_orthographic_camera_is_not_fogged():
    plane = under_water.near_plane(np.eye(4), orthographic(-50.0, 50.0))
    distance = plane.distance(np.zeros((3, 2)), np.array([0.2, 0.5, 0.6]))
    np.testing.assert_allclose(distance, [0.0, 0.0, 10.0], atol=1e-12)


def test_meniscus_covers_the_line_and_ends():
    height = np.array([-3.0, -1.5, -0.7, 0.0, 0.7, 1.5, 3.0]) * 1e-4
    weight = under_water.meniscus_weight(height, np.full(7, 1e-4), 3.0)
    np.testing.assert_allclose(weight[[0, 1, 5, 6]], 0.0, atol=1e-12)
    np.testing.assert_allclose(weight[2:5], 1.0, atol=1e-12)


# The drawn surface.


def test_drawn_surface_of_a_grid_is_flat_between_its_vertices():
    """Equal to the waves at the vertices, linear in each triangle, cut along the diagonal as the mesh is."""
    body = grid_body(resolution=9)
    packed = packed_of(body)
    line = np.linspace(0.0, 1.0, 9)
    u, v = (a.ravel() for a in np.meshgrid(line, line))
    half, middle = np.array([10.0, 8.0]), np.array([1.0, -2.0])
    axes = body.matrix[:2, :2]
    vertices = (middle + (2 * np.column_stack([u, v]) - 1) * half) @ axes.T
    h = waves.height(packed, vertices)
    np.testing.assert_allclose(under_water.grid_height(body, packed, vertices), h, atol=1e-12)
    # WaterPainter's triangles: corner, corner + 1, corner + n + 1 and corner, corner + n + 1, corner + n.
    corner = (np.arange(8)[:, None] * 9 + np.arange(8)).ravel()
    for triangle in ((0, 1, 10), (0, 10, 9)):
        weights = RNG(3).dirichlet(np.ones(3), len(corner))
        at = sum(weights[:, i : i + 1] * vertices[corner + triangle[i]] for i in range(3))
        expected = sum(weights[:, i] * h[corner + triangle[i]] for i in range(3))
        np.testing.assert_allclose(under_water.grid_height(body, packed, at), expected, atol=1e-9)


# Sides.


def test_sides_of_plain_cases():
    body = grid_body()
    assert side_of(body, look_at((1, 0, 1), (1, 5, 0)), perspective()).side is Side.AIR
    assert side_of(body, look_at((1, 0, -1), (1, 5, 0)), perspective()).side is Side.UNDER
    split = side_of(body, look_at((1, 0, 0), (1, 5, 0)), perspective(near=0.5))
    assert split.side is Side.SPLIT and split.from_above and split.from_below
    assert "cuts through" in split.reason


def test_only_inside_of_its_rectangle_is_the_camera_in_the_water():
    body = grid_body(heading=0.0)  # x from -9 to 11, y from -10 to 6
    inside = side_of(body, look_at((10.5, 5.5, -1), (0, 0, -1)), perspective())
    beside = side_of(body, look_at((11.5, 5.5, -1), (20, 0, -1)), perspective())
    across = side_of(body, look_at((11.0, 0, -1), (11.0, 3, -1)), perspective())
    assert inside.side is Side.UNDER
    assert beside.side is Side.AIR and not beside.from_above and "beside" in beside.reason
    assert across.side is Side.SPLIT and not across.from_above and "edge" in across.reason
    high = side_of(body, look_at((11.5, 5.5, 0.1), (20, 0, 0)), perspective())
    assert high.side is Side.AIR and high.from_above


def test_heading_turns_the_rectangle():
    body = replace(grid_body(heading=np.pi / 2), grid=(9, 10.0, 1.0, 0.0, 0.0))
    assert side_of(body, look_at((0, 8, -1), (0, 0, -1)), perspective()).side is Side.UNDER
    assert side_of(body, look_at((8, 0, -1), (9, 0, -1)), perspective()).side is Side.AIR


@pytest.mark.parametrize("resolution", [2, 9, 49, 400])
@pytest.mark.parametrize("projection", [perspective(), perspective(near=2.0), orthographic(width=3.0)])
def test_air_and_under_are_certain(resolution, projection):
    """Every point of the near plane is on the side that is said, for cameras all around the drawn surface."""
    body = grid_body(resolution)
    packed = packed_of(body)
    rng = RNG(4)
    ndc = np.stack(np.meshgrid(*2 * [np.linspace(-1, 1, 60)]), axis=-1).reshape(-1, 2)
    found = dict.fromkeys(Side, 0)
    for _ in range(150):
        position = np.append(rng.uniform(-9, 9, 2), rng.normal() * 0.12)
        view = look_at(position, position + rng.normal(size=3), rng.uniform(-3, 3))
        side = side_of(body, view, projection, packed=packed)
        found[side.side] += 1
        points = under_water.near_plane(view, projection).point(ndc)
        over = points[:, 2] - under_water.grid_height(body, packed, points[:, :2])
        frame = points[:, :2] @ body.matrix[:2, :2]
        inside = np.all(np.abs(frame - (1.0, -2.0)) <= (10.0, 8.0), axis=1)
        if side.side is Side.AIR:
            assert np.all(over[inside] > 0.0)
        elif side.side is Side.UNDER:
            assert np.all(over < 0.0) and np.all(inside)
        looks_down = not projection[3, 3] or view[2, 2] > 0.0
        if not side.from_above and looks_down:
            assert not np.any(inside & (over > 0.0))
        if not side.from_below:
            assert not np.any(inside & (over < 0.0))
    assert found[Side.SPLIT] > 5 and found[Side.AIR] > 5


def test_split_is_rare_with_a_small_near_plane():
    """It costs the textures of both sides: a hand's breadth from the surface it must be over."""
    body = grid_body()
    packed = packed_of(body)
    for x in np.linspace(-4, 4, 40):
        h = float(under_water.grid_height(body, packed, np.array([[x, 0.0]]))[0])
        for offset, side in ((0.1, Side.AIR), (-0.1, Side.UNDER)):
            view = look_at((x, 0.0, h + offset), (x, 5.0, h + offset))
            assert side_of(body, view, perspective(near=0.02), packed=packed).side is side


def sheet(resolution, half=6.0, relief=lambda x, y: 0.0 * x, keep=lambda x, y: np.full(len(x), True)):
    """A mesh over a square; keep: which of its cells there are."""
    line = np.linspace(-half, half, resolution)
    x, y = np.meshgrid(line, line)
    positions = np.stack([x, y, relief(x, y)], -1).reshape(-1, 3).astype(np.float32)
    corner = (np.arange(resolution - 1)[:, None] * resolution + np.arange(resolution - 1)).ravel()
    corner = corner[keep(*(positions[corner, i] + half / resolution for i in (0, 1)))]
    n = resolution
    triangles = np.concatenate(
        [np.stack([corner, corner + 1, corner + n + 1], 1), np.stack([corner, corner + n + 1, corner + n], 1)]
    ).astype(np.int32)
    normals = np.broadcast_to(np.float32([0, 0, 1]), positions.shape)
    used = np.unique(triangles)
    index = np.zeros(len(positions), np.int32)
    index[used] = np.arange(len(used))
    return Mesh("m", 1, positions[used], normals[used], None, None, (MeshPart(0, index[triangles]),), False)


def mesh_body(**options):
    return replace(grid_body(**options), grid=None, mesh="m")


def test_sides_of_a_rectangle_modelled_as_a_mesh():
    mesh, body = sheet(9), mesh_body()
    assert side_of(body, look_at((1, 0, 1), (1, 5, 0)), perspective(), mesh).side is Side.AIR
    assert side_of(body, look_at((1, 0, -1), (1, 5, 0)), perspective(), mesh).side is Side.UNDER
    assert side_of(body, look_at((1, 0, 0.05), (1, 5, 0)), perspective(), mesh).side is Side.SPLIT
    assert side_of(body, look_at((9, 0, -1), (1, 5, 0)), perspective(), mesh).side is Side.AIR


def test_below_a_mesh_of_another_outline_the_pixels_decide():
    """In the box around a round pond the camera may be beside it, but sees nothing from above."""
    mesh, body = sheet(33, keep=lambda x, y: np.hypot(x, y) < 6.0), mesh_body(heading=0.0)
    for place in ((5.5, 5.5, -1), (0, 0, -1)):
        side = side_of(body, look_at(place, (0, 1, -1)), perspective(), mesh)
        assert side.side is Side.SPLIT and not side.from_above and side.from_below


def test_relief_and_tilt_of_a_mesh_count():
    """A swell of 1 m in the mesh itself, and a mesh that lies on a slope."""
    body = mesh_body(of_waves=())
    swell = sheet(33, relief=lambda x, y: np.sin(x))
    for z, side in ((1.3, Side.AIR), (0.8, Side.SPLIT), (-0.8, Side.SPLIT), (-1.3, Side.UNDER)):
        assert side_of(body, look_at((1, 0, z), (1, 5, z)), perspective(), swell).side is side
    tilted = np.eye(4)
    tilted[2, 0] = 0.5
    body = replace(body, matrix=tilted)
    for z, side in ((3.5, Side.AIR), (2.5, Side.SPLIT), (-3.5, Side.SPLIT)):
        assert side_of(body, look_at((1, 0, z), (1, 5, z)), perspective(), sheet(9)).side is side


def test_mesh_without_vertices_or_faces_is_no_water():
    side = side_of(mesh_body(), look_at((1, 0, -1), (1, 5, 0)), perspective(), replace(sheet(3), parts=()))
    assert side.side is not Side.UNDER
    empty = replace(
        sheet(3), positions=np.zeros((0, 3), np.float32), parts=(MeshPart(0, np.zeros((0, 3), np.int32)),)
    )
    side = side_of(mesh_body(), look_at((1, 0, -1), (1, 5, 0)), perspective(), empty)
    assert side.side is Side.AIR and not side.from_above and not side.from_below


@pytest.mark.parametrize(
    ("view", "side"),
    [
        (look_at((0, 0, 5), (0, 5, 0)), Side.AIR),
        (look_at((0, 0, -5), (0, 5, 0)), Side.UNDER),
        (look_at((0, 0, -5), (0, 5, -6)), Side.UNDER),
        (look_at((0, 0, 0.5), (0, 5, 0.5)), Side.SPLIT),
    ],
)
def test_orthographic_pictures_begin_at_their_near_plane_too(view, side):
    assert side_of(grid_body(), view, orthographic(width=4.0)).side is side


# The map of the surface's heights.


@every_projection
def test_height_map_holds_the_whole_near_plane(projection):
    for view in VIEWS:
        plane = under_water.near_plane(view, projection)
        heights = under_water.height_map(plane, -0.5, 2.5)
        points = plane.point(RNG(5).uniform(-1, 1, (500, 2)))
        texel = heights.size / under_water.HEIGHT_TEXELS
        assert np.all(points[:, :2] > heights.corner + texel)
        assert np.all(points[:, :2] < heights.corner + heights.size - texel)
        for z in (-0.5, 2.5):  # all of the surface is between the clip planes
            clip = cameras.to_clip(
                heights.projection @ heights.view, np.column_stack([points[:, :2], np.full(500, z)])
            )
            assert np.all(np.abs(clip[:, :3]) < 1.0)
        corners = heights.corner + np.array([(0, 0), (1, 1)]) * heights.size
        clip = cameras.to_clip(heights.projection @ heights.view, np.column_stack([corners, [0.0, 0.0]]))
        np.testing.assert_allclose(clip[:, :2], [(-1, -1), (1, 1)], atol=1e-6)


def test_height_map_is_bilinear_and_knows_no_water():
    plane = under_water.near_plane(look_at((0, 0, 0), (0, 5, 0)), perspective())
    heights = under_water.height_map(plane, -1.0, 1.0)
    n = under_water.HEIGHT_TEXELS
    at = heights.corner + (np.stack(np.meshgrid(*2 * [np.arange(n) + 0.5]), -1)) / n * heights.size
    slope = np.array([0.3, -0.2])
    xy = heights.corner + RNG(6).uniform(0.05, 0.95, (300, 2)) * heights.size
    np.testing.assert_allclose(heights.height(at @ slope, xy), xy @ slope, atol=1e-12)
    nothing = np.full((n, n), under_water.NO_WATER)
    np.testing.assert_allclose(heights.height(nothing, xy), under_water.NO_WATER)
