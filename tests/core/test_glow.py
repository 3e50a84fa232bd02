# SPDX-License-Identifier: GPL-3.0-or-later
"""The glow's highlight, filter and plan: it must find every highlight, and not ask for many that are none."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lake_water_addon.core import cameras, glow, optics, waves
from lake_water_addon.core.settings import FrameSettings
from lake_water_addon.core.snapshot import Sun
from lake_water_addon.core.waves import SineWave
from tests.gpu import scenes

ON = FrameSettings(use_glow=True, glow_strength=1.0, glow_exponent=200.0, glow_threshold=0.0)
WHITE = np.ones(3)


def sun_at(elevation, azimuth=0.0):
    """A sun at these degrees; azimuth from +X."""
    e, a = np.radians([elevation, azimuth])
    return Sun(np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)]), WHITE)


def surface_of(body, time=0.0):
    packed = waves.pack(body.settings.waves, time, body.settings.depth, body.heading)
    return glow.mirror_surface(body, None, body.matrix[:3, 3], packed), packed


def planned(sun, camera, body, settings=ON, **view):
    return glow.plan_glow(sun, camera, [surface_of(body)[0]], settings, **view)


# highlight, filter


def test_highlight_is_that_of_the_thesis():
    """pow(max(0, R.s), 200): 1 in the mirror direction, cos^200 beside it, nothing behind."""
    sun = sun_at(30.0).direction
    beside = np.radians([0.0, 1.0, 5.0, 12.0, 120.0])
    across = np.array([-sun[2], 0.0, sun[0]])
    reflected = np.cos(beside)[:, None] * sun + np.sin(beside)[:, None] * across
    got = glow.highlight(reflected, sun, 200.0, 0.02)
    np.testing.assert_allclose(got[:3], np.cos(beside[:3]) ** 200, rtol=1e-12)
    assert got[2] > 0.02
    np.testing.assert_array_equal(got[3:], 0.0)  # 0.012 is less than the threshold


def test_star_of_one_bright_texel():
    """13 texels, the diagonals of 7x7, a 13th each; also where the border cuts it."""
    one = np.zeros((15, 20))
    one[7, 9] = 1.0
    star = glow.star_filter(one)
    y, x = np.nonzero(star)
    assert len(y) == 13
    np.testing.assert_array_equal(np.abs(y - 7), np.abs(x - 9))
    assert np.abs(y - 7).max() == 3
    np.testing.assert_allclose(star[y, x], 1.0 / 13.0, rtol=1e-12)
    assert star.sum() == pytest.approx(1.0)
    one[:] = 0.0
    one[0, 0] = 1.0
    assert np.count_nonzero(glow.star_filter(one)) == 4


def test_filter_keeps_a_constant_picture():
    star = glow.star_filter(np.full((20, 30), 0.7))
    np.testing.assert_allclose(star[3:-3, 3:-3], 0.7, rtol=1e-12)
    assert star.max() < 0.7 + 1e-12


# slopes


def brute_force_slope(packed):
    steps = packed[:, :2] * packed[:, 2:3]
    signs = np.array(list(itertools.product((-1.0, 1.0), repeat=len(packed)))).reshape(2 ** len(packed), -1)
    return float(np.linalg.norm(signs @ steps, axis=1).max(initial=0.0))


@given(st.integers(0, 9), st.integers(0, 10**6), st.booleans())
def test_greatest_slope_of_waves(count, seed, in_line):
    """All sums of the waves' slopes with all signs; waves that run in line included."""
    packed = np.random.default_rng(seed).normal(size=(count, 4))
    if in_line:
        packed[:, 1] = 2.0 * packed[:, 0]
    assert waves.max_slope(packed) == pytest.approx(brute_force_slope(packed), rel=1e-6, abs=1e-12)


def test_slopes_of_waves_stay_below_their_greatest():
    packed = waves.pack(scenes.LAKE_WAVES, 3.0, 5.0, 0.7)
    slopes = np.linalg.norm(
        waves.slope(packed, np.random.default_rng(1).uniform(-50, 50, (200_000, 2))), axis=1
    )
    greatest = waves.max_slope(packed)
    assert 0.9 * greatest < slopes.max() <= greatest


