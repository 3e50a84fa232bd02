# SPDX-License-Identifier: GPL-3.0-or-later
"""What a view needs, with its reasons; windows, jitter, and exactness far from the world's origin."""

from dataclasses import replace

import numpy as np
import pytest

from lake_water_addon.core import cameras, plan
from lake_water_addon.core.settings import FrameSettings
from lake_water_addon.core.snapshot import Camera, SceneSnapshot, Sky, WaterBody, WaterSettings
from lake_water_addon.core.under_water import Side, grid_height
from lake_water_addon.core.waves import MAX_WAVES, SineWave

WAVES = (SineWave(0.3, 4.0, 0.2), SineWave(0.2, 2.0, -0.9, 1.0))
PROJECTION = np.array([[1.5, 0, 0.1, 0], [0, 2.0, -0.2, 0], [0, 0, -1.0002, -0.20002], [0, 0, -1, 0]])
ORTHOGRAPHIC = np.array([[0.1, 0, 0, 0], [0, 0.15, 0, 0], [0, 0, -0.002, -1], [0, 0, 0, 1.0]])


def body(location=(0.0, 0.0, 0.0), heading=0.0, scale=1.0, key="water"):
    matrix = np.eye(4)
    c, s = np.cos(heading), np.sin(heading)
    matrix[:2, :2] = scale * np.array([[c, -s], [s, c]])
    matrix[:3, 3] = location
    return WaterBody(key, key, matrix, WaterSettings(waves=WAVES), (49, 10.0, 10.0, 0.0, 0.0))


def snapshot(*bodies):
    sky = Sky(np.ones(3), np.zeros((9, 3)))
    return SceneSnapshot(1, 0.0, {}, {}, (), sky, None, tuple(bodies))


def look_at(position, target):
    """Blender's convention: looks along -Z with +Y up."""
    back = np.subtract(position, target).astype(float)
    back /= np.linalg.norm(back)
    right = np.cross([0.0, 0.0, 1.0], back) if abs(back[2]) < 0.999 else np.array([1.0, 0.0, 0.0])
    right /= np.linalg.norm(right)
    to_world = np.eye(4)
    to_world[:3, :3] = np.column_stack([right, np.cross(back, right), back])
    to_world[:3, 3] = position
    return np.linalg.inv(to_world)


def planned(scene, camera, **options):
    view = {name: options.pop(name) for name in ("window", "jitter") if name in options}
    return plan.plan_frame(scene, camera, FrameSettings(**{"texture_size": 64, **options}), **view)


ABOVE = Camera(look_at((0, -20, 6), (0, 0, 0)), PROJECTION)


def test_water_in_the_picture_is_drawn_with_both_textures():
    (water,) = planned(snapshot(body()), ABOVE).bodies
    assert water.drawn and water.refraction.drawn and water.reflection.drawn
    assert "in the picture" in water.refraction.reason and "in the picture" in water.reflection.reason


@pytest.mark.parametrize("location", [(0, -60, 0), (300, 0, 0), (0, 200000, 0), (0, 0, -500)])
def test_water_out_of_the_picture_is_not_drawn_and_says_so(location):
    camera = Camera(look_at((0, -20, 6), (0, 0, 5)), PROJECTION)
    (water,) = planned(snapshot(body(location)), camera).bodies
    assert not (water.drawn or water.refraction.drawn or water.reflection.drawn)
    for reason in (water.reason, water.refraction.reason, water.reflection.reason):
        assert "out of the picture" in reason


def test_water_larger_than_the_picture_is_drawn():
    """No corner of it is in the view, but the picture is full of it."""
    wide = replace(body(), grid=(49, 1e4, 1e4, 0.0, 0.0))
    (water,) = planned(snapshot(wide), ABOVE).bodies
    assert water.drawn


def test_heading_and_centre_of_the_grid_count_for_what_is_in_the_picture():
    """A long strip beside the camera comes into view when the object is turned."""
    strip = replace(body(), grid=(49, 10.0, 0.5, 60.0, 0.0))
    turned = replace(strip, matrix=body(heading=np.pi / 2).matrix)
    assert not planned(snapshot(strip), ABOVE).bodies[0].drawn
    assert planned(snapshot(turned), ABOVE).bodies[0].drawn


