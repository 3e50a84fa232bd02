# SPDX-License-Identifier: GPL-3.0-or-later
"""The cameras of the passes against closed forms and geometric identities."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from lake_water_addon.core import cameras, optics

N12 = 1.0 / 1.333


def perspective(half_width=0.5, half_height=0.4, near=0.1, far=1000.0, shift=(0.0, 0.0)):
    """Half extents are those of the picture at distance 1; shift in half pictures."""
    a, b = -(far + near) / (far - near), -2.0 * far * near / (far - near)
    return np.array(
        [
            [1.0 / half_width, 0.0, shift[0], 0.0],
            [0.0, 1.0 / half_height, shift[1], 0.0],
            [0.0, 0.0, a, b],
            [0.0, 0.0, -1.0, 0.0],
        ]
    )


def orthographic(half_width=4.0, half_height=3.0, near=0.1, far=100.0, shift=(0.0, 0.0)):
    a, b = -2.0 / (far - near), -(far + near) / (far - near)
    return np.array(
        [
            [1.0 / half_width, 0.0, 0.0, -shift[0]],
            [0.0, 1.0 / half_height, 0.0, -shift[1]],
            [0.0, 0.0, a, b],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


def view_of(position, yaw=0.0, pitch=0.0, roll=0.0):
    """World to camera; pitch 0 looks level, -pi/2 straight down; roll about the viewing axis."""

    def turn(axis, angle):
        c, s = np.cos(angle), np.sin(angle)
        i, j = [(1, 2), (2, 0), (0, 1)][axis]
        m = np.eye(3)
        m[i, i], m[i, j], m[j, i], m[j, j] = c, -s, s, c
        return m

    to_world = np.eye(4)
    to_world[:3, :3] = turn(2, yaw) @ turn(0, np.pi / 2 + pitch) @ turn(2, roll)
    to_world[:3, 3] = position
    return np.linalg.inv(to_world)


PROJECTIONS = {
    "perspective": perspective(),
    "shifted lens": perspective(shift=(0.3, -0.7)),
    "anamorphic": perspective(half_width=0.2, half_height=1.1, near=0.001, far=5e4),
    "orthographic": orthographic(),
    "shifted orthographic": orthographic(shift=(0.4, 0.2), near=-50.0),
}
every_projection = pytest.mark.parametrize("projection", PROJECTIONS.values(), ids=PROJECTIONS)
points_in_view = np.random.default_rng(4).uniform([-3, -3, -60], [3, 3, -0.2], (300, 3))

cameras_above = st.builds(
    view_of,
    st.tuples(st.floats(-50, 50), st.floats(-50, 50), st.floats(0.01, 50)),
    st.floats(-4, 4),
    st.floats(-np.pi / 2, 0.0),
    st.floats(-np.pi, np.pi),
)


@every_projection
def test_clip_range_is_what_the_projection_was_made_with(projection):
    near, far = cameras.clip_range(projection)
    z = cameras.to_ndc(projection, np.array([[0.0, 0.0, -near], [0.0, 0.0, -far]]))[:, 2]
    np.testing.assert_allclose(z, [-1.0, 1.0], atol=1e-9)


def test_clip_range_returns_the_lens_settings():
    assert cameras.clip_range(perspective(near=0.25, far=77.0)) == pytest.approx((0.25, 77.0))
    assert cameras.clip_range(orthographic(near=-50.0, far=77.0)) == pytest.approx((-50.0, 77.0))


def test_kinds_of_cameras_are_told_apart():
    assert [cameras.is_orthographic(p) for p in PROJECTIONS.values()] == [False, False, False, True, True]


@every_projection
def test_texture_coordinates_run_over_the_picture(projection):
    """The corners of the view volume have the corners of the texture."""
    inverse = np.linalg.inv(projection)
    for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1), (0, 0)):
        point = inverse @ [x, y, 0.3, 1.0]
        np.testing.assert_allclose(
            cameras.to_texture(projection, point[:3] / point[3]), [(x + 1) / 2, (y + 1) / 2], atol=1e-9
        )


@every_projection
def test_rays_pass_through_what_they_are_asked_for(projection):
    for ndc in np.random.default_rng(3).uniform(-1, 1, (20, 2)):
        origin, direction = cameras.ray_through(projection, ndc)
        assert np.linalg.norm(direction) == pytest.approx(1.0)
        assert direction[2] < 0.0
        for distance in (0.5, 3.0, 60.0):
            seen = cameras.to_ndc(projection, origin + distance * direction)
            np.testing.assert_allclose(seen[:2], ndc, atol=1e-6)


@every_projection
def test_widening_divides_device_coordinates(projection):
    for fov_ext in (1.0, 1.5, 3.0):
        wide = cameras.to_ndc(cameras.widen(projection, fov_ext), points_in_view)
        narrow = cameras.to_ndc(projection, points_in_view)
        np.testing.assert_allclose(wide, narrow / [fov_ext, fov_ext, 1.0], rtol=1e-12)
    np.testing.assert_array_equal(cameras.widen(projection, 1.0), projection)


@every_projection
def test_cropping_shows_the_part(projection):
    """A point at (u, v) of the whole picture is at the same place of the part, measured from its corner."""
    left, bottom, right, top = 0.1, 0.25, 0.4, 0.95
    whole = cameras.to_texture(projection, points_in_view)
    part = cameras.to_texture(cameras.crop(projection, left, bottom, right, top), points_in_view)
    np.testing.assert_allclose(part, (whole - [left, bottom]) / [right - left, top - bottom], atol=1e-9)
    np.testing.assert_allclose(cameras.crop(projection, 0, 0, 1, 1), projection, atol=1e-15)


@every_projection
def test_cropping_in_two_steps_is_cropping_once(projection):
    once = cameras.crop(projection, 0.25, 0.5, 0.5, 0.75)
    twice = cameras.crop(cameras.crop(projection, 0.0, 0.5, 0.5, 1.0), 0.5, 0.0, 1.0, 0.5)
    np.testing.assert_allclose(twice, once, atol=1e-12)


@given(view=cameras_above, level=st.floats(-1000, 1000))
def test_mirror_of_a_mirror_is_the_identity(view, level):
    mirror = cameras.mirror_matrix(level)
    np.testing.assert_allclose(mirror @ mirror, np.eye(4), atol=1e-12)
    twice = cameras.mirrored_view(cameras.mirrored_view(view, level), level)
    np.testing.assert_allclose(twice, view, atol=1e-9)


@given(view=cameras_above, level=st.floats(-100, 100))
def test_mirrored_camera_stands_below_and_sees_mirrored_points(view, level):
    mirrored = cameras.mirrored_view(view, level)
    eye, below = cameras.eye_position(view), cameras.eye_position(mirrored)
    np.testing.assert_allclose(below, [eye[0], eye[1], 2 * level - eye[2]], atol=1e-9)
    assert np.linalg.det(mirrored[:3, :3]) == pytest.approx(-1.0)
    point = np.array([3.0, -7.0, level + 2.5, 1.0])
    image = np.array([3.0, -7.0, level - 2.5, 1.0])
    np.testing.assert_allclose(mirrored @ point, view @ image, atol=1e-9)
    on_plane = np.array([5.0, 1.0, level, 1.0])
    np.testing.assert_allclose(mirrored @ on_plane, view @ on_plane, atol=1e-9)


@given(angle=st.floats(-7, 7))
def test_rotation_keeps_its_axis_and_turns_by_the_angle(angle):
    point, axis = np.array([1.0, -2.0, 5.0]), np.array([0.6, 0.0, 0.8])
    m = cameras.rotation_about(point, axis, angle)
    for s in (-3.0, 0.0, 2.0):
        on_axis = np.append(point + s * axis, 1.0)
        np.testing.assert_allclose(m @ on_axis, on_axis, atol=1e-12)
    np.testing.assert_allclose(m[:3, :3] @ m[:3, :3].T, np.eye(3), atol=1e-12)
    across = np.array([0.0, 1.0, 0.0])
    turned = m[:3, :3] @ across
    assert turned @ across == pytest.approx(np.cos(angle), abs=1e-12)
    assert np.cross(across, turned) @ axis == pytest.approx(np.sin(angle), abs=1e-12)


def where_it_meets(origin, direction, level):
    return origin + direction * (level - origin[2]) / direction[2]


@every_projection
@given(view=cameras_above, level=st.floats(-1000, 1000))
def test_refracted_ray_of_the_lowest_edge_goes_through_the_same_point(projection, view, level):
    """The refraction picture shows O where the main one does, and looks along the refracted ray there.

    That place is the middle of the lowest edge, or of an orthographic picture itself.
    """
    lift = np.eye(4)
    lift[2, 3] = -level
    view = view @ lift  # the camera's height is above the plane, wherever that is
    eyeless = cameras.is_orthographic(projection)
    edges = ((0.0, 0.0),) if eyeless else ((0.0, -1.0), (-1.0, 0.0), (1.0, 0.0), (0.0, 1.0))
    edge = min(
        (np.array(ndc) for ndc in edges),
        key=lambda ndc: round((view[:3, :3].T @ cameras.ray_through(projection, ndc)[1])[2], 9),
    )
    origin, direction = cameras.ray_through(projection, edge)
    to_world = np.linalg.inv(view)
    origin, incident = (to_world @ np.append(origin, 1.0))[:3], to_world[:3, :3] @ direction
    turned = cameras.refraction_view(view, projection, level, N12)
    if incident[2] >= -1e-6 or (origin[2] <= level and not eyeless):
        np.testing.assert_array_equal(turned, view)
        return
    assume(incident[2] < -1e-3)  # nearer to the horizon O is kilometres away, and its digits are lost
    hit = where_it_meets(origin, incident, level)
    refracted, _ = optics.refract_direction(incident, np.array([0.0, 0.0, 1.0]), N12)
    scale = 1.0 + np.linalg.norm(hit - origin)

    seen = turned[:3, :3] @ hit + turned[:3, 3]
    before = view[:3, :3] @ hit + view[:3, 3]
    np.testing.assert_allclose(seen, before, atol=1e-9 * scale)  # O stays where it was in the picture
    np.testing.assert_allclose(turned[:3, :3].T @ direction, refracted, atol=1e-7)
    np.testing.assert_allclose(turned[:3, :3] @ turned[:3, :3].T, np.eye(3), atol=1e-9)  # rigid
    assert np.linalg.det(turned[:3, :3]) == pytest.approx(1.0)
    if not eyeless:
        assert cameras.eye_position(turned)[2] > level
        # In the air the path is as long as before: the camera was turned, not moved along its ray.
        assert np.linalg.norm(cameras.eye_position(turned) - hit) == pytest.approx(
            np.linalg.norm(cameras.eye_position(view) - hit), rel=1e-6
        )


def test_refraction_camera_of_a_known_case():
    """45 degrees down at the lowest edge: refracted to 32.04 degrees, so a turn by 12.96 degrees."""
    projection = perspective(half_width=0.3, half_height=np.tan(np.radians(15.0)))
    view = view_of((0.0, 0.0, 10.0), pitch=-np.radians(30.0))
    turned = cameras.refraction_view(view, projection, 0.0, N12)
    angle_in, angle_out = np.radians(45.0), np.arcsin(np.sin(np.radians(45.0)) / 1.333)
    # O = (0, 10, 0); the camera goes up on its circle about O.
    radius = 10.0 * np.sqrt(2.0)
    expected = [0.0, 10.0 - radius * np.sin(angle_out), radius * np.cos(angle_out)]
    np.testing.assert_allclose(cameras.eye_position(turned), expected, atol=1e-12)
    forward = -turned[2, :3]
    pitch = -np.radians(30.0) - (angle_in - angle_out)
    np.testing.assert_allclose(forward, [0.0, np.cos(pitch), np.sin(pitch)], atol=1e-12)


def test_camera_that_looks_up_or_stands_in_the_water_is_left_alone():
    up = view_of((1.0, 2.0, 3.0), pitch=1.0)
    np.testing.assert_array_equal(cameras.refraction_view(up, perspective(), 0.0, N12), up)
    under = view_of((1.0, 2.0, -3.0), pitch=-0.5)
    np.testing.assert_array_equal(cameras.refraction_view(under, perspective(), 0.0, N12), under)


def test_equal_indices_leave_the_camera_alone():
    view = view_of((1.0, 2.0, 3.0), pitch=-0.5)
    np.testing.assert_allclose(cameras.refraction_view(view, perspective(), 0.0, 1.0), view, atol=1e-9)


def test_orthographic_camera_straight_down_is_left_alone():
    view = view_of((1.0, 2.0, 30.0), pitch=-np.pi / 2)
    np.testing.assert_allclose(cameras.refraction_view(view, orthographic(), 0.0, N12), view, atol=1e-9)


def test_upside_down_camera_uses_the_edge_that_is_lowest_in_the_world():
    """Rolled by half a turn the picture's top edge is the low one: the camera turns to the same place."""
    position, projection = (0.0, 0.0, 10.0), perspective()
    upright = cameras.refraction_view(view_of(position, pitch=-0.6), projection, 0.0, N12)
    rolled = cameras.refraction_view(view_of(position, pitch=-0.6, roll=np.pi), projection, 0.0, N12)
    np.testing.assert_allclose(cameras.eye_position(rolled), cameras.eye_position(upright), atol=1e-9)
    np.testing.assert_allclose(rolled[2], upright[2], atol=1e-9)