@pytest.mark.parametrize(
    ("matrix", "slope"),
    [
        (np.eye(3), 0.5),
        (np.diag([2.0, 4.0, 3.0]), 0.75),
        (np.diag([1.0, 1.0, 0.0]), 0.0),
        (np.diag([-1.0, 1.0, 1.0]), 0.5),
        (np.diag([0.0, 1.0, 1.0]), np.inf),
        (cameras.rotation_about(np.zeros(3), np.array([1.0, 0.0, 0.0]), 0.1)[:3, :3], np.inf),
    ],
    ids=["as it is", "scaled", "flattened", "mirrored", "crushed", "tilted"],
)
def test_slope_of_a_mesh(matrix, slope):
    """A ramp of 0.5, as its object's matrix leaves it; any slope where that is not easily told."""
    ramp = scenes.grid_mesh("ramp", 5, 2.0, lambda x, y: 0.5 * x)
    body = replace(scenes.water(), grid=None, mesh="ramp", matrix=np.eye(4))
    body.matrix[:3, :3] = matrix
    surface = glow.mirror_surface(body, ramp, np.zeros(3), np.zeros((0, 4)))
    assert surface.slope == pytest.approx(slope, rel=1e-6)
    corners = ramp.positions @ matrix.T
    np.testing.assert_allclose(surface.corners.min(axis=0), corners.min(axis=0), atol=1e-9)
    np.testing.assert_allclose(surface.corners.max(axis=0), corners.max(axis=0), atol=1e-9)


def test_slope_of_upright_faces_is_not_bounded():
    wall = scenes.box_mesh("wall", (1.0, 1.0, 1.0))
    assert wall.max_slope == np.inf
    body = replace(scenes.water(), grid=None, mesh="wall", matrix=np.diag([1.0, 1.0, 0.0, 1.0]))
    assert glow.mirror_surface(body, wall, np.zeros(3), np.zeros((0, 4))).slope == 0.0


# plan


TOWARDS_SUN = scenes.look_at((-10, 0, 4), (0, 0, 0))


@pytest.mark.parametrize(
    ("sun", "settings", "reason"),
    [
        (sun_at(20.0), replace(ON, use_glow=False), "switched off"),
        (sun_at(20.0), replace(ON, glow_strength=0.0), "switched off"),
        (None, ON, "no sun"),
        (Sun(sun_at(20.0).direction, np.zeros(3)), ON, "no sun"),
        (sun_at(0.0), ON, "below the horizon"),
        (sun_at(-20.0), ON, "below the horizon"),
        (sun_at(20.0), replace(ON, glow_threshold=1.0), "threshold"),
        (sun_at(20.0), replace(ON, glow_strength=1e-4), "strength"),
    ],
)
def test_what_cannot_glow_is_not_drawn_and_says_why(sun, settings, reason):
    plan = planned(sun, TOWARDS_SUN, scenes.water(waves=scenes.LAKE_WAVES), settings)
    assert not plan.drawn and reason in plan.reason
    assert planned(sun_at(20.0), TOWARDS_SUN, scenes.water(waves=scenes.LAKE_WAVES)).drawn


def test_without_water_seen_from_the_air_nothing_glows():
    for surfaces in ([], [None, None]):
        plan = glow.plan_glow(sun_at(20.0), TOWARDS_SUN, surfaces, ON)
        assert not plan.drawn and "no water" in plan.reason


def test_only_bodies_that_can_mirror_the_sun_are_drawn():
    near, behind = scenes.water(half_size=8.0), scenes.water((-40.0, 0.0, 0.0), half_size=8.0)
    surfaces = [surface_of(behind)[0], None, surface_of(near)[0]]
    assert glow.plan_glow(sun_at(20.0), TOWARDS_SUN, surfaces, ON).bodies == (False, False, True)


