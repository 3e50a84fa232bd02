# SPDX-License-Identifier: GPL-3.0-or-later
"""Ripple: a flat mirror behind a moving map, as opaque as distance, angle and depth make it."""

from dataclasses import replace
from math import cos, radians, sin

import numpy as np
import pytest

from lake_water_addon.core.technique_ripple import (
    RippleSettings,
    brightness,
    displacement,
    opacity,
    water_radiance,
)
from tests.core.basin import CAMERAS, DEPTH, Basin, constant

CALM = constant(0.5, 0.5, 0.0, 1.0)
CLEAR = RippleSettings(
    distance_strength=0, angle_strength=0, depth_strength=0, depth_darkening=0, path_darkening=0
)
every_camera = pytest.mark.parametrize("camera", CAMERAS)


def radiance(basin, settings, textures, dudv_map=CALM, time=0.0):
    surface, to_eye = basin.surface()
    return water_radiance(surface, to_eye, basin.body, settings, time, textures, dudv_map)


def test_the_surface_is_flat():
    assert not RippleSettings().displaces


@pytest.mark.parametrize("heading", [0.0, 1.1])
def test_the_map_is_carried_along_the_flow(heading):
    """What stands at p now was at p - v t: in the direction of the flow, turned with the body."""
    basin = Basin(heading=heading)
    settings = RippleSettings(tile_size=3.0, flow_direction=0.6, flow_speed=0.5)

    def dudv_map(uv):
        return 0.5 + 0.5 * np.column_stack([np.sin(2 * np.pi * uv), np.cos(2 * np.pi * uv)])

    surface, _ = basin.surface()
    flow = np.array([cos(0.6 + heading), sin(0.6 + heading), 0.0])
    later = displacement(surface + 0.5 * 7.0 * flow, basin.body, settings, 7.0, dudv_map)
    np.testing.assert_allclose(later, displacement(surface, basin.body, settings, 0.0, dudv_map), atol=1e-9)
    along = 3.0 * np.array([cos(heading), sin(heading), 0.0])
    there = displacement(surface + along, basin.body, settings, 0.0, dudv_map)
    np.testing.assert_allclose(there, displacement(surface, basin.body, settings, 0.0, dudv_map), atol=1e-9)


@every_camera
def test_both_pictures_are_looked_up_at_the_fragments_own_place_and_displaced(camera):
    """The pictures hold their coordinates; the map says (0.2, -0.6) everywhere."""
    basin = Basin(camera)
    settings = replace(CLEAR, reflection_distortion=0.05, refraction_distortion=0.02)

    def place(uv):
        return np.column_stack([uv, np.zeros(len(uv))])

    displaced = constant(0.6, 0.2, 0.0, 1.0)
    surface, _ = basin.surface()
    own = basin.coordinates(surface)
    below = radiance(basin, settings, basin.textures(place, (0, 0, 0)), displaced)
    np.testing.assert_allclose(below[:, :2], own + 0.02 * np.array([0.2, -0.6]), atol=1e-9)
    opaque = replace(settings, distance_strength=1.0, distance_range=(-1.0, 0.0))
    mirrored = radiance(basin, opaque, basin.textures((0, 0, 0), place), displaced)
    np.testing.assert_allclose(mirrored[:, :2], own + 0.05 * np.array([0.2, -0.6]), atol=1e-9)


def test_opacity_is_the_sum_of_three_factors():
    settings = RippleSettings(
        distance_strength=0.1,
        distance_range=(10.0, 20.0),
        angle_strength=0.4,
        angle_range=(0.0, radians(80.0)),
        depth_strength=0.3,
        depth_range=(1.0, 3.0),
    )
    distance, depth = np.array([5.0, 15.0, 99.0]), np.array([0.0, 2.0, 99.0])
    cosine = np.cos(np.radians([0.0, 40.0, 89.0]))
    np.testing.assert_allclose(opacity(distance, cosine, depth, settings), [0.0, 0.4, 0.8], atol=1e-12)
    for name, part in (("distance", 0.1), ("angle", 0.4), ("depth", 0.3)):
        alone = replace(
            settings,
            **{f"{other}_strength": 0.0 for other in ("distance", "angle", "depth") if other != name},
        )
        np.testing.assert_allclose(
            opacity(distance, cosine, depth, alone), part * np.array([0, 0.5, 1]), atol=1e-12
        )


@pytest.mark.parametrize("strength", [3.0, -3.0])
def test_opacity_stays_a_part(strength):
    alpha = opacity(
        np.array([100.0]), np.array([0.1]), np.array([9.0]), RippleSettings(distance_strength=strength)
    )
    assert alpha == (1.0 if strength > 0 else 0.0)