def test_only_the_bodies_in_the_picture_are_drawn():
    scene = snapshot(body((500, 0, 0), key="far"), body(key="near"), body((0, -100, 0), key="behind"))
    assert [b.drawn for b in planned(scene, ABOVE).bodies] == [False, True, False]


def test_under_water_the_textures_are_those_from_below():
    below = Camera(look_at((0, -5, -2), (0, 0, 0)), PROJECTION)
    plan_below = planned(snapshot(body()), below)
    (water,) = plan_below.bodies
    assert plan_below.immersed == 0 and water.side.side is Side.UNDER and water.drawn
    assert not (water.refraction.drawn or water.reflection.drawn)
    assert water.under.refraction.drawn and water.under.reflection.drawn and water.under.heights is None
    assert "under water" in water.reason and "under water" in water.refraction.reason
    np.testing.assert_allclose(water.under.refraction.view, plan_below.camera.view)
    assert water.under.reflection.mirrored and not water.under.refraction.mirrored


def test_where_the_surface_cuts_the_picture_the_textures_of_both_sides_are_drawn():
    above = planned(snapshot(body()), ABOVE).bodies[0]
    z = float(grid_height(above.body, above.packed_waves, np.array([[0.0, -5.0]]))[0])
    at_it = Camera(look_at((0, -5, z), (0, 0, z)), PROJECTION)
    (water,) = planned(snapshot(body()), at_it).bodies
    assert water.side.side is Side.SPLIT and water.under.heights is not None
    for texture_pass in (water.refraction, water.reflection, water.under.refraction, water.under.reflection):
        assert texture_pass.drawn


@pytest.mark.parametrize("elevation", np.linspace(0.05, 1.5, 12))
def test_under_water_land_is_raised_no_more_than_it_appears(elevation):
    """Whatever part of Snell's window is seen; the steepest line of sight counts, and there is a bound."""
    target = (0.0, -2.0 + np.cos(elevation), -1.0 + np.sin(elevation))
    camera = Camera(look_at((0, -2, -1), target), PROJECTION)
    (water,) = planned(snapshot(body()), camera, reflection_steps=8).bodies
    ior = water.body.settings.ior
    scale = np.linalg.norm(water.under.refraction.view[:3, 2])
    assert water.under.steps == 8
    assert ior - 1e-9 <= scale <= plan.MOST_RAISED
    if elevation > 1.2:  # straight up is in the picture
        assert scale == pytest.approx(ior, rel=0.02)


def test_under_water_without_the_surface_in_the_picture_there_is_only_fog():
    looks_down = Camera(look_at((0, 0, -3), (0, 0.1, -9)), PROJECTION)
    plan_below = planned(snapshot(body()), looks_down)
    (water,) = plan_below.bodies
    assert plan_below.immersed == 0 and not water.drawn
    assert not (water.under.refraction.drawn or water.under.reflection.drawn)
    assert "under water" in water.reason and "out of the picture" in water.reason


def test_the_picture_begins_in_one_body_at_most():
    """Basins one above the other: the camera is in that with the lowest surface over it."""
    below = Camera(look_at((0, -5, -2), (0, 0, 0)), PROJECTION)
    for order in ((3.0, 0.0), (0.0, 3.0)):
        scene = snapshot(*(body((0, 0, z), key=z) for z in order))
        plan_below = planned(scene, below)
        assert plan_below.immersed == order.index(0.0)
        other = plan_below.bodies[1 - plan_below.immersed]
        assert other.under is None and not other.drawn and "another water" in other.reason


def test_other_bodies_are_seen_from_the_air():
    below = Camera(look_at((0, -5, -2), (0, 0, 0)), PROJECTION)
    scene = snapshot(body(), body((0, 25, -4), key="other"))
    own, other = planned(scene, below).bodies
    assert own.under is not None and other.under is None and other.refraction.drawn


def test_waves_and_not_the_plane_decide_whether_the_camera_is_under_water():
    """Two cameras at the height of half an amplitude: one stands under a crest, one over a trough."""
    packed = planned(snapshot(body()), ABOVE).bodies[0].packed_waves
    line = np.column_stack([np.linspace(-6, 6, 400), np.zeros(400)])
    h = plan.waves.height(packed, line)
    for point, side in ((line[h.argmax()], Side.UNDER), (line[h.argmin()], Side.AIR)):
        eye = (*point, 0.1)
        camera = Camera(look_at(eye, (point[0], 3.0, 0.0)), PROJECTION)
        fine = replace(body(), grid=(401, 10.0, 10.0, 0.0, 0.0))
        assert planned(snapshot(fine), camera).bodies[0].side.side is side


