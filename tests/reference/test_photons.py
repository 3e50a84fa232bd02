# SPDX-License-Identifier: GPL-3.0-or-later
"""The count of photons under water."""

from __future__ import annotations

import numpy as np
import pytest

from lake_water_addon.core import optics, waves
from lake_water_addon.core.snapshot import Material, Sun
from lake_water_addon.core.waves import SineWave
from scripts.reference.optics import physical_optics
from scripts.reference.tracer import Reference
from tests.gpu import scenes

IOR, DEPTH = 1.333, 2.0
OVERHEAD = Sun(np.array([0.0, 0.0, 1.0]), np.ones(3))
ASLANT = Sun(np.array([0.48, -0.36, 0.8]), np.ones(3))
UP = np.array([0.0, 0.0, 1.0])


def _reference(sun, these_waves=(), k=0.0, extra=(), **options):
    bed = scenes.grid_mesh("bed", 2, 30.0, -DEPTH)
    sand = Material("sand", np.ones(3))
    meshes, draws = (bed,), [("bed", "sand", [np.eye(4)])]
    if extra:
        meshes += (scenes.box_mesh("box", (0.5, 0.5, 0.25)),)
        draws.append(("box", "sand", [scenes.translation(*place) for place in extra]))
    body = scenes.water(half_size=30.0, ior=IOR, k=k, waves=these_waves)
    return Reference(scenes.snapshot(meshes, (sand,), draws, (body,), sun=sun), **options)


def _square(half: float, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Middles (n, 2) of count x count cells of a square, and points of the bottom there."""
    line = ((np.arange(count) + 0.5) / count * 2.0 - 1.0) * half
    xy = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    return xy, np.column_stack([xy, np.full(len(xy), -DEPTH)])


@pytest.mark.parametrize("absorption", [0.4, (0.5, 0.2, 0.3)])
def test_calm_water_has_no_pattern(absorption):
    def water(settings):
        return physical_optics(settings, np.broadcast_to(absorption, 3))

    light = _reference(ASLANT, water_optics=water).sunlight[0]
    _, points = _square(3.0, 40)
    light.count(points, np.full(len(points), 5.0), 40_000)
    below = np.sqrt(1.0 - (1.0 - 0.64) / IOR**2)
    passed = 1.0 - optics.fresnel_dielectric(0.8, 1.0 / IOR)
    expected = passed * np.exp(-np.broadcast_to(absorption, 3) * DEPTH / below)
    np.testing.assert_allclose(light.calm(points[:1])[0], expected, rtol=1e-12)
    found = light.light(points, np.broadcast_to(UP, points.shape))
    np.testing.assert_allclose(found, np.broadcast_to(expected, found.shape), rtol=5e-3)
    # On level ground this is what falls on the water.
    sun = light.irradiance(points[:1], UP[None], UP[None])
    np.testing.assert_allclose(sun[0], ASLANT.irradiance * 0.8 * expected, rtol=5e-3)


def test_one_wave_by_hand():
    """Sunlight from overhead through one sine: each ray by Snell's law alone, counted in a histogram."""
    wave = SineWave(0.08, 2.0)
    light = _reference(OVERHEAD, (wave,)).sunlight[0]
    cells = 80
    window = light.count_over(
        np.array([-2.0, -0.5]), np.array([4.0 / cells, 1.0]), np.array([cells, 1]), 300_000
    )
    packed = waves.pack((wave,), 1.0, 5.0)
    x = np.linspace(-6.0, 6.0, 3_000_001)
    xy = np.stack([x, 0.0 * x], axis=1)
    height, slope = waves.height(packed, xy), waves.slope(packed, xy)[:, 0]
    incidence = np.arctan(slope)
    deviation = incidence - np.arcsin(np.sin(incidence) / IOR)
    landing = x + np.tan(deviation) * (DEPTH + height)
    light_of = 1.0 - optics.fresnel_dielectric(np.cos(incidence), 1.0 / IOR)
    # The count's kernel is a quadratic B-spline: a box three times.
    fine = 15
    bins = 3 * fine * cells
    expected, edges = np.histogram(landing, bins, (-6.0, 6.0), weights=light_of)
    for _ in range(3):
        expected = np.convolve(expected, np.ones(fine) / fine, mode="same")
    middle = -2.0 + (np.arange(cells) + 0.5) * 4.0 / cells
    expected = np.interp(middle, 0.5 * (edges[1:] + edges[:-1]), expected * bins / len(x))
    found = window.counts[0, 0, :, 0]
    assert found.max() > 2.0 * found.min()
    np.testing.assert_allclose(found, expected, atol=0.02 * expected.max())


def test_no_light_is_lost():
    """Whatever passes the waves arrives: k = 0, and a window of whole wavelengths."""
    wave = SineWave(0.1, 1.0, 0.0)
    light = _reference(OVERHEAD, (wave,)).sunlight[0]
    window = light.count_over(np.array([-2.0, -1.0]), np.array([0.05, 0.05]), np.array([80, 40]), 200_000)
    packed = waves.pack((wave,), 1.0, 5.0)
    normal = waves.normal(packed, np.stack([np.linspace(0.0, 1.0, 10_001)[:-1], np.zeros(10_000)], axis=1))
    passed = np.mean(1.0 - optics.fresnel_dielectric(normal[:, 2], 1.0 / IOR))
    assert window.counts.sum() / (80 * 40) == pytest.approx(passed, rel=2e-3)


def test_shadows_in_the_air_and_under_water():
    reference = _reference(OVERHEAD, (SineWave(0.02, 1.5),), extra=((-2.0, 0.0, 1.0), (2.0, 0.0, -1.0)))
    light = reference.sunlight[0]
    _, points = _square(4.0, 60)
    light.count(points, np.full(len(points), 5.0), 200_000)
    probes = np.array([[-2.0, 0.0, -DEPTH], [2.0, 0.0, -DEPTH], [2.0, 0.0, -0.75], [0.0, 2.0, -DEPTH]])
    layer = light.layer(probes, np.broadcast_to(UP, probes.shape))
    np.testing.assert_array_equal(layer, [0, 1, 0, 0])
    found = light.light(probes, np.broadcast_to(UP, probes.shape))[:, 0]
    assert np.all(found[:2] < 0.01)
    assert np.all(found[2:] > 0.5)


def test_nearer_places_get_finer_windows():
    light = _reference(ASLANT, (SineWave(0.02, 1.5),)).sunlight[0]
    _, far = _square(20.0, 40)
    distance = np.linalg.norm(far - (0.0, -20.0, 2.0), axis=1)
    light.count(far, distance, 20_000)
    cells = [window.cell[0] for window in light.windows]
    assert len(cells) > 1
    assert cells == sorted(cells)
    for window in light.windows[:1]:
        near = light.across(far[distance < distance.max() / 16.0])
        assert window.at(near, np.zeros(len(near), int))[1].all()
