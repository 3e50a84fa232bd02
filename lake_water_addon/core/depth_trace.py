# SPDX-License-Identifier: GPL-3.0-or-later
"""Rays through a depth texture: the twin of `gpu_shaders/depth_trace_lib.glsl`, `reflection_trace_lib.glsl`.

A ray is followed in steps that are even across the texture (McGuire and Mara 2014), so that none is left out
and none is looked at twice; 1 / w is linear there, which gives the way along the ray. From the first step
that ends behind what the texture shows, bisection leads to the place.

A depth texture shows fronts. A ray that passes farther behind one than a thing is thick goes on; where it
comes out again before the bottom, that is found as ever. Where it comes out behind what stands farther off,
it met that while it was hidden, and takes this place, unless it is far behind. One that stays behind until
it ends has met something that the texture does not show: it takes the place where it was the least behind,
unless it was far behind. One that ends in front of everything, or leaves the texture, has met nothing:
reflection then gives the sky.

Points and directions are in render space (see `plan`), arrays (n, 3).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np

from . import cameras, optics, waves
from .air_lookup import WaterTextures, in_camera
from .lookup import Lookup, known_color

if TYPE_CHECKING:  # the plan looks up the techniques, which look up this
    from .plan import BodyPlan, TexturePass

DEPTH_JUMP = 16.0
"""Texels' widths between neighbours: what is deeper is an edge and not interpolated across."""

CLOSES_IN = 0.7
"""A ray that was behind something, and within a step is behind by less than so many times as much, comes out
from behind its edge."""

FARTHEST = 5e4
"""m: where a reflected ray ends; what is farther is sky."""

HIDDEN_LAND = 0.4
"""How far behind what hides it a ray may meet something, as a part of its own depth: behind what stands on
land there is more often sky than not."""

HIDDEN_BOTTOM = 1.0
"""The same in the water: there is always a bottom."""

LEAST_DESCENT = 0.05
"""Least -z of a direction into the water; refraction at the steepest wave leaves more."""

BEYOND = 0.1
"""m below the lowest thing in the water, or above the highest over it, where a ray ends."""


class Search(Protocol):
    """How rays are followed.

    march_steps: most steps along one; bisection_steps: halvings of the step in which it meets something;
    thickness: m that things are taken to be thick.
    """

    march_steps: int
    bisection_steps: int
    thickness: float


@dataclass(frozen=True)
class FollowedRays:
    """The `Search` of Lake, from the air and from below."""

    march_steps: int
    bisection_steps: int = 6
    thickness: float = 2.0


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


def trace(depth: np.ndarray, ray: TextureRay, size: float, search: Search, hidden: float) -> Trace:
    """What rays meet in a depth texture: distances along its camera's axis. hidden: as `HIDDEN_LAND`."""
    across = np.ceil(np.linalg.norm(ray.to - ray.start, axis=1) * size)
    steps = np.clip(across, 1, search.march_steps)
    before = np.minimum(behind(depth, ray, np.zeros(len(steps))), 0.0)
    found, least = np.ones(len(steps)), np.full(len(steps), np.inf)
    open_rays = np.ones(len(steps), bool)
    for i in range(1, search.march_steps + 1):
        active = open_rays & (i <= steps)
        if not active.any():
            break
        low, high = (i - 1) / steps, np.minimum(i / steps, 1.0)
        now = behind(depth, ray, high)
        enters = (now > 0.0) & (before <= 0.0)
        after, ahead = now.copy(), before.copy()
        for _ in range(search.bisection_steps):
            middle = 0.5 * (low + high)
            there = behind(depth, ray, middle)
            inside = there > 0.0
            after, ahead = np.where(inside, there, after), np.where(inside, ahead, there)
            low, high = np.where(inside, low, middle), np.where(inside, middle, high)
        between = low + (high - low) * ahead / np.where(ahead < after, ahead - after, -1.0)
        part = np.where(enters, between, np.minimum(i / steps, 1.0))
        after = np.where(enters, after, now)
        is_hit = active & (now > 0.0)
        way = way_at(ray, part)
        is_hit &= after <= search.thickness + 2.0 * texel_at(ray, way)
        comes_out = (before > search.thickness) & (now < CLOSES_IN * before)
        is_hit |= (
            active
            & comes_out
            & (now > 0.0)
            & (now < -hidden * (ray.origin[:, 2] + way * ray.direction[:, 2]))
        )
        nearer = active & (now > 0.0) & (now < least) & ~is_hit
        least = np.where(nearer, now, least)
        found = np.where(is_hit, part, np.where(nearer, np.minimum(i / steps, 1.0), found))
        before = np.where(active, now, before)
        open_rays &= ~is_hit
    ray_depth = -(ray.origin[:, 2] + way_at(ray, found) * ray.direction[:, 2])
    known = ~open_rays | ((before > 0.0) & (least < hidden * ray_depth))
    found = np.where(known, found, 1.0)
    return Trace(ray.at(found), way_at(ray, found), known.astype(float))


