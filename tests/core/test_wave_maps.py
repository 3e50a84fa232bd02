# SPDX-License-Identifier: GPL-3.0-or-later
"""Tiles of waves: what they are a sum of, that they repeat, and what tells their pictures apart."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lake_water_addon.core import wave_maps
from lake_water_addon.core.wave_maps import Spectrum

SMALL = Spectrum(lowest=2.0, highest=7.0)


def summed(waves, xy):
    """Height and slope of the sum of sines at points (..., 2), sine by sine."""
    angle = 2.0 * np.pi * xy @ waves[:, :2].T + waves[:, 3]
    height = np.sin(angle) @ waves[:, 2]
    return height, (np.cos(angle) * waves[:, 2]) @ (2.0 * np.pi * waves[:, :2])


def texel_centers(size):
    line = (np.arange(size) + 0.5) / size
    return np.stack(np.meshgrid(line, line), axis=-1)


@pytest.mark.parametrize("size", [16, 31, 64])
def test_fields_are_the_sum_of_the_sines_at_the_texels(size):
    waves = wave_maps.sines(3, SMALL)
    height, slope = summed(waves, texel_centers(size))
    np.testing.assert_allclose(wave_maps.height_field(waves, size), height, atol=1e-13)
    np.testing.assert_allclose(wave_maps.slope_field(waves, size), slope, atol=1e-12)


def test_slope_is_the_derivative_of_the_height():
    waves = wave_maps.sines(3, SMALL)
    size = 512
    height, slope = wave_maps.height_field(waves, size), wave_maps.slope_field(waves, size)
    for axis in (0, 1):  # central differences over the seam, too
        across = np.roll(height, -1, 1 - axis) - np.roll(height, 1, 1 - axis)
        np.testing.assert_allclose(across * size / 2.0, slope[..., axis], atol=2e-3)


@given(seed=st.integers(-(2**40), 2**40), x=st.integers(-3, 3), y=st.integers(-3, 3))
def test_the_tile_repeats_exactly(seed, x, y):
    waves = wave_maps.sines(seed, SMALL)
    points = np.random.default_rng(1).random((20, 2))
    np.testing.assert_array_equal(waves[:, :2], np.round(waves[:, :2]))
    for here, there in zip(summed(waves, points), summed(waves, points + np.array([x, y])), strict=True):
        np.testing.assert_allclose(there, here, atol=1e-12)


@pytest.mark.parametrize("spectrum", [wave_maps.POND_RIPPLES, SMALL, Spectrum(1, 1), Spectrum(4, 9, 0, 1, 8)])
def test_root_mean_square_slope_is_one(spectrum):
    slope = wave_maps.slope_field(wave_maps.sines(7, spectrum), 128)
    assert np.mean(np.sum(slope**2, axis=-1)) == pytest.approx(1.0, abs=1e-12)


def test_spectrum_is_the_stated_one():
    """Amplitudes fall as |k|^-exponent; no wave is there twice, in either of its two directions."""
    waves = wave_maps.sines(1, Spectrum(2.0, 12.0, exponent=2.5, spread=0.0))
    length = np.hypot(waves[:, 0], waves[:, 1])
    assert length.min() == 2.0 and length.max() <= 12.0
    np.testing.assert_allclose(waves[:, 2] * length**2.5, waves[0, 2] * length[0] ** 2.5, rtol=1e-12)
    both = np.concatenate([waves[:, :2], -waves[:, :2]])
    assert len(np.unique(both, axis=0)) == len(both)
    disc = sum(4.0 <= x * x + y * y <= 144.0 for x in range(-12, 13) for y in range(-12, 13))
    assert len(both) == disc


def test_waves_run_along_their_direction():
    waves = wave_maps.sines(1, Spectrum(2.0, 12.0, direction=0.7, spread=6.0))
    slope = wave_maps.slope_field(waves, 64).reshape(-1, 2)
    along, across = np.array([np.cos(0.7), np.sin(0.7)]), np.array([-np.sin(0.7), np.cos(0.7)])
    assert np.std(slope @ along) > 2.0 * np.std(slope @ across)


def test_maps_are_the_same_on_every_machine():
    """Phases are whole steps of 2 pi / 2^32, from integers: nothing depends on the processor.

    The numbers are those of pcg3d with Python's own integers.
    """
    waves = wave_maps.sines(1, SMALL)[:4]
    steps = np.round(waves[:, 3] / (2.0 * np.pi) * 2.0**32).astype(np.int64)
    assert waves[:, :2].tolist() == [[1, -6], [2, -6], [3, -6], [1, -5]]
    assert steps.tolist() == [1683184920, 3404700531, 1968485046, 3336308759]


def test_seeds_give_other_waves_and_the_band_does_not():
    near, far = wave_maps.sines(1, SMALL), wave_maps.sines(1, Spectrum(2.0, 20.0))
    phase = {tuple(k): p for *k, _, p in far}
    assert all(phase[m, n] == p for m, n, _, p in near)
    turns = np.array([np.exp(1j * wave_maps.sines(seed)[:, 3]) for seed in range(-4, 4)])
    alike = np.abs(turns @ turns.conj().T) / turns.shape[1] - np.eye(8)
    assert alike.max() < 4.0 / np.sqrt(turns.shape[1])


def test_phases_are_even():
    phase = wave_maps.sines(5)[:, 3]
    counts, _ = np.histogram(phase, 8, (0.0, 2.0 * np.pi))
    expected = len(phase) / 8
    assert np.sum((counts - expected) ** 2 / expected) < 24.3  # chi squared, 7 degrees, 0.1 %


def test_waves_too_short_for_the_texels_are_left_out():
    """Else they would turn up as long ones."""
    waves = wave_maps.sines(1, SMALL)
    coarse = wave_maps.height_field(waves, 8)
    long = waves[np.abs(waves[:, :2]).max(axis=1) < 4]
    np.testing.assert_allclose(coarse, summed(long, texel_centers(8))[0], atol=1e-13)
    np.testing.assert_array_equal(wave_maps.height_field(waves, 4), 0.0)


def test_an_empty_band_is_refused():
    with pytest.raises(ValueError, match=r"no wave fits 2\.2 to 2\.2 times"):
        wave_maps.sines(1, Spectrum(2.2, 2.2))


def test_normal_map_is_square_to_the_surface():
    slopes = wave_maps.slope_field(wave_maps.sines(3), 64)
    texels = wave_maps.normal_map(slopes, 0.4)
    n = wave_maps.decode_normal(texels)
    np.testing.assert_allclose(n[..., :2] / n[..., 2:], -0.4 * slopes, atol=1e-12)
    assert texels.min() >= 0.0 and texels.max() <= 1.0
    assert np.all(wave_maps.normal_map(slopes, 0.0) == (0.5, 0.5, 1.0))


def test_dudv_map_displaces_down_the_slope():
    slopes = wave_maps.slope_field(wave_maps.sines(3), 64)
    texels = wave_maps.dudv_map(slopes, 0.25)
    np.testing.assert_allclose(wave_maps.decode_dudv(texels), -0.25 * slopes, atol=1e-12)
    assert np.all(texels[..., 2] == 0.0)
    steep = wave_maps.decode_dudv(wave_maps.dudv_map(slopes, 100.0))
    assert steep.min() == -1.0 and steep.max() == 1.0


def test_any_texel_decodes_to_a_unit_normal_that_points_out():
    texels = np.random.default_rng(1).random((500, 4))
    texels[:3] = (0.0, 0.0, 0.0, 0.0), (0.5, 0.5, 0.5, 1.0), (1.0, 1.0, 1.0, 1.0)
    n = wave_maps.decode_normal(texels)
    np.testing.assert_allclose(np.linalg.norm(n, axis=1), 1.0, atol=1e-14)
    assert np.all(n[:, 2] > 0.0)


def in_bytes(texels):
    return np.round(texels * 255.0) / 255.0


@pytest.mark.parametrize("strength", [0.0, 0.02, 0.2, 1.0, 3.0])
@pytest.mark.parametrize("kind", ["NORMAL", "DUDV"])
def test_own_maps_are_known_again(kind, strength):
    for seed in range(3):
        assert wave_maps.classify(in_bytes(wave_maps.make_map(kind, seed, 64, strength))) == kind


def smaller(texels):
    """Averaged 4 x 4, as a mipmap that nobody made unit again."""
    size = len(texels) // 4
    return texels.reshape(size, 4, size, 4, -1).mean(axis=(1, 3))


def test_kinds_survive_what_is_done_to_pictures():
    noise = np.random.default_rng(1).normal(0.0, 0.02, (64, 64, 3))  # of a lossy file
    for kind in ("NORMAL", "DUDV"):
        texels = wave_maps.make_map(kind, 4, 64, 0.3)
        assert wave_maps.classify(smaller(texels)) == kind
        assert wave_maps.classify(np.clip(texels + noise, 0.0, 1.0)) == kind
        assert wave_maps.classify(np.concatenate([texels, np.ones((64, 64, 1))], axis=2)) == kind
    flipped = wave_maps.make_map("NORMAL", 4, 64, 0.3) * (1.0, -1.0, 1.0) + (0.0, 1.0, 0.0)
    assert wave_maps.classify(flipped) == "NORMAL"  # green pointing down, another convention


def other_pictures():
    rng = np.random.default_rng(2)
    height = wave_maps.height_field(wave_maps.sines(1), 64)
    grey = 0.5 + 0.45 * height / np.abs(height).max()
    return {
        "a height map": np.repeat(grey[..., None], 3, axis=2),
        "noise": rng.random((64, 64, 3)),
        "black": np.zeros((64, 64, 3)),
        "white": np.ones((64, 64, 3)),
        "grey": np.full((64, 64, 3), 0.5),
        "a sky": np.linspace(0.2, 0.8, 64)[:, None, None] * np.ones((64, 64, 1)) * (0.5, 0.7, 1.0),
        "grass": rng.uniform(0.5, 1.0, (64, 64, 1)) * (0.2, 0.4, 0.05),
        "red": np.ones((64, 64, 3)) * (1.0, 0.0, 0.0),
    }


@pytest.mark.parametrize("texels", other_pictures().values(), ids=other_pictures())
def test_other_pictures_are_neither(texels):
    assert wave_maps.classify(texels) is None
