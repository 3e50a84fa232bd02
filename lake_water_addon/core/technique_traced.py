# SPDX-License-Identifier: GPL-3.0-or-later
"""The Traced technique: the float64 twin of `gpu_shaders/technique_traced_lib.glsl`.

The refracted and the reflected ray are each followed through the depth texture of their own pass (see
`depth_trace`). A refracted ray that meets nothing gives the water's own colour, a reflected one the sky.

Light that comes out of the water: with T = 1 - F of Fresnel's equations, T / n^2 of the radiance that the
bottom has in the water, less what is absorbed on the way, by colour. `water_color` is the radiance of deep
water as seen from the air.

Points and directions are in render space (see `plan`), arrays (n, 3).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from . import optics
from .depth_trace import TracedTextures, color_and_known, mirrored_radiance, trace_downwards
from .technique_settings import LENGTH, TechniqueSettings, setting

if TYPE_CHECKING:  # the plan looks up the techniques, this one among them
    from .plan import BodyPlan

COASTAL_3 = (0.46, 0.19, 0.39)
"""1/m at 650, 550 and 450 nm: Jerlov's coastal water of type 3 (Marine Optics, 1976, table XXVII)."""


@dataclass(frozen=True)
class TracedSettings(TechniqueSettings):
    """march_steps: most steps along a ray. thickness: m that things are taken to be thick. absorption: 1/m of
    red, green and blue light."""

    march_steps: int = setting(
        32,
        "March Steps",
        "Most steps along a ray, evenly across the texture and at most one a pixel of it. "
        "Raise it where thin things under water have gaps; time grows with it",
        min=1,
        max=1024,
        soft_max=256,
    )
    bisection_steps: int = setting(
        6,
        "Bisection Steps",
        "Halvings of the step in which a ray meets something. Raise it where what lies "
        "under water shows steps. Each costs a lookup",
        min=0,
        max=32,
        soft_max=12,
        label="Bisections",
    )
    thickness: float = setting(
        0.5,
        "Thickness",
        "How thick things are taken to be, as only their fronts are seen: a ray that "
        "passes farther behind one goes on. Raise it where rays slip through, lower it where thin "
        "things leave smears. Costs nothing",
        min=0.0,
        max=1000.0,
        soft_max=5.0,
        **LENGTH,
        step=1,
        precision=3,
    )
    absorption: tuple[float, float, float] = setting(
        COASTAL_3,
        "Absorption (1/m)",
        "How fast the water swallows red, green and blue light: after 1/value metres 37 % "
        "of it is left. As it comes, coastal water (Jerlov type 3); pure water has 0.340, 0.0565, "
        "0.0092. Costs nothing",
        min=0.0,
        max=1000.0,
        soft_max=3.0,
        step=1,
        precision=4,
        label="Absorption",
        section=True,
    )


def traced_refraction(
    surface: np.ndarray,
    direction: np.ndarray,
    body: BodyPlan,
    settings: TracedSettings,
    textures: TracedTextures,
) -> np.ndarray:
    """(n, 3) radiance that comes along the refracted ray, before it passes the surface."""
    planned, depth = body.refraction, textures.refraction_depth
    found = trace_downwards(surface, direction, planned, body.lowest, settings, depth)
    lookups = textures.lookups
    color, known = color_and_known(found, lookups.refraction_color, lookups.fade)
    water = np.array(body.body.settings.water_color)
    left = known * np.exp(-found.way[:, None] * np.array(settings.absorption))
    return water + left * (color / body.body.settings.ior**2 - water)


def water_radiance(
    surface: np.ndarray,
    normal: np.ndarray,
    to_eye: np.ndarray,
    body: BodyPlan,
    settings: TracedSettings,
    textures: TracedTextures,
) -> np.ndarray:
    """(n, 3) radiance of the water at U seen from E; the normal faces the viewer (`optics.face_viewer`)."""
    n12 = 1.0 / body.body.settings.ior
    bent, _ = optics.refract_direction(-to_eye, normal, n12)
    refracted = traced_refraction(surface, bent, body, settings, textures)
    reflected = mirrored_radiance(surface, -to_eye, normal, refracted, body, settings, textures)
    cosine = np.sum(to_eye * normal, axis=-1, keepdims=True)
    return optics.mix_fresnel(refracted, reflected, optics.fresnel_dielectric(cosine, n12))
