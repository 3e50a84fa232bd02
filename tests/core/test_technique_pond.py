# SPDX-License-Identifier: GPL-3.0-or-later
"""Pond: Luna's formulas, with the numbers of his paper where it gives any."""

from dataclasses import replace

import numpy as np
import pytest

from lake_water_addon.core import optics, technique_pond, wave_maps
from lake_water_addon.core.plan import plan_frame
from lake_water_addon.core.settings import FrameSettings
from lake_water_addon.core.snapshot import Sun
from lake_water_addon.core.technique_pond import PondMaps, PondSettings
from tests.core.basin import CAMERAS, DEPTH, Basin, constant, up
from tests.gpu import scenes

FLAT = constant(0.5, 0.5, 1.0, 1.0)
NONE = constant(0.0, 0.0, 0.0, 0.0)
CALM = PondMaps(FLAT, FLAT, NONE, NONE)
# Nothing but the weighted colour.
PLAIN = PondSettings(
    bias=0.0, power=1.0, ambient=(1, 1, 1), diffuse=(0, 0, 0), specular=(0, 0, 0), impurity=0.0
)
SUN = Sun(np.array([0.6, 0.0, 0.8]), np.array([3.0, 2.5, 2.0]))
SKY = scenes.constant_sky()
every_camera = pytest.mark.parametrize("camera", CAMERAS)


def radiance(basin, settings, textures, maps=CALM, *, time=0.0, sun=SUN, points=None):
    surface, to_eye = basin.surface()
    if points is not None:
        surface, to_eye = points, basin.to_eye(points)
    return technique_pond.water_radiance(
        surface, up(surface), to_eye, basin.body, settings, time, textures, maps, sun, SKY
    )


def encoded(x, y):
    """A normal map of one direction."""
    n = np.array([x, y, np.sqrt(1.0 - x * x - y * y)])
    return constant(*(0.5 + 0.5 * n), 1.0)


def waving(uv):
    """A normal map that tells its coordinates, repeating."""
    slopes = 0.3 * np.column_stack([np.sin(2 * np.pi * uv[:, 0]), np.cos(2 * np.pi * uv[:, 1])])
    return np.column_stack([wave_maps.normal_map(slopes, 1.0), np.ones(len(uv))])


def test_geometric_waves_are_a_choice():
    assert PondSettings(geometric_waves=True).displaces
    assert not PondSettings(geometric_waves=False).displaces


def planned(water, *meshes):
    """The water body as it is planned for a picture."""
    scene = scenes.snapshot(meshes, (), (), (water,))
    return plan_frame(scene, CAMERAS["perspective"], FrameSettings(texture_size=64)).bodies[0]


# Two normal maps


def test_the_normal_is_the_mean_of_both_maps():
    p = np.zeros((1, 2))
    opposed = PondMaps(encoded(0.3, -0.2), encoded(-0.3, 0.2), NONE, NONE)
    np.testing.assert_allclose(technique_pond.ripple_normal(p, PLAIN, 0.0, opposed), [[0, 0, 1]], atol=1e-12)
    n0, n1 = np.array([0.6, 0.0, 0.8]), np.array([0.0, 0.8, 0.6])
    both = PondMaps(encoded(0.6, 0.0), encoded(0.0, 0.8), NONE, NONE)
    mean = 0.5 * (n0 + n1)
    np.testing.assert_allclose(
        technique_pond.ripple_normal(p, PLAIN, 0.0, both)[0], mean / np.linalg.norm(mean), atol=1e-12
    )


