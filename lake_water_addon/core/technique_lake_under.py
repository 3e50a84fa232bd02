# SPDX-License-Identifier: GPL-3.0-or-later
"""The Lake technique from under water: the float64 twin of `gpu_shaders/technique_lake_under_lib.glsl`.

Points and directions are in render space (see `plan`), arrays (n, 3). The normal N points from the
water to the air, E from the surface to the eye: E.N < 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from . import cameras, optics
from .air_lookup import in_camera
from .depth_trace import FollowedRays, color_and_known, trace_downwards, trace_upwards
from .lookup import Lookup, inside_texture, known_color
from .plan import TexturePass
from .snapshot import WaterSettings
from .under_water import RAY_LENGTH

REACHES = (1.0, 0.5, 0.25, 0.0)
"""Parts of RAY_LENGTH that are tried until a lookup finds a colour."""

MOST_CLEARED = 4.0
"""Most by which the light that fog left in the picture is raised, where the way to the eye is shorter than
that which it was drawn with."""


@dataclass(frozen=True, eq=False)
class UnderTextures:
    """What the surface looks up, seen from below.

    refraction_color: uv (n, 2) -> premultiplied radiance and alpha (n, 4) of what is above the water;
    reflection_color: of what is in it, fogged, alpha 1; sky_radiance: unit direction (n, 3) -> (n, 3).
    refraction, reflection: the cameras of the two. fade: width, as a part of a texture, over which a
    lookup near its border gives way to its substitute. refraction_depth, reflection_depth: (size, size)
    distances along the axes of the two cameras in m, where rays are followed.
    """

    refraction_color: Lookup
    reflection_color: Lookup
    sky_radiance: Lookup
    refraction: TexturePass
    reflection: TexturePass
    fade: float
    refraction_depth: np.ndarray | None = None
    reflection_depth: np.ndarray | None = None


def refraction_without_hole(normal: np.ndarray, to_eye: np.ndarray, n12: float) -> np.ndarray:
    """R1 = (-N - E) / n12 + N of the thesis, n12 = 1 / 1.33: bends like water, with no total reflection."""
    return (-normal - to_eye) / n12 + normal


def _coordinates(planned: TexturePass, points: np.ndarray) -> np.ndarray:
    return cameras.to_texture(planned.projection, in_camera(planned, points))


def radiance_from_above(
    surface: np.ndarray, direction: np.ndarray, textures: UnderTextures, follow: Follow | None = None
) -> np.ndarray:
    """(n, 3) radiance of what is above, looked up at U + m R or nearer to U; outside the texture, the sky.

    A direction below the horizon, as R1 often is, is raised to it: there is nothing else above the water.
    """
    direction = np.concatenate([direction[:, :2], np.maximum(direction[:, 2:], optics.MIN_RISE)], axis=1)
    unit = direction / np.linalg.norm(direction, axis=1, keepdims=True)
    sky = textures.sky_radiance(unit)
    if follow is not None:
        search, planned = follow.search, textures.refraction
        found = trace_upwards(surface, unit, planned, follow.highest, search, textures.refraction_depth)
        color, known = color_and_known(found, textures.refraction_color, textures.fade)
        return sky + known * (color - sky)
    texel = np.zeros((len(surface), 4))
    uv = np.zeros((len(surface), 2))
    open_rays = np.ones(len(surface), bool)
    for part in REACHES:
        at = _coordinates(textures.refraction, surface + part * RAY_LENGTH * direction)
        uv[open_rays] = at[open_rays]
        texel[open_rays] = textures.refraction_color(uv)[open_rays]
        open_rays &= texel[:, 3] <= 0.5
    color, known = known_color(texel, uv, textures.fade)
    return sky + known * (color - sky)


def radiance_from_below(
    surface: np.ndarray, direction: np.ndarray, settings: WaterSettings, textures: UnderTextures
) -> np.ndarray:
    """(n, 3) radiance of what is in the water, looked up at U + m R; outside the texture, water_color."""
    uv = _coordinates(textures.reflection, surface + RAY_LENGTH * direction)
    color = np.array(settings.water_color)
    known = inside_texture(uv, textures.fade)[:, None]
    return color + known * (textures.reflection_color(uv)[:, :3] - color)


@dataclass(frozen=True, eq=False)
class Follow:
    """How rays are followed. lowest, highest: heights of the lowest thing in the water and of all things."""

    search: FollowedRays
    lowest: float
    highest: float


def followed_from_below(
    surface: np.ndarray,
    direction: np.ndarray,
    path: np.ndarray,
    settings: WaterSettings,
    textures: UnderTextures,
    follow: Follow,
) -> np.ndarray:
    """(n, 3) radiance of what the rays meet in the water, or what the texture shows where they leave it.

    The texture is fogged over the way from the mirrored camera to what it shows: over that which light really
    takes, `path` (n,) and the ray's, there is as much more or less.
    """
    planned, depth = textures.reflection, textures.reflection_depth
    found = trace_downwards(surface, direction, planned, follow.lowest, follow.search, depth)
    place = in_camera(planned, surface + found.way[:, None] * direction)
    fogged = -place[:, 2] if cameras.is_orthographic(planned.projection) else np.linalg.norm(place, axis=1)
    with np.errstate(over="ignore"):
        cleared = np.minimum(np.exp(settings.k * (fogged - path - found.way)), MOST_CLEARED)
    color = np.array(settings.water_color)
    cleared = np.where(found.known > 0.5, cleared, 1.0)
    return color + cleared[:, None] * (textures.reflection_color(found.uv)[:, :3] - color)


def water_radiance_from_below(
    surface: np.ndarray,
    normal: np.ndarray,
    to_eye: np.ndarray,
    path: np.ndarray,
    settings: WaterSettings,
    textures: UnderTextures,
    *,
    exact: bool,
    follow: Follow | None = None,
) -> np.ndarray:
    """(n, 3) radiance of the surface at U seen from below; path: (n,) m through the water to the eye.

    exact: the refracted direction with total internal reflection and Fresnel's equations, in place of
    R1 and Schlick's term with |N.E|. follow: how rays are, in place of a lookup on each of them.
    """
    n12 = 1.0 / settings.ior
    cosine = -np.sum(to_eye * normal, axis=-1, keepdims=True)
    if exact:
        bent, exists = optics.refract_direction(-to_eye, -normal, settings.ior)
        bent = np.where(exists[:, None], bent, normal)  # of no weight there, but a direction
        fresnel = np.where(exists[:, None], optics.fresnel_dielectric(cosine, settings.ior), 1.0)
    else:
        bent = refraction_without_hole(normal, to_eye, n12)
        fresnel = optics.schlick(cosine, optics.reflectance_at_normal(n12), settings.q)
    a = optics.attenuation(settings.k, path)[:, None]
    refracted = optics.through_water(
        radiance_from_above(surface, bent, textures, follow), np.array(settings.water_color), a
    )
    mirrored = optics.reflect_direction(-to_eye, normal)
    if follow is None:
        reflected = radiance_from_below(surface, mirrored, settings, textures)
    else:
        reflected = followed_from_below(surface, mirrored, path, settings, textures, follow)
    return optics.mix_fresnel(refracted, reflected, fresnel)