@pytest.mark.parametrize(
    ("elevation", "exponent"), [(10.0, 200.0), (30.0, 200.0), (30.0, 5000.0), (60.0, 50.0)]
)
def test_flat_water_glows_just_where_geometry_puts_it(elevation, exponent):
    """A camera that turns away from the sun: drawn as long as the cone of directions reaches the picture.

    The cone is measured here against the four edges of the picture by sampling them; a tile may be too many.
    """
    settings = replace(ON, glow_exponent=exponent)
    sun = sun_at(elevation)
    mirror = sun.direction * (1, 1, -1)
    lobe = np.degrees(np.arccos(glow.LEAST_VISIBLE ** (1.0 / exponent)))
    body = scenes.water(half_size=3000.0)
    edge = np.linspace(-1, 1, 201)
    device = np.concatenate([np.stack([edge, np.full_like(edge, s)], 1) for s in (-1, 1)])
    device = np.concatenate([device, device[:, ::-1]])
    tried = set()
    for yaw in range(0, 181, 4):
        a, e = np.radians(yaw), np.radians(elevation)
        camera = scenes.look_at((0, 0, 5), (np.cos(a), np.sin(a), 5 - np.tan(e)), fov=0.7)
        rays = np.stack([device[:, i] / camera.projection[i, i] for i in (0, 1)] + [-np.ones(len(device))], 1)
        rays = rays @ camera.view[:3, :3]
        rays /= np.linalg.norm(rays, axis=1, keepdims=True)
        inside = np.abs(cameras.to_ndc(camera.projection, mirror @ camera.view[:3, :3].T))[:2].max() < 1.0
        in_front = mirror @ -camera.view[2, :3] > 0.0
        away = np.degrees(np.arccos(np.clip(rays @ mirror, -1, 1))).min()
        away = 0.0 if inside and in_front else away
        # Margin and tile: 5 of 384 texels and half the diagonal of a 16th of the picture, 4 degrees of 40.
        if away < lobe:
            assert planned(sun, camera, body, settings).drawn, yaw
        elif away > lobe + 5.0:
            assert not planned(sun, camera, body, settings).drawn, yaw
        else:
            continue
        tried.add(away < lobe)
    assert tried == {True, False}


def test_waves_mirror_the_sun_from_further_and_not_from_everywhere():
    """Waves of a breeze (slope 0.39) at 20 degrees: found in front, not at right angles to the sun."""
    body = scenes.water(half_size=200.0, waves=scenes.LAKE_WAVES)

    def drawn(yaw, **settings):
        a = np.radians(yaw)
        camera = scenes.look_at((0, 0, 5), (15 * np.cos(a), 15 * np.sin(a), 0), fov=0.7)
        return planned(sun_at(20.0), camera, body, replace(ON, **settings)).drawn

    assert drawn(0) and drawn(45)
    assert not drawn(75) and not drawn(120) and not drawn(180)
    assert drawn(60) and not drawn(60, glow_exponent=2000.0, glow_threshold=0.9)


def highlights_in_view(sun, camera, body, settings, cut, window, rng):
    """Places in the picture (n, 2), 0..1, of random points of the surface that have a highlight."""
    _, packed = surface_of(body)
    _, half_x, half_y, *_ = body.grid
    xy = rng.uniform(-1, 1, (25_000, 2)) * (half_x, half_y)
    points = np.concatenate([xy, waves.height(packed, xy)[:, None]], 1) + body.matrix[:3, 3]
    clip = cameras.to_clip(camera.projection @ camera.view, points)
    near = clip[:, 3] > 1e-3
    at = 0.5 * clip[near, :2] / clip[near, 3:] + 0.5
    points, normal = points[near], waves.normal(packed, xy[near])
    if cameras.is_orthographic(camera.projection):
        to_eye = np.broadcast_to(camera.view[2, :3], points.shape)
    else:
        to_eye = cameras.eye_position(camera.view) - points
        to_eye = to_eye / np.linalg.norm(to_eye, axis=1, keepdims=True)
    reflected = optics.reflect_direction(-to_eye, optics.face_viewer(normal, to_eye))
    found = glow.highlight(reflected, sun.direction, settings.glow_exponent, cut) > 0.0
    margin = 4.0 / glow.LONG_SIDE  # of either side, so at most that of the longer one
    inside = np.all((at > np.array(window[:2]) - margin) & (at < np.array(window[2:]) + margin), axis=1)
    return at[found & inside]


