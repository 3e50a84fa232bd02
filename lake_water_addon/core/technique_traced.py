# SPDX-License-Identifier: GPL-3.0-or-later
"""The Traced technique: the float64 twin of `gpu_shaders/technique_traced_lib.glsl`.

The refracted and the reflected ray are each followed through the depth texture of their own pass, in
steps that are even across the texture (McGuire and Mara 2014), so that none is left out and none is
looked at twice; 1 / w is linear there, which gives the way along the ray. From the first step that ends
behind what the texture shows, bisection leads to the place.

A depth texture shows fronts. A ray that passes farther behind one than a thing is thick goes on; where it
comes out again before the bottom, that is found as ever. One that stays behind until it ends has met
something that the texture does not show: it takes the place where it was the least behind, unless it was
far behind. One that ends in front of everything, or leaves the texture, has met nothing: refraction then
gives the water's own colour, reflection the sky.

Light that comes out of the water: with T = 1 - F of Fresnel's equations, T / n^2 of the radiance that the
bottom has in the water, less what is absorbed on the way, by colour. `water_color` is the radiance of deep
water as seen from the air.

Points and directions are in render space (see `plan`), arrays (n, 3).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from . import cameras, optics
from .air_lookup import WaterTextures, in_camera
from .lookup import Lookup, inside_texture
from .technique_settings import LENGTH, TechniqueSettings, setting

if TYPE_CHECKING:  # the plan looks up the techniques, this one among them
    from .plan import BodyPlan

DEPTH_JUMP = 16.0
"""Texels' widths between neighbours: what is deeper is an edge and not interpolated across."""

LEAST_DESCENT = 0.05
"""Least -z of a refracted direction; refraction at the steepest wave leaves more."""

BELOW_LOWEST = 0.1
"""m below the lowest thing in the water where a refracted ray ends."""

FARTHEST = 5e4
"""m: where a reflected ray ends; what is farther is sky."""

HIDDEN_BOTTOM = 1.0
HIDDEN_LAND = 0.4
"""How far behind what hides it a ray may meet something, as a part of its own depth. There is always a
bottom; behind what stands on land there is more often sky than not."""

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


@dataclass(frozen=True, eq=False)
class TextureRay:
    """Rays in the space of a texture's camera, and the straight lines that they are in the texture.

    origin, direction: (n, 3); end: (n,) m along the ray; start, to: (n, 2) texture coordinates of origin and
    end; w, dw: (n,) clip w of the origin and its change for each m; texel_width: m, at clip w 1.
    """

    origin: np.ndarray
    direction: np.ndarray
    end: np.ndarray
    start: np.ndarray
    to: np.ndarray
    w: np.ndarray
    dw: np.ndarray
    texel_width: float

    def at(self, part: np.ndarray) -> np.ndarray:
        """(n, 2) texture coordinates at parts (n,) of the way across the texture."""
        return self.start + part[:, None] * (self.to - self.start)


class Trace(NamedTuple):
    """What rays meet: uv (n, 2), way (n,) m along the ray, known (n,) 1 when there is anything."""

    uv: np.ndarray
    way: np.ndarray
    known: np.ndarray


def texture_ray(
    origin: np.ndarray, direction: np.ndarray, projection: np.ndarray, end: np.ndarray, size: float
) -> TextureRay:
    """Rays (n, 3) as far as `end` (n,) m away, or to where they leave the texture, `size` texels a side."""
    start = origin @ projection[:, :3].T + projection[:, 3]
    change = direction @ projection[:, :3].T
    w, dw = start[:, 3], change[:, 3]
    for axis in (0, 1):
        for side in (1.0, -1.0):
            inside, inwards = w + side * start[:, axis], dw + side * change[:, axis]
            leaves = np.maximum(inside, 0.0) / np.where(inwards < 0.0, -inwards, 1.0)
            end = np.where(inwards < 0.0, np.minimum(end, leaves), end)
    end = np.where(dw < 0.0, np.minimum(end, 0.999 * w / np.where(dw < 0.0, -dw, 1.0)), end)
    return TextureRay(
        origin,
        direction,
        end,
        cameras.to_texture(projection, origin),
        cameras.to_texture(projection, origin + end[:, None] * direction),
        w,
        dw,
        2.0 / (min(projection[0, 0], projection[1, 1]) * size),
    )


