# SPDX-License-Identifier: GPL-3.0-or-later
"""Simple Lake (Mihálik and Ďurikovič's paper; MODEL section 2): twin of `technique_simple_lake_lib.glsl`.

As the Lake technique, but for three things: the refraction camera is the main camera, one step finds where
a refracted ray ends, and Fresnel's term has no reflectance at normal incidence, F = (1 - E.N)^q.
The paper has q = 4.5; it is taken from the water body.

Points and directions are in render space (see `plan`), arrays (n, 3).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from . import cameras, optics
from .air_lookup import WaterTextures, in_camera, radiance_through_water, reflected_radiance, straight_bottom
from .technique_settings import LENGTH, TechniqueSettings, setting

if TYPE_CHECKING:  # the plan looks up the techniques
    from .plan import BodyPlan


@dataclass(frozen=True)
class SimpleLakeSettings(TechniqueSettings):
    """The paper's constants. longest_path: m of water beyond which the step grows no more.

    step: part of the path that is gone along the refracted ray.
    """

    longest_path: float = setting(
        2.0,
        "Longest Path",
        "Metres of water beyond which the step along the ray grows no more. Raise it to bend deep water more",
        min=0.0,
        max=1000.0,
        soft_max=10.0,
        **LENGTH,
    )
    step: float = setting(
        1.0 / 3.0,
        "Step",
        "Part of the path that is gone along the refracted ray. Raise it for stronger refraction",
        min=0.0,
        max=1.0,
        precision=3,
    )


def refracted_radiance(
    surface: np.ndarray,
    direction: np.ndarray,
    body: BodyPlan,
    settings: SimpleLakeSettings,
    textures: WaterTextures,
) -> np.ndarray:
    """(n, 3) radiance looked up at W = U + clamp(dv, 0, 2) / 3 R, through dv = |A - U| m of water.

    dv runs along the ray that is not bent, and is 0 where what stands in the texture is nearer than U.
    """
    view, projection = body.refraction.view, body.refraction.projection
    u = in_camera(body.refraction, surface)
    a = straight_bottom(u, projection, textures.bottom_depth)
    path = np.where(a[:, 2] < u[:, 2], np.linalg.norm(a - u, axis=1), 0.0)
    step = np.minimum(path, settings.longest_path) * settings.step
    w = u + step[:, None] * (direction @ view[:3, :3].T)
    return radiance_through_water(u, cameras.to_texture(projection, w), path, body, textures)


def water_radiance(
    surface: np.ndarray,
    normal: np.ndarray,
    to_eye: np.ndarray,
    body: BodyPlan,
    settings: SimpleLakeSettings,
    textures: WaterTextures,
) -> np.ndarray:
    """(n, 3) radiance of the water at U seen from E; the normal faces the viewer (`optics.face_viewer`)."""
    bent, _ = optics.refract_direction(-to_eye, normal, 1.0 / body.body.settings.ior)
    refracted = refracted_radiance(surface, bent, body, settings, textures)
    reflected = reflected_radiance(surface, optics.reflect_upwards(-to_eye, normal), body, textures)
    cosine = np.sum(to_eye * normal, axis=-1, keepdims=True)
    return optics.mix_fresnel(refracted, reflected, optics.schlick(cosine, 0.0, body.body.settings.q))
