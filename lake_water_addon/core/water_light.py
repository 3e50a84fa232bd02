# SPDX-License-Identifier: GPL-3.0-or-later
"""Sunlight below a water surface: the float64 twin of `gpu_shaders/water_light_lib.glsl`.

Under a calm surface all sunlight travels in one direction r. The irradiance of a surface with normal n is

    E = E_sun (s_z / |r_z|) max(-n . r, 0) L

with s towards the sun, E_sun across its beam in the air, and L the light that is left, relative to
what falls on the water: (1 - F) exp(-k d) under a calm surface, and the sum of the photons, which is
just that on average, under waves. On a level bottom this is E_sun s_z L.

A technique that knows colours corrects that as under a calm surface: `plan.Spectrum`.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from . import cameras, optics
from .light import BORDER
from .lookup import inside_texture
from .plan import BodyPlan
from .snapshot import Sun

WINDOW_FADE = BORDER
"""Texels of the light depth over which the caustics give way to the light through a calm surface."""


def calm_light_path(position: np.ndarray, body: BodyPlan) -> np.ndarray:
    """(n,) m of water that sunlight passes to points (n, 3) under a calm surface; 0 above it."""
    return np.maximum(body.origin[2] - position[:, 2], 0.0) / max(-body.light.camera.direction[2], 1e-6)


def light_through_water(
    position: np.ndarray,
    body: BodyPlan,
    caustics: Callable[[np.ndarray], np.ndarray] | None,
    visibility_in_air: Callable[[np.ndarray], np.ndarray],
) -> np.ndarray:
    """L (n,) at points (n, 3) in render space.

    caustics: uv (n, 2) in the light camera's window -> (n,), or None without. visibility_in_air: points
    (n, 3) of the surface -> part of the sun that is seen from there (n,), which the caustics' photons know
    themselves. What a view sees lies within their window, but for the border over which they fade.
    """
    path = calm_light_path(position, body)
    calm = body.light.transmittance * optics.attenuation(body.body.settings.k, path)
    camera = body.light.camera
    if caustics is None:
        return calm * visibility_in_air(position - path[:, None] * camera.direction)
    uv = cameras.to_texture(camera.projection, position @ camera.view[:3, :3].T + camera.view[:3, 3])
    known = inside_texture(uv, WINDOW_FADE / camera.resolution)
    return calm + known * (caustics(uv) - calm)


def sky_in_water(position: np.ndarray, body: BodyPlan) -> np.ndarray:
    """(n, 3) part of the sky's light that is left at points (n, 3)."""
    depth = np.maximum(body.origin[2] - position[:, 2], 0.0)
    return body.spectrum.sky * np.exp(-depth[:, None] * body.spectrum.sky_absorption)


def sun_in_water(
    position: np.ndarray,
    normal: np.ndarray,
    body: BodyPlan,
    sun: Sun,
    light: np.ndarray,
    visibility: np.ndarray,
) -> np.ndarray:
    """E (n, 3), W/m^2, at points (n, 3) of surfaces with unit normals (n, 3).

    light: L (n,); visibility: (n,) what the shadows of things under water leave of it.
    """
    cosine = np.maximum(-(normal @ body.light.camera.direction), 0.0)
    beyond = body.spectrum.absorption - body.body.settings.k
    by_color = body.spectrum.sun * np.exp(-calm_light_path(position, body)[:, None] * beyond)
    return (body.light.bending * cosine * light * visibility)[:, None] * by_color * sun.irradiance
