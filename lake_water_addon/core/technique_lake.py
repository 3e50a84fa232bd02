# SPDX-License-Identifier: GPL-3.0-or-later
"""The Lake technique from the air: the float64 twin of `gpu_shaders/technique_lake_lib.glsl`.

Points and directions are in render space (see `plan`), arrays (n, 3). Textures are
functions of coordinates (n, 2): what stands in them is the passes' business.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from . import cameras, intersection, optics
from .lookup import Lookup, inside_texture
from .plan import BodyPlan

LEAST_KNOWN = 0.25
"""Alpha of a refraction lookup below which another place is tried."""

REACHES = (1.0, 0.5, 0.25, 0.0)
"""Parts of the reflection offset c that are tried until a lookup finds a colour."""


@dataclass(frozen=True, eq=False)
class LakeTextures:
    """What the water looks up.

    refraction_color, reflection_color: uv (n, 2) -> premultiplied radiance and alpha (n, 4);
    bottom_depth: uv -> distance along the viewing axis in m (n,); sky_radiance: unit direction
    (n, 3) -> (n, 3); fade: width, as a part of a texture, over which a lookup near its border
    gives way to its substitute.
    """

    refraction_color: Lookup
    bottom_depth: Lookup
    reflection_color: Lookup
    sky_radiance: Lookup
    fade: float


def _transform(view: np.ndarray, points: np.ndarray) -> np.ndarray:
    return points @ view[:3, :3].T + view[:3, 3]


def _color_and_known(texel: np.ndarray, uv: np.ndarray, fade: float) -> tuple[np.ndarray, np.ndarray]:
    """Radiance without the texels that have no colour, (n, 3), and how far it is known, (n, 1)."""
    color = texel[:, :3] / np.maximum(texel[:, 3:], 1e-4)
    known = np.clip(4.0 * texel[:, 3], 0.0, 1.0) * inside_texture(uv, fade)
    return color, known[:, None]


def refracted_radiance(
    surface: np.ndarray, direction: np.ndarray, body: BodyPlan, steps: int, textures: LakeTextures
) -> np.ndarray:
    """(n, 3) radiance that comes along the refracted ray to the surface points."""
    view, projection = body.refraction.view, body.refraction.projection
    u = _transform(view, surface)
    found = intersection.intersect(u, direction @ view[:3, :3].T, textures.bottom_depth, projection, steps)
    uv = cameras.to_texture(projection, found.hit)
    texel = textures.refraction_color(uv)
    unknown = texel[:, 3:] < LEAST_KNOWN  # there, look straight through the surface
    uv = np.where(unknown, cameras.to_texture(projection, u), uv)
    texel = np.where(unknown, textures.refraction_color(uv), texel)
    straight = intersection.bottom_through(u, -textures.bottom_depth(uv), cameras.is_orthographic(projection))
    bottom = np.where(unknown, straight, found.bottom)
    color, known = _color_and_known(texel, uv, textures.fade)
    settings = body.body.settings
    a = optics.attenuation(settings.k, np.linalg.norm(bottom - u, axis=1))
    return optics.through_water(color, np.array(settings.water_color), known * a[:, None])


def reflected_radiance(
    surface: np.ndarray, direction: np.ndarray, body: BodyPlan, textures: LakeTextures
) -> np.ndarray:
    """(n, 3) radiance that comes along the mirrored ray, looked up at U + c R or nearer to U."""
    view, projection = body.reflection.view, body.reflection.projection
    texel = np.zeros((len(surface), 4))
    uv = np.zeros((len(surface), 2))
    open_rays = np.ones(len(surface), bool)
    for part in REACHES:
        w = _transform(view, surface + part * body.body.settings.c * direction)
        uv[open_rays] = cameras.to_texture(projection, w)[open_rays]
        texel[open_rays] = textures.reflection_color(uv)[open_rays]
        open_rays &= texel[:, 3] <= 0.5
    color, known = _color_and_known(texel, uv, textures.fade)
    sky = textures.sky_radiance(direction)
    return sky + known * (color - sky)


def water_radiance(
    surface: np.ndarray,
    normal: np.ndarray,
    to_eye: np.ndarray,
    body: BodyPlan,
    steps: int,
    textures: LakeTextures,
) -> np.ndarray:
    """(n, 3) radiance of the water at U seen from E; the normal faces the viewer (`optics.face_viewer`)."""
    n12 = 1.0 / body.body.settings.ior
    bent, _ = optics.refract_direction(-to_eye, normal, n12)
    refracted = refracted_radiance(surface, bent, body, steps, textures)
    reflected = reflected_radiance(surface, optics.reflect_upwards(-to_eye, normal), body, textures)
    cosine = np.sum(to_eye * normal, axis=-1, keepdims=True)
    fresnel = optics.schlick(cosine, optics.reflectance_at_normal(n12), body.body.settings.q)
    return optics.mix_fresnel(refracted, reflected, fresnel)