def test_orthographic_pictures_begin_at_the_near_plane():
    """Its rays have no eye, but a beginning: above the water it sees the surface when it looks down."""
    looks_down = Camera(look_at((0, 0, -5), (0, 0, -15)), ORTHOGRAPHIC)
    looks_up = Camera(look_at((0, 0, -15), (0, 0, -5)), ORTHOGRAPHIC)
    scene = snapshot(body((0, 0, -20)))
    assert planned(scene, looks_down).bodies[0].drawn
    assert not planned(scene, looks_up).bodies[0].drawn
    from_below = Camera(look_at((0, 0, -25), (0, 0, -5)), ORTHOGRAPHIC)
    assert planned(scene, from_below).bodies[0].side.side is Side.UNDER


@pytest.mark.parametrize("z", [0.0, 137.0, -3.5])
def test_clip_planes_clear_the_highest_and_the_lowest_wave(z):
    """Above all waves for what is seen through the water, below all for what is mirrored, by 1 mm or more."""
    camera = Camera(look_at((0, -20, z + 6), (0, 0, z)), PROJECTION)
    (water,) = planned(snapshot(body((0, 0, z))), camera).bodies
    points = np.random.default_rng(1).uniform(-50, 50, (20000, 2))
    h = water.origin[2] + plan.waves.height(water.packed_waves, points)
    assert water.refraction.keep == 1 and water.refraction.clip_height >= h.max() + 1e-3
    assert water.reflection.keep == -1 and water.reflection.clip_height <= h.min() - 1e-3
    assert water.refraction.clip_height - water.reflection.clip_height < 1.2  # only "a little"


def test_only_the_reflection_camera_turns_winding_around():
    (water,) = planned(snapshot(body()), ABOVE).bodies
    assert water.reflection.mirrored and not water.refraction.mirrored


def test_part_of_a_picture_is_drawn_as_the_whole_is():
    """Border render: the camera is cropped, the textures and their cameras are those of the whole picture."""
    left, bottom, right, top = 0.2, 0.1, 0.7, 0.45
    whole = planned(snapshot(body()), ABOVE)
    part = planned(snapshot(body()), ABOVE, window=(left, bottom, right, top))
    points = np.random.default_rng(2).uniform([-5, -5, -30], [5, 5, -1], (100, 3))
    uv = cameras.to_texture(whole.camera.projection, points)
    np.testing.assert_allclose(
        cameras.to_texture(part.camera.projection, points),
        (uv - [left, bottom]) / [right - left, top - bottom],
        atol=1e-9,
    )
    for a, b in (
        (whole.bodies[0].refraction, part.bodies[0].refraction),
        (whole.bodies[0].reflection, part.bodies[0].reflection),
    ):
        np.testing.assert_array_equal(a.view, b.view)
        np.testing.assert_array_equal(a.projection, b.projection)


def test_part_without_water_draws_none():
    sky_only = planned(snapshot(body()), ABOVE, window=(0.0, 0.9, 1.0, 1.0))
    assert sky_only.bodies[0].reason == "out of the picture"


def test_textures_reach_beyond_the_picture_by_fov_ext():
    for fov_ext in (1.0, 1.5, 3.0):
        (water,) = planned(snapshot(body()), ABOVE, fov_ext=fov_ext).bodies
        corner = np.linalg.inv(water.refraction.projection) @ [1, 1, 0, 1]
        ndc = cameras.to_ndc(PROJECTION, corner[:3] / corner[3])
        np.testing.assert_allclose(ndc[:2], fov_ext, atol=1e-9)