@pytest.mark.parametrize("which", [0, 1])
def test_each_map_has_a_velocity_and_a_tiling_of_its_own(which):
    settings = PondSettings(tile_size_0=3.0, velocity_0=(0.4, -0.1), tile_size_1=2.0, velocity_1=(-0.2, 0.3))
    maps = PondMaps(*((waving, FLAT) if which == 0 else (FLAT, waving)), NONE, NONE)
    velocity, tile = ((0.4, -0.1), 3.0) if which == 0 else ((-0.2, 0.3), 2.0)
    p = np.random.default_rng(1).uniform(-9, 9, (100, 2))
    now = technique_pond.ripple_normal(p, settings, 0.0, maps)
    later = technique_pond.ripple_normal(p + 11.0 * np.array(velocity), settings, 11.0, maps)
    np.testing.assert_allclose(later, now, atol=1e-9)
    np.testing.assert_allclose(technique_pond.ripple_normal(p + tile, settings, 0.0, maps), now, atol=1e-9)
    assert np.ptp(now[:, 0]) > 0.1
    assert np.abs(technique_pond.ripple_normal(p + 0.5 * tile, settings, 0.0, maps) - now).max() > 0.1


@pytest.mark.parametrize("heading", [0.0, 0.8])
def test_ripples_lie_on_geometric_waves(heading):
    """Their slopes add; on flat water the ripples' own remain, turned with the body."""
    basin = Basin(heading=heading)
    rng = np.random.default_rng(2)
    c, s = np.cos(heading), np.sin(heading)

    def normal(slope):
        n = np.column_stack([-slope, np.ones(len(slope))])
        return n / np.linalg.norm(n, axis=1, keepdims=True)

    waves, ripples = rng.normal(0, 0.5, (100, 2)), rng.normal(0, 0.5, (100, 2))
    turned = ripples @ np.array([[c, s], [-s, c]])
    got = technique_pond.on_waves(normal(waves), normal(ripples), basin.body)
    np.testing.assert_allclose(got, normal(waves + turned), atol=1e-12)
    np.testing.assert_allclose(
        technique_pond.on_waves(up(got), normal(ripples), basin.body), normal(turned), atol=1e-12
    )


# Lookups


def test_the_shift_vanishes_at_the_bottom_edge_only():
    settings = PondSettings(ripple_scale=(0.1, 0.04))
    ripple = np.broadcast_to([0.3, -0.5, 0.8], (4, 3))
    own = np.array([[0.2, 0.0], [0.2, 0.5], [0.2, 1.0], [0.2, 0.1]])
    shift = technique_pond.lookup_shift(ripple, own, settings)
    np.testing.assert_allclose(shift[:, 0], 0.03)  # u is not held back
    factor = 1.0 - np.array([1.0, 0.5, 0.0, 0.9]) ** 10
    np.testing.assert_allclose(shift[:, 1], -0.02 * factor, atol=1e-15)
    assert shift[0, 1] == 0.0


@every_camera
@pytest.mark.parametrize("power", [0.0, 1e6])
def test_both_maps_are_looked_up_at_the_same_shifted_place(camera, power):
    """The pictures hold their coordinates; power 0 shows the refraction, a huge one the reflection."""
    basin = Basin(camera)
    settings = replace(PLAIN, ripple_scale=(0.1, 0.04), power=power)

    def place(uv):
        return np.column_stack([uv, np.zeros(len(uv))])

    tilted = encoded(0.3, -0.4)
    surface, _ = basin.surface()
    own = basin.coordinates(surface)
    got = radiance(basin, settings, basin.textures(place, place), PondMaps(tilted, tilted, NONE, NONE))
    v = 1.0 - own[:, 1]
    want = own + np.column_stack([np.full(len(own), 0.03), -0.016 * (1.0 - v**10)])
    np.testing.assert_allclose(got[:, :2], want, atol=1e-7)


@every_camera
def test_still_water_shows_both_maps_undistorted(camera):
    basin = Basin(camera)
    _, to_eye = basin.surface()
    got = radiance(basin, PLAIN, basin.textures((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)))
    w = to_eye[:, 2]
    np.testing.assert_allclose(got, np.column_stack([w, 1.0 - w, 0.0 * w]), atol=1e-9)


# The weight of the refraction


@pytest.mark.parametrize(("degrees", "weight"), [(45.0, 0.707), (0.0, 1.0), (90.0, 0.0)])
def test_weight_of_lunas_examples(degrees, weight):
    w = technique_pond.refraction_weight(np.cos(np.radians([degrees])), np.zeros(1), 1.0)
    assert w[0] == pytest.approx(weight, abs=5e-4)