def along_in_camera(planned: TexturePass, direction: np.ndarray) -> np.ndarray:
    """(n, 3) directions in the camera space of a pass."""
    return direction @ planned.view[:3, :3].T


@dataclass(frozen=True, eq=False)
class TracedTextures:
    """What the water looks up. lookups: colours and sky; refraction_depth, reflection_depth: (size, size)
    distances along the axes of the passes' cameras in m, first row at the bottom; None where no ray of that
    kind is followed."""

    lookups: WaterTextures
    refraction_depth: np.ndarray | None
    reflection_depth: np.ndarray | None


def trace_upwards(
    surface: np.ndarray,
    direction: np.ndarray,
    planned: TexturePass,
    highest: float,
    search: Search,
    depth: np.ndarray,
) -> Trace:
    """What rays (n, 3) from surface points (n, 3) meet above the water, in the depth texture of a pass.

    highest: height above which there is nothing.
    """
    origin, along = in_camera(planned, surface), along_in_camera(planned, direction)
    rise = np.maximum(highest - surface[:, 2], 0.0) + BEYOND
    end = np.minimum(rise / np.maximum(direction[:, 2], rise / FARTHEST), FARTHEST)
    ray = texture_ray(origin, along, planned.projection, end, len(depth))
    return trace(depth, ray, len(depth), search, HIDDEN_LAND)


def trace_downwards(
    surface: np.ndarray,
    direction: np.ndarray,
    planned: TexturePass,
    lowest: float,
    search: Search,
    depth: np.ndarray,
) -> Trace:
    """What rays (n, 3) from surface points (n, 3) meet in the water. lowest: the bottom's least height."""
    descent = np.maximum(-direction[:, 2], LEAST_DESCENT)
    end = (np.maximum(surface[:, 2] - lowest, 0.0) + BEYOND) / descent
    origin, along = in_camera(planned, surface), along_in_camera(planned, direction)
    ray = texture_ray(origin, along, planned.projection, end, len(depth))
    return trace(depth, ray, len(depth), search, HIDDEN_BOTTOM)


def color_and_known(found: Trace, lookup: Lookup, fade: float) -> tuple[np.ndarray, np.ndarray]:
    """Radiance (n, 3) at what rays met, and (n, 1) how far it is known."""
    color, known = known_color(lookup(found.uv), found.uv, fade)
    return color, found.known[:, None] * known


def traced_reflection(
    surface: np.ndarray,
    direction: np.ndarray,
    body: BodyPlan,
    search: Search,
    textures: TracedTextures,
) -> np.ndarray:
    """(n, 3) radiance that comes along the mirrored ray."""
    found = trace_upwards(
        surface, direction, body.reflection, body.highest, search, textures.reflection_depth
    )
    lookups = textures.lookups
    color, known = color_and_known(found, lookups.reflection_color, lookups.fade)
    sky = lookups.sky_radiance(direction)
    return sky + known * (color - sky)


def mirrored_radiance(
    surface: np.ndarray,
    incident: np.ndarray,
    normal: np.ndarray,
    refracted: np.ndarray,
    body: BodyPlan,
    search: Search,
    textures: TracedTextures,
) -> np.ndarray:
    """(n, 3) radiance of what the surface mirrors; refracted: (n, 3) of what it shows below.

    A ray that a wave sends downwards meets another wave, which mirrors its part of what is above; for what
    comes out of the water there, what does here is taken.
    """
    reflected = traced_reflection(surface, optics.reflect_upwards(incident, normal), body, search, textures)
    rise = optics.reflect_direction(incident, normal)[:, 2:]
    part = optics.fresnel_dielectric(waves.met_slope(body.packed_waves) - rise, 1.0 / body.body.settings.ior)
    return optics.mix_fresnel(refracted, reflected, np.where(rise < 0.0, part, 1.0))