def way_at(ray: TextureRay, part: np.ndarray) -> np.ndarray:
    """(n,) m along the rays at parts (n,) of their way across the texture: 1 / w is linear there."""
    return part * ray.w * ray.end / (ray.w + (1.0 - part) * ray.dw * ray.end)


def texel_at(ray: TextureRay, way: np.ndarray) -> np.ndarray:
    """(n,) m that a texel measures where the rays then are."""
    return ray.texel_width * (ray.w + way * ray.dw)


def depth_between(depth: np.ndarray, uv: np.ndarray, jump: np.ndarray) -> np.ndarray:
    """(n,) a depth texture (h, w) at uv (n, 2), bilinear; across an edge of `jump` (n,) m, the nearest."""
    height, width = depth.shape
    size = np.array([width, height])
    at = np.clip(uv, 0.0, 1.0) * size - 0.5
    low = np.clip(np.floor(at), 0, size - 2).astype(int)
    part = np.clip(at - low, 0.0, 1.0)
    x, y = low.T
    z = np.stack([depth[y, x], depth[y, x + 1], depth[y + 1, x], depth[y + 1, x + 1]])
    edge = z.max(axis=0) - z.min(axis=0) > jump
    part = np.where(edge[:, None], np.floor(part + 0.5), part)
    lower, upper = z[0] + part[:, 0] * (z[1] - z[0]), z[2] + part[:, 0] * (z[3] - z[2])
    return lower + part[:, 1] * (upper - lower)


def behind(depth: np.ndarray, ray: TextureRay, part: np.ndarray) -> np.ndarray:
    """(n,) m that the rays are behind what the texture shows; negative before it."""
    way = way_at(ray, part)
    shown = depth_between(depth, ray.at(part), DEPTH_JUMP * texel_at(ray, way))
    return -(ray.origin[:, 2] + way * ray.direction[:, 2]) - shown


def trace(depth: np.ndarray, ray: TextureRay, size: float, settings: TracedSettings, hidden: float) -> Trace:
    """What rays meet in a depth texture: distances along its camera's axis. hidden: as `HIDDEN_LAND`."""
    across = np.ceil(np.linalg.norm(ray.to - ray.start, axis=1) * size)
    steps = np.clip(across, 1, settings.march_steps)
    before = np.minimum(behind(depth, ray, np.zeros(len(steps))), 0.0)
    found, least = np.ones(len(steps)), np.full(len(steps), np.inf)
    open_rays = np.ones(len(steps), bool)
    for i in range(1, settings.march_steps + 1):
        active = open_rays & (i <= steps)
        if not active.any():
            break
        low, high = (i - 1) / steps, np.minimum(i / steps, 1.0)
        now = behind(depth, ray, high)
        enters = (now > 0.0) & (before <= 0.0)
        after, ahead = now.copy(), before.copy()
        for _ in range(settings.bisection_steps):
            middle = 0.5 * (low + high)
            there = behind(depth, ray, middle)
            inside = there > 0.0
            after, ahead = np.where(inside, there, after), np.where(inside, ahead, there)
            low, high = np.where(inside, low, middle), np.where(inside, middle, high)
        between = low + (high - low) * ahead / np.where(ahead < after, ahead - after, -1.0)
        part = np.where(enters, between, np.minimum(i / steps, 1.0))
        after = np.where(enters, after, now)
        is_hit = active & (now > 0.0)
        is_hit &= after <= settings.thickness + 2.0 * texel_at(ray, way_at(ray, part))
        nearer = active & (now > 0.0) & (now < least) & ~is_hit
        least = np.where(nearer, now, least)
        found = np.where(is_hit, part, np.where(nearer, np.minimum(i / steps, 1.0), found))
        before = np.where(active, now, before)
        open_rays &= ~is_hit
    ray_depth = -(ray.origin[:, 2] + way_at(ray, found) * ray.direction[:, 2])
    known = ~open_rays | ((before > 0.0) & (least < hidden * ray_depth))
    found = np.where(known, found, 1.0)
    return Trace(ray.at(found), way_at(ray, found), known.astype(float))