def random_case(rng):
    """A sun, and a camera above waves that looks at about where they may mirror it."""
    sun = sun_at(rng.uniform(1.0, 90.0), rng.uniform(0.0, 360.0))
    steepness = rng.choice([0.0, 0.2, 0.6, 1.5])
    lengths = rng.uniform(0.3, 4.0, 2)
    body = scenes.water(
        (1.0, 2.0, rng.uniform(-3.0, 3.0)),
        half_size=rng.uniform(5.0, 60.0),
        waves=tuple(
            SineWave(0.5 * steepness * length / (2.0 * np.pi), length, *rng.uniform(0.0, 6.0, 2))
            for length in lengths
        ),
    )
    at = body.matrix[:3, 3]
    above = rng.uniform(0.3, 20.0) + waves.max_height(body.settings.waves)
    eye = at + np.array([*rng.uniform(-20.0, 20.0, 2), above])
    mirror = sun.direction * (1, 1, -1) + rng.normal(size=3) * rng.choice([0.1, 0.5])
    ortho = rng.choice([None, None, 40.0])
    if ortho is not None:
        mirror[2] = min(mirror[2], -0.05)
    camera = scenes.look_at(eye, eye + mirror, fov=rng.uniform(0.2, 2.2), ortho=ortho)
    camera.projection[0, 2] += rng.uniform(-0.5, 0.5)
    left, bottom = rng.uniform(0.0, 0.6, 2)
    window = (left, bottom, left + 0.4, bottom + 0.3) if rng.random() < 0.3 else (0.0, 0.0, 1.0, 1.0)
    settings = replace(
        ON,
        glow_exponent=rng.choice([20.0, 200.0, 5000.0]),
        glow_strength=rng.choice([0.1, 1.0, 50.0]),
        glow_threshold=rng.choice([0.0, 0.5, 0.95]),
    )
    return sun, body, camera, window, settings


def test_no_highlight_is_missed():
    """Random suns, cameras, waves and borders: what has a highlight is in the part that is drawn.

    And that part is no more than it must be: mostly within a fifth of the picture of a highlight.
    """
    rng = np.random.default_rng(4)
    glowing, gaps = 0, []
    for _ in range(240):
        sun, body, camera, window, settings = random_case(rng)
        cut = max(settings.glow_threshold, glow.LEAST_VISIBLE / settings.glow_strength)
        plan = planned(sun, camera, body, settings, window=window)
        places = highlights_in_view(sun, camera, body, settings, cut, window, rng)
        if len(places) == 0:
            continue
        glowing += 1
        assert plan.drawn, plan.reason
        assert plan.cut == cut
        # Those that can reach into the picture are drawn with their star, and one dark texel around.
        texels = places * plan.lattice
        low, high = np.array(plan.rectangle[:2]), np.array(plan.rectangle[2:])
        window_low = np.floor(np.array(window[:2]) * plan.lattice) - glow.MARGIN
        window_high = np.ceil(np.array(window[2:]) * plan.lattice) + glow.MARGIN
        room = glow.REACH + 1
        below, above = texels.min(axis=0) - room - low, high - room - texels.max(axis=0)
        assert np.all((below >= 0.0) | (low == window_low)) and np.all((above >= 0.0) | (high == window_high))
        size = (np.array(window[2:]) - window[:2]) * plan.lattice
        gaps += [*((below / size)[low > window_low]), *((above / size)[high < window_high])]
    assert glowing > 60 and len(gaps) > 50, "too few cases tried it"
    assert np.median(gaps) < 0.2, np.median(gaps)


# lattice


def test_the_lattice_follows_the_lens_and_not_the_number_of_pixels():
    wide = planned(sun_at(20.0), scenes.look_at((-10, 0, 4), (0, 0, 0), size=(200, 100)), scenes.water())
    np.testing.assert_allclose(wide.lattice, [glow.LONG_SIDE, glow.LONG_SIDE / 2])
    tall = planned(sun_at(20.0), scenes.look_at((-10, 0, 4), (0, 0, 0), size=(100, 200)), scenes.water())
    np.testing.assert_allclose(tall.lattice, [glow.LONG_SIDE / 2, glow.LONG_SIDE])


