# SPDX-License-Identifier: GPL-3.0-or-later
"""The Lake technique from the air: the float64 twin of `gpu_shaders/technique_lake_lib.glsl`.

Points and directions are in render space (see `plan`), arrays (n, 3).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from . import cameras, intersection, optics
from .air_lookup import WaterTextures, in_camera, radiance_through_water, reflected_radiance
from .depth_trace import TracedTextures, mirrored_radiance
from .plan import BodyPlan


@dataclass(frozen=True)
class ReflectionSearch:
    """How reflected rays are followed, where they are (`depth_trace.Search`)."""

    march_steps: int
    bisection_steps: int = 6
    thickness: float = 2.0


def refracted_radiance(
    surface: np.ndarray, direction: np.ndarray, body: BodyPlan, steps: int, textures: WaterTextures
) -> np.ndarray:
    """(n, 3) radiance that comes along the refracted ray to the surface points."""
    view, projection = body.refraction.view, body.refraction.projection
    u = in_camera(body.refraction, surface)
    found = intersection.intersect(u, direction @ view[:3, :3].T, textures.bottom_depth, projection, steps)
    uv = cameras.to_texture(projection, found.hit)
    path = np.linalg.norm(found.bottom - u, axis=1)
    return radiance_through_water(u, uv, path, body, textures)


def water_radiance(
    surface: np.ndarray,
    normal: np.ndarray,
    to_eye: np.ndarray,
    body: BodyPlan,
    steps: int,
    textures: WaterTextures,
    *,
    reflection_depth: np.ndarray | None = None,
    reflection_steps: int = 0,
    exact_fresnel: bool = False,
) -> np.ndarray:
    """(n, 3) radiance of the water at U seen from E; the normal faces the viewer (`optics.face_viewer`).

    reflection_depth: (size, size) distances along the axis of the reflection's camera, with reflection_steps.
    """
    n12 = 1.0 / body.body.settings.ior
    bent, _ = optics.refract_direction(-to_eye, normal, n12)
    refracted = refracted_radiance(surface, bent, body, steps, textures)
    if reflection_steps:
        traced, search = TracedTextures(textures, None, reflection_depth), ReflectionSearch(reflection_steps)
        reflected = mirrored_radiance(surface, -to_eye, normal, refracted, body, search, traced)
    else:
        reflected = reflected_radiance(surface, optics.reflect_upwards(-to_eye, normal), body, textures)
    cosine = np.sum(to_eye * normal, axis=-1, keepdims=True)
    if exact_fresnel:
        fresnel = optics.fresnel_dielectric(cosine, n12)
    else:
        fresnel = optics.schlick(cosine, optics.reflectance_at_normal(n12), body.body.settings.q)
    return optics.mix_fresnel(refracted, reflected, fresnel)
