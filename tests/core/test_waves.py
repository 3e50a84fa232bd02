# SPDX-License-Identifier: GPL-3.0-or-later
"""The sum of sine waves against the closed forms of linear wave theory."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lake_water_addon.core import waves
from lake_water_addon.core.waves import SineWave

LAKE = (
    SineWave(0.08, 4.0, 0.2, 0.0),
    SineWave(0.06, 2.7, -0.4, 1.0),
    SineWave(0.03, 1.5, 0.9, 2.0),
    SineWave(0.015, 0.8, -1.0, 3.0),
)
POINTS = np.random.default_rng(5).uniform(-40.0, 40.0, (200, 2))


def test_deep_water_waves_do_not_feel_the_bottom():
    """omega^2 = g k as soon as the water is deeper than a wavelength."""
    k = 2.0 * np.pi / 1.5
    assert waves.angular_frequency(k, 1000.0) == pytest.approx(np.sqrt(9.81 * k), rel=1e-12)
    assert waves.angular_frequency(k, 1.5) == pytest.approx(np.sqrt(9.81 * k), rel=1e-5)


def test_shallow_water_waves_all_run_at_sqrt_g_depth():
    """omega / k = sqrt(g D), whatever the wavelength, when it is far longer than the water is deep."""
    for wavelength in (50.0, 200.0, 1000.0):
        k = 2.0 * np.pi / wavelength
        assert waves.angular_frequency(k, 0.1) / k == pytest.approx(np.sqrt(9.81 * 0.1), rel=1e-4)


@given(k=st.floats(0.01, 100.0), depth=st.floats(0.01, 100.0))
def test_frequency_grows_with_wave_number_and_depth(k, depth):
    assert waves.angular_frequency(1.01 * k, depth) > waves.angular_frequency(k, depth)
    assert waves.angular_frequency(k, 1.01 * depth) >= waves.angular_frequency(k, depth)


def test_crest_travels_along_the_direction_at_the_phase_speed():
    """The crest that is at the origin at t = 0 is omega / k t further along `direction` later."""
    direction, wavelength, depth, time = 0.7, 3.0, 2.0, 12.5
    wave = SineWave(0.1, wavelength, direction, phase=np.pi / 2.0)
    speed = waves.angular_frequency(2.0 * np.pi / wavelength, depth) * wavelength / (2.0 * np.pi)
    along = np.array([np.cos(direction), np.sin(direction)])
    across = np.array([-along[1], along[0]])
    crest = np.array([speed * time * along + s * across for s in (-5.0, 0.0, 7.0)])
    packed = waves.pack([wave], time, depth)
    np.testing.assert_allclose(waves.height(packed, crest), 0.1, atol=1e-12)
    np.testing.assert_allclose(waves.slope(packed, crest), 0.0, atol=1e-12)


def test_slope_is_the_derivative_of_the_height():
    packed = waves.pack(LAKE, 3.7, 5.0, heading=0.4)
    h = 1e-5
    for axis in (0, 1):
        step = np.zeros(2)
        step[axis] = h
        numeric = (waves.height(packed, POINTS + step) - waves.height(packed, POINTS - step)) / (2.0 * h)
        np.testing.assert_allclose(waves.slope(packed, POINTS)[:, axis], numeric, atol=1e-8)


def test_normal_is_unit_points_up_and_is_square_to_the_surface():
    packed = waves.pack(LAKE, 3.7, 5.0)
    n = waves.normal(packed, POINTS)
    gradient = waves.slope(packed, POINTS)
    np.testing.assert_allclose(np.linalg.norm(n, axis=1), 1.0, atol=1e-14)
    assert np.all(n[:, 2] > 0.0)
    for axis in (0, 1):
        tangent = np.zeros((len(POINTS), 3))
        tangent[:, axis], tangent[:, 2] = 1.0, gradient[:, axis]
        np.testing.assert_allclose(np.sum(n * tangent, axis=1), 0.0, atol=1e-14)


@pytest.mark.skipif(np.finfo(np.longdouble).eps > 1e-18, reason="the reference needs an 80-bit float")
def test_phase_keeps_its_digits_after_a_million_seconds():
    """After 1e6 s (11.6 days) the phase is right to 1e-7 rad: 1e-8 of a wave, far below one float32 step."""
    time = 1.0e6
    long_pi = np.longdouble("3.14159265358979323846264338327950288")
    for wave in LAKE:
        k = np.longdouble(2) * long_pi / np.longdouble(wave.wavelength)
        omega = np.sqrt(np.longdouble(waves.GRAVITY) * k * np.tanh(k * np.longdouble(5.0)))
        exact = np.longdouble(wave.phase) - omega * np.longdouble(time)
        difference = float(np.mod(exact, 2 * long_pi)) - waves.phase_at(wave, time, 5.0)
        difference = (difference + np.pi) % (2.0 * np.pi) - np.pi
        assert abs(difference) < 1e-7, f"wavelength {wave.wavelength} m is {difference} rad off"


@given(time=st.floats(-1e6, 1e6), phase=st.floats(-100.0, 100.0))
def test_phase_is_reduced_to_one_turn(time, phase):
    reduced = waves.phase_at(SineWave(0.1, 1.0, 0.0, phase), time, 5.0)
    assert 0.0 <= reduced <= 2.0 * np.pi
    assert abs(np.float32(reduced) - reduced) < 1e-6


def test_surface_is_a_pure_function_of_time():
    """Frames may be drawn in any order: what was asked before leaves no trace."""
    first = waves.pack(LAKE, 5.0, 5.0)
    for time in (900.0, -3.0, 0.0):
        waves.pack(LAKE, time, 5.0)
    np.testing.assert_array_equal(waves.pack(LAKE, 5.0, 5.0), first)


@given(heading=st.floats(-7.0, 7.0))
def test_heading_turns_the_waves_with_the_object(heading):
    """The height at a point of the water frame does not depend on where the object is turned to."""
    c, s = np.cos(heading), np.sin(heading)
    turned = POINTS @ np.array([[c, s], [-s, c]])
    still = waves.height(waves.pack(LAKE, 2.0, 5.0), POINTS)
    np.testing.assert_allclose(waves.height(waves.pack(LAKE, 2.0, 5.0, heading), turned), still, atol=1e-12)


def test_no_wave_reaches_above_the_bound():
    packed = waves.pack(LAKE, 0.0, 5.0)
    bound = waves.max_height(LAKE)
    assert bound == pytest.approx(0.185)
    heights = waves.height(packed, np.random.default_rng(1).uniform(-500, 500, (20000, 2)))
    assert 0.8 * bound < np.max(np.abs(heights)) <= bound


def test_no_waves_are_flat_water():
    packed = waves.pack([], 1.0, 5.0)
    np.testing.assert_array_equal(waves.height(packed, POINTS), 0.0)
    np.testing.assert_array_equal(waves.normal(packed, POINTS), np.broadcast_to([0.0, 0.0, 1.0], (200, 3)))
    assert waves.max_height([]) == 0.0


def test_a_skimming_ray_meets_waves_that_lean_towards_it():
    """Many small waves along one line have normal slopes; a place counts by the area it turns to the ray."""
    rng = np.random.default_rng(6)
    many = [
        SineWave(a, length, 0.0, phase) for a, length, phase in rng.uniform(0.01, 6.0, (32, 3)) * (5e-4, 1, 1)
    ]
    packed = waves.pack(many, 0.0, 1e3)
    towards = waves.slope(packed, np.stack([np.linspace(0.0, 5e3, 400_000), np.zeros(400_000)], axis=1))[:, 0]
    area = np.maximum(towards, 0.0)
    assert waves.met_slope(packed) == pytest.approx(np.average(towards, weights=area), rel=0.05)
