# SPDX-License-Identifier: GPL-3.0-or-later
"""Qualities: what they set at which size of picture, and that settings are known again."""

from dataclasses import asdict, fields
from itertools import pairwise
from types import SimpleNamespace

import pytest

from lake_water_addon.core.quality import CUSTOM, LARGEST, QUALITIES, STEP, quality_of, quality_settings
from lake_water_addon.core.settings import DEFAULTS, FrameSettings

SIDES = (64, 320, 640, 1920, 3840, 16384)
# What a quality must leave alone: it decides how exactly the water is computed, and not what it is.
NOT_TOUCHED = {
    *("technique", "use_caustics", "use_shadows", "use_glow", "caustics_method"),
    *("glow_strength", "glow_exponent", "glow_threshold", "use_exact_under_water"),
}


def shown(name: str, longer_side: int) -> SimpleNamespace:
    """Settings as a scene has them after a quality was chosen."""
    return SimpleNamespace(**asdict(DEFAULTS) | quality_settings(name, longer_side))


@pytest.mark.parametrize("name", QUALITIES)
def test_it_sets_parameters_of_the_picture_and_leaves_the_water_alone(name):
    names = set(quality_settings(name, 640))
    known = {field.name for field in fields(FrameSettings)} | {"samples", "viewport_samples"}
    assert names <= known - NOT_TOUCHED
    assert names == set(quality_settings("DRAFT", 640)), "one quality leaves what another has set"


@pytest.mark.parametrize("longer_side", SIDES)
@pytest.mark.parametrize("name", QUALITIES)
def test_a_quality_is_known_again(name, longer_side):
    settings = shown(name, longer_side)
    sizes = [quality_settings(key, longer_side)["texture_size"] for key in QUALITIES]
    assert sizes == sorted(sizes)
    assert quality_of(settings, longer_side) == name
    settings.refraction_steps += 1
    assert quality_of(settings, longer_side) == CUSTOM


def test_float32_of_blender_is_no_other_value():
    settings = shown("DRAFT", 640)
    settings.fov_ext = 1.2000000476837158
    assert quality_of(settings, 640) == "DRAFT"
    settings.fov_ext = 1.21
    assert quality_of(settings, 640) == CUSTOM


def test_textures_follow_the_picture():
    for name in QUALITIES:
        sizes = [quality_settings(name, side)["texture_size"] for side in SIDES]
        assert all(size % STEP == 0 and STEP <= size <= LARGEST for size in sizes)
        small, large = (quality_settings(name, side)["texture_size"] for side in (480, 1920))
        assert large / small == pytest.approx(4.0, rel=STEP / small)


def test_each_quality_is_finer_than_the_one_before():
    for before, after in pairwise(quality_settings(name, 640) for name in QUALITIES):
        for name, value in before.items():
            assert after[name] >= value, name
