# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the ray of each pixel really goes, and how far off a technique's answer is.

The refracted ray ends on the first thing under water, the reflected one on the first thing in the air; each
is followed once, as the techniques do. Points are in render space (see `lake_water_addon.core.plan`).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from lake_water_addon.core import cameras, optics
from lake_water_addon.core.snapshot import Camera

from .tracer import AIR, Meeting, Rays, Reference


class RayEnds(NamedTuple):
    """One ray a pixel: direction (h, w, 3) unit, point (h, w, 3) where it ends and distance (h, w) m to it.

    point is NaN and distance inf where it meets nothing; direction is NaN without water, and under total
    internal reflection.
    """

    direction: np.ndarray
    point: np.ndarray
    distance: np.ndarray


class TrueHits(NamedTuple):
    """First row at the bottom. body: (h, w) number of the water that the pixel shows first, -1 for none.

    surface: (h, w, 3) U; normal: (h, w, 3) unit, to the air; both NaN without water. from_air: (h, w) whether
    it is seen from there.
    """

    body: np.ndarray
    surface: np.ndarray
    normal: np.ndarray
    from_air: np.ndarray
    refracted: RayEnds
    reflected: RayEnds

    @property
    def water(self) -> np.ndarray:
        """(h, w) the pixels that show water."""
        return self.body >= 0


class HitErrors(NamedTuple):
    """distance: (h, w) |W - W*| in m, NaN where one of the two is missing; texels: (h, w) that in a texture.

    missed: share of the true hits that were not found; false: share of the pixels without one that were given
    one; beyond: share of the pairs that lie more than a texel apart. NaN for a share of nothing.
    """

    distance: np.ndarray
    texels: np.ndarray
    missed: float
    false: float
    beyond: float


def true_hits(
    reference: Reference, camera: Camera, size: tuple[int, int], within: tuple[float, float] = (0.5, 0.5)
) -> TrueHits:
    """What is seen through, and in, the water in each of `size` = (width, height) pixels.

    within: where in its pixel the ray passes, 0 to 1; the middle is what a picture of one sample shows.
    """
    width, height = size
    x, y = np.meshgrid(np.arange(width) + within[0], np.arange(height) + within[1])
    ndc = np.stack([2.0 * x / width - 1.0, 2.0 * y / height - 1.0], axis=-1).reshape(-1, 2)
    rays = reference.camera_rays(camera, ndc)
    met = reference.meet(rays)
    shape = (height, width)
    surface = np.full((len(ndc), 3), np.nan)
    normal = surface.copy()
    shown = np.flatnonzero(met.body != AIR)
    seen, at = rays.take(shown), Meeting(*(array[shown] for array in met))
    surface[shown] = seen.origin + at.distance[:, None] * seen.direction
    normal[shown] = at.normal
    ends = []
    for refracts in (True, False):
        direction = np.full((len(ndc), 3), np.nan)
        point, distance = direction.copy(), np.full(len(ndc), np.inf)
        followed, which = _followed(reference, seen, at, refracts)
        pixels = shown[which]
        direction[pixels] = followed.direction
        found = reference.meet(followed)
        hit = found.triangle >= 0
        distance[pixels[hit]] = found.distance[hit]
        point[pixels[hit]] = followed.origin[hit] + found.distance[hit, None] * followed.direction[hit]
        ends.append(RayEnds(direction.reshape(*shape, 3), point.reshape(*shape, 3), distance.reshape(shape)))
    return TrueHits(
        met.body.reshape(shape),
        surface.reshape(*shape, 3),
        normal.reshape(*shape, 3),
        (rays.medium == AIR).reshape(shape),
        *ends,
    )


def _followed(reference: Reference, rays: Rays, met: Meeting, refracts: bool) -> tuple[Rays, np.ndarray]:
    """The refracted or reflected rays of those that met a surface, and the numbers of those that have one."""
    place = rays.origin + met.distance[:, None] * rays.direction
    from_air = rays.medium == AIR
    towards = np.where(from_air[:, None], met.normal, -met.normal)
    if refracts:
        ior = np.array([water.ior for water in reference.optics])[met.body]
        direction, exists = np.empty_like(place), np.empty(len(place), bool)
        for value in np.unique(ior):
            for these, n12 in ((from_air, 1.0 / value), (~from_air, value)):
                of = these & (ior == value)
                direction[of], exists[of] = optics.refract_direction(rays.direction[of], towards[of], n12)
        medium = np.where(from_air, met.body, AIR)
    else:
        direction = optics.reflect_direction(rays.direction, towards)
        exists, medium = np.ones(len(place), bool), rays.medium
    which = np.flatnonzero(exists)
    direction = direction[which] / np.linalg.norm(direction[which], axis=1, keepdims=True)
    followed = rays.take(which)
    return followed._replace(origin=place[which], direction=direction, medium=medium[which]), which


def hit_errors(
    true: np.ndarray,
    given: np.ndarray,
    mask: np.ndarray,
    to_texels: Callable[[np.ndarray], np.ndarray],
) -> HitErrors:
    """How far the points that a technique gives, (h, w, 3), are from the true ones, NaN where there is none.

    mask: (h, w) the pixels that count. to_texels: points (n, 3) -> places (n, 2) in the technique's texture,
    in texels: for a texture pass its camera's projection times the texture's size (see `texture_places`).
    """
    exists, found = np.isfinite(true).all(axis=-1), np.isfinite(given).all(axis=-1)
    both = mask & exists & found
    distance, texels = np.full(mask.shape, np.nan), np.full(mask.shape, np.nan)
    distance[both] = np.linalg.norm(given[both] - true[both], axis=-1)
    texels[both] = np.linalg.norm(to_texels(given[both]) - to_texels(true[both]), axis=-1)
    return HitErrors(
        distance,
        texels,
        missed=_share(~found, mask & exists),
        false=_share(found, mask & ~exists),
        beyond=_share(texels > 1.0, both),
    )


def _share(of: np.ndarray, among: np.ndarray) -> float:
    return float(of[among].mean()) if among.any() else float("nan")


def texture_places(
    view: np.ndarray, projection: np.ndarray, texels: int
) -> Callable[[np.ndarray], np.ndarray]:
    """`to_texels` of a texture pass with these cameras (4, 4), `texels` a side."""

    def places(points: np.ndarray) -> np.ndarray:
        return cameras.to_texture(projection, points @ view[:3, :3].T + view[:3, 3]) * texels

    return places
