# SPDX-License-Identifier: GPL-3.0-or-later
"""FLIP against the evaluator of its authors."""

from __future__ import annotations

import flip_evaluator
import numpy as np
import pytest

from lake_water_addon.core import flip

RNG = np.random.default_rng(5)


def smooth(picture: np.ndarray, times: int) -> np.ndarray:
    for _ in range(times):
        for axis in (0, 1):
            picture = (np.roll(picture, 1, axis) + picture + np.roll(picture, -1, axis)) / 3.0
    return picture


def noise(times: int = 0, size: tuple[int, int] = (90, 120)) -> np.ndarray:
    picture = smooth(RNG.random((*size, 3)), times)
    low, high = picture.min(), picture.max()
    return ((picture - low) / (high - low)).astype(np.float32)


def flat(red: float, green: float, blue: float) -> np.ndarray:
    return np.broadcast_to(np.array([red, green, blue], np.float32), (60, 80, 3)).copy()


def scene(shift: int) -> np.ndarray:
    """Edges, points, dark and light colours, moved to the side."""
    picture = flat(0.1, 0.3, 0.25)
    picture[20:40] = (0.8, 0.7, 0.5)
    picture[:, 30:32] = (0.02, 0.01, 0.05)
    picture[10::15, 5::12] = 1.0
    return np.roll(picture, shift, axis=1)


PAIRS = {
    "noise": (noise(), noise()),
    "clouds": (noise(6), noise(6)),
    "little noise": ((base := noise(10)), np.clip(base + RNG.normal(0.0, 0.02, base.shape), 0.0, 1.0)),
    "green and blue": (flat(0, 1, 0), flat(0, 0, 1)),
    "black and white": (flat(0, 0, 0), flat(1, 1, 1)),
    "moved": (scene(0), scene(2)),
    "narrower than the filters": (noise(0, (7, 9)), noise(0, (7, 9))),
}


@pytest.mark.parametrize("pair", PAIRS.values(), ids=PAIRS)
@pytest.mark.parametrize("per_degree", [flip.PIXELS_PER_DEGREE, 30.0])
def test_it_is_the_authors_value(pair, per_degree):
    reference, picture = (np.ascontiguousarray(p, dtype=np.float32) for p in pair)
    want, mean, _ = flip_evaluator.evaluate(
        reference, picture, "LDR", applyMagma=False, parameters={"ppd": per_degree}
    )
    got = flip.FlipReference(reference, per_degree).compare(picture)
    assert abs(got.mean() - mean) < 1e-3
    np.testing.assert_allclose(got, want[..., 0], atol=2e-3)


def test_equal_pictures_do_not_differ():
    assert np.all(flip.FlipReference(noise()).compare(noise()) > 0.0)
    one = noise(2)
    assert np.all(flip.FlipReference(one).compare(one) == 0.0)


def test_a_part_with_its_reach_has_the_values_of_the_whole():
    reference, picture = noise(1), noise(1)
    reach = flip.reach()
    whole = flip.FlipReference(reference).compare(picture)
    part = np.s_[20 : 60 + 2 * reach, 10 : 50 + 2 * reach]
    inner = flip.FlipReference(reference[part]).compare(picture[part])[reach:-reach, reach:-reach]
    np.testing.assert_allclose(inner, whole[20 + reach : 60 + reach, 10 + reach : 50 + reach], atol=1e-12)


def test_pictures_of_two_sizes_are_refused():
    with pytest.raises(ValueError, match="cannot be compared"):
        flip.FlipReference(flat(0, 0, 0)).compare(noise())
