# SPDX-License-Identifier: GPL-3.0-or-later
"""What the techniques that look from the air share: the float64 twin of `gpu_shaders/air_lookup_lib.glsl`.

Points and directions are in render space (see `plan`), arrays (n, 3). Textures are
functions of coordinates (n, 2): what stands in them is the passes' business.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from . import cameras, intersection, optics
from .lookup import Lookup, known_color

if TYPE_CHECKING:  # the plan looks up the techniques, which look up this
    from .plan import BodyPlan, TexturePass

LEAST_KNOWN = 0.25
"""Alpha of a refraction lookup below which another place is tried."""

REACHES = (1.0, 0.5, 0.25, 0.0)
"""Parts of the reflection offset c that are tried until a lookup finds a colour."""


@dataclass(frozen=True, eq=False)
class WaterTextures:
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


def in_camera(planned: TexturePass, points: np.ndarray) -> np.ndarray:
    """(n, 3) points in the camera space of a pass."""
    return points @ planned.view[:3, :3].T + planned.view[:3, 3]


def straight_bottom(u: np.ndarray, projection: np.ndarray, bottom_depth: Lookup) -> np.ndarray:
    """A (n, 3) of rays that are not bent, in the refraction camera's space, as u."""
    depth = bottom_depth(cameras.to_texture(projection, u))
    return intersection.bottom_through(u, -depth, cameras.is_orthographic(projection))


def radiance_through_water(
    u: np.ndarray, uv: np.ndarray, path: np.ndarray, body: BodyPlan, textures: WaterTextures
) -> np.ndarray:
    """(n, 3) radiance of what the refraction texture shows at uv, through `path` (n,) m of water.

    u: (n, 3) points of the surface in the refraction camera's space. Where nothing is known at uv, what
    is seen straight through u.
    """
    projection = body.refraction.projection
    texel = textures.refraction_color(uv)
    unknown = texel[:, 3] < LEAST_KNOWN
    uv = np.where(unknown[:, None], cameras.to_texture(projection, u), uv)
    texel = np.where(unknown[:, None], textures.refraction_color(uv), texel)
    straight = np.linalg.norm(straight_bottom(u, projection, textures.bottom_depth) - u, axis=1)
    color, known = known_color(texel, uv, textures.fade)
    settings = body.body.settings
    a = optics.attenuation(settings.k, np.where(unknown, straight, path))
    return optics.through_water(color, np.array(settings.water_color), known * a[:, None])


def over_horizon(planned: TexturePass, points: np.ndarray) -> np.ndarray:
    """Points (n, 3) in the mirrored camera's space, raised to its horizon.

    Among the waves, a ray from a trough below it would be looked up in the sky's nadir.
    """
    if cameras.is_orthographic(planned.projection):
        return points
    up = planned.view[:3, 2]
    least = optics.MIN_RISE * np.linalg.norm(points, axis=1)
    return points + np.maximum(least - points @ up, 0.0)[:, None] * up


def reflected_radiance(
    surface: np.ndarray, direction: np.ndarray, body: BodyPlan, textures: WaterTextures
) -> np.ndarray:
    """(n, 3) radiance that comes along the mirrored ray, looked up at U + c R or nearer to U."""
    texel = np.zeros((len(surface), 4))
    uv = np.zeros((len(surface), 2))
    open_rays = np.ones(len(surface), bool)
    for part in REACHES:
        w = in_camera(body.reflection, surface + part * body.body.settings.c * direction)
        at = cameras.to_texture(body.reflection.projection, over_horizon(body.reflection, w))
        uv[open_rays] = at[open_rays]
        texel[open_rays] = textures.reflection_color(uv)[open_rays]
        open_rays &= texel[:, 3] <= 0.5
    color, known = known_color(texel, uv, textures.fade)
    sky = textures.sky_radiance(direction)
    return sky + known * (color - sky)
