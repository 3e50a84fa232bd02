# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene's own light, one sun and the sky: the float64 twin of `gpu_shaders/lighting_lib.glsl`."""

from __future__ import annotations

import numpy as np

from . import sky
from .snapshot import Sky, Sun


def sky_irradiance(world: Sky, normal: np.ndarray) -> np.ndarray:
    """(..., 3) irradiance of the sky divided by pi on surfaces with unit normals (..., 3).

    Never negative: an expansion of degree 2 dips below zero opposite a small bright patch.
    """
    return np.maximum(sky.evaluate(world.irradiance_sh, normal), 0.0)


def sun_in_air(normal: np.ndarray, sun: Sun | None) -> np.ndarray:
    """(..., 3) irradiance of the sun on surfaces with unit normals (..., 3) that see all of it."""
    if sun is None:
        return np.zeros_like(normal)
    return sun.irradiance * np.maximum(np.sum(normal * sun.direction, axis=-1, keepdims=True), 0.0)


def diffuse_radiance(
    albedo: np.ndarray, normal: np.ndarray, sun: np.ndarray, sky_part: np.ndarray, world: Sky
) -> np.ndarray:
    """(..., 3) radiance of a diffuse surface, in every direction; albedo (..., 3), unit normals (..., 3).

    Lambert's law: albedo / pi times the sun's irradiance (..., 3) and a part (..., 3) of the sky's.
    """
    return albedo * (sun / np.pi + sky_part * sky_irradiance(world, normal))
