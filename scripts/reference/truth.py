# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the ray of each pixel really goes, and how far off a technique's answer is.

The refracted ray ends on the first thing under water, the reflected one on the first thing in the air; each
is followed once, as the techniques do. Points are in render space (see `lake_water_addon.core.plan`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from lake_water_addon.core import optics
from lake_water_addon.core.hits import HitErrors, reflection_errors, refraction_errors
from lake_water_addon.core.plan import FramePlan, TexturePass
from lake_water_addon.core.snapshot import Camera

from .geometry import Geometry, clearance
from .tracer import AIR, Meeting, Rays, Reference

if TYPE_CHECKING:  # which needs a GPU
    from lake_water_addon.render.passes.hits import Hits


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


class TechniqueErrors(NamedTuple):
    """refracted, reflected: errors of (h, w) pixels; mask: (h, w) those that count."""

    refracted: HitErrors
    reflected: HitErrors
    mask: np.ndarray


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


def hidden_from(texture_pass: TexturePass, points: np.ndarray, geometry: Geometry) -> np.ndarray:
    """(n,) whether something on the pass's side of the water stands between its camera and points (n, 3).

    The camera is a perspective one; where its view is no rotation, its rays are straight all the same.
    """
    towards = np.linalg.inv(texture_pass.view)[:3, 3] - points
    length = np.linalg.norm(towards, axis=1)
    towards = towards / length[:, None]
    to_plane = (texture_pass.clip_height - points[:, 2]) / np.where(towards[:, 2] == 0.0, 1.0, towards[:, 2])
    length = np.where(to_plane > 0.0, np.minimum(length, to_plane), length)
    start = clearance(points)
    return geometry.occluded(points + start * towards, towards, np.maximum(length - start[:, 0], 0.0))


def technique_errors(plan: FramePlan, hits: Hits, true: TrueHits, i: int = 0) -> TechniqueErrors:
    """How far off the hits pass of a plan is, of body `i` from the side that most of its pixels show."""
    height, width = true.body.shape
    shown = (true.body == i) & (hits.surface[..., 3] == i + 1)
    from_air = bool(true.from_air[shown].mean() >= 0.5) if shown.any() else True
    mask = shown & (true.from_air == from_air)
    refracted, reflected = (
        measure(plan, i, (width, height), given, ends.point, mask, from_below=not from_air)
        for measure, given, ends in (
            (refraction_errors, hits.refracted, true.refracted),
            (reflection_errors, hits.reflected, true.reflected),
        )
    )
    return TechniqueErrors(refracted, reflected, mask)