def test_more_water_is_darker():
    settings = RippleSettings(
        depth_darkening=0.5,
        depth_darkening_range=(0.0, 4.0),
        path_darkening=0.25,
        path_darkening_range=(0.0, 10.0),
    )
    zero = np.zeros(5)
    np.testing.assert_allclose(
        brightness(np.array([0, 1, 2, 4, 9.0]), zero, settings), [1, 0.875, 0.75, 0.5, 0.5]
    )
    np.testing.assert_allclose(
        brightness(zero, np.array([0, 2, 4, 10, 90.0]), settings), [1, 0.95, 0.9, 0.75, 0.75]
    )
    assert brightness(np.array([9.0]), np.array([90.0]), replace(settings, path_darkening=2.0)) == 0.0


@every_camera
def test_darkened_with_the_depth_and_the_water_in_front(camera):
    """Linear in both, below a white bottom."""
    basin = Basin(camera)
    settings = replace(
        CLEAR,
        depth_darkening=0.3,
        depth_darkening_range=(0.0, 10.0),
        path_darkening=0.2,
        path_darkening_range=(0.0, 100.0),
    )
    surface, _ = basin.surface()
    path = np.linalg.norm(basin.bottom_through(surface) - surface, axis=1)
    got = radiance(basin, settings, basin.textures())
    np.testing.assert_allclose(
        got[:, 0], 1.0 - 0.3 * DEPTH / 10.0 - 0.2 * np.minimum(path, 100.0) / 100.0, atol=1e-6
    )


@every_camera
def test_reflection_covers_what_is_below_by_alpha(camera):
    basin = Basin(camera)
    settings = replace(CLEAR, angle_strength=1.0, angle_range=(0.0, radians(90.0)))
    _, to_eye = basin.surface()
    got = radiance(basin, settings, basin.textures((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)))
    alpha = np.arccos(to_eye[:, 2]) / radians(90.0)
    np.testing.assert_allclose(got, np.column_stack([1.0 - alpha, alpha, 0 * alpha]), atol=1e-7)


def test_the_map_tilts_the_normal():
    """Towards +x the angle of view grows on one side; the reflection with it."""
    basin = Basin("straight down")
    settings = replace(CLEAR, angle_strength=1.0, angle_range=(0.0, 1.5), normal_strength=0.8)
    point = np.zeros((1, 3))
    tilted = water_radiance(
        point,
        np.array([[0.0, 0.0, 1.0]]),
        basin.body,
        settings,
        0.0,
        basin.textures((0, 0, 0)),
        constant(1.0, 0.5, 0, 1),
    )
    np.testing.assert_allclose(tilted[0], np.arctan(0.8) / 1.5 * np.ones(3), atol=1e-9)


def test_a_ripple_near_the_horizon_does_not_look_beyond_it():
    """The picture holds the rise of the mirrored ray: positive where the scene is, negative in the nadir."""
    basin = Basin("low")
    settings = replace(CLEAR, reflection_distortion=2.0, distance_strength=1.0, distance_range=(-1.0, 0.0))
    view, projection = basin.body.reflection.view, basin.projection

    def rise(uv):
        ray = np.column_stack([(2.0 * uv - 1.0) / np.diagonal(projection)[:2], np.full(len(uv), -1.0)])
        return np.repeat((ray @ view[:3, 2])[:, None], 3, axis=1)

    textures = basin.textures((0, 0, 0), rise)
    for y in (0.0, 1.0):
        seen = radiance(basin, settings, textures, constant(0.5, y, 0.0, 1.0))[:, 0]
        assert seen.min() > 0.0
    assert rise(basin.coordinates(basin.surface()[0]) + np.array([0.0, 2.0])).min() < 0.0


def test_where_nothing_is_known_the_fragments_own_place_is_taken():
    basin = Basin()
    settings = replace(CLEAR, refraction_distortion=0.4)
    textures = basin.textures()
    surface, _ = basin.surface()
    own = basin.coordinates(surface)

    def holed(uv):
        known = np.linalg.norm(uv - own, axis=1) < 1e-6
        return np.where(known[:, None], [0.25, 0.5, 0.75, 1.0], 0.0)

    got = radiance(basin, settings, replace(textures, refraction_color=holed), constant(1.0, 0.0, 0.0, 1.0))
    np.testing.assert_allclose(got, np.broadcast_to([0.25, 0.5, 0.75], got.shape))
    nowhere = replace(textures, refraction_color=constant(0, 0, 0, 0), reflection_color=constant(0, 0, 0, 0))
    assert np.all(radiance(basin, settings, nowhere) == 0.0)
    sky = replace(nowhere, sky_radiance=lambda d: np.broadcast_to([0.1, 0.2, 0.3], d.shape))
    opaque = replace(settings, distance_strength=1.0, distance_range=(-1.0, 0.0))
    np.testing.assert_allclose(radiance(basin, opaque, sky), np.broadcast_to([0.1, 0.2, 0.3], got.shape))