def _along(view: np.ndarray, direction: np.ndarray) -> np.ndarray:
    return direction @ view[:3, :3].T


def trace_refraction(
    surface: np.ndarray,
    direction: np.ndarray,
    body: BodyPlan,
    settings: TracedSettings,
    depth: np.ndarray,
) -> Trace:
    """What refracted rays (n, 3) from surface points (n, 3) meet in the refraction's depth texture."""
    descent = np.maximum(-direction[:, 2], LEAST_DESCENT)
    end = (np.maximum(surface[:, 2] - body.lowest, 0.0) + BELOW_LOWEST) / descent
    planned, size = body.refraction, len(depth)
    origin, along = in_camera(planned, surface), _along(planned.view, direction)
    ray = texture_ray(origin, along, planned.projection, end, size)
    return trace(depth, ray, size, settings, HIDDEN_BOTTOM)


def trace_reflection(
    surface: np.ndarray,
    direction: np.ndarray,
    body: BodyPlan,
    settings: TracedSettings,
    depth: np.ndarray,
) -> Trace:
    """What reflected rays (n, 3) from surface points (n, 3) meet in the reflection's depth texture."""
    planned, size = body.reflection, len(depth)
    origin, along = in_camera(planned, surface), _along(planned.view, direction)
    end = np.full(len(surface), FARTHEST)
    ray = texture_ray(origin, along, planned.projection, end, size)
    return trace(depth, ray, size, settings, HIDDEN_LAND)


@dataclass(frozen=True, eq=False)
class TracedTextures:
    """What the water looks up. lookups: colours and sky; refraction_depth, reflection_depth: (size, size)
    distances along the axes of the passes' cameras in m, first row at the bottom."""

    lookups: WaterTextures
    refraction_depth: np.ndarray
    reflection_depth: np.ndarray


def _color_and_known(found: Trace, lookup: Lookup, fade: float) -> tuple[np.ndarray, np.ndarray]:
    texel = lookup(found.uv)
    known = found.known * np.clip(4.0 * texel[:, 3], 0.0, 1.0) * inside_texture(found.uv, fade)
    return texel[:, :3] / np.maximum(texel[:, 3:], 1e-4), known[:, None]


def traced_refraction(
    surface: np.ndarray,
    direction: np.ndarray,
    body: BodyPlan,
    settings: TracedSettings,
    textures: TracedTextures,
) -> np.ndarray:
    """(n, 3) radiance that comes along the refracted ray, before it passes the surface."""
    found = trace_refraction(surface, direction, body, settings, textures.refraction_depth)
    lookups = textures.lookups
    color, known = _color_and_known(found, lookups.refraction_color, lookups.fade)
    water = np.array(body.body.settings.water_color)
    left = known * np.exp(-found.way[:, None] * np.array(settings.absorption))
    return water + left * (color / body.body.settings.ior**2 - water)


def traced_reflection(
    surface: np.ndarray,
    direction: np.ndarray,
    body: BodyPlan,
    settings: TracedSettings,
    textures: TracedTextures,
) -> np.ndarray:
    """(n, 3) radiance that comes along the mirrored ray."""
    found = trace_reflection(surface, direction, body, settings, textures.reflection_depth)
    lookups = textures.lookups
    color, known = _color_and_known(found, lookups.reflection_color, lookups.fade)
    sky = lookups.sky_radiance(direction)
    return sky + known * (color - sky)


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
    mirrored = optics.reflect_upwards(-to_eye, normal)
    reflected = traced_reflection(surface, mirrored, body, settings, textures)
    cosine = np.sum(to_eye * normal, axis=-1, keepdims=True)
    return optics.mix_fresnel(refracted, reflected, optics.fresnel_dielectric(cosine, n12))
