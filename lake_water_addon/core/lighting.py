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


def diffuse_radiance(albedo: np.ndarray, normal: np.ndarray, sun: Sun | None, world: Sky) -> np.ndarray:
    """(..., 3) radiance of a diffuse surface, in every direction; albedo (..., 3), unit normals (..., 3).

    Lambert's law for the sun, albedo / pi times its irradiance times the cosine, plus the sky's part.
    """
    light = sky_irradiance(world, normal)
    if sun is not None:
        cosine = np.maximum(np.sum(normal * sun.direction, axis=-1, keepdims=True), 0.0)
        light = light + sun.irradiance * cosine / np.pi
    return albedo * light
