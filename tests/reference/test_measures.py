# SPDX-License-Identifier: GPL-3.0-or-later
"""The measures, on pictures whose error is known."""

from __future__ import annotations

import numpy as np
import pytest

from scripts.reference.measures import caustics_error, displayed, error_maps, picture_error

RNG = np.random.default_rng(3)
PICTURE = RNG.uniform(0.05, 0.9, (40, 50, 3)).repeat(2, axis=0).repeat(2, axis=1)


def test_equal_pictures_have_no_error():
    error = picture_error(PICTURE, PICTURE.copy())
    assert error.flip == pytest.approx(0.0, abs=1e-6)
    assert error.hdr_flip == pytest.approx(0.0, abs=1e-6)
    assert error.rmse == 0.0
    assert error.ssim == pytest.approx(1.0)


def test_black_in_place_of_white_is_the_worst():
    white, black = np.ones((30, 40, 3)), np.zeros((30, 40, 3))
    error = picture_error(white, black)
    assert error.flip > 0.95
    assert error.rmse == pytest.approx(1.0)
    assert error.ssim < 1e-3


def test_only_the_masked_pixels_count():
    wrong = PICTURE.copy()
    wrong[:, :30] += 0.2
    near = np.zeros(PICTURE.shape[:2])
    near[:, :30] = 1.0
    far = np.zeros(PICTURE.shape[:2], bool)
    far[:, 70:] = True
    assert picture_error(PICTURE, wrong, near).rmse == pytest.approx(0.2)
    there = picture_error(PICTURE, wrong, far)
    assert there.rmse == 0.0
    assert there.flip < 1e-3
    assert there.ssim > 0.999
    maps = error_maps(PICTURE, wrong)
    assert picture_error(PICTURE, wrong, maps=maps).flip == pytest.approx(float(maps.flip.mean()), rel=1e-5)


def test_hdr_sees_what_the_display_clips():
    bright = PICTURE * 20.0 + 1.0
    brighter = bright * 1.5
    error = picture_error(bright, brighter)
    assert error.flip == pytest.approx(0.0, abs=1e-6)
    assert error.hdr_flip > 0.05
    assert picture_error(bright, brighter, exposure=-5.0).flip > 0.05


def test_display_encoding():
    np.testing.assert_allclose(
        displayed(np.array([-1.0, 0.0, 0.001, 0.18, 1.0, 7.0])), [0, 0, 0.01292, 0.4613561, 1, 1], atol=1e-6
    )
    np.testing.assert_allclose(displayed(np.array([0.09]), 1.0), displayed(np.array([0.18])))


def test_caustics():
    counted = RNG.uniform(0.0, 2.0, (20, 20))
    same = caustics_error(counted, 3.0 * counted)
    assert (same.correlation, same.contrast, same.energy) == pytest.approx((1.0, 1.0, 3.0))
    flatter = caustics_error(counted, 0.5 * counted + 0.5 * counted.mean())
    assert (flatter.correlation, flatter.contrast, flatter.energy) == pytest.approx((1.0, 0.5, 1.0))
    mask = counted > 0.5
    spoiled = np.where(mask, counted, 99.0)
    assert caustics_error(counted, spoiled, mask).correlation == pytest.approx(1.0)


def test_what_cannot_be_compared_is_refused():
    with pytest.raises(ValueError, match="mask is empty"):
        picture_error(PICTURE, PICTURE, np.zeros(PICTURE.shape[:2], bool))
    with pytest.raises(ValueError, match="compared"):
        error_maps(PICTURE, PICTURE[1:])
    with pytest.raises(ValueError, match="black"):
        error_maps(np.zeros((8, 8, 3)), np.ones((8, 8, 3)))
    with pytest.raises(ValueError, match="finite"):
        error_maps(PICTURE, PICTURE * np.nan)
    with pytest.raises(ValueError, match="even"):
        caustics_error(np.ones((4, 4)), np.ones((4, 4)))
    with pytest.raises(ValueError, match="shape"):
        caustics_error(np.ones((4, 4)), np.ones((4, 5)))