@pytest.mark.parametrize("roll", [0.3, np.pi / 2, np.pi])
def test_rolling_an_orthographic_camera_turns_its_refraction_camera_about_the_same_point(roll):
    position, projection = (0.0, 0.0, 10.0), orthographic()
    upright = cameras.refraction_view(view_of(position, pitch=-0.6), projection, 0.0, N12)
    rolled = cameras.refraction_view(view_of(position, pitch=-0.6, roll=roll), projection, 0.0, N12)
    np.testing.assert_allclose(cameras.eye_position(rolled), cameras.eye_position(upright), atol=1e-9)


def test_orthographic_refraction_picture_stays_centred():
    """What the picture's four corners see of the water is spread evenly about the middle of the texture."""
    view, projection = view_of((0.0, 0.0, 10.0), pitch=-0.6), orthographic()
    turned = cameras.refraction_view(view, projection, 0.0, N12)
    corners = []
    for ndc in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
        origin, direction = cameras.ray_through(projection, np.array(ndc))
        to_world = np.linalg.inv(view)
        hit = where_it_meets(to_world[:3, :3] @ origin + to_world[:3, 3], to_world[:3, :3] @ direction, 0.0)
        corners.append(cameras.to_ndc(projection, turned[:3, :3] @ hit + turned[:3, 3])[:2])
    np.testing.assert_allclose(np.mean(corners, axis=0), 0.0, atol=1e-9)


def test_orthographic_camera_refracts_its_direction_also_when_its_low_edge_starts_in_the_water():
    view = view_of((0.0, 0.0, 1.0), pitch=-0.6)
    turned = cameras.refraction_view(view, orthographic(half_height=5.0), 0.0, N12)
    refracted, _ = optics.refract_direction(-view[2, :3], np.array([0.0, 0.0, 1.0]), N12)
    np.testing.assert_allclose(-turned[2, :3], refracted, atol=1e-12)
