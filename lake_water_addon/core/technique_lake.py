# SPDX-License-Identifier: GPL-3.0-or-later
"""The Lake technique from the air: the float64 twin of `gpu_shaders/technique_lake_lib.glsl`.

Points and directions are in render space (see `plan`), arrays (n, 3).
"""

from __future__ import annotations

import numpy as np

from . import cameras, intersection, optics
from .air_lookup import WaterTextures, in_camera, radiance_through_water, reflected_radiance
from .depth_trace import FollowedRays, TracedTextures, color_and_known, mirrored_radiance, trace_downwards
from .plan import BodyPlan
from .settings import FrameSettings


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


def followed_radiance(
    surface: np.ndarray, direction: np.ndarray, body: BodyPlan, steps: int, textures: TracedTextures
) -> np.ndarray:
    """The same, where the refracted ray is followed through the depth texture."""
    planned, depth = body.refraction, textures.refraction_depth
    found = trace_downwards(surface, direction, planned, body.lowest, FollowedRays(steps), depth)
    lookups, settings = textures.lookups, body.body.settings
    color, known = color_and_known(found, lookups.refraction_color, lookups.fade)
    a = known * optics.attenuation(settings.k, found.way)[:, None]
    return optics.through_water(color, np.array(settings.water_color), a)


def water_radiance(
    surface: np.ndarray,
    normal: np.ndarray,
    to_eye: np.ndarray,
    body: BodyPlan,
    settings: FrameSettings,
    textures: TracedTextures,
) -> np.ndarray:
    """(n, 3) radiance of the water at U seen from E; the normal faces the viewer (`optics.face_viewer`)."""
    n12 = 1.0 / body.body.settings.ior
    bent, _ = optics.refract_direction(-to_eye, normal, n12)
    lookups = textures.lookups
    if settings.refraction_steps:
        refracted = followed_radiance(surface, bent, body, settings.refraction_steps, textures)
    else:
        refracted = refracted_radiance(surface, bent, body, settings.intersection_steps, lookups)
    if settings.reflection_steps:
        search = FollowedRays(settings.reflection_steps)
        reflected = mirrored_radiance(surface, -to_eye, normal, refracted, body, search, textures)
    else:
        reflected = reflected_radiance(surface, optics.reflect_upwards(-to_eye, normal), body, lookups)
    cosine = np.sum(to_eye * normal, axis=-1, keepdims=True)
    if settings.use_exact_fresnel:
        fresnel = optics.fresnel_dielectric(cosine, n12)
    else:
        fresnel = optics.schlick(cosine, optics.reflectance_at_normal(n12), body.body.settings.q)
    return optics.mix_fresnel(refracted, reflected, fresnel)