def test_scene_a_thousand_kilometres_away_gives_the_same_float32_numbers():
    """Everything that the GPU gets is relative to the water; 1e6 m away float32 itself resolves 6 cm."""
    far = np.array([1.0e6, -2.0e6, 5.0e4])
    shifted_view = ABOVE.view.copy()
    shifted_view[:3, 3] -= ABOVE.view[:3, :3] @ far
    near_plan = planned(snapshot(body(), body((3.25, 1.5, -0.5))), ABOVE)
    beside = far + np.array([3.25, 1.5, -0.5])
    far_plan = planned(snapshot(body(far), body(beside)), Camera(shifted_view, PROJECTION))
    object_matrix = np.eye(4)
    object_matrix[:3, 3] = 7.5, -2.25, 0.125
    moved = object_matrix.copy()
    moved[:3, 3] += far

    def gpu_numbers(p, matrix):
        yield plan.rebase(matrix, p.origin)
        yield p.camera.view
        for b in p.bodies:
            yield from (b.origin, b.refraction.view, b.reflection.view, np.array(b.refraction.clip_height))

    for near, there in zip(gpu_numbers(near_plan, object_matrix), gpu_numbers(far_plan, moved), strict=True):
        np.testing.assert_allclose(there, near, rtol=6e-8, atol=2e-8)


def test_rebased_views_see_rebased_points_at_the_same_place():
    p = planned(snapshot(body((10.0, 20.0, 30.0))), Camera(look_at((0, -20, 40), (10, 20, 30)), PROJECTION))
    point = np.array([12.0, 18.0, 29.0])
    world_view = look_at((0, -20, 40), (10, 20, 30))
    np.testing.assert_allclose(
        p.camera.view @ np.append(point - p.origin, 1.0), world_view @ np.append(point, 1.0), atol=1e-12
    )


def test_scene_without_water_is_planned():
    p = planned(snapshot(), ABOVE)
    assert p.bodies == ()
    np.testing.assert_array_equal(p.origin, 0.0)


def test_more_waves_than_the_shader_sums_are_cut_off_and_still_clear_the_clip_plane():
    many = replace(body(), settings=WaterSettings(waves=tuple(SineWave(0.01, 1.0, i) for i in range(50))))
    (water,) = planned(snapshot(many), ABOVE).bodies
    assert len(water.packed_waves) == MAX_WAVES
    assert water.refraction.clip_height > MAX_WAVES * 0.01


def test_jitter_moves_the_picture_by_parts_of_a_pixel():
    moved = planned(snapshot(body()), ABOVE, jitter=(0.01, -0.02)).camera
    point = np.array([[1.0, 2.0, -10.0]])
    difference = cameras.to_ndc(moved.projection, point) - cameras.to_ndc(PROJECTION, point)
    np.testing.assert_allclose(difference, [[0.01, -0.02, 0.0]], atol=1e-12)


@pytest.mark.parametrize("samples", [2, 8, 64])
def test_jitter_spreads_over_the_pixel(samples):
    """All inside the pixel, no two alike, and centred: the mean is within one stratum of the middle."""
    width, height = 160, 120
    pixels = [
        np.array(plan.pixel_jitter(i, samples, width, height)) * [width / 2, height / 2]
        for i in range(samples)
    ]
    assert np.all(np.abs(pixels) <= 0.5)
    assert len({tuple(p) for p in pixels}) == samples
    assert np.all(np.abs(np.mean(pixels, axis=0)) <= 1.0 / samples)


def test_single_sample_is_taken_in_the_middle():
    assert plan.pixel_jitter(0, 1, 160, 120) == (0.0, 0.0)


def test_jitter_fills_the_pixel_evenly():
    """64 samples in a 4 x 4 division of the pixel: 4 each, give or take 2."""
    points = np.array([plan.pixel_jitter(i, 64, 2, 2) for i in range(64)]) + 0.5
    counts, _, _ = np.histogram2d(points[:, 0], points[:, 1], bins=4, range=[[0, 1], [0, 1]])
    assert counts.min() >= 2 and counts.max() <= 6, counts


def test_the_grid_is_as_fine_as_the_picture_asks_for():
    scene = snapshot(body())
    own = scene.waters[0].grid
    for least, expected in ((own[0] + 7, own[0] + 7), (own[0] - 1, own[0])):
        (drawn,) = planned(scene, ABOVE, least_grid_resolution=least).bodies
        assert drawn.body.grid == (expected, *own[1:])


@pytest.mark.parametrize("samples, bias", [(1, 0.0), (4, -1.0), (16, -2.0), (1000, -2.0)])
def test_images_are_sharper_by_as_much_as_samples_lie_closer(samples, bias):
    assert plan.plan_frame(snapshot(body()), ABOVE, FrameSettings(), samples=samples).lod_bias == bias
