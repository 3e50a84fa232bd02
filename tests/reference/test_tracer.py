# SPDX-License-Identifier: GPL-3.0-or-later
"""The reference picture of calm water, by hand."""

from __future__ import annotations

import numpy as np
import pytest

from lake_water_addon.core import optics
from lake_water_addon.core.snapshot import Material, Sun
from scripts.reference.optics import physical_optics, project_optics
from scripts.reference.tracer import Reference, render
from tests.gpu import scenes

IOR, DEPTH, K = 1.333, 2.0, 0.4
COLOR = np.array([0.01, 0.08, 0.06])
ALBEDO = np.array([0.5, 0.4, 0.3])
SUN = Sun(np.array([0.6, 0.0, 0.8]), np.array([3.0, 2.9, 2.6]))
SKY = scenes.SKY_RADIANCE
SIZE = (8, 6)


def _calm(**settings):
    bed = scenes.grid_mesh("bed", 2, 40.0, -DEPTH)
    body = scenes.water(half_size=40.0, ior=IOR, k=K, water_color=tuple(COLOR), **settings)
    sand = Material("sand", ALBEDO)
    return scenes.snapshot((bed,), (sand,), (("bed", "sand", [np.eye(4)]),), (body,), sun=SUN)


def _bottom(sky: float, sky_k: float) -> np.ndarray:
    """Radiance of the bottom in the water."""
    cosine = np.sqrt(1.0 - (1.0 - SUN.direction[2] ** 2) / IOR**2)
    passed = 1.0 - optics.fresnel_dielectric(SUN.direction[2], 1.0 / IOR)
    sun = SUN.irradiance * SUN.direction[2] * passed * np.exp(-K * DEPTH / cosine)
    return ALBEDO * (sun / np.pi + SKY * sky * np.exp(-sky_k * DEPTH))


@pytest.mark.parametrize("physical", [False, True])
@pytest.mark.parametrize("slope", [0.0, 0.7, 3.0])
def test_from_the_air(slope, physical):
    camera = scenes.look_at((0.0, -5.0 * slope, 5.0), (0.0, 0.0, 0.0), SIZE, ortho=1.0)
    seen = render(
        _calm(),
        camera,
        SIZE,
        samples=1,
        photons=30_000,
        water_optics=physical_optics if physical else project_optics,
    )
    cosine = 1.0 / np.hypot(1.0, slope)
    below = np.sqrt(1.0 - (1.0 - cosine**2) / IOR**2)
    fresnel = optics.fresnel_dielectric(cosine, 1.0 / IOR)
    bottom = _bottom(1.0, 0.0)
    if physical:
        bottom = _bottom(optics.diffuse_transmittance(IOR), K * optics.diffuse_path(IOR)) / IOR**2
    through = COLOR + np.exp(-K * DEPTH / below) * (bottom - COLOR)
    expected = fresnel * SKY + (1.0 - fresnel) * through
    np.testing.assert_allclose(seen, np.broadcast_to(expected, seen.shape), rtol=2e-3)


@pytest.mark.parametrize("slope", [0.3, 2.0])
def test_from_below(slope):
    """Through the surface, and at 63 degrees by total internal reflection."""
    camera = scenes.look_at((0.0, -slope, -1.0), (0.0, 0.0, 0.0), SIZE, ortho=0.1, near=0.0)
    seen = render(_calm(), camera, SIZE, samples=1, photons=30_000)
    cosine = 1.0 / np.hypot(1.0, slope)
    fresnel = optics.fresnel_dielectric(cosine, IOR)
    assert (fresnel == 1.0) == (slope == 2.0)
    mirrored = COLOR + np.exp(-K * DEPTH / cosine) * (_bottom(1.0, 0.0) - COLOR)
    at_surface = fresnel * mirrored + (1.0 - fresnel) * SKY
    expected = COLOR + np.exp(-K / cosine) * (at_surface - COLOR)
    # The rays of a picture 0.1 m wide begin 0.05 m higher or lower.
    np.testing.assert_allclose(seen.mean(axis=(0, 1)), expected, rtol=2e-3)


def test_dry_ground_and_its_shadows():
    bed = scenes.grid_mesh("bed", 2, 40.0)
    post = scenes.box_mesh("post", (0.5, 0.5, 2.0))
    sand = Material("sand", ALBEDO)
    scene = scenes.snapshot(
        (bed, post), (sand,), (("bed", "sand", [np.eye(4)]), ("post", "sand", [np.eye(4)])), sun=SUN
    )
    camera = scenes.look_at((0.0, 0.0, 10.0), (0.0, 0.0, 0.0), (40, 30), ortho=8.0)
    picture = Reference(scene).picture(camera, (40, 30), samples=1)
    lit = ALBEDO * (SUN.irradiance * SUN.direction[2] / np.pi + SKY)
    # A post 2 m high in a sun of slope 4/3: its shadow ends 1.5 m beyond its edge, at x = -2.
    x = (np.arange(40) + 0.5) * 0.2 - 4.0
    expected = np.where(((x > -2.0) & (x < -0.5))[:, None], ALBEDO * SKY, lit)
    np.testing.assert_allclose(picture.radiance[15], expected, rtol=1e-6)
    assert picture.water.max() == 0.0


def test_the_picture_does_not_move_with_the_world():
    scene, camera = scenes.pond(), scenes.look_at((0.0, -14.0, 4.0), (0.0, 0.0, 0.0), (24, 18))
    here = Reference(scene).picture(camera, (24, 18), samples=2, photons=20_000)
    there = Reference(scenes.moved(scene, camera, (1e6, -2e6, 300.0))[0]).picture(
        scenes.moved(scene, camera, (1e6, -2e6, 300.0))[1], (24, 18), samples=2, photons=20_000
    )
    np.testing.assert_array_equal(there.water, here.water)
    assert np.abs(there.radiance - here.radiance).mean() < 1e-4
    assert 0.3 < here.water.mean() < 0.8
