# SPDX-License-Identifier: GPL-3.0-or-later
"""The thesis's intersection algorithm: the float64 twin of `gpu_shaders/intersection_lib.glsl`.

Estimates where a ray from the water surface meets the bottom, which is known only as a
depth texture. Everything is in the camera space of the camera that drew the texture.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from .cameras import is_orthographic, to_texture

PARALLEL = 1e-10
"""|R x Q|^2 / |Q|^2 under which R and Q count as parallel: no intersection."""

BETWEEN_TOLERANCE = 1.1
"""The thesis's slack in the test whether a point lies between two others."""


class Intersection(NamedTuple):
    """hit: W (n, 3); bottom: A (n, 3), the bottom seen through W; error: |A - W| in m (n,)."""

    hit: np.ndarray
    bottom: np.ndarray
    error: np.ndarray


def bottom_through(point: np.ndarray, z: np.ndarray, orthographic: bool) -> np.ndarray:
    """The point with view-space z on the line of sight through `point` (n, 3)."""
    if orthographic:
        return np.concatenate([point[:, :2], z[:, None]], axis=1)
    return point * (z / np.minimum(point[:, 2], -1e-6))[:, None]


def intersect(
    surface: np.ndarray,
    direction: np.ndarray,
    depth: Callable[[np.ndarray], np.ndarray],
    projection: np.ndarray,
    steps: int,
) -> Intersection:
    """n steps of the algorithm (MODEL section 1) for rays U + t R: the best of U, W1 ... Wn.

    A step leads from one place to the next: one is that of the paper, W1 = U + |A1 - U| R. The last place is
    looked at, too, as it is for the thesis's photons, which is one lookup more than its loop has.

    surface: U (n, 3); direction: unit R (n, 3); depth(uv): distance of the bottom along the
    viewing axis (positive, = -z), for uv (n, 2), the texture's border repeated outside;
    projection: of the depth texture's camera; steps >= 1.
    """
    orthographic = is_orthographic(projection)
    w = a = surface
    hit, bottom = surface.copy(), surface.copy()
    error = np.full(len(surface), np.inf)
    for step in range(steps + 1):
        a_next = bottom_through(w, -depth(to_texture(projection, w)), orthographic)
        gap = np.linalg.norm(a_next - w, axis=1)
        better = gap < error
        hit = np.where(better[:, None], w, hit)
        bottom = np.where(better[:, None], a_next, bottom)
        error = np.where(better, gap, error)
        if step == steps:
            break
        q = a_next - a
        rq = np.cross(direction, q)
        rq2 = np.sum(rq * rq, axis=1)
        q2 = np.sum(q * q, axis=1)
        parallel = rq2 <= PARALLEL * q2
        # Equation (3): where the ray meets the line from A_i to A_i+1.
        t = np.sum(np.cross(a - surface, q) * rq, axis=1) / np.where(parallel, 1.0, rq2)
        w_next = surface + t[:, None] * direction
        outside = np.linalg.norm(w_next - a, axis=1) + np.linalg.norm(
            a_next - w_next, axis=1
        ) > BETWEEN_TOLERANCE * np.sqrt(q2)
        step_along = parallel | outside | (step == 0)
        # Behind the bottom: step back. (z, not |z|: an orthographic camera also sees what has z > 0.)
        sign = np.where(w[:, 2] < a_next[:, 2], -1.0, 1.0)
        stepped = w + (sign * gap)[:, None] * direction
        w = np.where(step_along[:, None], stepped, w_next)
        a = a_next
    return Intersection(hit, bottom, error)