def test_the_textures_hold_any_part_of_any_picture():
    rng = np.random.default_rng(5)
    body = scenes.water(half_size=200.0, waves=scenes.STEEP_WAVES)
    for size in [(1, 1), (1, 40), (3000, 7), (1920, 1080)]:
        for _ in range(10):
            left, bottom = rng.uniform(0, 0.5, 2)
            window = (left, bottom, *(np.array([left, bottom]) + rng.uniform(0.01, 0.5, 2)))
            camera = scenes.look_at((-10, 0, 4), (0, 0, 0), size=size)
            plan = planned(sun_at(20.0), camera, body, window=rng.choice([window, (0, 0, 1, 1)]))
            assert plan.drawn and max(plan.size) <= glow.LONG_SIDE + 2 * glow.MARGIN + 2


@pytest.mark.parametrize("window", [(0.0, 0.0, 1.0, 1.0), (0.21, 0.33, 0.48, 0.71)])
@pytest.mark.parametrize("jitter", [(0.0, 0.0), (0.7 / 320, -0.4 / 180)])
@pytest.mark.parametrize("ortho", [None, 30.0])
def test_texels_lie_where_their_projection_puts_them(window, jitter, ortho):
    """A point's texel by the projection that draws it, and by its place in the picture, are the same."""
    size = tuple(np.round((np.array(window[2:]) - window[:2]) * (320, 180)).astype(int).tolist())
    camera = scenes.look_at((-10, 0, 4), (0, 0, 0), size=(320, 180), ortho=ortho)
    body = scenes.water(half_size=200.0, waves=scenes.STEEP_WAVES)
    plan = planned(sun_at(30.0), camera, body, window=window, jitter=jitter)
    points = np.random.default_rng(3).uniform((-2, -2, -1), (8, 2, 1), (100, 3))
    in_camera = points @ camera.view[:3, :3].T + camera.view[:3, 3]
    drawn = cameras.to_texture(plan.drawn_projection(size), in_camera) * plan.size
    shift = np.eye(4)
    shift[:2, 3] = jitter
    picture = cameras.to_texture(cameras.crop(shift @ camera.projection, *window), in_camera)
    scale, offset = plan.to_texels(size)
    np.testing.assert_allclose(drawn, picture * scale + offset, atol=1e-9)
    # The lattice is that of the whole picture: the same place has the same texel in any part of it.
    whole = cameras.to_texture(camera.projection, in_camera) * plan.lattice
    np.testing.assert_allclose(drawn + plan.rectangle[:2] - plan.shift(size), whole, atol=1e-9)
    np.testing.assert_allclose(plan.shift(size), 0.5 * np.array(jitter) * (320, 180), atol=0.01)


def test_the_pixels_that_are_added_to_hold_the_whole_star():
    """Every pixel whose interpolation reads a texel that is drawn, and hardly one more."""
    body = scenes.water(half_size=200.0)
    camera = scenes.look_at((-10, 0, 4), (0, 0, 0), size=(200, 150), fov=1.2)
    size = (200, 150)
    plan = planned(sun_at(30.0), camera, body, replace(ON, glow_exponent=5000.0))
    left, bottom, width, height = plan.pixels(size)
    assert 0 < width < 120 and 0 < height < 120, "the lobe covers a small part of the picture"
    scale, offset = plan.to_texels(size)
    x, y = np.meshgrid(np.arange(200) + 0.5, np.arange(150) + 0.5)
    texel = np.stack([x, y], -1) / size * scale + offset
    reached = np.all((texel > 0) & (texel < plan.size), axis=-1)
    y, x = np.nonzero(reached)
    assert (left, bottom) <= (x.min(), y.min()) and x.min() - left <= 1 and y.min() - bottom <= 1
    assert x.max() < left + width <= x.max() + 2 and y.max() < bottom + height <= y.max() + 2