def test_power_and_bias_bend_the_weight():
    cosine = np.array([-1.0, 0.0, 0.5, 1.0])
    weight = technique_pond.refraction_weight
    np.testing.assert_allclose(weight(cosine, np.zeros(4), 2.0), [0, 0, 0.25, 1.0], atol=1e-30)
    np.testing.assert_allclose(weight(cosine, np.full(4, 0.1), 2.0), [0.1, 0.1, 0.35, 1.0])
    np.testing.assert_allclose(weight(cosine, np.full(4, -0.1), 2.0), [0, 0, 0.15, 0.9])
    np.testing.assert_allclose(weight(cosine, np.zeros(4), 0.0), 1.0)


def test_bias_is_a_sum_of_a_constant_a_map_depth_and_distance():
    settings = PondSettings(
        bias=0.1,
        bias_map_strength=0.5,
        bias_depth_strength=0.2,
        bias_depth_range=(1.0, 3.0),
        bias_distance_strength=-0.3,
        bias_distance_range=(10.0, 30.0),
    )
    deep, far, black = np.array([9.0]), np.array([99.0]), np.zeros(1)
    bias = technique_pond.refraction_bias
    assert bias(deep, far, black, settings) == pytest.approx(0.1)
    assert bias(deep, far, black + 0.6, settings) == pytest.approx(0.1 + 0.5 * 0.6)
    np.testing.assert_allclose(
        [bias(np.array([d]), far, black, settings)[0] for d in (0.0, 1.0, 2.0, 3.0)], [0.3, 0.3, 0.2, 0.1]
    )
    np.testing.assert_allclose(
        [bias(deep, np.array([d]), black, settings)[0] for d in (5.0, 20.0, 30.0)], [-0.2, -0.05, 0.1]
    )


@every_camera
def test_bias_by_depth_is_that_of_the_water_below(camera):
    basin = Basin(camera)
    settings = replace(PLAIN, power=1e6, bias_depth_strength=1.0, bias_depth_range=(0.0, 2.0 * DEPTH))
    got = radiance(basin, settings, basin.textures((1, 1, 1), (0, 0, 0)))
    np.testing.assert_allclose(got, 0.5, atol=1e-6)


def test_the_bias_map_is_stretched_over_the_water_once():
    basin = Basin(heading=0.5)
    body = replace(basin.body, extent=(4.0, 2.0, 1.0, -3.0))
    corners = np.array([[-3.0, -5.0], [5.0, -1.0], [1.0, -3.0]])
    np.testing.assert_allclose(technique_pond.over_the_water(corners, body), [[0, 0], [1, 1], [0.5, 0.5]])


def test_an_image_is_stretched_over_a_grid_or_the_box_around_a_mesh():
    """In the water frame, whatever the object's heading and scale."""
    grid = scenes.water()
    assert planned(grid).extent == (30.0, 30.0, 0.0, 0.0)
    mesh = scenes.box_mesh("surface", (2.0, 1.0, 0.0))
    mesh = scenes.changed(mesh, positions=mesh.positions + np.float32([1.0, 5.0, 0.0]))
    c, s = 3.0 * np.cos(0.8), 3.0 * np.sin(0.8)
    matrix = scenes.translation(7.0, 8.0)
    matrix[:2, :2] = [[c, -s], [s, c]]
    body = planned(replace(grid, grid=None, mesh="surface", matrix=matrix), mesh)
    np.testing.assert_allclose(body.extent, (6.0, 3.0, 3.0, 15.0), atol=1e-6)


# Material, lights and impurities


@every_camera
def test_the_weighted_colour_takes_the_place_of_the_materials(camera):
    basin = Basin(camera)
    settings = replace(PLAIN, ambient=(0.2, 0.3, 0.4), diffuse=(0.5, 0.6, 0.7))
    textures = basin.textures((0.4, 0.4, 0.4), (0.4, 0.4, 0.4))
    lit = radiance(basin, settings, textures)
    np.testing.assert_allclose(
        lit, np.broadcast_to(0.4 * (np.array([0.2, 0.3, 0.4]) + 0.8 * np.array([0.5, 0.6, 0.7])), lit.shape)
    )
    overcast = radiance(basin, settings, textures, sun=None)
    np.testing.assert_allclose(overcast, np.broadcast_to(0.4 * np.array([0.7, 0.9, 1.1]), lit.shape))


