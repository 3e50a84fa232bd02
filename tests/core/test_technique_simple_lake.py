# SPDX-License-Identifier: GPL-3.0-or-later
"""Simple Lake over a flat bottom, against the paper's formulas worked out in world space."""

import numpy as np
import pytest

from lake_water_addon.core import optics
from lake_water_addon.core.technique_simple_lake import (
    SimpleLakeSettings,
    refracted_radiance,
    water_radiance,
)
from tests.core.basin import CAMERAS, Basin, up

PAPER = SimpleLakeSettings()
every_camera = pytest.mark.parametrize("camera", CAMERAS)


@every_camera
@pytest.mark.parametrize("depth", [0.5, 3.0, 40.0])
@pytest.mark.parametrize("location", [(0, 0, 0), (500.0, -300.0, 20.0)])
def test_one_clamped_step_along_the_refracted_ray(camera, depth, location):
    """W = U + clamp(dv, 0, 2) / 3 R: the texture holds the place of the bottom that is seen in it."""
    basin = Basin(camera, fov_ext=3.0, depth=depth, location=location, k=0.0)
    surface, to_eye = basin.surface()
    refracted, _ = optics.refract_direction(-to_eye, up(surface), 1.0 / 1.333)
    got = refracted_radiance(surface, refracted, basin.body, PAPER, basin.textures(basin.bottom_at))
    dv = np.linalg.norm(basin.bottom_through(surface) - surface, axis=1, keepdims=True)
    w = surface + np.clip(dv, 0.0, 2.0) / 3.0 * refracted
    np.testing.assert_allclose(got, basin.bottom_through(w), atol=1e-6 * (1.0 + depth))


@every_camera
def test_light_is_lost_along_the_straight_ray(camera):
    basin = Basin(camera, fov_ext=3.0, k=0.4, water_color=(0.0, 0.0, 0.0))
    surface, to_eye = basin.surface()
    refracted, _ = optics.refract_direction(-to_eye, up(surface), 1.0 / 1.333)
    got = refracted_radiance(surface, refracted, basin.body, PAPER, basin.textures())
    d = np.linalg.norm(basin.bottom_through(surface) - surface, axis=1)
    np.testing.assert_allclose(got, np.exp(-0.4 * d)[:, None] * np.ones(3), rtol=1e-9)


@every_camera
def test_fresnel_without_reflectance_at_normal_incidence(camera):
    """Black water under a white reflection shows F = (1 - E.N)^4.5 itself."""
    basin = Basin(camera, fov_ext=3.0, k=1e6, q=4.5, water_color=(0.0, 0.0, 0.0))
    surface, to_eye = basin.surface()
    got = water_radiance(surface, up(surface), to_eye, basin.body, PAPER, basin.textures())
    np.testing.assert_allclose(got[:, 0], (1.0 - to_eye[:, 2]) ** 4.5, atol=1e-12)


def test_nothing_is_reflected_straight_down():
    basin = Basin("straight down", k=0.0, q=4.5)
    point = np.zeros((1, 3))
    got = water_radiance(
        point, up(point), up(point), basin.body, PAPER, basin.textures((0.2, 0.4, 0.6), (9.0, 9.0, 9.0))
    )
    np.testing.assert_allclose(got, [[0.2, 0.4, 0.6]], atol=1e-12)


@every_camera
def test_deep_water_is_not_brighter_than_what_it_mixes(camera):
    """The printed newrefrcol + F (newreflcol - refrcol) is, when the bottom is darker than the water."""
    basin = Basin(camera, fov_ext=3.0, depth=30.0, k=1.0, q=4.5, water_color=(0.3, 0.3, 0.3))
    surface, to_eye = basin.surface()
    textures = basin.textures((0.0, 0.0, 0.0), (0.5, 0.5, 0.5))
    got = water_radiance(surface, up(surface), to_eye, basin.body, PAPER, textures)
    assert np.all((got >= 0.3 - 1e-9) & (got <= 0.5 + 1e-9))


def test_what_is_nearer_than_the_surface_is_not_seen_through_water():
    """Where the texture holds something raised over the surface, no step is taken and no light is lost."""
    basin = Basin(depth=-0.2, k=5.0, water_color=(0.0, 0.0, 0.0))
    surface, to_eye = basin.surface()
    refracted, _ = optics.refract_direction(-to_eye, up(surface), 1.0 / 1.333)
    got = refracted_radiance(surface, refracted, basin.body, PAPER, basin.textures(basin.bottom_at))
    np.testing.assert_allclose(got, basin.bottom_through(surface), atol=1e-6)