def test_the_highlight_is_the_suns_mirror_image():
    settings = PondSettings(specular=(0.5, 0.6, 0.7), shininess=30.0)
    n = up(np.zeros((3, 3)))
    mirrored = np.array([-0.6, 0.0, 0.8])
    aside = np.array([0.8, 0.0, 0.6])  # square to it
    close = np.cos(0.1) * mirrored + np.sin(0.1) * aside
    got = technique_pond.highlight(n, np.array([mirrored, close, aside]), settings, SUN)
    full = np.array([0.5, 0.6, 0.7]) * SUN.irradiance / np.pi
    np.testing.assert_allclose(got, [full, full * np.cos(0.1) ** 30, 0.0 * full], atol=1e-12)


def test_there_is_no_highlight_on_what_faces_away_or_without_a_sun():
    settings = PondSettings(shininess=0.0)
    away = np.array([[-0.9, 0.0, np.sqrt(0.19)]])
    eye = optics.reflect_direction(-SUN.direction[None], away)
    assert away[0] @ SUN.direction < 0.0
    assert np.all(technique_pond.highlight(away, eye, settings, SUN) == 0.0)
    assert np.all(technique_pond.highlight(up(away), eye, settings, None) == 0.0)


@every_camera
def test_impurities_cover_the_refraction_with_the_waters_colour(camera):
    basin = Basin(camera, water_color=(0.1, 0.3, 0.2))
    settings = replace(PLAIN, impurity=0.25)
    _, to_eye = basin.surface()
    got = radiance(basin, settings, basin.textures((1.0, 1.0, 1.0), (0.0, 0.0, 0.0)))
    murky = 0.75 + 0.25 * np.array([0.1, 0.3, 0.2])
    np.testing.assert_allclose(got, to_eye[:, 2:] * murky, atol=1e-9)


def test_a_layer_of_impurities_floats_on_the_water():
    """Opaque where its alpha is 1, lit like anything that is dry; as its strength says."""
    basin = Basin()
    albedo = np.array([0.2, 0.5, 0.1])

    def half_covered(uv):
        return np.column_stack([np.broadcast_to(albedo, (len(uv), 3)), (uv[:, 0] % 1.0 > 0.5).astype(float)])

    settings = replace(PLAIN, impurity_map_strength=1.0, impurity_tile_size=3.0)
    maps = replace(CALM, impurity_map=half_covered)
    surface, _ = basin.surface()
    got = radiance(basin, settings, basin.textures((7, 7, 7), (7, 7, 7)), maps)
    covered = surface[:, 0] / 3.0 % 1.0 > 0.5
    light = 0.8 * SUN.irradiance / np.pi + scenes.SKY_RADIANCE
    np.testing.assert_allclose(got[covered], np.broadcast_to(albedo * light, got[covered].shape), rtol=1e-6)
    np.testing.assert_allclose(got[~covered], 7.0)
    half = radiance(
        basin, replace(settings, impurity_map_strength=0.5), basin.textures((7, 7, 7), (7, 7, 7)), maps
    )
    np.testing.assert_allclose(half, 0.5 * (got + 7.0))


def test_unknown_places_take_the_fragments_own_then_water_and_sky():
    basin = Basin(water_color=(0.1, 0.3, 0.2))
    nothing = replace(basin.textures(sky=(0.5, 0.6, 0.7)), refraction_color=NONE, reflection_color=NONE)
    _, to_eye = basin.surface()
    w = to_eye[:, 2:]
    got = radiance(basin, PLAIN, nothing)
    np.testing.assert_allclose(got, w * [0.1, 0.3, 0.2] + (1.0 - w) * [0.5, 0.6, 0.7], atol=1e-9)
